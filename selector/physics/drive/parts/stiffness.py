"""How stiff a feed axis is, from its parts, what friction is worth as damping, and how both go along with a motion."""

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike
from scipy import optimize, special

from selector.errors import InputError
from selector.physics.checks import Above0, Checked
from selector.physics.drive.parts.axis import AxialCompliance, Friction, ThreeMassMechanics
from selector.physics.drive.parts.catalogue import Bearings, Nut, Parts
from selector.physics.drive.trajectory import ParameterCourse, Reference
from selector.types import Vector

POISSON = 0.3


@dataclass(frozen=True)
class PreloadedContact(Checked):
    """Two equal contacts, force κ·δ^(3/2) each, pressed against each other by a preload.

    A load F deflects them by δ: ``F = κ·(δ0 + δ)₊^1.5 − κ·(δ0 − δ)₊^1.5`` with δ0 = (preload/κ)^(2/3); odd in F. The
    stiffness falls from 3·preload/(2·δ0)·2 at F = 0 to 1/√2 of it at F = 2^1.5·preload, where one side lets go, and
    grows with F^(1/3) from there on.
    """

    load_per_deflection: Above0  #: κ of one side [N/m^1.5]
    preload_n: Above0  #: Preload [N]

    @classmethod
    def from_rigidity(cls, stiffness_n_per_m: float, at_preload_n: float, preload_n: float) -> "PreloadedContact":
        """That which has this stiffness, unloaded, at `at_preload_n`; K = 3·κ^(2/3)·preload^(1/3)."""
        return cls((stiffness_n_per_m / (3.0 * at_preload_n ** (1.0 / 3.0))) ** 1.5, preload_n)

    @property
    def preload_deflection_m(self) -> float:
        """δ0, by which the preload alone deflects each side [m]."""
        return math.cbrt(self.preload_n / self.load_per_deflection) ** 2

    @property
    def release_n(self) -> float:
        """Load at which one side lets go: 2^1.5·preload [N]."""
        return 2.0 * math.sqrt(2.0) * self.preload_n

    def deflection_m(self, load_n: ArrayLike) -> Vector:
        """Deflection under an axial load [m], shape of `load_n` [N]; closed form."""
        load = np.asarray(load_n, dtype=np.float64)
        return np.asarray(np.sign(load) * self.preload_deflection_m * self._ratio(load))

    def stiffness_n_per_m(self, load_n: ArrayLike) -> Vector:
        """dF/dδ [N/m], shape of `load_n` [N]."""
        ratio = self._ratio(np.asarray(load_n, dtype=np.float64))
        unloaded = 1.5 * self.preload_n / self.preload_deflection_m
        return np.asarray(unloaded * (np.sqrt(1.0 + ratio) + np.sqrt(np.maximum(1.0 - ratio, 0.0))))

    def _ratio(self, load: Vector) -> Vector:
        # with a = √(1+u), b = √(1−u), d = a − b the law is the cubic 3d − d³/2 = |F|/P
        share = np.abs(load) / self.preload_n
        d = 2.0 * math.sqrt(2.0) * np.sin(np.arcsin(np.minimum(share / (2.0 * math.sqrt(2.0)), 1.0)) / 3.0)
        both = d * np.sqrt(1.0 - d * d / 4.0)
        return np.where(share < 2.0 * math.sqrt(2.0), both, share ** (2.0 / 3.0) - 1.0)


def groove_approach(
    ball_diameter_m: float, conformity: float, pitch_circle_m: float, contact_angle_rad: float, modulus_pa: float
) -> float:
    """How much two grooves approach that press one ball by Q along the contact: c of δ = c·Q^(2/3) [m/N^(2/3)].

    Hertz contact of ball and inner groove and of ball and outer groove in series; steel on steel, ν = 0.3. Curvatures
    as in Harris, Rolling Bearing Analysis, ch. 2 and 6: across the rolling direction the groove has the radius
    conformity·ball diameter, along it the inner one is convex and the outer one hollow.
    """
    gamma = ball_diameter_m * math.cos(contact_angle_rad) / pitch_circle_m
    return sum(
        _approach(2.0 / ball_diameter_m, -1.0 / (conformity * ball_diameter_m), along, modulus_pa)
        for along in (2.0 * gamma / (ball_diameter_m * (1.0 - gamma)), -2.0 * gamma / (ball_diameter_m * (1.0 + gamma)))
    )


def axial_load_per_deflection(approach: float, balls: float, contact_angle_rad: float, helix_rad: float = 0.0) -> float:
    """κ of an axial load on a row of balls, F = κ·δ^1.5 [N/m^1.5], from `groove_approach`'s c [m/N^(2/3)].

    F = Z·Q·sin α·cos φ and δ = c·Q^(2/3)/(sin α·cos φ), so κ = Z·(sin α·cos φ)^(5/2)/c^(3/2).
    """
    return float(balls * (math.sin(contact_angle_rad) * math.cos(helix_rad)) ** 2.5 / approach**1.5)


def _approach(ball: float, across: float, along: float, modulus_pa: float) -> float:
    total = 2.0 * ball + across + along
    difference = abs(along - across) / total
    # the ellipse's axes a/b = 1/√(1−m) are those whose integrals give this difference of curvatures
    m = optimize.brentq(lambda value: _difference(value) - difference, 1e-12, 1.0 - 1e-14, xtol=1e-15)
    axes = 1.0 / math.sqrt(1.0 - m)
    k, e = float(special.ellipk(m)), float(special.ellipe(m))
    factor = 2.0 * k / math.pi * (math.pi / (2.0 * axes**2 * e)) ** (1.0 / 3.0)
    compliance = 2.0 * (1.0 - POISSON**2) / modulus_pa
    return float(factor * (1.5 / total * compliance) ** (2.0 / 3.0) * total / 2.0)


def _difference(m: float) -> float:
    axes2 = 1.0 / (1.0 - m)
    k, e = float(special.ellipk(m)), float(special.ellipe(m))
    return ((axes2 + 1.0) * e - 2.0 * k) / ((axes2 - 1.0) * e)


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

    InputError if the nut would be outside the screw.
    """
    _, screw = _screw_under(parts, position_m, load_n)
    return np.asarray(1.0 / (1.0 / nut_contact(parts).stiffness_n_per_m(load_n) + 1.0 / screw))


def published_axial_stiffness_n_per_m(
    parts: Parts, *, position_m: ArrayLike = 0.0, load_n: ArrayLike = 0.0, load_share: float = 0.5
) -> Vector:
    """Ke as F reads Hertz: one-sided, each contact stiffer by (1 + share·|load|/preload)^(1/3) [N/m]; shapes broadcast.

    F eq. 5 is a lost picture, see docs/explanation/drive-stiffness.md; without load `axial_stiffness_n_per_m` agrees.
    `load_share` is the share of the load that adds to a side of the nut; of the bearings' load likewise.
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


def three_mass_mechanics(parts: Parts) -> ThreeMassMechanics:
    """Masses and springs of F eq. 1 with the stiffness at table position 0 without load."""
    screw, motor, coupling = parts.screw, parts.motor, parts.coupling
    length_m = (screw.length_mm + screw.overhang_mm) * 1e-3
    cylinder = math.pi / 32.0 * screw.density_kg_per_m3 * (screw.diameter_mm * 1e-3) ** 4 * length_m
    return ThreeMassMechanics(
        motor_inertia_kg_m2=motor.inertia_kg_m2 + coupling.inertia_kg_m2,
        screw_inertia_kg_m2=cylinder if screw.inertia_kg_m2 is None else screw.inertia_kg_m2,
        table_mass_kg=parts.table.mass_kg,
        lead_m=screw.lead_mm * 1e-3,
        torsional_stiffness_nm_per_rad=torsional_stiffness_nm_per_rad(parts),
        axial_stiffness_n_per_m=float(axial_stiffness_n_per_m(parts)),
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


GRAVITY_M_PER_S2 = 9.80665
Reading = Literal["instant", "cycle", "vibration"]


def equivalent_damping_ns_per_m(
    coulomb_n: float, *, speed_amplitude_m_per_s: ArrayLike, mean_speed_m_per_s: ArrayLike = 0.0
) -> Vector:
    """Viscous damping that takes as much energy from a vibration in a cycle as dry friction does [N·s/m].

    The speed is mean + amplitude·cos ωt, amplitude = ωA. Dry friction takes 4·F·A·√(1 − (mean/amplitude)²) in a cycle,
    damping π·C·ω·A²: ``C = 4·F/(π·ωA)·√(1 − (mean/ωA)²)``, 0 where the mean is so fast that nothing reverses: friction
    is then a constant force. Without a mean it is F eq. 6, C ∝ μN/(πωA). Amplitudes are above 0; shapes broadcast.
    """
    amplitude = np.asarray(speed_amplitude_m_per_s, dtype=np.float64)
    share = np.minimum(np.abs(np.asarray(mean_speed_m_per_s, dtype=np.float64)) / amplitude, 1.0)
    return np.asarray(4.0 * coulomb_n / (math.pi * amplitude) * np.sqrt(1.0 - share**2))


def dry_friction(parts: Parts) -> Friction:
    """Coulomb friction of guide and seals on the table, and of nut and bearings on the screw."""
    guide, screw = parts.guide, parts.screw
    carried_n = parts.table.mass_kg * GRAVITY_M_PER_S2 + 2.0 * guide.carriages * guide.carriage_preload_n
    return Friction(
        coulomb_n=guide.friction_coefficient * carried_n + guide.carriages * guide.seal_n,
        screw_coulomb_nm=parts.nut.drag_torque_nm + parts.bearings.drag_torque_nm * (2 if screw.both_ends else 1),
        nut_efficiency=parts.nut.efficiency,
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
