"""Axes and references that several tests move."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from selector.physics.drive.parts.axis import Axis, RigidMechanics, Servo, ThreeMassMechanics
from selector.physics.drive.trajectory import Reference

THREE = ThreeMassMechanics(
    motor_inertia_kg_m2=0.01,
    screw_inertia_kg_m2=0.005,
    table_mass_kg=300.0,
    lead_m=0.016,
    torsional_stiffness_nm_per_rad=2e4,
    axial_stiffness_n_per_m=1e8,
    screw_damping_nms_per_rad=0.01,
    guide_damping_ns_per_m=2000.0,
    torsional_damping_nms_per_rad=1.0,
    axial_damping_ns_per_m=5e3,
)
UNDAMPED = replace(
    THREE,
    screw_damping_nms_per_rad=0.0,
    guide_damping_ns_per_m=0.0,
    torsional_damping_nms_per_rad=0.0,
    axial_damping_ns_per_m=0.0,
)
CONTINUOUS = Servo(position_gain_per_s=40.0, velocity_gain=5.0, velocity_integral_gain=100.0, actuator_gain=1.2)
SAMPLED = replace(CONTINUOUS, sample_s=5e-4, delay_s=2.5e-4)
RIGID = RigidMechanics(mass_kg=95.0, guide_damping_ns_per_m=200.0)
RIGID_SERVO = Servo(position_gain_per_s=100.0, velocity_gain=240.0, velocity_integral_gain=2000.0, actuator_gain=35.0)


def sine(period_s: float, duration_s: float, amplitude_m: float = 0.02, frequency_hz: float = 2.0) -> Reference:
    t = np.arange(round(duration_s / period_s) + 1) * period_s
    w = 2 * np.pi * frequency_hz
    position, speed = amplitude_m * np.sin(w * t), amplitude_m * w * np.cos(w * t)
    return Reference(period_s, position, speed, -(w**2) * position)


def still(period_s: float, duration_s: float, force_n: np.ndarray | None = None) -> Reference:
    """Nothing asked for, perhaps a force from outside."""
    zero = np.zeros(round(duration_s / period_s) + 1)
    return Reference(period_s, zero, zero, zero, force_n)


def free(axis: Axis) -> Axis:
    return replace(axis, servo=None)
