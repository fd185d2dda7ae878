"""The modal model: laws of heating and cooling, exact stepping, honest limits."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from selector.errors import InputError
from selector.physics.thermal.modes.modes import Cyclogram, ModalModel, SpeedLaw
from tests.physics.thermal.segments import of_segments

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


def heating(time_s, tau_s, steady_um, initial_um):
    """Σ_k A_k (1 − e^(−t/τ_k)) + Σ_k B_k e^(−t/τ_k) (C eq. 1, 3)."""
    left = np.exp(-time_s[:, None] / tau_s)
    return (1.0 - left) @ steady_um + left @ initial_um


def running(one, speed_rpm, time_s):
    """Continuous running from rest."""
    return one.displacement_um(Cyclogram([0.0], [speed_rpm], time_s[-1]), time_s)


def standing(one, start, time_s):
    """Standing from a state on."""
    return one.displacement_um(Cyclogram([0.0], [0.0], time_s[-1]), time_s, start)


def rates(one, x, speed_rpm):
    """x' of the states of shape (n_modes, n_terms), flat."""
    share = (speed_rpm / one.law.reference_rpm) ** one.cooling_exponent
    losses = np.eye(len(one.tau_s)) + share * one.cooling_growth
    change = one.law.terms(np.array([speed_rpm])) - losses @ x.reshape(len(one.tau_s), -1)
    return (change / one.tau_s[:, None]).ravel()


def test_continuous_running_is_the_heating_law_and_standing_the_cooling_law():
    one = model()
    gains = np.einsum("j,jkr->kr", one.law.terms(np.array([1400.0]))[0], one.gains_um)
    heated = running(one, 1400.0, TIME)
    for r in range(2):
        np.testing.assert_allclose(heated[:, r], heating(TIME, one.tau_s, gains[:, r], np.zeros(2)), atol=1e-10)
    start = one.states_at(of_segments((120, 1400.0)), np.array([7200.0]))[0]
    reached = (1 - np.exp(-7200.0 / one.tau_s))[:, None] * gains
    cooled = standing(one, start, TIME)
    for r in range(2):  # 1e-10 µm: rounding of a few operations on 40 µm
        np.testing.assert_allclose(cooled[:, r], heating(TIME, one.tau_s, np.zeros(2), reached[:, r]), atol=1e-10)


def test_steps_are_those_of_the_differential_equation():
    one = coupled()
    cycle = of_segments((20, 800.0), (10, 0.0), (30, 2000.0), (15, 500.0))
    x = np.zeros(4)
    for begin, end, speed in zip(cycle.start_s, [*cycle.start_s[1:], cycle.end_s], cycle.speed_rpm, strict=True):
        x = solve_ivp(lambda t, y, n=speed: rates(one, y, n), (begin, end), x, rtol=1e-10, atol=1e-12).y[:, -1]
        reached = one.displacement_um(cycle, np.array([end]))[0]
        # the integrator is told 1e-10; gains are 40 µm
        np.testing.assert_allclose(np.einsum("kj,jkr->r", x.reshape(2, -1), one.gains_um), reached, atol=1e-6)


def test_growth_that_is_off_is_the_simpler_model():
    cycle = of_segments((20, 800.0), (10, 0.0), (30, 2000.0))
    time = np.linspace(0, cycle.end_s, 40)
    off = model(growth=np.zeros((2, 2))).displacement_um(cycle, time)
    assert (off == model().displacement_um(cycle, time)).all()
    assert np.abs(coupled().displacement_um(cycle, time) - off).max() > 1.0


def test_films_lower_steady_levels_and_leave_the_standing_machine_alone():
    grown = model(growth=(1.0, 1.0))
    steady, of_grown = (running(one, 2000.0, np.array([1e7])) for one in (model(), grown))
    np.testing.assert_allclose(of_grown, steady / 2, rtol=1e-12)
    start = np.ones((2, 2))
    np.testing.assert_allclose(standing(grown, start, TIME), standing(model(), start, TIME), atol=1e-12)


@settings(max_examples=30)
@given(
    minutes=st.lists(st.integers(1, 90), min_size=1, max_size=6),
    speeds=st.lists(st.sampled_from([0.0, 300.0, 1250.0, 2000.0]), min_size=6, max_size=6),
    cut=st.floats(0.05, 0.95),
)
def test_a_duty_cycle_may_be_cut_anywhere(minutes, speeds, cut):
    """States carry everything: the rest of a cycle from the state at the cut is the whole cycle."""
    one = coupled()
    whole = of_segments(*zip(map(float, minutes), speeds, strict=False))
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
        running(model(), speed, TIME)


def test_standing_machine_stays_where_it_is():
    assert (running(model(), 0.0, TIME) == 0.0).all()


def test_terms_of_a_law_with_knots_are_powers_at_every_knot():
    law = SpeedLaw((1.3,), 2000.0, (800.0, 1250.0, 2000.0))
    np.testing.assert_allclose(law.terms(np.array([0.0, 800.0, 2000.0])).sum(axis=1), [0.0, 0.4**1.3, 1.0], rtol=1e-14)
    assert law.size == 3
