"""How stiff a feed axis is, from its parts: in torsion, and axially under load and along the travel."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

from selector.errors import InputError
from selector.physics.drive.catalogue import Bearings, Nut, Parts
from selector.physics.drive.contact import PreloadedContact, axial_load_per_deflection, groove_approach
from selector.physics.drive.mechanics import ThreeMassMechanics
from selector.physics.drive.transmission import AxialCompliance

Vector = NDArray[np.float64]


def torsional_stiffness_nm_per_rad(parts: Parts, *, position_m: float = 0.0) -> float:
    """Kθ: coupling and the screw between coupling and nut in series [N·m/rad], πGD⁴/(32L) each (F eq. 4).

    F's list of symbols has no length for the screw that depends on the position; its formula is lost. Torque leaves the
    screw at the nut, so the length here does.
    """
    screw, coupling = parts.screw, parts.coupling
    length_m = screw.overhang_mm * 1e-3 + float(_nut_to_bearing_m(parts, position_m))
    shaft = _shaft_in_torsion(screw.shear_modulus_gpa, screw.root_diameter_mm, length_m)
    joint = coupling.stiffness_nm_per_rad or _shaft_in_torsion(
        coupling.shear_modulus_gpa, coupling.diameter_mm, coupling.length_mm * 1e-3
    )
    return 1.0 / (1.0 / shaft + 1.0 / joint)


def nut_contact(parts: Parts) -> PreloadedContact:
    """The balls of the nut, from its catalogue rigidity, or by Hertz over all loaded turns."""
    nut = parts.nut
    helix = math.atan(parts.screw.lead_mm / (math.pi * nut.pitch_circle_mm))
    balls = nut.turns * math.pi * nut.pitch_circle_mm / (nut.ball_diameter_mm * math.cos(helix))
    return _contact(nut, balls, helix, parts.screw.modulus_gpa)


def bearing_contact(parts: Parts) -> PreloadedContact:
    """The set of bearings at one end, from its catalogue rigidity, or by Hertz over balls × bearings a direction."""
    bearings = parts.bearings
    return _contact(bearings, bearings.balls * bearings.per_direction, 0.0, parts.screw.modulus_gpa)


def axial_deflection_m(parts: Parts, *, position_m: ArrayLike = 0.0, load_n: ArrayLike = 0.0) -> Vector:
    """How far the table moves against the bed under an axial load, the motor held [m]; shapes broadcast.

    Nut in series with the screw: its shaft and the bearings of one end, or of both ends in parallel (F eq. 5).
    """
    screw, _ = _screw_under(parts, position_m, load_n)
    return np.asarray(nut_contact(parts).deflection_m(load_n) + screw)


def axial_stiffness_n_per_m(parts: Parts, *, position_m: ArrayLike = 0.0, load_n: ArrayLike = 0.0) -> Vector:
    """Ke: slope of the load over `axial_deflection_m` [N/m]; shapes broadcast.

    Each contact is two-sided: preload stiffens it, and a load within 2^1.5 of the preload softens it.

    Raises
    ------
    InputError
        If the nut would be outside the screw.
    """
    _, screw = _screw_under(parts, position_m, load_n)
    return np.asarray(1.0 / (1.0 / nut_contact(parts).stiffness_n_per_m(load_n) + 1.0 / screw))


def published_axial_stiffness_n_per_m(
    parts: Parts, *, position_m: ArrayLike = 0.0, load_n: ArrayLike = 0.0, load_share: float = 0.5
) -> Vector:
    """Ke as F reads Hertz: one-sided, each contact stiffer by (1 + share·|load|/preload)^(1/3) [N/m]; shapes broadcast.

    F eq. 5 (a lost picture) has K ~ load^(1/3) with load = preload + what the axial load adds. The side that the load
    relieves is left out, so the stiffness rises with every load, where `axial_stiffness_n_per_m` falls. Both agree
    without load. `load_share` is the share of the load that adds to a side of the nut; of the bearings' load likewise.
    """
    load = np.abs(np.asarray(load_n, dtype=np.float64))
    nut, bearing = nut_contact(parts), bearing_contact(parts)
    near, far = _shaft_m_per_n(parts, position_m)
    near_share = (far + 1.0 / _unloaded(bearing)) / (near + far + 2.0 / _unloaded(bearing))
    near_load = load * (near_share if parts.screw.both_ends else 1.0)

    def stiffened(contact: PreloadedContact, axial_n: Vector) -> Vector:
        return np.asarray(_unloaded(contact) * np.cbrt(1.0 + load_share * axial_n / contact.preload_n))

    screw = 1.0 / (near + 1.0 / stiffened(bearing, near_load))
    if parts.screw.both_ends:
        screw = screw + 1.0 / (far + 1.0 / stiffened(bearing, load - near_load))
    return np.asarray(1.0 / (1.0 / stiffened(nut, load) + 1.0 / screw))


def three_mass_mechanics(parts: Parts, *, position_m: float | None = None, load_n: float = 0.0) -> ThreeMassMechanics:
    """Masses and springs of F eq. 1 with the stiffness at one position and load; position None: table position 0."""
    at_m = 0.0 if position_m is None else position_m
    screw, motor, coupling = parts.screw, parts.motor, parts.coupling
    length_m = (screw.length_mm + screw.overhang_mm) * 1e-3
    cylinder = math.pi / 32.0 * screw.density_kg_per_m3 * (screw.diameter_mm * 1e-3) ** 4 * length_m
    return ThreeMassMechanics(
        motor_inertia_kg_m2=motor.inertia_kg_m2 + coupling.inertia_kg_m2,
        screw_inertia_kg_m2=cylinder if screw.inertia_kg_m2 is None else screw.inertia_kg_m2,
        table_mass_kg=parts.table.mass_kg,
        lead_m=screw.lead_mm * 1e-3,
        torsional_stiffness_nm_per_rad=torsional_stiffness_nm_per_rad(parts, position_m=at_m),
        axial_stiffness_n_per_m=float(axial_stiffness_n_per_m(parts, position_m=at_m, load_n=load_n)),
        screw_damping_nms_per_rad=screw.damping_nms_per_rad,
        guide_damping_ns_per_m=parts.guide.viscous_ns_per_m,
        torsional_damping_nms_per_rad=screw.torsional_damping_nms_per_rad,
        axial_damping_ns_per_m=screw.axial_damping_ns_per_m,
    )


def axial_compliance(parts: Parts) -> AxialCompliance:
    """The same spring as a table of deflections, for simulations in which it follows its own load and position.

    Of a screw held at both ends, each bearing counts as the length of shaft that gives way like it, so that position
    and linear deflection are exact everywhere; what the load changes about the bearings is that of table position 0.
    Odd in the load; the slope between two points is the stiffness between them within 0.1 %; reaches to three times
    the load at which the nut loses its preload.
    """
    screw = parts.screw
    shaft_n = _tension_n(parts)
    length_m, origin_m = screw.length_mm * 1e-3, screw.origin_mm * 1e-3
    if screw.both_ends:
        bearing_m = shaft_n / _unloaded(bearing_contact(parts))
        length_m, origin_m = length_m + 2.0 * bearing_m, origin_m + bearing_m
        shaft_m_per_n = origin_m * (length_m - origin_m) / (length_m * shaft_n)
    else:
        shaft_m_per_n = origin_m / shaft_n
    load = _fine_loads(parts, 3.0 * nut_contact(parts).release_n)
    joints = axial_deflection_m(parts, load_n=load) - load * shaft_m_per_n
    return AxialCompliance(
        force_n=np.concatenate([-load[:0:-1], load]),
        joint_deflection_m=np.concatenate([-joints[:0:-1], joints]),
        shaft_n=shaft_n,
        length_m=length_m,
        origin_m=origin_m,
        both_ends=screw.both_ends,
    )


def _fine_loads(parts: Parts, largest_n: float) -> Vector:
    """Loads from 0 on, close enough that the stiffness at the ends of a cell differs by less than 0.2 %."""
    load = np.linspace(0.0, largest_n, 33)
    # stiffness has a kink like a square root where a preload is lost: halving it away needs a cell of 1e-6
    for _ in range(25):
        stiffness = axial_stiffness_n_per_m(parts, load_n=load)
        wide = np.abs(np.diff(stiffness)) > 2e-3 * stiffness[:-1]
        if not wide.any():
            break
        load = np.sort(np.concatenate([load, ((load[:-1] + load[1:]) / 2.0)[wide]]))
    return load


def _screw_under(parts: Parts, position_m: ArrayLike, load_n: ArrayLike) -> tuple[Vector, Vector]:
    """Deflection and stiffness of shaft and bearings at the nut."""
    bearing = bearing_contact(parts)
    near, far = _shaft_m_per_n(parts, position_m)
    load = np.asarray(load_n, dtype=np.float64)
    taken = load + 0.0 * near
    if parts.screw.both_ends:
        taken = _near_load(bearing, near, far, load)
    deflection = taken * near + bearing.deflection_m(taken)
    stiffness = 1.0 / (near + 1.0 / bearing.stiffness_n_per_m(taken))
    if parts.screw.both_ends:
        stiffness = stiffness + 1.0 / (far + 1.0 / bearing.stiffness_n_per_m(load - taken))
    return deflection, stiffness


def _near_load(bearing: PreloadedContact, near: Vector, far: Vector, load: Vector) -> Vector:
    """What the bearing at the motor's end takes of the load, so that both ends deflect the nut alike."""
    taken = load * far / (near + far)
    # slopes of the two sides differ by less than a factor 2 (`PreloadedContact`), so that Newton's steps contract
    for _ in range(60):
        other = load - taken
        surplus = taken * near + bearing.deflection_m(taken) - other * far - bearing.deflection_m(other)
        slope = near + far + 1.0 / bearing.stiffness_n_per_m(taken) + 1.0 / bearing.stiffness_n_per_m(other)
        step = surplus / slope
        taken = taken - step
        if np.all(np.abs(step) <= 1e-12 * np.abs(load)):
            break
    return np.asarray(taken)


def _shaft_m_per_n(parts: Parts, position_m: ArrayLike) -> tuple[Vector, Vector]:
    """Compliance of the shaft from the nut to the bearing at the motor, and to the other one."""
    near_m = _nut_to_bearing_m(parts, position_m)
    return near_m / _tension_n(parts), (parts.screw.length_mm * 1e-3 - near_m) / _tension_n(parts)


def _nut_to_bearing_m(parts: Parts, position_m: ArrayLike) -> Vector:
    screw = parts.screw
    near_m = screw.origin_mm * 1e-3 + np.asarray(position_m, dtype=np.float64)
    if not (np.isfinite(near_m).all() and (near_m > 0).all() and (near_m < screw.length_mm * 1e-3).all()):
        raise InputError(
            f"table positions from {np.min(position_m):g} to {np.max(position_m):g} m",
            expected=f"the nut on the screw: between {-screw.origin_mm * 1e-3:g} and "
            f"{(screw.length_mm - screw.origin_mm) * 1e-3:g} m",
            where="position of the table",
            advice="move less, or correct length_mm and origin_mm of the screw",
        )
    return near_m


def _tension_n(parts: Parts) -> float:
    screw = parts.screw
    return screw.modulus_gpa * 1e9 * math.pi / 4.0 * (screw.root_diameter_mm * 1e-3) ** 2


def _shaft_in_torsion(shear_modulus_gpa: float, diameter_mm: float, length_m: float) -> float:
    return math.pi * shear_modulus_gpa * 1e9 * (diameter_mm * 1e-3) ** 4 / (32.0 * length_m)


def _contact(part: Nut | Bearings, balls: float, helix_rad: float, modulus_gpa: float) -> PreloadedContact:
    if part.rigidity_n_per_um is not None and part.rigidity_preload_n is not None:
        stiffness = part.rigidity_share * part.rigidity_n_per_um * 1e6
        return PreloadedContact.from_rigidity(stiffness, part.rigidity_preload_n, part.preload_n)
    angle = math.radians(part.contact_angle_deg)
    approach = groove_approach(
        part.ball_diameter_mm * 1e-3, part.conformity, part.pitch_circle_mm * 1e-3, angle, modulus_gpa * 1e9
    )
    kappa = axial_load_per_deflection(approach, balls, angle, helix_rad)
    return PreloadedContact(kappa * part.rigidity_share**1.5, part.preload_n)


def _unloaded(contact: PreloadedContact) -> float:
    return float(contact.stiffness_n_per_m(0.0))
