"""What friction is worth as viscous damping, and how stiffness and damping go along with a commanded motion."""

from __future__ import annotations

import math
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from selector.errors import InputError
from selector.physics.drive.motion import ParameterCourse, Reference
from selector.physics.drive.parts.catalogue import Parts
from selector.physics.drive.parts.mechanics import Friction
from selector.physics.drive.parts.stiffness import axial_stiffness_n_per_m, published_axial_stiffness_n_per_m
from selector.types import Vector

GRAVITY_M_PER_S2 = 9.80665
Reading = Literal["instant", "cycle", "vibration"]


def equivalent_damping_ns_per_m(
    coulomb_n: float, *, speed_amplitude_m_per_s: ArrayLike, mean_speed_m_per_s: ArrayLike = 0.0
) -> Vector:
    """Viscous damping that takes as much energy from a vibration in a cycle as dry friction does [N·s/m].

    The speed is mean + amplitude·cos ωt, amplitude = ωA. Dry friction takes 4·F·A·√(1 − (mean/amplitude)²) in a cycle,
    damping π·C·ω·A²: ``C = 4·F/(π·ωA)·√(1 − (mean/ωA)²)``, 0 where the mean is so fast that nothing reverses: friction
    is then a constant force. Without a mean it is F eq. 6, C ∝ μN/(πωA). Shapes broadcast.

    InputError if an amplitude is not above 0.
    """
    amplitude = np.asarray(speed_amplitude_m_per_s, dtype=np.float64)
    if not (np.isfinite(amplitude).all() and (amplitude > 0).all()):
        raise InputError(
            f"a speed amplitude of {np.min(amplitude):g} m/s",
            expected="a number above 0",
            where="equivalent damping",
            advice="give the largest speed of the vibration, frequency in rad/s times amplitude",
        )
    share = np.minimum(np.abs(np.asarray(mean_speed_m_per_s, dtype=np.float64)) / amplitude, 1.0)
    return np.asarray(4.0 * coulomb_n / (math.pi * amplitude) * np.sqrt(1.0 - share**2))


def dry_friction(parts: Parts) -> Friction:
    """Coulomb friction of guide and seals on the table, and of nut and bearings on the screw."""
    guide, screw = parts.guide, parts.screw
    carried_n = parts.table.mass_kg * GRAVITY_M_PER_S2 + 2.0 * guide.carriages * guide.carriage_preload_n
    return Friction(
        coulomb_n=guide.friction_coefficient * carried_n + guide.carriages * guide.seal_n,
        screw_coulomb_nm=parts.nut.drag_torque_nm + parts.bearings.drag_torque_nm * (2 if screw.both_ends else 1),
    )


def axial_load_n(parts: Parts, reference: Reference) -> Vector:
    """What the screw must push with along a reference: inertia + friction of the guide − outside force [N]."""
    friction = dry_friction(parts).coulomb_n * np.sign(reference.speed_m_per_s)
    viscous = parts.guide.viscous_ns_per_m * reference.speed_m_per_s
    outside = 0.0 if reference.force_n is None else reference.force_n
    return np.asarray(parts.table.mass_kg * reference.acceleration_m_per_s2 + viscous + friction - outside)


def guide_damping_course_ns_per_m(
    parts: Parts, reference: Reference, *, damping: Reading = "instant", reversal_speed_m_per_s: float = 0.02
) -> Vector:
    """Ct along a reference [N·s/m]: viscous friction, and dry friction F as damping at the commanded speed v.

    F's formula is lost; it has ωA in the denominator and calls Ct a function of the speed. `damping` says how:

    - ``"instant"``: F/|v|. Force and energy are those of dry friction at every instant; what a tracking error needs.
    - ``"cycle"``: 4F/(π·|v|), F eq. 6 with ωA = |v|: 27 % more, as the energy of a cycle with this top speed.
    - ``"vibration"``: a vibration of the speed amplitude `reversal_speed_m_per_s` rides on v; see
      `equivalent_damping_ns_per_m`. Damps vibrations near reversals only and takes no part in the force at speed.

    Below `reversal_speed_m_per_s` the first two go no higher. An axis with this course has no Coulomb friction besides.
    """
    coulomb_n = dry_friction(parts).coulomb_n
    speed = np.abs(reference.speed_m_per_s)
    if damping == "vibration":
        dry = equivalent_damping_ns_per_m(
            coulomb_n, speed_amplitude_m_per_s=reversal_speed_m_per_s, mean_speed_m_per_s=speed
        )
    else:
        dry = equivalent_damping_ns_per_m(coulomb_n, speed_amplitude_m_per_s=np.maximum(speed, reversal_speed_m_per_s))
        if damping == "instant":
            dry = dry * (math.pi / 4.0)
    return np.asarray(parts.guide.viscous_ns_per_m + dry)


def parameter_course(
    parts: Parts,
    reference: Reference,
    *,
    stiffness: Literal["two-sided", "published"] = "two-sided",
    damping: Reading = "instant",
    reversal_speed_m_per_s: float = 0.02,
) -> ParameterCourse:
    """Ke(t) and Ct(t) from commanded position, speed and acceleration (F eq. 5, 6).

    Ke at the commanded position under `axial_load_n`, by `axial_stiffness_n_per_m` or, ``"published"``, by
    `published_axial_stiffness_n_per_m`; Ct by `guide_damping_course_ns_per_m`.

    InputError if the reference moves the nut off the screw, or `reversal_speed_m_per_s` is not above 0.
    """
    law = axial_stiffness_n_per_m if stiffness == "two-sided" else published_axial_stiffness_n_per_m
    return ParameterCourse(
        period_s=reference.period_s,
        axial_stiffness_n_per_m=law(parts, position_m=reference.position_m, load_n=axial_load_n(parts, reference)),
        guide_damping_ns_per_m=guide_damping_course_ns_per_m(
            parts, reference, damping=damping, reversal_speed_m_per_s=reversal_speed_m_per_s
        ),
    )
