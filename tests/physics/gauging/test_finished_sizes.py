"""Parts by Monte Carlo: exact where nothing is random, the same whatever surrounds them, told where they fail."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import linalg
from scipy.optimize import brentq

from selector.errors import InputError
from selector.physics.gauging import _part_kernel as kernel
from selector.physics.gauging.characteristic import Characteristic
from selector.physics.gauging.gauged_grinding import finished_sizes, part_course, part_plan, steps_per_filter
from selector.physics.gauging.transducer import Grinding, LinearGauge, Noise, Relay, Stage, Surface, smoothed_surface
from tests.physics.gauging.mean_course import mean_allowance_um, mean_voltage_v
from tests.physics.gauging.set_ups import GAUGE, TWO_STAGES, set_up

ONE_STAGE = Grinding(20.0, (Stage(5.0, 2.0),))
NOISY = set_up(
    replace(TWO_STAGES, feed_sd=0.1, lag_s=0.1, wheel_wear=0.05, wear_growth_per_part=0.02, dress_every=7),
    noise=Noise(0.4, 40.0),
    relay=Relay(0.02, 0.001),
    surface=Surface(240.0, 3, 0.1, 2.0, 0.3),
)


def test_without_disturbance_every_part_is_to_size():
    sizes = finished_sizes(set_up(ONE_STAGE), 3)
    # the transient exp(−18/(5·0.05)) has died; the crossing is the root of a cubic through steps of T_Φ/8, from
    # which the straight course with its dead transient does not differ
    np.testing.assert_allclose(sizes.size_um, 2.0, atol=1e-9)
    np.testing.assert_allclose(sizes.duration_s, 18.0 / 5.0, atol=1e-9)
    assert sizes.sd_um == pytest.approx(0.0, abs=1e-12)
    assert sizes.tripped.all()
    assert not sizes.at_once.any()
    assert sizes.findings() == ()


@settings(max_examples=30)
@given(
    lag_s=st.sampled_from([0.0, 0.03, 0.4]), delay_s=st.floats(0.0, 0.3), first=st.floats(5.0, 40.0),
    second=st.floats(0.5, 5.0), filter_s=st.floats(0.02, 0.3),
)  # fmt: skip
def test_stages_lags_and_delays_are_those_of_the_closed_form(lag_s, delay_s, first, second, filter_s):
    """Allowance and voltage of each stage by their formulas, one after the other, crossings by brentq."""
    grinding = Grinding(60.0, (Stage(first, 30.0), Stage(second, 2.0)), lag_s=lag_s)
    setup = set_up(grinding, relay=Relay(delay_s), gauge=replace(GAUGE, time_constant_s=filter_s))
    sizes = finished_sizes(setup, 1, steps=4 * steps_per_filter(setup))
    gauge = setup.gauge
    x, y, r, now, at_once = 60.0, gauge.bias_v + gauge.gain_v_per_um * 60.0, 0.0, 0.0, False
    for stage, volts in zip(grinding.stages, setup.thresholds_v, strict=True):
        start = (x, y, r if lag_s > 0 else stage.feed_um_per_s)

        def voltage(t: float, feed: float = stage.feed_um_per_s, start: tuple = start) -> float:
            return float(mean_voltage_v(gauge, t, start[0], feed, start_v=start[1], lag_s=lag_s, start_rate=start[2]))

        at_once |= voltage(0.0) >= volts
        over = delay_s
        if voltage(0.0) < volts:
            over += brentq(lambda t, volts=volts, voltage=voltage: voltage(t) - volts, 0.0, 1e4, xtol=1e-13)
        x = float(mean_allowance_um(over, start[0], stage.feed_um_per_s, lag_s=lag_s, start_rate=start[2]))
        y = voltage(over)
        left = math.exp(-over / lag_s) if lag_s > 0 else 0.0
        r = stage.feed_um_per_s + (start[2] - stage.feed_um_per_s) * left
        now += over
    # input taken straight over a step h of at most a 32nd of T_Φ and lag, where it bends by exp(−t/lag): (h/lag)²/12 of
    # what the lag still changes, at most 40 µm/s · 0.4 s with h = 0.3 s / 32
    assert sizes.size_um[0] == pytest.approx(x - lag_s * r, abs=8e-4)
    # the same over the slowest feed
    assert sizes.duration_s[0] == pytest.approx(now, abs=1.5e-3)
    assert bool(sizes.at_once[0]) == at_once


def test_the_method_is_of_second_order_in_the_step():
    """What is left is the input that is taken straight; beside 64 times as many steps."""
    setup = set_up(replace(ONE_STAGE, allowance_um=4.0, lag_s=0.2), surface=Surface(300.0, runout_um=1.0))
    exact, *others = (finished_sizes(setup, 20, steps=steps).size_um for steps in (4096, 32, 64, 128))
    errors = [float(np.abs(other - exact).max()) for other in others]
    assert errors[0] < 2e-3  # µm, of a run-out of 1 µm
    # a factor of 4 for half the step; crossings fall anywhere within a step
    assert errors[0] / errors[1] > 3.0
    assert errors[1] / errors[2] > 3.0


def test_grooves_are_exact_at_any_step():
    """Their edges are events: eight steps in T_Φ find what 128 do."""
    setup = set_up(ONE_STAGE, surface=Surface(150.0, 2, 0.07, 5.0))
    coarse, fine = (finished_sizes(setup, 20, steps=steps) for steps in (8, 128))
    # crossings by a cubic over a step of T_Φ/8: its fourth order, (1/8)⁴/384 of 5 µm
    np.testing.assert_allclose(coarse.size_um, fine.size_um, atol=1e-4)


def test_voltage_with_grooves_is_the_closed_form():
    surface = Surface(150.0, 2, 0.07, 5.0, 0.0)
    setup = set_up(replace(ONE_STAGE, allowance_um=30.0), surface=surface)
    course = part_course(setup, 4, seed=3, period_s=0.0063)
    late = (course.time_s > 20 * GAUGE.time_constant_s) & (course.time_s < course.duration_s)
    straight = mean_voltage_v(GAUGE, course.time_s, 30.0, 5.0)
    rest = (course.voltage_v - straight)[late] / GAUGE.gain_v_per_um
    # at which angle the part began is known from the seed alone: it is found by trying
    starts = np.arange(0, 0.5, 1e-4)
    tried = np.array([smoothed_surface(surface, 0.05, start + 2.5 * course.time_s[late])[0] for start in starts])
    # angles in steps of 1e-4 of a turn, with a rate of 5 µm/0.05 s at 2.5 turns a second
    assert np.abs(tried - rest).max(axis=1).min() < 100.0 * 1e-4 / 2.5


def test_noise_is_drawn_from_its_joint_law():
    """Covariances of a step, against the matrix exponential of noise and filter (Van Loan 1978)."""
    for rate, filter_s, h in ((40.0, 0.05, 0.006), (20.0, 0.05, 0.006), (3.0, 0.4, 0.1), (100.0, 0.05, 0.05)):
        sd = 0.7
        plan = part_plan(set_up(gauge=replace(GAUGE, time_constant_s=filter_s), noise=Noise(sd, rate)), 1)
        keep, early, late, rho, spread, from_f, to_f, own, _ = kernel._weights(plan, h)
        drift = np.array([[-rate, 0.0], [1 / filter_s, -1 / filter_s]])
        diffusion = np.array([[2 * rate * sd**2, 0.0], [0.0, 0.0]])
        block = linalg.expm(np.block([[-drift, diffusion], [np.zeros((2, 2)), drift.T]]) * h)
        step = block[2:, 2:].T
        covariance = step @ block[:2, 2:]
        # exp(-beta h) f(0) and the deterministic part of the filter
        np.testing.assert_allclose([rho, keep], [step[0, 0], step[1, 1]], rtol=1e-12)
        through = from_f + early + (to_f + late) * rho
        np.testing.assert_allclose(through, step[1, 0], rtol=1e-9)
        found = np.array([[spread**2, (to_f + late) * spread**2], [0.0, ((to_f + late) * spread) ** 2 + own**2]])
        # eight nodes of Gauss and Legendre over at most five correlation times
        np.testing.assert_allclose(found[np.triu_indices(2)], covariance[np.triu_indices(2)], rtol=1e-6)


def test_a_part_is_the_same_whatever_surrounds_it():
    few, many = finished_sizes(NOISY, 30, seed=5), finished_sizes(NOISY, 200, seed=5)
    other = finished_sizes(NOISY, 30, seed=6)
    np.testing.assert_array_equal(few.size_um, many.size_um[:30])
    assert (few.size_um != other.size_um).all()


def test_a_course_is_that_of_the_part():
    sizes = finished_sizes(NOISY, 12, seed=5)
    for number in (0, 11):
        course = part_course(NOISY, number, seed=5, period_s=0.0063)
        assert course.size_um == sizes.size_um[number]
        assert course.duration_s == sizes.duration_s[number]
        np.testing.assert_array_equal(course.stage_end_s, sizes.stage_end_s[number])
        # seven lags after the stop: exp(−7) of the run-on, 0.1 s · 6 µm/s, is left
        assert course.allowance_um[-1] == pytest.approx(course.size_um, abs=math.exp(-7) * 0.6)
        assert (np.diff(course.stage) >= 0).all()
        np.testing.assert_array_equal(course.feed_um_per_s == 0, course.stage == 2)
        assert (np.diff(course.allowance_um) <= 0).all()


def test_progress_is_told():
    told: list[tuple[int, int]] = []
    finished_sizes(set_up(ONE_STAGE), 130, progress=lambda done, of: told.append((done, of)))
    assert told == [(64, 130), (128, 130), (130, 130)]


def test_noise_of_no_size_is_none():
    """Physics switched off is the simpler physics, draw by draw."""
    quiet = finished_sizes(set_up(ONE_STAGE, noise=Noise(1e-12, 40.0)), 5)
    np.testing.assert_allclose(quiet.size_um, finished_sizes(set_up(ONE_STAGE), 5).size_um, atol=1e-9)


@pytest.mark.parametrize("gain", [-0.01, 0.02])
def test_a_characteristic_that_is_a_line_is_the_line(gain):
    gauge = LinearGauge(gain, 3.0, 0.05)
    setup = set_up(noise=Noise(0.4, 40.0), surface=Surface(240.0, 3, 0.1, 2.0), gauge=gauge)
    at = np.array([-50.0, 80.0])
    curved = replace(setup, characteristic=Characteristic(at, gauge.bias_v + gain * at))
    # the table's own rounding
    np.testing.assert_allclose(finished_sizes(curved, 20).size_um, finished_sizes(setup, 20).size_um, rtol=0, atol=1e-9)


def test_a_worn_probe_sees_less_allowance():
    """It stops earlier, so each part is larger than the one before by what the tip lost."""
    sizes = finished_sizes(set_up(replace(ONE_STAGE, probe_wear_um_per_part=0.01)), 5)
    np.testing.assert_allclose(sizes.size_um, 2.0 + 0.01 * np.arange(5), atol=1e-9)


def test_a_worn_wheel_removes_less_than_the_threshold_is_ahead_for():
    worn = replace(ONE_STAGE, wheel_wear=0.1, wear_growth_per_part=0.5, dress_every=3)
    setup = set_up(worn)
    sizes = finished_sizes(setup, 6)
    rates = 5.0 / (1.0 + 0.1 * 1.5 ** np.array([0, 1, 2, 0, 1, 2]))
    np.testing.assert_allclose(sizes.size_um, 2.0 + (rates[0] - rates) * 0.07, atol=1e-9)


def test_a_threshold_that_the_gauge_never_shows():
    at = np.linspace(-10.0, 60.0, 8)
    curve = Characteristic(at, GAUGE.bias_v + GAUGE.gain_v_per_um * at)
    setup = replace(set_up(), characteristic=curve, thresholds_v=(2.85, 5.0))
    sizes = finished_sizes(setup, 4)
    assert not sizes.tripped.any()
    assert np.isfinite(sizes.size_um).all()
    (finding,) = sizes.findings()
    assert finding.id == "threshold-never-reached"
    assert finding.evidence == {"parts": 4, "of": 4, "first_part": 1}
    with pytest.raises(InputError, match="0 of 4 parts") as refused:
        _ = sizes.mean_um
    assert refused.value.where == "thresholds_v"
    course = part_course(setup, 1, period_s=0.0063)
    assert not course.tripped
    assert len(course.stage_end_s) == 1
    assert np.isfinite(course.allowance_um).all()


def test_a_threshold_that_is_passed_at_the_start():
    sizes = finished_sizes(replace(set_up(ONE_STAGE), thresholds_v=(2.7,)), 4)
    assert sizes.at_once.all()
    assert sizes.findings()[0].id == "threshold-reached-at-once"
    # stopped after the relay's delay
    np.testing.assert_allclose(sizes.size_um, 20.0 - 5.0 * 0.02, rtol=1e-12)


def test_steps_resolve_what_happens():
    assert steps_per_filter(set_up()) == 8
    assert steps_per_filter(set_up(noise=Noise(1.0, 400.0))) == 0.05 * 1600
    assert steps_per_filter(set_up(surface=Surface(600.0, runout_um=1.0))) == 0.05 * 640


@pytest.mark.parametrize(("change", "key"), [({"parts": 10**9}, "run.parts"), ({"steps": 10**6}, "grinding.stages")])
def test_what_cannot_be_ground_is_refused(change, key):
    with pytest.raises(InputError) as caught:
        finished_sizes(set_up(), **({"parts": 1} | change))
    assert caught.value.where == f"key {key}"


@pytest.mark.parametrize(
    ("change", "key"),
    [
        ({"thresholds_v": (2.5, 1e6)}, "thresholds.volts"),
        ({"thresholds_v": (1e6, 1e6)}, "thresholds.volts"),
        ({"grinding": replace(TWO_STAGES, stages=(Stage(1e-5, 12.0), Stage(5.0, 2.0)))}, "grinding.stages"),
        ({"gauge": replace(GAUGE, time_constant_s=1e-7)}, "grinding.stages"),
        ({"noise": Noise(0.1, 1e7)}, "grinding.stages"),
        ({"relay": Relay(0.02, 0.01, 1e-8)}, "grinding.stages"),
        ({"relay": Relay(1e5)}, "grinding.stages"),
    ],
)
def test_parts_that_nobody_waits_for_are_refused_at_once(change, key):
    with pytest.raises(InputError) as caught:
        finished_sizes(replace(set_up(), **change), 1)
    assert caught.value.where == f"key {key}"


def test_how_often_a_part_is_looked_at_does_not_change_it():
    seldom, often = (part_course(NOISY, 3, seed=5, period_s=period_s) for period_s in (0.04, 0.005))
    assert seldom.size_um == often.size_um == finished_sizes(NOISY, 4, seed=5).size_um[3]
    n = len(seldom.time_s) - 1
    for name in ("allowance_um", "seen_um", "voltage_v", "feed_um_per_s", "stage"):
        # the same course at the same times, but for their rounding
        np.testing.assert_allclose(getattr(often, name)[: 8 * n : 8], getattr(seldom, name)[:n], rtol=0, atol=1e-9)


def test_the_relay_acts_where_the_recorded_voltage_is_at_its_threshold():
    setup = replace(NOISY, relay=Relay(0.0))
    course = part_course(setup, 2, seed=5, period_s=1e-4)
    for volts, end in zip(setup.thresholds_v, course.stage_end_s, strict=True):
        # of a course that is straight over 0.1 ms: at most some 0.05 V/s of noise behind the filter
        assert np.interp(end, course.time_s, course.voltage_v) == pytest.approx(volts, abs=2e-5)
