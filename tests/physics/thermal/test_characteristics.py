"""Characteristics δ(n, t): noise is smoothed away, speeds between the tested ones, refusals."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from selector.errors import InputError
from selector.physics.thermal.modes.modes import cyclogram_kind
from selector.physics.thermal.modes.thermal_test import ThermalTest, coolings, heating_from_rest, mode_data
from selector.physics.thermal.prediction.piecewise import characteristics
from tests.physics.thermal.mode_machines import RESPONSES, heat_and_cool, modal_machine, recorded
from tests.physics.thermal.segments import of_segments

TAU_S = np.array([400.0, 2400.0, 9000.0])
# 60, 30 and 20 µm at 2000 r/min; Y turns back: its fast mode goes the other way
GAINS_UM = np.array([[15.0, -12.0, 5.0], [25.0, 20.0, 8.0], [20.0, 22.0, 7.0]])
NOISE_UM = 0.3


@pytest.fixture(scope="module")
def machine():
    return modal_machine(TAU_S, GAINS_UM, [1.3, 1.3, 1.3])


@pytest.fixture(scope="module")
def curves(machine):
    return characteristics(recorded(machine, np.random.default_rng(0), NOISE_UM, 30.0), RESPONSES)


def test_tested_speeds_are_followed_within_a_fraction_of_the_noise(machine, curves):
    for speed in (800.0, 1250.0, 2000.0):
        time, _, true = machine.course(of_segments((240, speed)), 30.0)
        got = np.column_stack([curve.heating_um(speed, time) for curve in curves])
        # 480 samples and 4 to 5 numbers a curve, the zero among them, of which blocks of up to 20 samples are averages:
        # some tenths of the noise, nowhere as much as a single sample has
        assert np.abs(got - true).max() < NOISE_UM
        assert np.sqrt(np.mean((got - true) ** 2)) < 0.5 * NOISE_UM


@pytest.mark.parametrize("speed", [400.0, 900.0, 1450.0, 1800.0])
def test_speeds_between_follow_the_power_of_the_speed(machine, curves, speed):
    time, _, true = machine.course(of_segments((240, speed)), 30.0)
    got = np.column_stack([curve.heating_um(speed, time) for curve in curves])
    # the gains grow with n^1.3 exactly, which is what is taken off before interpolating: only noise is left
    assert np.abs(got - true).max() < 1.2 * NOISE_UM
    assert curves[0].exponent == pytest.approx(1.3, abs=0.05)  # 0.1 µm in 60 µm at either end of ln(2000/800)


def test_starts_at_zero_and_stands_still_at_zero_speed(curves):
    for curve in curves:
        assert curve.heating_um(1100.0, np.array([0.0])) == pytest.approx([0.0])
        assert curve.heating_um(0.0, np.array([0.0, 100.0, np.inf])).tolist() == [0.0, 0.0, 0.0]


def test_coolings_begin_where_heating_ended_and_end_at_zero(curves):
    z = curves[0]
    assert len(z.cooling_starts_um) == 5
    # both curves are smoothed apart from each other
    ended = [float(z.heating_um(speed, np.array([14400.0]))[0]) for speed in z.speeds_rpm]
    assert z.cooling_starts_um == pytest.approx(ended, abs=0.5)
    assert np.abs(z.cooling_curve_um(4, np.array([1e6]))) < 1e-6


@pytest.mark.parametrize("speed", [-1.0, 2011.0, 5000.0, np.nan])
def test_speeds_outside_the_tests_are_refused(curves, speed):
    with pytest.raises(InputError, match="2000 r/min"):
        curves[0].heating_um(speed, np.array([60.0]))


def test_half_a_percent_is_the_same_speed(curves):
    assert curves[0].heating_um(2009.0, np.array([600.0])) == curves[0].heating_um(2000.0, np.array([600.0]))


def test_one_tested_speed_gives_a_straight_line_in_the_speed(machine):
    tests = recorded(machine, np.random.default_rng(1), 0.0, 60.0, heat_and_cool((1000.0,)))
    (z,) = characteristics([ThermalTest(t.run, t.time_s, t.speed_rpm, t.displacement_um[:, :1]) for t in tests], ("Z",))
    at = np.array([600.0, 6000.0])
    assert z.heating_um(500.0, at) == pytest.approx(0.5 * z.heating_um(1000.0, at), rel=1e-12)


def test_a_gauge_that_was_not_zeroed_makes_no_difference(machine, curves):
    tests = recorded(machine, np.random.default_rng(0), NOISE_UM, 30.0)
    moved = [ThermalTest(t.run, t.time_s, t.speed_rpm, t.displacement_um + 7.0) for t in tests]
    time = np.linspace(0, 14400, 50)
    again = characteristics(moved, RESPONSES)[0].heating_um(1600.0, time)
    assert again == pytest.approx(curves[0].heating_um(1600.0, time), abs=1e-6)  # the search stops at 1e-8


def test_which_stretches_are_used(machine):
    rng = np.random.default_rng(2)
    schedule = {
        "two_speeds": of_segments((60, 1000), (60, 2000), (90, 0), (60, 1600), (60, 0)),
        "waits_first": of_segments((30, 0), (120, 1600), (120, 0)),
    }
    tests = recorded(machine, rng, 0.1, 30.0, schedule)
    # 20 s of another reading in the midst of a stretch do not end it
    speed = tests[1].speed_rpm.copy()
    speed[150] = 0.0
    tests[1] = ThermalTest("waits_first", tests[1].time_s, speed, tests[1].displacement_um)
    cold = machine.states(schedule["two_speeds"], 30.0)[2][-240]
    tests.append(machine.test("cools_only", of_segments((200, 0)), 30.0, 0.1, rng, start=cold))
    data = mode_data(tests)
    heating = heating_from_rest(data)
    assert [(part.run, round(part.speed_rpm), round(part.duration_s / 60)) for part in heating] == [
        (0, 1000, 60),
        (1, 1600, 120),
    ]
    cooled = coolings(data)
    assert [(part.run, round(part.duration_s / 60)) for part in cooled] == [(0, 90), (0, 60), (1, 120), (2, 200)]


def test_no_heating_from_rest_is_refused(machine):
    warm = machine.states(of_segments((240, 2000)), 60.0)[2][-1]
    test = machine.test("r", of_segments((60, 0), (240, 1000)), 60.0, 0.3, np.random.default_rng(3), warm)
    with pytest.raises(InputError, match="cold"):
        characteristics([test], RESPONSES)


@pytest.mark.parametrize(
    ("kind", "speeds"),
    [
        ("idle", [0, 0]),
        ("continuous", [800, 800]),
        ("rising", [800, 1000, 2000]),
        ("rising", [0, 1000]),
        ("falling", [2000, 1000, 0]),
        ("intermittent", [1600, 0, 1600, 0]),
        ("intermittent", [1600, 0]),
        ("random", [1000, 2000, 500, 0, 800]),
    ],
)
def test_kinds_of_duty_cycles(kind, speeds):
    assert cyclogram_kind(of_segments(*[(10, speed) for speed in speeds])) == kind


@settings(max_examples=25)
@given(st.lists(st.sampled_from([0.0, 500.0, 1000.0, 2000.0]), min_size=1, max_size=6))
def test_kind_does_not_depend_on_how_segments_are_cut(speeds):
    whole = of_segments(*[(10.0, speed) for speed in speeds])
    cut = of_segments(*[(5.0, speed) for speed in speeds for _ in range(2)])
    assert cyclogram_kind(whole) == cyclogram_kind(cut)
