"""Which step of the calculation does an axis need."""

from __future__ import annotations

import math

import numpy as np

from selector.physics.drive.axis import Axis
from selector.physics.drive.closed_loop import plant, small_signal_mechanics
from selector.physics.drive.mechanics import RigidMechanics

PER_MODE = 0.2
"""Step × fastest rate of the axis. A method of order 4 then errs by about 1e-5 of that mode's motion in a period."""

STABLE_PER_MODE = 2.7
"""Step × fastest rate at which a Runge–Kutta method of order 4 begins to make vibrations grow (2.79 on the real axis,
2.83 on the imaginary one)."""


def fastest_rate_per_s(axis: Axis) -> float:
    """Largest |pole| of the mechanics, with bristles and the proportional part of the velocity loop [rad/s].

    Bristles count as a spring on the table, the velocity gain of a continuous control as damping of the motor; a
    sampled control holds its command over many steps.
    """
    mechanics, servo, lugre = small_signal_mechanics(axis), axis.servo, axis.friction.lugre
    system = plant(mechanics)
    A = system.A.copy()
    speeds = len(A) // 2
    mass = mechanics.mass_kg if isinstance(mechanics, RigidMechanics) else mechanics.table_mass_kg
    if lugre is not None:
        A[-1, speeds - 1] -= lugre.stiffness_n_per_m / mass
        A[-1, -1] -= lugre.damping_ns_per_m / mass
    if servo is not None and servo.sample_s == 0:
        A[speeds, speeds] -= servo.actuator_gain * servo.velocity_gain * float(system.B[speeds, 0])
    return float(np.abs(np.linalg.eigvals(A)).max())


def advised_step_s(axis: Axis, period_s: float) -> float:
    """Step that resolves the fastest mode of an axis, at most the period of the samples [s]."""
    rate = fastest_rate_per_s(axis)
    return min(period_s, PER_MODE / rate) if math.isfinite(rate) and rate > 0 else period_s
