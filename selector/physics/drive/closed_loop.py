"""What an axis under cascade control answers to its reference: its states, from sample to sample, at a frequency.

Linear: sliding, without dry friction, backlash, limits and pitch errors; an axial compliance at load and position 0.
"""

import math
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from scipy import linalg

from selector.errors import InputError
from selector.physics.drive.parts.axis import Axis, Mechanics, RigidMechanics, Servo
from selector.types import Array, Complex, Matrix, Vector


class StateSpace(NamedTuple):
    """x' = A·x + B·u, or x[k+1] = A·x[k] + B·u[k], with y = C·x + D·u."""

    A: Matrix
    B: Matrix
    C: Matrix
    D: Matrix

    @property
    def poles(self) -> Complex:
        """Eigenvalues of A [1/s, or per sample]."""
        return np.asarray(linalg.eigvals(self.A), dtype=np.complex128)

    def step_matrices(self, step_s: float) -> tuple[Matrix, Matrix]:
        """E and F of x(t + step) = E·x(t) + F·u for inputs held over the step; no approximation (`expm`)."""
        n, m = self.B.shape
        block = np.zeros((n + m, n + m))
        block[:n, :n], block[:n, n:] = self.A, self.B
        powers = linalg.expm(block * step_s)
        return powers[:n, :n], powers[:n, n:]


def small_signal_mechanics(axis: Axis) -> Mechanics:
    """Mechanics of the axis with the stiffness of its axial compliance, if it has one, unloaded at position 0."""
    if axis.compliance is None or isinstance(axis.mechanics, RigidMechanics):
        return axis.mechanics
    compliance, near = axis.compliance, axis.compliance.origin_m
    shaft = near * ((compliance.length_m - near) / compliance.length_m if compliance.both_ends else 1.0)
    middle = int(np.argmin(np.abs(compliance.force_n)))
    cell = slice(max(middle - 1, 0), middle + 2)
    joint = np.ptp(compliance.joint_deflection_m[cell]) / np.ptp(compliance.force_n[cell])
    return replace(axis.mechanics, axial_stiffness_n_per_m=float(1.0 / (joint + shaft / compliance.shaft_n)))


def inertia_at_motor(mechanics: Mechanics) -> float:
    """Inertia of the whole axis at the motor [kg·m²]; of a rigid axis its mass [kg]."""
    if isinstance(mechanics, RigidMechanics):
        return mechanics.mass_kg
    carried = mechanics.table_mass_kg * mechanics.travel_per_motion**2
    return mechanics.motor_inertia_kg_m2 + mechanics.screw_inertia_kg_m2 + carried


def plant(mechanics: Mechanics) -> StateSpace:
    """The mechanics alone: actuator's torque or force, and a force on the table, to motor and table, places and speeds.

    States: the places of motor, screw and table, then their speeds; of a rigid axis those of the table.
    """
    if isinstance(mechanics, RigidMechanics):
        mass = mechanics.mass_kg
        return StateSpace(
            A=np.array([[0.0, 1.0], [0.0, -mechanics.guide_damping_ns_per_m / mass]]),
            B=np.array([[0.0, 0.0], [1.0 / mass, 1.0 / mass]]),
            C=np.array([[1.0, 0.0], [0.0, 1.0], [1.0, 0.0], [0.0, 1.0]]),
            D=np.zeros((4, 2)),
        )
    radius = mechanics.travel_per_motion
    masses = np.array([mechanics.motor_inertia_kg_m2, mechanics.screw_inertia_kg_m2, mechanics.table_mass_kg])
    # deflections of the two springs by the positions of motor, screw, table
    springs = np.array([[1.0, -1.0, 0.0], [0.0, radius, -1.0]])
    stiffness = np.diag([mechanics.torsional_stiffness_nm_per_rad, mechanics.axial_stiffness_n_per_m])
    inner = np.diag([mechanics.torsional_damping_nms_per_rad, mechanics.axial_damping_ns_per_m])
    outer = np.diag([0.0, mechanics.screw_damping_nms_per_rad, mechanics.guide_damping_ns_per_m])
    A = np.zeros((6, 6))
    A[:3, 3:] = np.eye(3)
    A[3:, :3] = -(springs.T @ stiffness @ springs) / masses[:, None]
    A[3:, 3:] = -(springs.T @ inner @ springs + outer) / masses[:, None]
    B = np.zeros((6, 2))
    B[3, 0], B[5, 1] = 1.0 / masses[0], 1.0 / masses[2]
    C = np.zeros((4, 6))
    C[[0, 1, 2, 3], [0, 3, 2, 5]] = 1.0
    return StateSpace(A, B, C, np.zeros((4, 2)))


def closed_loop(axis: Axis) -> StateSpace:
    """Reference, its speed and acceleration, and a force on the table, to table position and command.

    States: those of the mechanics and the integral of the speed error, if the servo has one.

    InputError if the axis has no servo.
    """
    servo, system = servo_of(axis), plant(small_signal_mechanics(axis))
    order = len(system.A)
    has_integral = servo.velocity_integral_gain > 0
    error_by_state, error_by_input, command_by_state, command_by_input = _control(axis, *measurement(axis))
    torque = servo.actuator_gain * system.B[:, 0]
    size = order + has_integral
    A, B = np.zeros((size, size)), np.zeros((size, 4))
    A[:order, :order] = system.A + np.outer(torque, command_by_state)
    B[:order, :3] = np.outer(torque, command_by_input)
    B[:order, 3] = system.B[:, 1]
    C, D = np.zeros((2, size)), np.zeros((2, 4))
    C[0, :order], C[1, :order], D[1, :3] = system.C[2], command_by_state, command_by_input
    if has_integral:
        A[:order, order] = torque * servo.velocity_integral_gain
        A[order, :order], B[order, :3] = error_by_state, error_by_input
        C[1, order] = servo.velocity_integral_gain
    return StateSpace(A, B, C, D)


def _control(axis: Axis, position: Vector, speed: Vector) -> tuple[Vector, Vector, Vector, Vector]:
    """Error of the speed by states and by inputs, then the command by both, without its integral.

    `position` and `speed` are the rows that measure these; inputs are the reference, its speed and its acceleration.
    """
    servo, mechanics = servo_of(axis), small_signal_mechanics(axis)
    radius = mechanics.travel_per_motion
    gain = servo.position_gain_per_s / radius
    error_by_state = -speed - gain * position
    error_by_input = np.array([gain, servo.velocity_feedforward / radius, 0.0])
    command_by_input = servo.velocity_gain * error_by_input
    inertia = inertia_at_motor(mechanics) / (radius * servo.actuator_gain)
    command_by_input[2] += servo.acceleration_feedforward * inertia
    return error_by_state, error_by_input, servo.velocity_gain * error_by_state, command_by_input


def servo_of(axis: Axis) -> Servo:
    """The servo of an axis; InputError if it has none."""
    if axis.servo is None:
        raise InputError(
            "an axis without a servo",
            expected="a servo with its gains",
            where="feed axis",
            advice="add the section servo of the axis",
        )
    return axis.servo


def measurement(axis: Axis) -> tuple[Vector, Vector]:
    """Rows that give the measured position and the motor's speed from the states of `plant`."""
    system, servo = plant(small_signal_mechanics(axis)), servo_of(axis)
    if servo.feedback == "table":
        return system.C[2], system.C[1]
    return axis.mechanics.travel_per_motion * system.C[0], system.C[1]


def sampled_closed_loop(axis: Axis) -> StateSpace:
    """Reference, its speed and acceleration at the samples to table position and command.

    States: those of the mechanics, commands that wait, past motor positions if the speed is a difference of two, the
    integral of the speed error.

    For a sampled servo only; InputError if the axis has none.
    """
    servo, mechanics = servo_of(axis), small_signal_mechanics(axis)
    system, step_s = plant(mechanics), servo.sample_s
    position, speed = measurement(axis)
    order = len(system.A)
    waiting, rest_s = waiting_commands(servo)
    partly = rest_s > 0.0
    n_waiting = waiting + partly
    n_past = axis.sensing.speed_samples if axis.sensing.speed_from_encoder else 0
    has_integral = servo.velocity_integral_gain > 0
    past, integral = order + n_waiting, order + n_waiting + n_past
    size = integral + has_integral
    measured, turning = np.zeros(size), np.zeros(size)
    measured[:order] = position
    if n_past:
        turning[:order] = system.C[0] / (n_past * step_s)
        turning[integral - 1] = -1.0 / (n_past * step_s)
    else:
        turning[:order] = speed
    error_by_state, error_by_input, command_by_state, command_by_input = _control(axis, measured, turning)
    if has_integral:
        command_by_state[integral] += servo.velocity_integral_gain

    A, B = np.zeros((size, size)), np.zeros((size, 3))
    A[:order, :order], older, newer = held_forces(mechanics, step_s, rest_s)
    older, newer = servo.actuator_gain * older, servo.actuator_gain * newer
    # commands wait in order of age, the newest last; one computed now comes behind them
    if n_waiting:
        A[:order, order] += older if partly else newer
        if partly and n_waiting > 1:
            A[:order, order + 1] += newer
        for place in range(n_waiting - 1):
            A[order + place, order + place + 1] = 1.0
        A[order + n_waiting - 1], B[order + n_waiting - 1] = command_by_state, command_by_input
    if not n_waiting or (partly and n_waiting == 1):
        A[:order] += np.outer(newer, command_by_state)
        B[:order] += np.outer(newer, command_by_input)
    if n_past:
        A[past, :order] = system.C[0]
        A[past + 1 : integral, past : integral - 1] = np.eye(n_past - 1)
    if has_integral:
        A[integral], B[integral] = step_s * error_by_state, step_s * error_by_input
        A[integral, integral] += 1.0
    C, D = np.zeros((2, size)), np.zeros((2, 3))
    C[0, :order], C[1], D[1] = system.C[2], command_by_state, command_by_input
    return StateSpace(A, B, C, D)


def waiting_commands(servo: Servo) -> tuple[int, float]:
    """How many whole samples a command of a sampled servo waits, and what is left of its delay [s]."""
    waiting = math.floor(servo.delay_s / servo.sample_s * (1.0 + 1e-12))
    rest_s = servo.delay_s - waiting * servo.sample_s
    return waiting, rest_s if rest_s > 1e-9 * servo.sample_s else 0.0


@lru_cache(maxsize=64)
def held_forces(mechanics: Mechanics, step_s: float, rest_s: float) -> tuple[Matrix, Vector, Vector]:
    """Decay over a period, and what a force of 1 in its first `rest_s` and in the rest of it does to the states.

    Kept, because a search along the frequencies asks for the same mechanics again and again.

    InputError if the mechanics have numbers too far apart to be calculated with.
    """
    system = plant(mechanics)
    with np.errstate(all="ignore"):
        decay, load = system.step_matrices(step_s)
        older, newer = np.zeros_like(load), load
        if rest_s > 0.0:
            after, newer = system.step_matrices(step_s - rest_s)
            older = after @ system.step_matrices(rest_s)[1]
    for matrix in (decay, older, newer):
        if not np.isfinite(matrix).all():
            raise too_far_apart()
        matrix.setflags(write=False)
    return decay, older[:, 0], newer[:, 0]


def too_far_apart() -> InputError:
    """Numbers of an axis that are each possible, and together beyond what can be calculated."""
    return InputError(
        "masses, stiffnesses, damping, gains or times of the axis are too far apart to be calculated with",
        expected="numbers of a machine in SI units",
        where="feed axis",
        advice="look for a wrong power of ten: mm for m, µm for m, g·cm² for kg·m²",
    )


@dataclass(frozen=True)
class LoopResponse:
    """Complex answers at frequencies, each of the shape of these."""

    s: Complex  #: j·ω [1/s]
    integral: Complex  #: The integrator of the speed error, per speed error
    #: motor_speed, measured and table: Speed and position of the control, and true position of the table, per output of
    #: the control; the delay and the sampling are in them
    motor_speed: Complex
    measured: Complex
    table: Complex

    def speed_control(self, axis: Axis) -> Complex:
        """Output of the control per speed error: Kvp + Kvi·∫."""
        servo = servo_of(axis)
        return np.asarray(servo.velocity_gain + servo.velocity_integral_gain * self.integral)

    def opened_position_loop(self, axis: Axis) -> Complex:
        """Measured position per position error, the velocity loop closed."""
        speed_control = self.speed_control(axis)
        gain = servo_of(axis).position_gain_per_s / axis.mechanics.travel_per_motion
        return np.asarray(speed_control * gain * self.measured / (1.0 + speed_control * self.motor_speed))

    def reference_to_table(self, axis: Axis) -> Complex:
        """Table position per reference, the derivatives of which are fed forward as the servo says."""
        servo, speed_control = servo_of(axis), self.speed_control(axis)
        radius = axis.mechanics.travel_per_motion
        gain = servo.position_gain_per_s / radius
        inertia = inertia_at_motor(small_signal_mechanics(axis)) / (radius * servo.actuator_gain)
        ahead = servo.velocity_feedforward / radius * self.s
        command = speed_control * (gain + ahead) + servo.acceleration_feedforward * inertia * self.s**2
        return np.asarray(self.table * command / (1.0 + speed_control * (gain * self.measured + self.motor_speed)))


def loop_response(axis: Axis, rad_per_s: ArrayLike) -> LoopResponse:
    """The answers at angular frequencies above 0 [rad/s]; of a sampled servo at its samples.

    InputError if the axis has no servo, or numbers too far apart to be calculated with.
    """
    servo, system = servo_of(axis), plant(small_signal_mechanics(axis))
    s: Complex = np.asarray(1j * np.asarray(rad_per_s, dtype=np.float64))
    position_row, speed_row = measurement(axis)
    if servo.sample_s == 0:
        states = _solved(s, system.A, servo.actuator_gain * system.B[:, :1])[0]
        return LoopResponse(s, 1.0 / s, states @ speed_row, states @ position_row, states @ system.C[2])
    step_s = servo.sample_s
    waiting, rest_s = waiting_commands(servo)
    decay, older, newer = held_forces(small_signal_mechanics(axis), step_s, rest_s)
    # rates per sample, so that slow motions are not lost beside the 1 of z = 1 + …
    rate: Complex = np.asarray(np.expm1(s * step_s) / step_s)
    forces = servo.actuator_gain * np.stack([older, newer], axis=1) / step_s
    by_older, by_newer = _solved(rate, (decay - np.eye(len(decay))) / step_s, forces)
    states = by_newer + by_older * np.exp(-s * step_s)[..., None]
    states = states * np.exp(-waiting * step_s * s)[..., None]
    speed = states @ speed_row
    if axis.sensing.speed_from_encoder:
        span_s = axis.sensing.speed_samples * step_s
        speed = states @ system.C[0] * -np.expm1(-span_s * s) / span_s
    return LoopResponse(s, 1.0 / rate, speed, states @ position_row, states @ system.C[2])


def _solved(s: Complex, matrix: Array, forces: Array) -> list[Complex]:
    """(s − A)⁻¹·b of every column b, shape of `s` and the states."""
    unit = np.eye(len(matrix))
    try:
        answer = np.linalg.solve(s[..., None, None] * unit - matrix, np.broadcast_to(forces, (*s.shape, *forces.shape)))
    except np.linalg.LinAlgError:
        raise too_far_apart() from None
    return [np.asarray(answer[..., column]) for column in range(forces.shape[1])]


def nyquist_rad_per_s(axis: Axis) -> float:
    """Half the sample rate of the servo [rad/s]; infinite of a continuous one."""
    step_s = servo_of(axis).sample_s
    return math.pi / step_s if step_s > 0 else math.inf


_ROUNDING = 1e-9  #: Share of the fastest pole below which the sign of the slowest is rounding.


def loop_poles(axis: Axis) -> Complex:
    """Poles of the closed loop [1/s], the slowest or growing ones first; of a sampled servo ln(z)/sample time.

    InputError if the axis has no servo, or numbers too far apart to be calculated with.
    """
    servo = servo_of(axis)
    try:
        if servo.sample_s > 0:
            z = sampled_closed_loop(axis).poles
            # what decays within one sample has no logarithm and is of no interest here
            poles: Complex = np.asarray(np.log(np.where(np.abs(z) > 1e-12, z, 1e-12)) / servo.sample_s)
        else:
            poles = closed_loop(axis).poles
    except (np.linalg.LinAlgError, ValueError):
        # eigenvalues of what is not finite
        raise too_far_apart() from None
    return np.asarray(poles[np.argsort(-poles.real, kind="stable")])


def growing_poles(poles: Complex) -> Complex:
    """Those of the poles of a loop that do not decay.

    Poles at 0 up to rounding decay: the constant term of the characteristic polynomial is a product of gains and never
    0, so none comes through 0 from the side where all are while the gains are small.
    """
    slow = np.abs(poles) <= _ROUNDING * np.abs(poles).max()
    return np.asarray(poles[(poles.real >= 0.0) & ~slow])


# |R(z)| ≤ 1 of Runge–Kutta 4 holds on the axes to −2.785 and ±2.828; the least of both is the least around
_STABLE = 2.78


def fastest_rate_per_s(axis: Axis) -> float:
    """Largest |pole| of the axis, with its control if that is continuous [rad/s]; its bristles hold like springs."""
    is_continuous = axis.servo is not None and axis.servo.sample_s == 0
    system = closed_loop(axis) if is_continuous else plant(small_signal_mechanics(axis))
    A, lugre = system.A.copy(), axis.friction.lugre
    if lugre is not None and any(most > 0 for direction in axis.friction.directions for most in direction):
        mechanics = axis.mechanics
        mass = mechanics.mass_kg if isinstance(mechanics, RigidMechanics) else mechanics.table_mass_kg
        speed = len(plant(mechanics).A) - 1
        place = speed // 2
        A[speed, place] -= lugre.stiffness_n_per_m / mass
        A[speed, speed] -= lugre.damping_ns_per_m / mass
    return float(np.abs(np.linalg.eigvals(A)).max())


def largest_stable_step_s(axis: Axis) -> float:
    """Largest step at which the kernel does not blow up the fastest vibration of an axis [s]; infinite if none."""
    fastest = fastest_rate_per_s(axis)
    return _STABLE / fastest if fastest > 0 else math.inf
