"""How much energy an axis holds, in its masses, springs and bristles; and when its bristles make none."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from selector.errors import InputError
from selector.physics.drive.axis import Axis
from selector.physics.drive.mechanics import RigidMechanics, ThreeMassMechanics
from selector.physics.drive.motion import Motion
from selector.physics.drive.pitch import pitch_error_m
from selector.physics.drive.transmission import AxialCompliance

Vector = NDArray[np.float64]

# |v|·exp(−(v/v_d)²) is v_d/√(2e) at most, and σ1 times that has to be below 4·C
_MOST_FADED = 4.0 * math.sqrt(2.0 * math.e)


def stored_energy_j(axis: Axis, motion: Motion) -> Vector:
    """Kinetic energy, that of both springs and ½·σ0·z² of the bristles, at the samples of a motion [J].

    Left to itself an axis never gains any. Weight (`offset_n`), cogging and forces from outside do work that is not
    counted here, and so does a course that changes the stiffness.

    Raises
    ------
    InputError
        If the motion does not say what the screw and the bristles did.
    """
    bristles = _bristles(axis, motion)
    mechanics = axis.mechanics
    if isinstance(mechanics, RigidMechanics):
        return 0.5 * mechanics.mass_kg * motion.motor_speed**2 + bristles
    screw, screw_speed = _known(motion.screw, "screw"), _known(motion.screw_speed, "screw_speed")
    kinetic = mechanics.motor_inertia_kg_m2 * motion.motor_speed**2 + mechanics.screw_inertia_kg_m2 * screw_speed**2
    kinetic = kinetic + mechanics.table_mass_kg * motion.table_speed_m_per_s**2
    twist = mechanics.torsional_stiffness_nm_per_rad * (motion.motor - screw) ** 2
    return 0.5 * (kinetic + twist) + _axial_energy_j(axis, mechanics, motion, screw) + bristles


def passive_bristle_damping_ns_per_m(axis: Axis) -> float:
    """Largest σ1 up to which bristles make no energy, whatever the axis does [N·s/m]; infinite if any will do.

    The power of friction and viscous damping, v·(σ0·z + σ1·z' + Ct·v), is at least that of ½·σ0·z² if σ1·(S − C)/C ≤ Ct
    (Barabanov, Ortega 2000, IEEE Trans. Autom. Control 45(4)) or σ1(v)·|v| ≤ 4·C; C and S: the least and the most that
    sliding takes in either direction.
    """
    sliding, breakaway = _sliding_range_n(axis)
    if breakaway <= sliding or axis.friction.lugre is None:
        return math.inf
    viscous = axis.mechanics.guide_damping_ns_per_m * sliding / (breakaway - sliding)
    fading = axis.friction.lugre.fading_speed_m_per_s
    return max(viscous, _MOST_FADED * sliding / fading) if fading > 0 else viscous


def passive_fading_speed_m_per_s(axis: Axis) -> float:
    """Largest fading speed at which the damping that the bristles of an axis have makes no energy [m/s]."""
    lugre = axis.friction.lugre
    if lugre is None or lugre.damping_ns_per_m == 0:
        return math.inf
    return _MOST_FADED * _sliding_range_n(axis)[0] / lugre.damping_ns_per_m


def _sliding_range_n(axis: Axis) -> tuple[float, float]:
    """Least and most of the friction while it slides, over speeds and directions."""
    values = [value for direction in axis.friction.directions for value in direction]
    return min(values), max(values)


def _bristles(axis: Axis, motion: Motion) -> Vector:
    if axis.friction.lugre is None:
        return np.zeros(len(motion.time_s))
    return 0.5 * axis.friction.lugre.stiffness_n_per_m * _known(motion.bristle_m, "bristle_m") ** 2


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
    places = forces * compliance.shaft_m_per_n(table_m) + compliance.joint_deflection_m
    within = places[(places > min(0.0, deflection)) & (places < max(0.0, deflection))]
    corners = np.sort(np.concatenate([[0.0, deflection], within]))
    piece = np.clip(np.searchsorted(places, corners, side="right") - 1, 0, len(places) - 2)
    slope = np.diff(forces) / np.diff(places)
    work = float(np.trapezoid(forces[piece] + slope[piece] * (corners - places[piece]), corners))
    return work if deflection >= 0 else -work


def _known(values: Vector | None, name: str) -> Vector:
    if values is None:
        raise InputError(
            f"a motion without {name}", expected="one with it", where="stored energy", advice="simulate the axis"
        )
    return values
