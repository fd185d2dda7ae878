"""What the parts of the control loop of an axis answer at a frequency, and which poles it has."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from selector.physics.drive.loop.closed_loop import (
    closed_loop,
    inertia_at_motor,
    measurement,
    plant,
    servo_of,
    small_signal_mechanics,
)
from selector.physics.drive.loop.sampled_loop import held_forces, sampled_closed_loop, too_far_apart, waiting_commands
from selector.physics.drive.parts.axis import Axis

Response = NDArray[np.complex128]


@dataclass(frozen=True)
class LoopResponse:
    """Complex answers at frequencies, each of the shape of these."""

    s: Response  #: j·ω [1/s]
    integral: Response  #: The integrator of the speed error, per speed error
    #: motor_speed, measured and table: Speed and position of the control, and true position of the table, per output of
    #: the control; the delay and the sampling are in them
    motor_speed: Response
    measured: Response
    table: Response

    def speed_control(self, axis: Axis) -> Response:
        """Output of the control per speed error: Kvp + Kvi·∫."""
        servo = servo_of(axis)
        return np.asarray(servo.velocity_gain + servo.velocity_integral_gain * self.integral)

    def opened_position_loop(self, axis: Axis) -> Response:
        """Measured position per position error, the velocity loop closed."""
        speed_control = self.speed_control(axis)
        gain = servo_of(axis).position_gain_per_s / axis.mechanics.travel_per_motion
        return np.asarray(speed_control * gain * self.measured / (1.0 + speed_control * self.motor_speed))

    def reference_to_table(self, axis: Axis) -> Response:
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
    s: Response = np.asarray(1j * np.asarray(rad_per_s, dtype=np.float64))
    position_row, speed_row = measurement(axis)
    if servo.sample_s == 0:
        states = _solved(s, system.A, servo.actuator_gain * system.B[:, :1])[0]
        return LoopResponse(s, 1.0 / s, states @ speed_row, states @ position_row, states @ system.C[2])
    step_s = servo.sample_s
    waiting, rest_s = waiting_commands(servo)
    decay, older, newer = held_forces(small_signal_mechanics(axis), step_s, rest_s)
    # rates per sample, so that slow motions are not lost beside the 1 of z = 1 + …
    rate: Response = np.asarray(np.expm1(s * step_s) / step_s)
    forces = servo.actuator_gain * np.stack([older, newer], axis=1) / step_s
    by_older, by_newer = _solved(rate, (decay - np.eye(len(decay))) / step_s, forces)
    states = by_newer + by_older * np.exp(-s * step_s)[..., None]
    states = states * np.exp(-waiting * step_s * s)[..., None]
    speed = states @ speed_row
    if axis.sensing.speed_from_encoder:
        span_s = axis.sensing.speed_samples * step_s
        speed = states @ system.C[0] * -np.expm1(-span_s * s) / span_s
    return LoopResponse(s, 1.0 / rate, speed, states @ position_row, states @ system.C[2])


def _solved(s: Response, matrix: NDArray[np.float64], forces: NDArray[np.float64]) -> list[Response]:
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


_ROUNDING = 1e-9
"""Share of the fastest pole below which the sign of the slowest is rounding."""


def loop_poles(axis: Axis) -> NDArray[np.complex128]:
    """Poles of the closed loop [1/s], the slowest or growing ones first; of a sampled servo ln(z)/sample time.

    InputError if the axis has no servo, or numbers too far apart to be calculated with.
    """
    servo = servo_of(axis)
    try:
        if servo.sample_s > 0:
            z = sampled_closed_loop(axis).poles
            # what decays within one sample has no logarithm and is of no interest here
            poles: NDArray[np.complex128] = np.asarray(np.log(np.where(np.abs(z) > 1e-12, z, 1e-12)) / servo.sample_s)
        else:
            poles = closed_loop(axis).poles
    except (np.linalg.LinAlgError, ValueError):
        # eigenvalues of what is not finite
        raise too_far_apart() from None
    return np.asarray(poles[np.argsort(-poles.real, kind="stable")])


def growing_poles(poles: NDArray[np.complex128]) -> NDArray[np.complex128]:
    """Those of the poles of a loop that do not decay.

    Poles at 0 up to rounding decay: the constant term of the characteristic polynomial is a product of gains and never
    0, so none comes through 0 from the side where all are while the gains are small.
    """
    slow = np.abs(poles) <= _ROUNDING * np.abs(poles).max()
    return np.asarray(poles[(poles.real >= 0.0) & ~slow])
