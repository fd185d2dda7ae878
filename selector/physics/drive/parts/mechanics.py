"""What turns and slides, what resists along the way, and where the travel differs from lead × turns."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated

import numpy as np

from selector.errors import InputError
from selector.physics.checks import keep_arrays, require_finite, require_not_negative, require_positive
from selector.physics.model_fields import Fit, Limits, Unit, Usual
from selector.types import Vector

Mass = Annotated[float, Unit("kg"), Limits(1e-9, 1e9), Fit()]
CarriedMass = Annotated[Mass, Usual(5.0, 1e5, {"t": 1e3, "g": 1e-3})]
_INERTIA_UNITS = {"kg·cm²": 1e-4, "kg·mm²": 1e-6, "g·cm²": 1e-7}
Inertia = Annotated[float, Unit("kg·m²"), Limits(1e-12, 1e6), Fit(), Usual(1e-7, 0.5, _INERTIA_UNITS)]
Force = Annotated[float, Unit("N"), Limits(0.0, 1e9), Fit()]
Torque = Annotated[float, Unit("N·m"), Limits(0.0, 1e9), Fit()]
Stiffness = Annotated[float, Unit("N/m"), Limits(1e-3, 1e13), Fit()]
TorsionalStiffness = Annotated[
    float, Unit("N·m/rad"), Limits(1e-6, 1e12), Fit(), Usual(50.0, 1e7, {"kN·m/rad": 1e3, "N·mm/rad": 1e-3})
]
Damping = Annotated[float, Unit("N·s/m"), Limits(0.0, 1e9), Fit()]
TorsionalDamping = Annotated[float, Unit("N·m·s/rad"), Limits(0.0, 1e6), Fit()]
Angle = Annotated[float, Unit("rad"), Limits(0.0, 1e6), Fit(either_sign=math.pi)]
Length = Annotated[float, Unit("m"), Limits(0.0, 1e4)]
_ERROR = Usual(0.0, 2e-3, {"µm": 1e-6, "mm": 1e-3})


@dataclass(frozen=True)
class RigidMechanics:
    """One mass: M·v' = force − viscous·v − friction."""

    mass_kg: Mass  #: Everything that moves, rotating parts included as J/R² [kg]
    guide_damping_ns_per_m: Damping = 0.0  #: Viscous friction [N·s/m]

    def __post_init__(self) -> None:
        require_positive(self, "mass_kg")
        require_not_negative(self, "guide_damping_ns_per_m")

    @property
    def travel_per_motion(self) -> float:
        """Table travel per unit of motor position: 1, both are metres."""
        return 1.0


@dataclass(frozen=True)
class ThreeMassMechanics:
    """Motor, screw, table (F eq. 1), R = lead/2π, with damping in the two springs added.

    ``Jm·θm'' = T − Kθ(θm − θl) − Dθ(θm' − θl')``,
    ``Jl·θl'' = Kθ(θm − θl) + Dθ(θm' − θl') − Cl·θl' − R·Fa``, ``Mt·xt'' = Fa − Ct·xt' − friction``,
    ``Fa = Ke(R·θl − xt) + De(R·θl' − xt')``.
    """

    #: motor_inertia_kg_m2 and screw_inertia_kg_m2: Jm (motor and coupling), Jl (screw) [kg·m²]
    motor_inertia_kg_m2: Inertia
    screw_inertia_kg_m2: Inertia
    table_mass_kg: CarriedMass  #: Mt, with what lies on it [kg]
    #: Travel per revolution [m]; negative for a left-handed screw is not meant
    lead_m: Annotated[float, Unit("m"), Limits(1e-6, 10.0), Usual(5e-4, 0.2, {"mm": 1e-3})]
    #: torsional_stiffness_nm_per_rad and axial_stiffness_n_per_m: Kθ, Ke
    torsional_stiffness_nm_per_rad: TorsionalStiffness
    axial_stiffness_n_per_m: Annotated[Stiffness, Usual(1e6, 1e10, {"N/µm": 1e6, "N/mm": 1e3})]
    #: screw_damping_nms_per_rad and guide_damping_ns_per_m: Cl, Ct
    screw_damping_nms_per_rad: TorsionalDamping = 0.0
    guide_damping_ns_per_m: Damping = 0.0
    #: torsional_damping_nms_per_rad and axial_damping_ns_per_m: Dθ, De: damping inside the springs; 0 in the source
    torsional_damping_nms_per_rad: TorsionalDamping = 0.0
    axial_damping_ns_per_m: Damping = 0.0

    def __post_init__(self) -> None:
        require_positive(
            self,
            "motor_inertia_kg_m2",
            "screw_inertia_kg_m2",
            "table_mass_kg",
            "lead_m",
            "torsional_stiffness_nm_per_rad",
            "axial_stiffness_n_per_m",
        )
        require_not_negative(
            self,
            "screw_damping_nms_per_rad",
            "guide_damping_ns_per_m",
            "torsional_damping_nms_per_rad",
            "axial_damping_ns_per_m",
        )

    @property
    def travel_per_motion(self) -> float:
        """R: table travel per radian of the motor [m/rad]."""
        return self.lead_m / (2.0 * math.pi)


Mechanics = RigidMechanics | ThreeMassMechanics


@dataclass(frozen=True)
class LuGre:
    """Bristles of the guide before it slides: z' = v − σ0·|v|/g(v)·z, force σ0·z + σ1·z'.

    g(v) is the sliding friction of the same `Friction`. Canudas de Wit, Olsson, Åström, Lischinsky (1995), IEEE
    Trans. Autom. Control 40(3), 419–425.
    """

    stiffness_n_per_m: Stiffness  #: σ0 [N/m]
    damping_ns_per_m: Damping = 0.0  #: σ1 [N·s/m]
    #: σ1 falls as exp(−(v/v_d)²), so that sliding is not damped twice and friction stays passive; 0: it does not fall
    fading_speed_m_per_s: Annotated[float, Unit("m/s"), Limits(0.0, 1e3), Fit(up_to=0.1)] = 0.0

    def __post_init__(self) -> None:
        require_positive(self, "stiffness_n_per_m")
        require_not_negative(self, "damping_ns_per_m", "fading_speed_m_per_s")


@dataclass(frozen=True)
class Friction:
    """Dry friction of the guide on the table's speed, and of the screw on its own; viscous friction is damping.

    Sliding: ``sgn(v)·(C + (S − C)·exp(−(|v|/v_s)^δ))`` with C, S of the direction. At rest it holds whatever is less
    than S. All zero: no friction.
    """

    coulomb_n: Force = 0.0  #: C for v > 0 [N]
    coulomb_negative_n: Force | None = None  #: C for v < 0 [N], as a positive number; None: as for v > 0
    #: static_n and static_negative_n: Breakaway S of the two directions [N]; None: equal to C, no Stribeck effect. If
    #: nothing is given for v < 0, both C and S are those of v > 0.
    static_n: Force | None = None
    static_negative_n: Force | None = None
    #: stribeck_speed_m_per_s and stribeck_exponent: v_s, δ; they matter only where S differs from C
    stribeck_speed_m_per_s: Annotated[float, Unit("m/s"), Limits(1e-9, 1e3), Fit(1e-4, 0.5)] = 0.01
    stribeck_exponent: Annotated[float, Limits(1e-3, 100.0), Fit(0.5, 4.0)] = 2.0
    offset_n: Force = 0.0  #: Constant force against the positive direction: weight, cable [N]
    #: Dry friction of screw and bearings on the screw's speed [N·m]; three-mass axis only
    screw_coulomb_nm: Torque = 0.0
    lugre: LuGre | None = None  #: Friction with memory instead of the jump at v = 0

    def __post_init__(self) -> None:
        require_not_negative(
            self, "coulomb_n", "coulomb_negative_n", "static_n", "static_negative_n", "screw_coulomb_nm"
        )
        require_positive(self, "stribeck_speed_m_per_s", "stribeck_exponent")
        require_finite(self, "offset_n")

    @property
    def directions(self) -> tuple[tuple[float, float], tuple[float, float]]:
        """(C, S) for v > 0, and for v < 0 [N]."""
        up = (self.coulomb_n, self.coulomb_n if self.static_n is None else self.static_n)
        if self.coulomb_negative_n is None and self.static_negative_n is None:
            return up, up
        coulomb = self.coulomb_n if self.coulomb_negative_n is None else self.coulomb_negative_n
        return up, (coulomb, coulomb if self.static_negative_n is None else self.static_negative_n)


@dataclass(frozen=True)
class Ripple:
    """One harmonic of the actuator: cogging, amplitude·sin(n·φ + phase), and ripple, a share of its own force.

    φ is 2π per `period` of motor position (2π rad for a motor that turns, the pole pitch in metres for a rigid axis).
    """

    harmonic: Annotated[float, Limits(1e-6, 1e6)]  #: n, periods per `period`
    #: Amplitude that does not depend on the current [N·m], or [N] for a rigid axis
    cogging: Annotated[float, Limits(0.0, 1e9), Fit()] = 0.0
    #: Amplitude as a share of the actuator's force
    share: Annotated[float, Limits(0.0, 100.0), Fit(either_sign=0.5)] = 0.0
    phase_rad: Angle = 0.0  #: Phase [rad]

    def __post_init__(self) -> None:
        require_positive(self, "harmonic")
        require_finite(self, "cogging", "share", "phase_rad")


@dataclass(frozen=True)
class Transmission:
    """Where the travel differs from lead × turns."""

    #: Lost motion at reversal, the whole gap [m]; three-mass axis only
    backlash_m: Annotated[Length, Fit(up_to=1e-3), _ERROR] = 0.0
    #: pitch_amplitude_m and pitch_phase_rad: Error that repeats with the lead: amplitude·sin(θl + phase) [m]; of a
    #: rigid axis θl is 2π a `ripple_period`
    pitch_amplitude_m: Annotated[Length, Fit(up_to=1e-4), _ERROR] = 0.0
    pitch_phase_rad: Angle = 0.0
    #: Cumulative pitch error, travel per travel (1e-6: 1 µm/m)
    pitch_slope: Annotated[float, Limits(0.0, 0.1), Fit(either_sign=1e-3)] = 0.0
    #: pitch_position_m and pitch_error_m: Table of cumulative pitch error over the nominal travel R·θl [m], straight
    #: between, constant beyond; may be empty
    pitch_position_m: tuple[Length, ...] = ()
    pitch_error_m: tuple[Length, ...] = ()

    def __post_init__(self) -> None:
        require_not_negative(self, "backlash_m", "pitch_amplitude_m")
        require_finite(self, "pitch_phase_rad", "pitch_slope")
        x, e = np.array(self.pitch_position_m), np.array(self.pitch_error_m)
        if len(x) != len(e) or not (np.isfinite(x).all() and np.isfinite(e).all()) or (np.diff(x) <= 0).any():
            raise InputError(
                f"{len(x)} positions and {len(e)} errors of pitch",
                expected="as many errors as positions, positions that increase",
                where="pitch_position_m",
                advice="sort the table of the pitch error and give one error a position",
            )


@dataclass(frozen=True)
class AxialCompliance:
    """How the axial spring gives way under load and along the travel, instead of one stiffness Ke.

    Deflection = force·shaft(x) + joints(force). `shaft(x)` is x'/(E·A) of a screw held at one end, or of two lengths
    in parallel held at both, with x' = `origin_m` + table position.
    """

    #: force_n and joint_deflection_m: (n_points,): Deflection of nut and bearings together [m] at axial forces [N],
    #: both increasing through (0, 0)
    force_n: Vector
    joint_deflection_m: Vector
    shaft_n: float  #: E·A of the screw shaft [N]
    #: length_m and origin_m: Distance of the bearings; that of the nut from the fixed one at table position 0 [m]
    length_m: float
    origin_m: float
    both_ends: bool = True  #: Whether the screw is held axially at both ends

    def __post_init__(self) -> None:
        require_positive(self, "shaft_n", "length_m", "origin_m")
        keep_arrays(self, "force_n", "joint_deflection_m")
        force, deflection = self.force_n, self.joint_deflection_m
        rising = len(force) >= 2 and force.shape == deflection.shape
        if not rising or (np.diff(force) <= 0).any() or (np.diff(deflection) <= 0).any():
            raise InputError(
                f"{force.shape} forces and {deflection.shape} deflections",
                expected="two increasing rows of the same length",
                where="axial compliance",
                advice="give the deflection of the joints at increasing axial forces",
            )

    def shaft_m_per_n(self, table_m: float) -> float:
        """Deflection of the shaft alone per force with the table there [m/N]; constant beyond the bearings."""
        free = min(max(self.origin_m + table_m, 0.0), self.length_m)
        share = free * (self.length_m - free) / self.length_m if self.both_ends else free
        return share / self.shaft_n
