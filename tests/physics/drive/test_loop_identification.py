"""In the loop, parameters come back from the motion that they made, and a wrong control is paid for by the mass."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from selector.errors import InputError
from selector.physics.drive.axis import Axis
from selector.physics.drive.friction import Friction
from selector.physics.drive.loop_identification import fitted_in_loop, loop_errors
from selector.physics.drive.mechanics import RigidMechanics, ThreeMassMechanics
from selector.physics.drive.servo import Sensing, Servo
from selector.physics.drive.simulation import simulate_axis
from selector.physics.drive.trajectory import moves

STEP_S = 1e-3
SERVO = Servo(160.0, 240.0, actuator_gain=35.0, sample_s=STEP_S, feedback="motor")
SENSING = Sensing(motor_resolution=5e-8, speed_from_encoder=True, speed_samples=2)
AXIS = Axis(RigidMechanics(95.0, 200.0), SERVO, Friction(20.0, offset_n=-3.0), sensing=SENSING)
THREE = ThreeMassMechanics(1e-3, 1e-3, 90.0, 5e-3, 1e4, 1e8)


@pytest.fixture(scope="module")
def reference():
    return moves([0.05, 0.0], STEP_S, speed_m_per_s=[0.05, 0.12], acceleration_m_per_s2=0.8, dwell_s=0.05)


@pytest.fixture(scope="module")
def motion(reference):
    return simulate_axis(AXIS, reference, step_s=STEP_S)


def test_the_parameters_that_made_the_motion_come_back(reference, motion):
    begin = replace(AXIS, mechanics=RigidMechanics(85.0, 230.0), friction=Friction(22.0, offset_n=-2.0))
    found = fitted_in_loop(begin, reference, motion.measured_m, motion.command, step_s=STEP_S)
    assert found.names == ("mass_kg", "guide_damping_ns_per_m", "coulomb_n", "offset_n")
    # rounding of the encoder: 15 nm beside a lag of a millimetre
    assert found.values == pytest.approx([95.0, 200.0, 20.0, -3.0], rel=2e-3)
    assert (np.abs(found.values - [95.0, 200.0, 20.0, -3.0]) < 5 * found.standard_errors).all()
    assert found.after.position_rms_m < 1e-7 < 4e-6 < found.before.position_rms_m
    assert found.axis.mechanics.mass_kg == found["mass_kg"]
    assert found.axis.friction.offset_n == found["offset_n"]
    assert found.axis.sensing == SENSING


def test_friction_by_direction(reference):
    two = replace(AXIS, friction=Friction(17.0, 23.0))
    motion = simulate_axis(two, reference, step_s=STEP_S)
    begin = replace(AXIS, friction=Friction(20.0))
    names = ("coulomb_n", "coulomb_negative_n")
    found = fitted_in_loop(begin, reference, motion.measured_m, motion.command, step_s=STEP_S, names=names)
    assert found.values == pytest.approx([17.0, 23.0], rel=2e-3)


def test_a_wrong_law_of_the_control_is_absorbed_by_the_mass(reference, motion):
    true_speed = replace(AXIS, sensing=Sensing(motor_resolution=5e-8))
    found = fitted_in_loop(true_speed, reference, motion.measured_m, motion.command, step_s=STEP_S)
    # a speed that comes 1 ms earlier damps more: one or two per cent less mass looks alike
    assert 0.95 * 95.0 < found["mass_kg"] < 0.99 * 95.0
    assert abs(found["mass_kg"] - 95.0) > 5 * found.standard_errors[0]


def test_errors_are_those_of_the_arrays(motion):
    errors = loop_errors(motion, motion.measured_m + 1e-6, motion.command * 1.1, skip=10)
    assert errors.position_rms_m == pytest.approx(1e-6, rel=1e-9)
    assert errors.position_max_m == pytest.approx(1e-6, rel=1e-9)
    assert errors.relative_command_error == pytest.approx(0.1 / 1.1, rel=1e-9)
    assert errors.command_max == pytest.approx(0.1 * np.abs(motion.command[10:]).max(), rel=1e-9)
    recorded_m = motion.measured_m[10:] + 1e-6
    expected = 1e-6 * len(recorded_m) ** 0.5 / np.linalg.norm(recorded_m)
    assert errors.relative_position_error == pytest.approx(expected, rel=1e-9)


@pytest.mark.parametrize(
    ("axis", "names", "says"),
    [
        (replace(AXIS, servo=None, sensing=Sensing()), ("mass_kg",), "without a servo"),
        (Axis(THREE, SERVO), ("mass_kg",), "several masses"),
        (AXIS, ("mass",), "mass. Expected"),
        (AXIS, (), "no parameter"),
        (AXIS, ("mass_kg", "mass_kg"), "twice"),
    ],
)
def test_what_cannot_be_fitted_is_refused(axis, names, says, reference, motion):
    with pytest.raises(InputError, match=says):
        fitted_in_loop(axis, reference, motion.measured_m, motion.command, step_s=STEP_S, names=names)


def test_records_of_another_length_are_refused(reference, motion):
    with pytest.raises(InputError, match="as many of each"):
        fitted_in_loop(AXIS, reference, motion.measured_m[:-1], motion.command, step_s=STEP_S)
