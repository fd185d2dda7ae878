"""What a simulated axis does, against exact solutions; what is refused."""

from __future__ import annotations

import math
import re
from dataclasses import replace

import numpy as np
import pytest

from selector.errors import InputError
from selector.physics.drive.parts.axis import (
    Axis,
    AxisState,
    Friction,
    RigidMechanics,
    Ripple,
    Sensing,
    Servo,
    Transmission,
    unloaded_state,
)
from selector.physics.drive.simulation import simulate_axis
from selector.physics.drive.trajectory import ParameterCourse, Reference
from tests.physics.drive.axes import CONTINUOUS, RIGID, RIGID_SERVO, SAMPLED, THREE, sine, still
from tests.physics.drive.axis_system import AxisSystem, linearise

MASS = RigidMechanics(mass_kg=10.0)


def exact_samples(axis: Axis, reference: Reference, delay_samples: int) -> tuple[np.ndarray, np.ndarray]:
    """Table and command of a linear axis under sampled control, by matrix exponentials between the samples."""
    servo, travel = axis.servo, axis.mechanics.travel_per_motion
    free = AxisSystem(replace(axis, servo=None), reference)
    plant = linearise(free, np.zeros(6), np.zeros(2))
    decay, load = plant.step_matrices(servo.sample_s)
    x, integral, waiting = np.zeros(6), 0.0, [0.0] * delay_samples
    table, commands = [], []
    for position in reference.position_m:
        error = servo.position_gain_per_s * (position - x[4]) / travel - x[1]
        command = servo.velocity_gain * error + servo.velocity_integral_gain * integral
        integral += servo.sample_s * error
        table.append(x[4])
        commands.append(command)
        waiting.append(command)
        x = decay @ x + load[:, 1] * servo.actuator_gain * waiting.pop(0)
    return np.array(table), np.array(commands)


@pytest.mark.parametrize("delay_samples", [0, 1, 2])
def test_sampled_control_is_exact_to_the_order_of_the_mechanics(delay_samples):
    servo = replace(CONTINUOUS, sample_s=1e-3, delay_s=delay_samples * 1e-3, velocity_gain=2.0)
    axis, reference = Axis(THREE, servo), sine(1e-3, 0.3)
    motion = simulate_axis(axis, reference, step_s=1e-5)
    table, commands = exact_samples(axis, reference, delay_samples)
    # Jacobians by differences are good to 1e-9 of 0.02 m; commands see the speeds
    assert motion.table_m == pytest.approx(table, abs=1e-10)
    assert motion.command == pytest.approx(commands, abs=1e-6)


def test_a_delay_that_is_no_whole_number_of_steps_is_exact():
    """A push of 100 N from a sample on, 0.37 of a step late, on a mass without friction."""
    servo = Servo(1.0, 1.0, actuator_gain=50.0, sample_s=1e-3, delay_s=1.37e-3)
    commands = np.zeros(101)
    commands[20:] = 2.0
    motion = simulate_axis(Axis(MASS, servo), still(1e-3, 0.1), step_s=1e-3, commands=commands)
    since = np.maximum(motion.time_s - 0.02137, 0.0)
    # parabolas are exact but for rounding
    assert motion.table_m == pytest.approx(5.0 * since**2, abs=1e-15)
    assert motion.actuator_force[[21, 22]] == pytest.approx([0.0, 100.0])
    assert motion.command == pytest.approx(commands)


def test_commands_need_no_servo_and_are_held():
    commands = np.array([10.0, -10.0, 0.0, 0.0])
    motion = simulate_axis(Axis(MASS), still(1.0, 3.0), step_s=0.1, commands=commands)
    # 1 m/s² for a second each way
    assert motion.table_speed_m_per_s == pytest.approx([0.0, 1.0, 0.0, 0.0], abs=1e-15)
    assert motion.table_m == pytest.approx([0.0, 0.5, 1.0, 1.0])


def test_a_viscous_mass_runs_down_exponentially():
    motion = simulate_axis(Axis(RIGID), still(1e-3, 1.0), step_s=1e-3, start=AxisState(motor_speed=1.0))
    rate = RIGID.guide_damping_ns_per_m / RIGID.mass_kg
    # (rate·h)⁵/120 a step, a thousand steps
    assert motion.table_speed_m_per_s == pytest.approx(np.exp(-rate * motion.time_s), rel=1e-12)


def test_steady_lag_is_speed_over_gain():
    t = np.arange(2001) * 1e-3
    ramp = Reference(1e-3, 0.1 * t, np.full(2001, 0.1), np.zeros(2001))
    for servo, lag in (
        (CONTINUOUS, 0.1 / 40.0),
        (replace(CONTINUOUS, velocity_feedforward=1.0), 0.0),
        (SAMPLED, 0.0025),
    ):
        motion = simulate_axis(Axis(THREE, servo), ramp, step_s=1e-4)
        # the integral's slowest pole, Kvi/Kvp = 20 1/s, has died away to exp(−40)
        assert motion.tracking_error_m[-1] == pytest.approx(lag, abs=1e-9)
    without_integral = replace(CONTINUOUS, velocity_integral_gain=0.0)
    motion = simulate_axis(Axis(THREE, without_integral, Friction(300.0)), ramp, step_s=1e-4)
    travel = THREE.travel_per_motion
    torque = travel * (300.0 + 2000.0 * 0.1) + 0.01 * 0.1 / travel
    # what friction and damping ask for is one speed error more; the spring between gives way too
    stretch = (300.0 + 200.0) / 1e8 + travel * torque / 2e4
    expected = 0.1 / 40.0 + torque / (1.2 * 5.0) * travel / 40.0
    assert motion.tracking_error_m[-1] == pytest.approx(expected, rel=1e-6)
    assert travel * motion.motor[-1] - motion.table_m[-1] == pytest.approx(stretch, rel=1e-2)


def test_limits_hold_and_the_integral_stops():
    servo = replace(SAMPLED, command_limit=30.0, speed_limit=40.0, delay_s=0.0)
    step = Reference(5e-4, np.r_[0.0, np.full(1999, 0.05)], np.zeros(2000), np.zeros(2000))
    motion = simulate_axis(Axis(THREE, servo), step, step_s=1e-4)
    assert np.abs(motion.command).max() == 30.0
    # a proportional speed loop stays below its wanted speed, an integral one that winds up would not
    assert np.abs(motion.motor_speed).max() < 40.0 * 1.1
    assert motion.table_m[-1] == pytest.approx(0.05, abs=1e-6)
    still_there = np.abs(motion.command) < 30.0
    assert still_there[-1000:].all()


def test_encoders_and_noise():
    sensing = Sensing(motor_resolution=1e-3, scale_resolution_m=1e-6, speed_from_encoder=True, current_noise=0.1)
    axis = Axis(THREE, replace(SAMPLED, delay_s=0.0), sensing=sensing)
    reference = sine(5e-4, 0.5)
    one, again, other = (simulate_axis(axis, reference, step_s=1e-4, seed=seed) for seed in (1, 1, 2))
    assert np.array_equal(one.table_m, again.table_m)
    assert not np.array_equal(one.table_m, other.table_m)
    assert one.measured_m == pytest.approx(1e-6 * np.round(one.table_m / 1e-6), abs=1e-18)
    noisy, quiet = (
        simulate_axis(replace(axis, sensing=Sensing(current_noise=noise)), reference, step_s=1e-4).command
        for noise in (0.1, 0.0)
    )
    # the loop answers the noise, hardly within one sample; 4 standard errors of 1000 differences are 13 %
    assert np.std(np.diff(noisy - quiet)) == pytest.approx(0.1 * math.sqrt(2), rel=0.13)


def test_ripple_and_cogging_on_the_motor():
    ripple = (Ripple(4.0, 0.5, 0.02, 0.3), Ripple(6.0, 0.1))
    axis = Axis(THREE, CONTINUOUS, ripple=ripple)
    motion = simulate_axis(axis, sine(1e-3, 0.3), step_s=1e-4)
    wave = np.sin(4 * motion.motor + 0.3)
    expected = 1.2 * motion.command * (1 + 0.02 * wave) + 0.5 * wave + 0.1 * np.sin(6 * motion.motor)
    assert motion.actuator_force == pytest.approx(expected, rel=1e-12, abs=1e-12)


def test_a_start_that_is_not_given_is_at_rest_where_the_control_wants_it():
    pitch = Transmission(
        pitch_amplitude_m=1e-4, pitch_slope=1e-3, pitch_position_m=(-1.0, 1.0), pitch_error_m=(1e-4, -1e-4)
    )
    reference = Reference(1e-3, np.full(11, 0.123), np.zeros(11), np.zeros(11))
    for mechanics, servo in ((THREE, CONTINUOUS), (RIGID, RIGID_SERVO)):
        for feedback in ("table", "motor"):
            axis = Axis(mechanics, replace(servo, feedback=feedback), transmission=pitch)
            motion = simulate_axis(axis, reference, step_s=1e-4)
            assert motion.measured_m == pytest.approx(np.full(11, 0.123), abs=1e-12)
            state = unloaded_state(axis, 0.123, 0.5)
            assert state.table_speed_m_per_s == 0.5
    assert simulate_axis(Axis(THREE, CONTINUOUS, transmission=pitch), reference, step_s=1e-4).table_m[0] == 0.123


def test_a_step_that_divides_nothing_is_shortened():
    whole = simulate_axis(Axis(THREE, SAMPLED), sine(1e-3, 0.05), step_s=5e-5 / 3)
    given = simulate_axis(Axis(THREE, SAMPLED), sine(1e-3, 0.05), step_s=1.7e-5)
    assert np.array_equal(whole.table_m, given.table_m)
    # 1 ms and 0.4 ms have 0.2 ms in common
    servo = replace(SAMPLED, sample_s=4e-4, delay_s=0.0)
    coarse, fine = (simulate_axis(Axis(THREE, servo), sine(1e-3, 0.1), step_s=h).table_m for h in (1.0, 2e-5))
    # 0.2 ms at 700 1/s is a coarse step: (0.14)⁵/120 of 20 mm and less
    assert coarse == pytest.approx(fine, abs=1e-8)


def test_half_the_step_has_a_sixteenth_of_the_error():
    axis, reference = Axis(THREE, CONTINUOUS, Friction(300.0)), sine(1e-3, 0.5)
    whole, half, best = (simulate_axis(axis, reference, step_s=step_s).table_m for step_s in (2e-4, 1e-4, 2e-5))
    # order 4
    assert np.abs(whole - half).max() == pytest.approx(np.abs(whole - best).max() * 15 / 16, rel=0.05)


UNSTABLE = replace(CONTINUOUS, velocity_gain=5e3, sample_s=1e-3)
REFUSED = {
    "sample_s": (Axis(THREE, replace(SAMPLED, sample_s=3.14159e-4)), {"step_s": 1e-4}, "multiple"),
    "step_s": (Axis(THREE, CONTINUOUS), {"step_s": 0.0}, "largest step"),
    "commands": (Axis(THREE), {"step_s": 1e-4, "commands": np.zeros(3)}, "at the times"),
    "simulation of the axis": (Axis(THREE, UNSTABLE), {"step_s": 5e-5}, "stable with velocity_gain"),
    "course of parameters": (Axis(THREE), {"step_s": 1e-4, "course": ParameterCourse(1e-3, np.ones(3))}, "reference"),
}


@pytest.mark.parametrize("where", REFUSED)
def test_what_cannot_be_simulated_is_refused_with_advice(where):
    axis, options, advice = REFUSED[where]
    with pytest.raises(InputError) as caught:
        simulate_axis(axis, sine(1e-3, 2.0), **options)
    assert caught.value.where == where
    assert advice in caught.value.advice


def test_a_runaway_of_a_stable_loop_blames_what_acts_on_it():
    axis = Axis(RigidMechanics(100.0, 200.0), Servo(60.0, 2e4, sample_s=1e-3, velocity_feedforward=1e15))
    with pytest.raises(InputError) as caught:
        simulate_axis(axis, sine(1e-3, 2.0), step_s=1e-3)
    assert "unstable" not in str(caught.value)
    assert "feed-forward" in caught.value.advice
    pushed = np.full(len(sine(1e-3, 2.0).position_m), 1e300)
    with pytest.raises(InputError) as caught:
        simulate_axis(axis, sine(1e-3, 2.0), step_s=1e-3, commands=pushed)
    assert "commands" in caught.value.advice


def test_a_runaway_says_when_and_what():
    with pytest.raises(InputError) as caught:
        simulate_axis(Axis(THREE, UNSTABLE), sine(1e-3, 2.0), step_s=5e-5)
    assert "motor" in caught.value.found
    assert 0.0 < float(re.search(r"before ([\d.]+) s", caught.value.found)[1]) < 0.5
    with pytest.raises(InputError) as caught:
        simulate_axis(Axis(MASS), still(1.0, 300.0), step_s=0.1, commands=np.full(301, 1.0))
    assert "commands" in caught.value.advice


def test_courses_that_do_not_fit():
    course = ParameterCourse(1e-3, np.full(51, 1e8))
    for axis in (Axis(RIGID), Axis(THREE)):
        reference = sine(1e-3, 0.05) if isinstance(axis.mechanics, RigidMechanics) else sine(2e-3, 0.1)
        with pytest.raises(InputError) as refused:
            simulate_axis(axis, reference, step_s=1e-4, course=course)
        assert refused.value.where == "course of parameters"
    for values in (np.array([1e8, -1.0]), np.array([0.0, 1.0]), np.array([math.nan, 1.0]), np.ones((2, 2))):
        with pytest.raises(InputError, match="axial_stiffness"):
            ParameterCourse(1e-3, values)
