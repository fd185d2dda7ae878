from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from selector.errors import InputError
from selector.physics.drive.closed_loop import loop_poles, plant, sampled_closed_loop
from selector.physics.drive.parts.axis import Axis, RigidMechanics, Sensing
from selector.physics.drive.parts.catalogue import thc6350_servo, thc6350_x_axis
from selector.physics.drive.parts.stiffness import three_mass_mechanics
from selector.physics.drive.simulation import simulate_axis
from selector.physics.drive.trajectory import Reference

MECHANICS = three_mass_mechanics(thc6350_x_axis())


def by_hand(axis: Axis, reference: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Table and command at the samples: the control as it is written in `Servo`, the mechanics in 100 exact pieces."""
    servo, pieces = axis.servo, 100
    system, radius = plant(axis.mechanics), axis.mechanics.travel_per_motion
    decay, load = system.step_matrices(servo.sample_s / pieces)
    late = round(servo.delay_s / servo.sample_s * pieces)
    x, integral, table, command = np.zeros(len(system.A)), 0.0, [], []
    past, given = [0.0] * axis.sensing.speed_samples, [0.0] * late
    for position, speed, acceleration in reference:
        motor, motor_speed, at, _ = system.C @ x
        measured = at if servo.feedback == "table" else radius * motor
        if axis.sensing.speed_from_encoder:
            motor_speed = (motor - past[0]) / (len(past) * servo.sample_s)
        past = [*past[1:], motor]
        error = (
            servo.position_gain_per_s * (position - measured) / radius
            + servo.velocity_feedforward * speed / radius
            - motor_speed
        )
        if isinstance(axis.mechanics, RigidMechanics):
            inertia = axis.mechanics.mass_kg
        else:
            m = axis.mechanics
            inertia = m.motor_inertia_kg_m2 + m.screw_inertia_kg_m2 + m.table_mass_kg * radius**2
        ahead = servo.acceleration_feedforward * inertia * acceleration / (radius * servo.actuator_gain)
        u = servo.velocity_gain * error + servo.velocity_integral_gain * integral + ahead
        integral += servo.sample_s * error
        table.append(at)
        command.append(u)
        given += [u] * pieces
        for _ in range(pieces):
            x = decay @ x + load[:, 0] * servo.actuator_gain * given.pop(0)
    return np.array(table), np.array(command)


@pytest.mark.parametrize("mechanics", [MECHANICS, RigidMechanics(95.0, 200.0)], ids=["three masses", "rigid"])
@pytest.mark.parametrize("delay", [0.0, 0.3, 1.0, 1.73, 3.0])
@pytest.mark.parametrize("speed_samples", [0, 1, 3])
def test_states_do_what_control_and_mechanics_do(mechanics, delay, speed_samples):
    from_encoder = speed_samples > 0
    rigid = isinstance(mechanics, RigidMechanics)
    servo = replace(
        thc6350_servo(),
        sample_s=1e-3,
        delay_s=delay * 1e-3,
        velocity_gain=300.0 if rigid else 1.5,
        velocity_integral_gain=0.0 if from_encoder else 50.0,
        velocity_feedforward=0.7,
        acceleration_feedforward=0.5,
        feedback="motor" if from_encoder else "table",
    )
    axis = Axis(mechanics, servo, sensing=Sensing(speed_from_encoder=from_encoder, speed_samples=max(speed_samples, 1)))
    reference = np.random.default_rng(3).normal(size=(60, 3)) * [1e-3, 0.1, 2.0]
    loop = sampled_closed_loop(axis)
    x, found = np.zeros(len(loop.A)), []
    for row in reference:
        found.append(loop.C @ x + loop.D @ row)
        x = loop.A @ x + loop.B @ row
    table, command = by_hand(axis, reference)
    # 6000 exact pieces against 60 exact periods: rounding
    np.testing.assert_allclose(np.array(found)[:, 0], table, rtol=1e-7, atol=1e-9 * np.abs(table).max())
    np.testing.assert_allclose(np.array(found)[:, 1], command, rtol=1e-7, atol=1e-9 * np.abs(command).max())


def test_fast_sampling_tends_to_the_continuous_loop():
    axis = Axis(MECHANICS, thc6350_servo())
    slowest = loop_poles(axis)[0]
    errors = []
    for sample_s in (4e-4, 2e-4, 1e-4):
        sampled = replace(axis, servo=replace(thc6350_servo(), sample_s=sample_s))
        errors.append(abs(loop_poles(sampled)[0] - slowest))
    # the integral is a sum of rectangles and commands are held: first order
    assert errors[0] / errors[1] == pytest.approx(2.0, abs=0.2)
    assert errors[1] / errors[2] == pytest.approx(2.0, abs=0.2)


def test_an_axis_without_a_servo_has_no_loop():
    with pytest.raises(InputError, match="servo"):
        sampled_closed_loop(Axis(MECHANICS))


@pytest.mark.parametrize("delay", [0.0, 0.4, 2.0])
@pytest.mark.parametrize("speed_samples", [0, 2])
def test_states_do_what_the_simulation_does(delay, speed_samples):
    servo = replace(
        thc6350_servo(), sample_s=1e-3, delay_s=delay * 1e-3, velocity_gain=1.5, velocity_integral_gain=50.0,
        velocity_feedforward=0.7, acceleration_feedforward=0.5, command_limit=None,
    )  # fmt: skip
    mechanics = replace(MECHANICS, torsional_damping_nms_per_rad=0.3, axial_damping_ns_per_m=2e4)
    axis = Axis(
        mechanics, servo, sensing=Sensing(speed_from_encoder=speed_samples > 0, speed_samples=max(speed_samples, 1))
    )
    columns = np.random.default_rng(5).normal(size=(60, 3)) * [1e-3, 0.1, 2.0]
    columns[0] = 0.0
    motion = simulate_axis(axis, Reference(1e-3, *columns.T), step_s=1e-5)
    loop = sampled_closed_loop(axis)
    x, found = np.zeros(len(loop.A)), []
    for row in columns:
        found.append(loop.C @ x + loop.D @ row)
        x = loop.A @ x + loop.B @ row
    # steps of order 4 and 10 µs against modes of 460 Hz: (2π·460·1e-5)⁴/120 a step
    table, command = np.array(found).T
    np.testing.assert_allclose(motion.table_m, table, rtol=0, atol=1e-6 * np.abs(table).max())
    np.testing.assert_allclose(motion.command, command, rtol=0, atol=1e-6 * np.abs(command).max())
