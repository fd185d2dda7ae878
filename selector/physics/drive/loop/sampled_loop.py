"""What an axis under sampled cascade control does from sample to sample: the exact discrete-time loop.

Linear as `closed_loop` is. The mechanics between samples are those of held commands, by matrix exponentials; a delay is
commands that wait, and the one that acts first for a part of a period is the older one.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from selector.errors import InputError
from selector.physics.drive.loop.closed_loop import (
    inertia_at_motor,
    measurement,
    plant,
    servo_of,
    small_signal_mechanics,
)
from selector.physics.drive.parts.axis import Axis, Servo
from selector.physics.drive.parts.mechanics import Mechanics
from selector.types import Matrix, Vector


@dataclass(frozen=True)
class SampledLoop:
    """x[k+1] = A·x[k] + B·u[k], y[k] = C·x[k] + D·u[k]."""

    #: A, B, C and D: (n, n): Its matrices. States: those of the mechanics, commands that wait, past motor positions if
    #: the speed is a difference of two, the integral of the speed error.
    A: Matrix
    B: Matrix
    C: Matrix
    D: Matrix
    step_s: float  #: Period of the control [s]

    @property
    def poles(self) -> NDArray[np.complex128]:
        """Eigenvalues z of A, the largest first."""
        z = np.asarray(np.linalg.eigvals(self.A), dtype=np.complex128)
        return z[np.argsort(-np.abs(z), kind="stable")]


def sampled_closed_loop(axis: Axis) -> SampledLoop:
    """Reference, its speed and acceleration at the samples to table position and command.

    InputError if the axis has no servo, or one that is not sampled.
    """
    servo, mechanics = servo_of(axis), small_signal_mechanics(axis)
    if servo.sample_s <= 0:
        raise InputError(
            "a continuous servo",
            expected="sample_s above 0",
            where="servo",
            advice="give the sample time, or look at the continuous loop",
        )
    system, radius, step_s = plant(mechanics), mechanics.travel_per_motion, servo.sample_s
    position, speed = measurement(axis)
    order = len(system.states)
    waiting, rest_s = waiting_commands(servo)
    partly = rest_s > 0.0
    n_waiting = waiting + partly
    n_past = axis.sensing.speed_samples if axis.sensing.speed_from_encoder else 0
    has_integral = servo.velocity_integral_gain > 0
    past, integral = order + n_waiting, order + n_waiting + n_past
    size = integral + has_integral
    gain = servo.position_gain_per_s / radius

    measured, turning = np.zeros(size), np.zeros(size)
    measured[:order] = position
    if n_past:
        turning[:order] = system.C[0] / (n_past * step_s)
        turning[integral - 1] = -1.0 / (n_past * step_s)
    else:
        turning[:order] = speed
    error_by_state = -turning - gain * measured
    error_by_input = np.array([gain, servo.velocity_feedforward / radius, 0.0])
    command_by_state = servo.velocity_gain * error_by_state
    command_by_input = servo.velocity_gain * error_by_input
    inertia = inertia_at_motor(mechanics) / (radius * servo.actuator_gain)
    command_by_input[2] += servo.acceleration_feedforward * inertia
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
    return SampledLoop(A, B, C, D, step_s)


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
