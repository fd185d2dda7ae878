"""The loop of an axis told in other ways than by its states: opened, and by the impedances of its masses."""

from __future__ import annotations

import numpy as np

from selector.physics.drive.closed_loop import closed_loop, inertia_at_motor, measurement, sampled_closed_loop
from selector.physics.drive.parts.axis import Axis, RigidMechanics


def opened_position_loop(axis: Axis):
    """A, B and C from the position error to the measured position, the velocity loop closed."""
    closed = sampled_closed_loop(axis) if axis.servo.sample_s > 0 else closed_loop(axis)
    row = measurement(axis)[0]
    measured = np.zeros((1, len(closed.A)))
    measured[0, : len(row)] = row
    # the reference comes in where the measured position is taken off
    B = closed.B[:, :1]
    return closed.A + B @ measured, B, measured


def by_impedances(axis: Axis, s):
    """Table position over reference at complex frequencies, and 1 + loop, of a continuous servo (F eq. 2 corrected)."""
    m, servo = axis.mechanics, axis.servo
    radius = m.travel_per_motion
    if isinstance(m, RigidMechanics):
        motor = table = 1 / (m.mass_kg * s**2 + m.guide_damping_ns_per_m * s)
    else:
        torsion = m.torsional_damping_nms_per_rad * s + m.torsional_stiffness_nm_per_rad
        axial = m.axial_damping_ns_per_m * s + m.axial_stiffness_n_per_m
        first = m.motor_inertia_kg_m2 * s**2 + torsion
        second = m.screw_inertia_kg_m2 * s**2 + m.screw_damping_nms_per_rad * s + torsion + radius**2 * axial
        third = m.table_mass_kg * s**2 + m.guide_damping_ns_per_m * s + axial
        behind = second - radius**2 * axial**2 / third
        motor = 1 / (first - torsion**2 / behind)
        table = motor * torsion / behind * radius * axial / third
    pi = servo.actuator_gain * (servo.velocity_gain + servo.velocity_integral_gain / s)
    gain = servo.position_gain_per_s / radius
    inertia = servo.acceleration_feedforward * inertia_at_motor(m) / radius
    command = pi * (servo.velocity_feedforward / radius * s + gain) + inertia * s**2
    loop = pi * (s * motor + gain * (table if servo.feedback == "table" else radius * motor))
    return command * table / (1 + loop), 1 + loop
