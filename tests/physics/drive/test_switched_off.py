"""Whatever is switched off is gone to the last bit."""

from __future__ import annotations

from dataclasses import fields, replace

import numpy as np
import pytest

from selector.errors import InputError
from selector.physics.drive.parts.axis import Axis, Friction, LuGre, Ripple, Sensing, Transmission
from selector.physics.drive.simulation import simulate_axis
from selector.physics.drive.trajectory import ParameterCourse, Reference
from tests.physics.drive.axes import CONTINUOUS, RIGID, RIGID_SERVO, SAMPLED, THREE, sine

COULOMB = Friction(300.0, offset_n=20.0, screw_coulomb_nm=0.2)
GUIDE = Friction(20.0, offset_n=3.0)
STRIBECK = replace(COULOMB, static_n=450.0)
DIRECT = replace(SAMPLED, delay_s=0.0)
SMOOTH, DRY, DIGITAL = Axis(THREE, CONTINUOUS), Axis(THREE, CONTINUOUS, COULOMB), Axis(THREE, DIRECT, COULOMB)
MASS = Axis(RIGID, RIGID_SERVO, GUIDE)
REFERENCE = sine(1e-3, 0.4)


def same(one, other, **options):
    first, second = simulate_axis(one, REFERENCE, step_s=1e-4, **options), simulate_axis(other, REFERENCE, step_s=1e-4)
    assert np.abs(first.table_m).max() > 0.01
    for field in fields(first):
        assert np.array_equal(getattr(first, field.name), getattr(second, field.name)), field.name


def differ(one, other):
    """That the effect is there when it is on: else its absence would prove nothing."""
    first, second = (simulate_axis(axis, REFERENCE, step_s=1e-4).table_m for axis in (one, other))
    assert not np.array_equal(first, second)


CASES = {
    "friction": (SMOOTH, Friction(0.0, 0.0, 0.0, 0.0, 0.003, 1.0), Friction(1.0)),
    "breakaway": (DRY, replace(COULOMB, static_n=300.0, stribeck_speed_m_per_s=0.05), STRIBECK),
    "both breakaways": (
        DRY,
        replace(COULOMB, static_n=300.0, static_negative_n=300.0, stribeck_exponent=0.7),
        STRIBECK,
    ),
    "asymmetry": (DRY, replace(COULOMB, coulomb_negative_n=300.0), replace(COULOMB, coulomb_negative_n=301.0)),
    "viscous by direction": (
        DRY,
        replace(COULOMB, viscous_negative_ns_per_m=0.0),
        replace(COULOMB, viscous_negative_ns_per_m=100.0),
    ),
    "asymmetric breakaway": (
        Axis(THREE, CONTINUOUS, STRIBECK),
        replace(STRIBECK, coulomb_negative_n=300.0, static_negative_n=450.0),
        replace(STRIBECK, coulomb_negative_n=300.0),
    ),
    "bristles of nothing": (SMOOTH, Friction(lugre=LuGre(1e7, 1e4, 0.01)), Friction(1.0, lugre=LuGre(1e7, 1e4, 0.01))),
    "fading of no damping": (
        Axis(THREE, CONTINUOUS, replace(STRIBECK, lugre=LuGre(1e7))),
        replace(STRIBECK, lugre=LuGre(1e7, 0.0, 0.01)),
        replace(STRIBECK, lugre=LuGre(1e7, 1e3, 0.01)),
    ),
}


@pytest.mark.parametrize("name", CASES)
def test_friction(name):
    simpler, off, on = CASES[name]
    same(replace(simpler, friction=off), simpler)
    differ(replace(simpler, friction=on), simpler)


@pytest.mark.parametrize("axis", [DRY, MASS], ids=["three", "rigid"])
def test_pitch_error(axis):
    off = Transmission(0.0, 0.0, 0.7, 0.0, (-0.1, 0.0, 0.1), (0.0, 0.0, 0.0))
    same(replace(axis, transmission=off), axis)
    for on in (
        replace(off, pitch_amplitude_m=1e-9),
        replace(off, pitch_slope=1e-9),
        replace(off, pitch_error_m=(0.0, 0.0, 1e-9)),
    ):
        differ(replace(axis, transmission=on), axis)


def test_backlash():
    same(replace(DRY, transmission=Transmission(backlash_m=0.0)), DRY)
    differ(replace(DRY, transmission=Transmission(backlash_m=1e-9)), DRY)


@pytest.mark.parametrize("axis", [DRY, DIGITAL, MASS], ids=["three", "sampled", "rigid"])
def test_ripple(axis):
    same(replace(axis, ripple=(Ripple(4.0, 0.0, 0.0, 0.3), Ripple(12.0))), axis)
    differ(replace(axis, ripple=(Ripple(4.0, 1e-6),)), axis)
    differ(replace(axis, ripple=(Ripple(4.0, 0.0, 1e-6),)), axis)


@pytest.mark.parametrize("axis", [DRY, DIGITAL], ids=["continuous", "sampled"])
def test_limits_that_are_never_reached(axis):
    same(replace(axis, servo=replace(axis.servo, command_limit=1e6, speed_limit=1e6)), axis)
    differ(replace(axis, servo=replace(axis.servo, command_limit=10.0)), axis)
    differ(replace(axis, servo=replace(axis.servo, speed_limit=50.0)), axis)


def test_delay_quantisation_and_noise_of_a_sampled_servo():
    same(replace(DIGITAL, servo=replace(DIRECT, delay_s=0.0), sensing=Sensing(0.0, 0.0, False, 1, 0.0)), DIGITAL)
    same(DIGITAL, DIGITAL, seed=7)
    differ(replace(DIGITAL, servo=replace(DIRECT, delay_s=1e-5)), DIGITAL)
    differ(replace(DIGITAL, sensing=Sensing(scale_resolution_m=1e-9)), DIGITAL)
    differ(replace(DIGITAL, sensing=Sensing(current_noise=1e-9)), DIGITAL)
    encoder = replace(DIGITAL, servo=replace(DIRECT, feedback="motor"))
    same(replace(encoder, sensing=Sensing(scale_resolution_m=1e-3)), encoder)
    differ(replace(encoder, sensing=Sensing(motor_resolution=1e-6)), encoder)


@pytest.mark.parametrize("axis", [SMOOTH, DRY, DIGITAL], ids=["smooth", "dry", "sampled"])
def test_parameters_that_do_not_change(axis):
    count = len(REFERENCE.position_m)
    stiffness = np.full(count, THREE.axial_stiffness_n_per_m)
    damping = np.full(count, THREE.guide_damping_ns_per_m)
    for course in (
        ParameterCourse(1e-3),
        ParameterCourse(1e-3, stiffness),
        ParameterCourse(1e-3, None, damping),
        ParameterCourse(1e-3, stiffness, damping),
    ):
        same(axis, axis, course=course)
    same(MASS, MASS, course=ParameterCourse(1e-3, None, np.full(count, RIGID.guide_damping_ns_per_m)))


def test_forces_from_outside():
    with_zeros = Reference(
        1e-3, REFERENCE.position_m, REFERENCE.speed_m_per_s, REFERENCE.acceleration_m_per_s2, np.zeros(401)
    )
    first = simulate_axis(DRY, with_zeros, step_s=1e-4)
    assert np.array_equal(first.table_m, simulate_axis(DRY, REFERENCE, step_s=1e-4).table_m)


def test_feedforward():
    ahead = replace(CONTINUOUS, velocity_feedforward=0.0, acceleration_feedforward=0.0)
    same(replace(DRY, servo=ahead), DRY)
    differ(replace(DRY, servo=replace(ahead, acceleration_feedforward=1e-6)), DRY)
    differ(replace(DRY, servo=replace(ahead, velocity_feedforward=1e-6)), DRY)


def test_viscous_friction_that_would_push_is_refused():
    with pytest.raises(InputError, match="-1 N·s/m") as refused:
        Axis(RIGID, friction=Friction(viscous_negative_ns_per_m=-1.0 - RIGID.guide_damping_ns_per_m))
    assert refused.value.where == "friction.viscous_negative_ns_per_m"
