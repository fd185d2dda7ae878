"""The piecewise method: exact where its hypothesis holds, what it does where it does not, and what it says then."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from selector.errors import InputError
from selector.physics.thermal.prediction.piecewise import Characteristics, characteristics, piecewise_displacement_um
from tests.physics.thermal.mode_machines import RESPONSES, modal_machine, random_network, recorded
from tests.physics.thermal.segments import of_segments

SEED_SCHEDULES = {
    "two speeds": [(20, 2000), (280, 1000)],
    "intermittent": [(30, 1600), (15, 0)] * 7,
    "rising": [(60, 800), (60, 1000), (60, 1250), (60, 1600)],
    "falling": [(60, 2000), (60, 1600), (60, 1000), (60, 0)],
    "random": [(40, 1250), (50, 500), (30, 2000), (60, 800), (20, 0), (50, 2000), (50, 200)],
}


@pytest.fixture(scope="module")
def one_mode():
    """One mode: the displacement is the whole state, so that the hypothesis of the method is true."""
    machine = modal_machine([3000.0], [[60.0, -30.0, 10.0]], [1.2])
    return machine, characteristics(recorded(machine, np.random.default_rng(0), 0.0, 60.0), RESPONSES)


@pytest.mark.parametrize("name", SEED_SCHEDULES)
def test_exact_for_a_machine_with_one_mode(one_mode, name):
    machine, curves = one_mode
    cycle = of_segments(*SEED_SCHEDULES[name])
    time, _, true = machine.course(cycle, 60.0)
    got, _ = piecewise_displacement_um(curves, cycle, np.minimum(time, cycle.end_s))
    # block averages put the fitted curve off by up to 8e-5 of its amplitude, for each of at most 14 segments
    assert np.abs(got - true).max() < 14 * 8e-5 * 60


@pytest.fixture(scope="module")
def network():
    rng = np.random.default_rng(3)
    machine = random_network(rng)
    return machine, characteristics(recorded(machine, rng, 0.3, 30.0), RESPONSES)


@pytest.mark.parametrize("name", SEED_SCHEDULES)
def test_along_the_spindle_within_what_the_source_claims(network, name):
    machine, curves = network
    cycle = of_segments(*SEED_SCHEDULES[name])
    time, _, true = machine.course(cycle, 60.0)
    got, _ = piecewise_displacement_um(curves[:1], cycle, np.minimum(time, cycle.end_s))
    # C: at most 10 % of the peak along the spindle
    assert np.abs(got[:, 0] - true[:, 0]).max() < 0.10 * np.abs(true[:, 0]).max()


@settings(max_examples=20)
@given(
    st.lists(
        st.tuples(st.sampled_from([0.5, 10.0, 45.0, 400.0]), st.sampled_from([0.0, 50.0, 700.0, 1600.0, 2000.0])),
        min_size=1,
        max_size=8,
    )
)
def test_continuous_bounded_and_zero_at_the_start(network, segments):
    _, curves = network
    cycle = of_segments(*segments)
    time = np.unique(np.r_[np.linspace(0, cycle.end_s, 400), cycle.start_s, cycle.start_s + 1e-6])
    got, _ = piecewise_displacement_um(curves, cycle, time)
    assert np.abs(got[0]).max() == 0.0
    for r, curve in enumerate(curves):
        largest = np.abs(curve.heating_um(2000.0, np.r_[np.linspace(0, 1e5, 500), np.inf])).max()
        # never beyond what the fastest speed does for good, with 5 % for curves that turn back (GROWS), a segment each
        assert np.abs(got[:, r]).max() <= 1.05 ** len(segments) * largest + 1e-9
    for change in cycle.start_s[1:]:
        at = np.searchsorted(time, change)
        # steepest at 60 µm within the fastest time constant of some seconds
        assert np.abs(got[at + 1] - got[at]).max() < 1e-3


def curve(**changes):
    given_values = {
        "response": "Z",
        "speeds_rpm": np.array([1000.0, 2000.0]),
        "tested_s": np.array([14400.0, 14400.0]),
        "tau_s": np.array([3000.0]),
        "steady_um": np.array([[20.0], [50.0]]),
        "exponent": 1.0,
        "cooling_tau_s": np.array([3000.0]),
        "cooling_um": np.array([[20.0], [50.0]]),
        "noise_um": 0.1,
    }
    return Characteristics(**{**given_values, **changes})


def told(one, *segments):
    cycle = of_segments(*segments)
    time = np.linspace(0, cycle.end_s, 200)
    got, findings = piecewise_displacement_um([one], cycle, time)
    return got[:, 0], {finding.id: finding for finding in findings}


def test_falling_speed_needs_the_additional_operation():
    got, findings = told(curve(), (200, 2000), (200, 1000))
    assert set(findings) == {"additional-operation"}
    assert findings["additional-operation"].evidence["times_s"] == [12000.0]
    # from above, down to the lower steady level
    assert got[-1] == pytest.approx(20.0, abs=1.0)
    assert (np.diff(got[101:]) < 0).all()


def test_idle_follows_the_cooling_that_begins_nearest_beyond():
    fast_then_slow = curve(cooling_tau_s=np.array([600.0, 6000.0]), cooling_um=np.array([[20.0, 0.0], [0.0, 45.0]]))
    low, _ = told(fast_then_slow, (30, 1000), (60, 0))
    high, _ = told(fast_then_slow, (60, 2000), (60, 0))
    # 9 µm: the curve from 20 µm, which fades with 600 s; 35 µm: the one from 45 µm, with 6000 s
    assert low[-1] / low.max() == pytest.approx(np.exp(-6), rel=0.05)
    assert high[-1] / high.max() == pytest.approx(np.exp(-0.6), rel=0.02)


def test_beyond_every_cooling_the_largest_is_scaled():
    _, findings = told(curve(cooling_um=np.array([[20.0]])), (200, 2000), (60, 0))
    assert "cooling-scaled" in findings


def test_without_coolings_heating_is_turned_upside_down():
    got, findings = told(curve(cooling_tau_s=np.zeros(0), cooling_um=np.zeros((0, 0))), (200, 2000), (50, 0))
    assert "cooling-assumed" in findings
    assert got[-1] / got.max() == pytest.approx(np.exp(-1.0), rel=0.01)  # 50 min are one time constant


def test_a_displacement_on_the_other_side():
    # below 1000 r/min it grows, above it shrinks
    got, findings = told(curve(steady_um=np.array([[20.0], [-50.0]])), (200, 1000), (400, 2000))
    assert "displacement-on-other-side" in findings
    assert got[-1] == pytest.approx(-50.0, abs=0.5)


def test_a_characteristic_that_turns_back_is_told():
    turns = curve(tau_s=np.array([600.0, 9000.0]), steady_um=np.array([[20.0, -15.0], [50.0, -40.0]]))
    _, findings = told(turns, (60, 2000), (10, 0), (60, 2000))
    assert findings["entry-not-unique"].level == "warning"


def test_further_than_the_tests_is_told():
    _, findings = told(curve(), (400, 1000))
    assert set(findings) == {"characteristic-extended"}


def test_speeds_outside_the_tests_are_refused():
    with pytest.raises(InputError, match="0 to 2000 r/min"):
        told(curve(), (10, 1000), (10, 2100))
