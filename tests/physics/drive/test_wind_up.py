"""Lost motion that friction alone makes is what a simulated axis shows behind the encoder of its motor."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from selector.errors import InputError
from selector.physics.drive.parts.axis import Axis, Friction, RigidMechanics, Servo, ThreeMassMechanics, wind_up_m
from selector.physics.drive.simulation import simulate_axis
from selector.physics.drive.trajectory import moves

SCREW = ThreeMassMechanics(
    motor_inertia_kg_m2=0.002,
    screw_inertia_kg_m2=0.001,
    table_mass_kg=300.0,
    lead_m=0.01,
    torsional_stiffness_nm_per_rad=8e3,
    axial_stiffness_n_per_m=1.5e8,
    torsional_damping_nms_per_rad=1.0,
    axial_damping_ns_per_m=3e4,
)
SERVO = Servo(30.0, 1.0, 40.0, actuator_gain=0.8, feedback="motor")
AXIS = Axis(SCREW, SERVO, friction=Friction(coulomb_n=300.0, coulomb_negative_n=200.0, screw_coulomb_nm=0.5))


@pytest.mark.parametrize("efficiency", [1.0, 0.85])
def test_lost_motion_of_a_simulated_axis_is_its_wind_up(efficiency):
    axis = replace(AXIS, friction=replace(AXIS.friction, nut_efficiency=efficiency))
    reference = moves([0.02, 0.0], 1e-3, speed_m_per_s=0.02, acceleration_m_per_s2=1.0)
    motion = simulate_axis(axis, reference, step_s=5e-5)
    behind = SCREW.travel_per_motion * motion.motor - motion.table_m
    # in the middle of either move, where all speeds are constant
    there, back = (behind[int(share * len(behind))] for share in (0.25, 0.75))
    # vibrations have died down to 1e-5 of it
    assert there - back == pytest.approx(wind_up_m(axis), rel=1e-4)


def test_half_of_the_friction_or_twice_the_stiffness_is_half_of_it():
    size = wind_up_m(AXIS)
    assert size is not None
    half = replace(AXIS, friction=Friction(coulomb_n=150.0, coulomb_negative_n=100.0, screw_coulomb_nm=0.25))
    stiff = replace(SCREW, torsional_stiffness_nm_per_rad=16e3, axial_stiffness_n_per_m=3e8)
    for other in (half, replace(AXIS, mechanics=stiff)):
        assert wind_up_m(other) == pytest.approx(size / 2.0, rel=1e-12)  # rounding


def test_there_is_none_without_springs_or_with_a_scale_on_the_table():
    assert wind_up_m(replace(AXIS, friction=Friction())) == 0.0
    assert wind_up_m(replace(AXIS, servo=replace(SERVO, feedback="table"))) is None
    assert wind_up_m(Axis(RigidMechanics(100.0), SERVO, friction=Friction(coulomb_n=20.0))) is None


@pytest.mark.parametrize(("load_n", "torque"), [(-2000.0, 1.0 / 0.8), (2000.0, 2.0 - 1.0 / 0.8)])
def test_a_nut_drives_with_more_and_is_driven_with_less(load_n, torque):
    reference = moves([0.02], 1e-3, speed_m_per_s=0.02, acceleration_m_per_s2=1.0)
    pushed = replace(reference, force_n=np.full(len(reference.time_s), load_n))
    axis = Axis(SCREW, SERVO, friction=Friction(nut_efficiency=0.8))
    motion = simulate_axis(axis, pushed, step_s=5e-5)
    middle = len(motion.motor) // 2
    # R·F against the load, or held back with it; the load was there from the start, and all speeds are constant now
    expected = -torque * SCREW.travel_per_motion * load_n
    assert SERVO.actuator_gain * motion.command[middle] == pytest.approx(expected, rel=1e-3)


def test_an_efficiency_that_cannot_be():
    for efficiency in (1.2, 0.0, -0.5):
        with pytest.raises(InputError, match=r"efficiency|above 0"):
            Axis(SCREW, SERVO, friction=Friction(nut_efficiency=efficiency))
    with pytest.raises(InputError, match="one mass"):
        Axis(RigidMechanics(100.0), SERVO, friction=Friction(nut_efficiency=0.9))
