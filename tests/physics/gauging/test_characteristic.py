"""The characteristic, its inverse, the line at a size and how far it holds, against direct runs."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from selector.errors import InputError
from selector.physics.gauging.characteristic import (
    Characteristic,
    characteristic,
    linear_gauge,
    linear_range_um,
    simulate_transducer,
    steady_swing,
)
from tests.physics.gauging.examples import TRANSDUCER
from tests.physics.gauging.test_steady_swing import tuned


@pytest.fixture(scope="module")
def shipped() -> Characteristic:
    return characteristic(TRANSDUCER)


def test_the_example_can_be_gauged_over_more_than_150_um(shipped):
    low, high = shipped.monotone_um
    assert high - low > 150.0
    assert low == pytest.approx(shipped.touch_um)
    assert low < -20.0
    assert high > 100.0
    # 24 V from mains, volts out
    assert 2.0 < shipped.voltage_v[0] < 4.0
    assert 100.0 < shipped.free_amplitude_um < 200.0


def test_below_the_first_touch_it_is_flat_and_above_the_range_of_the_swing_nearly_0(shipped):
    assert shipped.voltage_at(shipped.touch_um - 1000.0) == shipped.voltage_v[0]
    assert shipped.voltage_v[0] == pytest.approx(shipped.voltage_v[1], rel=1e-6)
    assert shipped.voltage_v[-1] < 0.002 * shipped.voltage_v[0]


def test_between_its_points_it_is_what_direct_runs_give(shipped):
    low, high = shipped.monotone_um
    for at_um, off_um in (
        (low + 2.0, 0.01),
        (-20.0, 3e-3),
        (0.0, 3e-3),
        (50.0, 3e-3),
        (100.0, 3e-3),
        (high - 6.0, 0.1),
    ):
        direct = steady_swing(TRANSDUCER, at_um).voltage_v
        # cubics between points 1 to 5 µm apart; seen 1e-3 µm, more where the swing begins to touch, and 0.05 µm where
        # the curve turns up at its end
        assert abs(float(shipped.voltage_at(at_um)) - direct) < off_um * abs(float(shipped.slope_at(at_um)))


@pytest.mark.parametrize(("at_um", "tolerance"), [(-20.0, 2e-4), (0.0, 1e-4), (40.0, 1e-4), (80.0, 1e-3)])
def test_the_slope_of_a_line_is_that_of_direct_runs(shipped, at_um, tolerance):
    gauge = linear_gauge(shipped, at_um, 0.1)
    near, far = (steady_swing(TRANSDUCER, at_um + shift).voltage_v for shift in (0.1, -0.1))
    # slopes of PCHIP at points 1 to 5 µm apart; seen 4e-5, 1e-6, 5e-6, 4e-4
    assert gauge.gain_v_per_um == pytest.approx((near - far) / 0.2, rel=tolerance)
    assert gauge.bias_v + gauge.gain_v_per_um * at_um == pytest.approx(float(shipped.voltage_at(at_um)), rel=1e-12)
    assert (gauge.time_constant_s, gauge.allowance_um) == (0.1, at_um)


@settings(max_examples=25)
@given(share=st.lists(st.floats(0.0, 1.0), min_size=1, max_size=5))
def test_inverse_and_curve_undo_each_other(shipped, share):
    low, high = shipped.monotone_um
    allowance = low + np.array(share) * (high - low)
    voltage = shipped.voltage_at(allowance)
    # 52 halvings of a few volts over a few micrometres; where the curve begins flat, the square root of the rounding
    np.testing.assert_allclose(shipped.voltage_at(shipped.allowance_at(voltage)), voltage, rtol=1e-13)
    np.testing.assert_allclose(shipped.allowance_at(voltage), allowance, atol=1e-6)


def test_voltages_of_no_allowance_are_refused_with_the_range(shipped):
    for wrong in (shipped.voltage_v[0] * 1.01, 0.0, np.nan):
        with pytest.raises(InputError) as refused:
            shipped.allowance_at([1.0, wrong])
        assert (refused.value.where, refused.value.found) == ("characteristic", f"{wrong:.6g} V")
        assert all(f"{end:.5g} µm" in refused.value.expected for end in shipped.monotone_um)


def test_the_line_is_within_the_tolerance_up_to_its_range_and_not_beyond(shipped):
    gauge = linear_gauge(shipped, 0.0, 0.1)
    low, high = linear_range_um(shipped, gauge, 1.0)
    assert low < 0.0 < high

    def off_um(at_um):
        return float((shipped.voltage_at(at_um) - gauge.bias_v) / gauge.gain_v_per_um - at_um)

    for end in (low, high):
        # 50 halvings of a step of the search
        assert abs(off_um(end)) == pytest.approx(1.0, rel=1e-9)
        assert abs(off_um(end * 1.01)) > 1.0
        assert abs(off_um(end * 0.9)) < 1.0


def test_a_line_holds_everywhere_on_a_straight_characteristic():
    straight = Characteristic(np.array([0.0, 10.0, 40.0]), np.array([3.0, 2.0, -1.0]))
    gauge = linear_gauge(straight, 20.0, 0.1)
    assert (gauge.gain_v_per_um, gauge.bias_v) == pytest.approx((-0.1, 3.0))
    assert linear_range_um(straight, gauge, 1e-6) == (0.0, 40.0)


@pytest.mark.parametrize("at_um", [-500.0, 150.0, 1000.0, np.nan])
def test_a_line_where_the_voltage_does_not_fall_is_refused(shipped, at_um):
    with pytest.raises(InputError, match="at_um"):
        linear_gauge(shipped, at_um, 0.1)


def test_a_voltage_that_falls_nowhere_is_refused():
    with pytest.raises(InputError, match="falls nowhere"):
        linear_gauge(Characteristic(np.array([0.0, 1.0]), np.array([1.0, 1.0])), 0.5, 0.1)


def test_grinding_slowly_the_gauge_is_its_characteristic_behind_a_filter(shipped):
    """The allowance falls at 10 µm/s: the whole chain lags by T_Φ and hardly more."""
    rate, time = 10.0, np.linspace(0.0, 4.0, 8001)
    allowance = 40.0 - rate * time
    start = steady_swing(TRANSDUCER, 40.0).state
    motion = simulate_transducer(TRANSDUCER, allowance, time, start=start)
    # a round has 20 samples
    whole = _means(motion.smoothed_v, 20)
    quasi = shipped.voltage_at(allowance)
    smoothed, fade = np.empty(len(time)), np.exp(-(time[1] - time[0]) / 0.1)
    smoothed[0] = quasi[0]
    for k in range(1, len(time)):
        smoothed[k] = fade * smoothed[k - 1] + (1 - fade) * 0.5 * (quasi[k] + quasi[k - 1])
    late = slice(200, None)
    off_um = (whole - _means(smoothed, 20))[late] / shipped.slope_at(_means(allowance, 20))[late]
    # the swing itself takes a few periods to follow: 10 µm/s times some 5 ms
    assert np.abs(off_um).max() < 0.1


def _means(values, count):
    return values[: len(values) // count * count].reshape(-1, count).mean(axis=1)


def test_above_the_resonance_two_swings_are_told():
    told = characteristic(tuned(0.8, 10.0)).findings
    assert "two-swings" in {finding.id for finding in told}
    assert next(finding for finding in told if finding.id == "two-swings").level == "warning"


def test_impacts_that_do_not_repeat_are_told():
    found = characteristic(tuned(1.1, 25.0))
    assert {"irregular-swing", "swing-of-several-rounds"} <= {finding.id for finding in found.findings}
    assert np.isfinite(found.voltage_v).all()


def test_a_workpiece_that_the_swing_does_not_reach_shows_nothing():
    far = replace(TRANSDUCER, rest_gap_m=1e-3)
    allowance = np.linspace(-50.0, 50.0, 5)
    flat = Characteristic(allowance, np.array([steady_swing(far, at_um).voltage_v for at_um in allowance.tolist()]))
    with pytest.raises(InputError, match="rest_gap_m"):
        linear_gauge(flat, 0.0, 0.1)
