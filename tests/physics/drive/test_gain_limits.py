from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from selector.errors import InputError
from selector.physics.drive.closed_loop import growing_poles, loop_poles, loop_response, sampled_closed_loop
from selector.physics.drive.parts.axis import Axis, RigidMechanics, Sensing, Servo
from selector.physics.drive.parts.catalogue import thc6350_x_axis
from selector.physics.drive.parts.stiffness import three_mass_mechanics
from selector.physics.drive.stability import GAINS, Crossing, gain_crossings, stable_factors
from tests.physics.drive.loops import opened_position_loop

THREE = three_mass_mechanics(thc6350_x_axis())
DAMPED = replace(THREE, torsional_damping_nms_per_rad=0.5, axial_damping_ns_per_m=2e4)
RIGID = RigidMechanics(100.0, 200.0)


def factor(exponent: float) -> st.SearchStrategy[float]:
    return st.floats(-exponent, exponent).map(lambda power: 10.0**power)


@st.composite
def axes(draw: st.DrawFn) -> Axis:
    mechanics = draw(st.sampled_from([RIGID, RigidMechanics(3.0), THREE, DAMPED]))
    rigid = isinstance(mechanics, RigidMechanics)
    sample_s = draw(st.sampled_from([0.0, 1e-4, 1e-3, 4e-3]))
    # a velocity loop of some 60 1/s, times what is drawn
    gain = (60.0 * mechanics.mass_kg if rigid else 3.0) * draw(factor(1.5))
    servo = Servo(
        20.0 * draw(factor(1.5)),
        gain,
        draw(st.sampled_from([0.0, 20.0, 400.0])) * gain,
        sample_s=sample_s,
        delay_s=draw(st.sampled_from([0.0, 0.4, 1.0, 3.3, 20.0])) * sample_s,
        feedback=draw(st.sampled_from(["table", "motor"])),
    )
    samples = draw(st.sampled_from([0, 1, 5])) if sample_s > 0 else 0
    return Axis(mechanics, servo, sensing=Sensing(speed_from_encoder=samples > 0, speed_samples=max(samples, 1)))


@settings(max_examples=75)
@given(axes(), st.sampled_from(GAINS), factor(5.0))
def test_crossings_tell_how_many_poles_grow_with_any_factor(axis, gain, by):
    if getattr(axis.servo, gain) == 0.0:
        return
    poles = loop_poles(axis)
    crossings = gain_crossings(axis, gain, poles)
    # at the edge eigenvalues are as good as rounding
    if any(abs(math.log(one.factor / near)) < 1e-4 for one in crossings for near in (1.0, by)):
        return
    changed = replace(axis, servo=replace(axis.servo, **{gain: by * getattr(axis.servo, gain)}))
    new = loop_poles(changed)
    lying = np.abs(new.real) < 1e-9 * np.abs(new).max()
    if (lying & (np.abs(new) > 1e-6 * np.abs(new).max())).any():
        return
    # a sampled pole on the negative real axis has no partner to be counted with
    sample_s = axis.servo.sample_s
    if sample_s > 0.0 and np.any(np.abs(np.abs(new.imag) * sample_s - np.pi) < 1e-6):
        return
    between = sum(one.grow for one in crossings if 1.0 < one.factor < by)
    between -= sum(one.grow for one in crossings if by < one.factor < 1.0)
    assert len(growing_poles(new)) == len(growing_poles(poles)) + between


def slide(kp: float, kvp: float, kvi: float, **more: float) -> Axis:
    return Axis(RIGID, Servo(kp, kvp, kvi, sample_s=1e-3, **more))


def limits(axis: Axis, gain: str) -> tuple[float | None, float | None]:
    poles = loop_poles(axis)
    return stable_factors(gain_crossings(axis, gain, poles), len(growing_poles(poles)))


@pytest.mark.parametrize(
    ("axis", "gain", "low", "high"),
    [
        # eigenvalues of the sampled loop, written down once more by hand, on 1000 factors a decade
        (slide(60.0, 2e9, 1e5), "velocity_gain", 2.44e3, 2.0e5),
        (slide(60.0, 2e4, 1e13), "velocity_integral_gain", None, 1.433e7),
        (slide(60.0, 2e4, 1e5), "position_gain_per_s", None, 1970.0),
    ],
)
def test_limits_far_from_the_gain_are_found(axis, gain, low, high):
    value = getattr(axis.servo, gain)
    found = limits(axis, gain)
    assert found == tuple(None if one is None else pytest.approx(one / value, rel=3e-3) for one in (low, high))


def test_long_waiting_costs_no_more_than_its_eigenvalues():
    axis = Axis(RIGID, Servo(0.5, 50.0, 5.0, sample_s=1e-3, delay_s=0.2))
    _, high = limits(axis, "velocity_gain")
    assert high is not None
    for by, count in ((0.999 * high, 0), (1.001 * high, 2)):
        changed = replace(axis, servo=replace(axis.servo, velocity_gain=50.0 * by))
        assert len(growing_poles(loop_poles(changed))) == count


def test_range_nearest_to_one():
    crossings = (Crossing(0.1, -2), Crossing(0.5, 2), Crossing(1.5, -2), Crossing(90.0, 2))
    assert stable_factors(crossings, 2) == (1.5, 90.0)
    assert stable_factors(crossings[:3], 2) == (1.5, None)
    assert stable_factors(crossings[:2], 2) == (0.1, 0.5)
    assert stable_factors((), 0) == (None, None)
    assert stable_factors((), 2) == (None, 0.0)


def test_slow_poles_decay_though_rounding_hides_their_sign():
    # ∫ of 1e-5 of the speed error: a pole at −5e-10 1/s beside others of 200 1/s
    poles = loop_poles(slide(60.0, 2e4, 1e-5))
    assert poles[0].real == pytest.approx(-1e-5 / 2e4, rel=0.01)
    assert len(growing_poles(np.array([2e-9, -5.0, -8.0]))) == 0
    assert len(growing_poles(np.array([1e-3 + 4.0j, 1e-3 - 4.0j, -8.0]))) == 2


def test_response_without_waiting_states_is_that_of_the_states():
    servo = Servo(60.0, 2e4, 1e5, sample_s=1e-3, delay_s=3.4e-3)
    axis = Axis(RIGID, servo, sensing=Sensing(speed_from_encoder=True, speed_samples=3))
    rad = np.geomspace(0.1, 3000.0, 40)
    unit = np.exp(1j * rad * 1e-3)[:, None, None]
    closed = sampled_closed_loop(axis)
    for (A, B, C), answer in (
        (opened_position_loop(axis), loop_response(axis, rad).opened_position_loop(axis)),
        ((closed.A, closed.B, closed.C), loop_response(axis, rad).reference_to_table(axis)),
    ):
        states = np.linalg.solve(unit * np.eye(len(A)) - A, B[:, :1])
        # rounding, larger where z is near the two poles at 1
        np.testing.assert_allclose(answer, (C[:1] @ states)[:, 0, 0], rtol=1e-7)


def test_numbers_too_far_apart_are_refused():
    axis = Axis(replace(THREE, motor_inertia_kg_m2=1e-300), Servo(40.0, 2.0, 20.0, sample_s=1e-3))
    with pytest.raises(InputError) as refused:
        loop_poles(axis)
    assert refused.value.where == "feed axis"
