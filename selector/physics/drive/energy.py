"""Damping up to which bristles make no energy, and how much lost motion the friction of an axis winds up."""

from __future__ import annotations

import math

from selector.physics.drive.parts.axis import Axis
from selector.physics.drive.parts.mechanics import ThreeMassMechanics

# |v|·exp(−(v/v_d)²) is v_d/√(2e) at most, and σ1 times that has to be below 4·C
_MOST_FADED = 4.0 * math.sqrt(2.0 * math.e)


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


def wind_up_m(axis: Axis) -> float | None:
    """Twice what dry friction winds up shaft, nut, bearings and coupling before the table follows [m].

    The guide bends the axial spring and twists the torsional one through the screw, the friction of the screw twists it
    alone: 2·(F/Ke + R·(R·F + Ts)/Kθ), F the mean of the two directions. None where it does not show as lost motion:
    one mass has no spring, and a control that sees the table takes it out again.
    """
    mechanics, servo = axis.mechanics, axis.servo
    if not isinstance(mechanics, ThreeMassMechanics) or servo is None or servo.feedback == "table":
        return None
    radius = mechanics.travel_per_motion
    (up, _), (down, _) = axis.friction.directions
    force = (up + down) / 2.0
    twisted = radius * force + axis.friction.screw_coulomb_nm
    turned = twisted / mechanics.torsional_stiffness_nm_per_rad
    return 2.0 * (force / mechanics.axial_stiffness_n_per_m + radius * turned)
