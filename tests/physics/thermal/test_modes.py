"""The modal model: laws of heating and cooling, exact stepping, honest limits."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from selector.errors import InputError
from selector.physics.thermal.cyclogram import Cyclogram
from selector.physics.thermal.modes import ModalModel, cooling, heating
from selector.physics.thermal.speed_law import SpeedLaw

TIME = np.linspace(0.0, 7200.0, 25)


def model(growth=(0.0, 0.0), **changes):
    parts = {
        "responses": ("Z", "Y"),
        "tau_s": np.array([300.0, 3600.0]),
        "gains_um": np.array([[[10.0, -3.0], [25.0, 8.0]], [[4.0, 1.0], [0.0, 2.0]]]),
        "law": SpeedLaw((1.0, 1.7), 2000.0),
        "fastest_rpm": 2000.0,
        "cooling_growth": np.array(growth),
    }
    return ModalModel(**(parts | changes))


def coupled():
    return model(growth=[[0.8, 0.3], [0.5, 1.1]])


def test_heating_starts_at_b_and_ends_at_a():
    a, b, tau = np.array([10.0, 20.0]), np.array([1.0, -2.0]), np.array([100.0, 1000.0])
    course = heating(np.array([0.0, 1e6]), tau, a, b)
    np.testing.assert_allclose(course, [-1.0, 30.0], rtol=1e-12)  # the sums of B and of A, in double precision


def test_cooling_is_heating_with_a_and_b_exchanged():
    a, b, tau = np.array([10.0, 20.0]), np.array([1.0, -2.0]), np.array([100.0, 1000.0])
    assert (cooling(TIME, tau, a, b) == heating(TIME, tau, b, a)).all()


def test_continuous_running_is_the_heating_law_and_standing_the_cooling_law():
    one = model()
    gains = one.gain_um(np.array([1400.0]))[0]
    heated = one.characteristic(1400.0, TIME)
    for r in range(2):
        np.testing.assert_allclose(heated[:, r], heating(TIME, one.tau_s, gains[:, r], np.zeros(2)), atol=1e-10)
    start = one.states_at(Cyclogram.of_segments((120, 1400.0)), np.array([7200.0]))[0]
    reached = (1 - np.exp(-7200.0 / one.tau_s))[:, None] * gains
    cooled = one.cooling(start, TIME)
    for r in range(2):  # 1e-10 µm: rounding of a few operations on 40 µm
        np.testing.assert_allclose(cooled[:, r], cooling(TIME, one.tau_s, reached[:, r], np.zeros(2)), atol=1e-10)


def test_steps_are_those_of_the_differential_equation():
    one = coupled()
    cycle = Cyclogram.of_segments((20, 800.0), (10, 0.0), (30, 2000.0), (15, 500.0))
    x = np.zeros(4)
    for begin, end, speed in zip(cycle.start_s, [*cycle.start_s[1:], cycle.end_s], cycle.speed_rpm, strict=True):
        x = solve_ivp(
            lambda t, y, n=speed: one.derivative(t, y, np.array([n])), (begin, end), x, rtol=1e-10, atol=1e-12
        ).y[:, -1]
        reached = one.displacement_um(cycle, np.array([end]))[0]
        # the integrator is told 1e-10; gains are 40 µm
        np.testing.assert_allclose(one.output(end, x, np.array([speed])), reached, atol=1e-6)


def test_growth_that_is_off_is_the_simpler_model():
    cycle = Cyclogram.of_segments((20, 800.0), (10, 0.0), (30, 2000.0))
    time = np.linspace(0, cycle.end_s, 40)
    off = model(growth=np.zeros((2, 2))).displacement_um(cycle, time)
    assert (off == model().displacement_um(cycle, time)).all()
    assert np.abs(coupled().displacement_um(cycle, time) - off).max() > 1.0


def test_films_lower_steady_levels_and_leave_the_standing_machine_alone():
    grown = model(growth=(1.0, 1.0))
    np.testing.assert_allclose(grown.gain_um(np.array([2000.0])), model().gain_um(np.array([2000.0])) / 2, rtol=1e-12)
    start = np.ones((2, 2))
    np.testing.assert_allclose(grown.cooling(start, TIME), model().cooling(start, TIME), atol=1e-12)


@settings(max_examples=60, deadline=None)
@given(
    minutes=st.lists(st.integers(1, 90), min_size=1, max_size=6),
    speeds=st.lists(st.sampled_from([0.0, 300.0, 1250.0, 2000.0]), min_size=6, max_size=6),
    cut=st.floats(0.05, 0.95),
)
def test_a_duty_cycle_may_be_cut_anywhere(minutes, speeds, cut):
    """States carry everything: the rest of a cycle from the state at the cut is the whole cycle."""
    one = coupled()
    whole = Cyclogram.of_segments(*zip(map(float, minutes), speeds, strict=False))
    at = cut * whole.end_s
    keep = whole.start_s > at
    rest = Cyclogram(
        np.r_[0.0, whole.start_s[keep] - at],
        np.r_[whole.speed_at(np.array([at])), whole.speed_rpm[keep]],
        whole.end_s - at,
    )
    time = np.linspace(0.0, rest.end_s * (1 - 1e-12), 9)
    start = one.states_at(whole, np.array([at]))[0]
    np.testing.assert_allclose(
        one.displacement_um(rest, time, start), one.displacement_um(whole, time + at), atol=1e-8
    )  # rounding of times up to 3e4 s against time constants of 300 s


@pytest.mark.parametrize("speed", [2100.0, -1.0, float("nan")])
def test_speeds_that_were_not_tested_are_refused(speed):
    with pytest.raises(InputError, match="2000 r/min"):
        model().gain_um(np.array([speed]))


@pytest.mark.parametrize("time", [-1.0, 1201.0, float("nan")])
def test_times_outside_the_cycle_are_refused(time):
    with pytest.raises(InputError, match="1200 s"):
        model().displacement_um(Cyclogram.of_segments((20, 800.0)), np.array([time]))


def test_standing_machine_stays_where_it_is():
    assert (model().characteristic(0.0, TIME) == 0.0).all()
    assert model().speed_limits_rpm == (0.0, 2000.0)


def test_parts_that_do_not_fit_are_refused():
    with pytest.raises(ValueError, match="gains"):
        model(tau_s=np.array([300.0]))
    with pytest.raises(ValueError, match="cooling growth"):
        model(cooling_growth=np.zeros((3, 3)))


def test_terms_of_a_law_with_knots_are_powers_at_every_knot():
    law = SpeedLaw((1.3,), 2000.0, (800.0, 1250.0, 2000.0))
    np.testing.assert_allclose(law.terms(np.array([0.0, 800.0, 2000.0])).sum(axis=1), [0.0, 0.4**1.3, 1.0], rtol=1e-14)
    assert law.size == 3
