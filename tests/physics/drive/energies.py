"""How much energy an axis holds in masses, springs and bristles."""

from __future__ import annotations

import numpy as np

from selector.physics.drive.parts.axis import AxialCompliance, Axis, RigidMechanics, ThreeMassMechanics, pitch_error_m
from selector.physics.drive.trajectory import Motion
from selector.types import Vector
from tests.physics.drive.axis_system import shaft_m_per_n


def stored_energy_j(axis: Axis, motion: Motion) -> Vector:
    """Kinetic energy, that of both springs and ½·σ0·z² of the bristles, at the samples of a motion [J].

    Left to itself an axis never gains any. Weight (`offset_n`), cogging and forces from outside do work that is not
    counted here, and so does a course that changes the stiffness.
    """
    lugre = axis.friction.lugre
    bristles = 0.5 * lugre.stiffness_n_per_m * motion.bristle_m**2 if lugre is not None else 0.0
    mechanics = axis.mechanics
    if isinstance(mechanics, RigidMechanics):
        return 0.5 * mechanics.mass_kg * motion.motor_speed**2 + bristles
    screw, screw_speed = motion.screw, motion.screw_speed
    kinetic = mechanics.motor_inertia_kg_m2 * motion.motor_speed**2 + mechanics.screw_inertia_kg_m2 * screw_speed**2
    kinetic = kinetic + mechanics.table_mass_kg * motion.table_speed_m_per_s**2
    twist = mechanics.torsional_stiffness_nm_per_rad * (motion.motor - screw) ** 2
    return 0.5 * (kinetic + twist) + _axial_energy_j(axis, mechanics, motion, screw) + bristles


def _axial_energy_j(axis: Axis, mechanics: ThreeMassMechanics, motion: Motion, screw: Vector) -> Vector:
    deflection = mechanics.travel_per_motion * screw + pitch_error_m(axis, screw)[0] - motion.table_m
    half_gap = axis.transmission.backlash_m / 2
    beyond = np.sign(deflection) * np.maximum(np.abs(deflection) - half_gap, 0.0)
    if axis.compliance is None:
        return 0.5 * mechanics.axial_stiffness_n_per_m * beyond**2
    return np.array(
        [_compliant_energy_j(axis.compliance, one, at) for one, at in zip(beyond, motion.table_m, strict=True)]
    )


def _compliant_energy_j(compliance: AxialCompliance, deflection: float, table_m: float) -> float:
    """∫ force d(deflection) at one place of the table: force over deflection is a polygon, whose ends go on."""
    forces = compliance.force_n
    places = forces * shaft_m_per_n(compliance, table_m) + compliance.joint_deflection_m
    within = places[(places > min(0.0, deflection)) & (places < max(0.0, deflection))]
    corners = np.sort(np.concatenate([[0.0, deflection], within]))
    piece = np.clip(np.searchsorted(places, corners, side="right") - 1, 0, len(places) - 2)
    slope = np.diff(forces) / np.diff(places)
    work = float(np.trapezoid(forces[piece] + slope[piece] * (corners - places[piece]), corners))
    return work if deflection >= 0 else -work
