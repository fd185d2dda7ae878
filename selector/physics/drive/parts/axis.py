"""A feed axis in SI units: what turns, slides and resists, where the travel differs, servo, sensing, and its state."""

import math
from collections.abc import Iterator
from dataclasses import dataclass, field, fields
from itertools import pairwise
from typing import Annotated, Literal

import numpy as np
from numpy.typing import ArrayLike
from scipy import optimize

from selector.errors import InputError, Misfit
from selector.physics.checks import FINITE, FROM_0, Above0, Checked, Finite, From0, keep_arrays
from selector.physics.model_fields import Fit, Limits, Unit, Usual
from selector.types import Vector

Mass = Annotated[Above0, Unit("kg"), Limits(1e-9, 1e9), Fit()]
CarriedMass = Annotated[Mass, Usual(5.0, 1e5, {"t": 1e3, "g": 1e-3})]
_INERTIA_UNITS = {"kg·cm²": 1e-4, "kg·mm²": 1e-6, "g·cm²": 1e-7}
Inertia = Annotated[Above0, Unit("kg·m²"), Limits(1e-12, 1e6), Fit(), Usual(1e-7, 0.5, _INERTIA_UNITS)]
Force = Annotated[From0, Unit("N"), Limits(0.0, 1e9), Fit()]
Torque = Annotated[From0, Unit("N·m"), Limits(0.0, 1e9), Fit()]
Stiffness = Annotated[Above0, Unit("N/m"), Limits(1e-3, 1e13), Fit()]
TorsionalStiffness = Annotated[
    Above0, Unit("N·m/rad"), Limits(1e-6, 1e12), Fit(), Usual(50.0, 1e7, {"kN·m/rad": 1e3, "N·mm/rad": 1e-3})
]
Damping = Annotated[From0, Unit("N·s/m"), Limits(0.0, 1e9), Fit()]
TorsionalDamping = Annotated[From0, Unit("N·m·s/rad"), Limits(0.0, 1e6), Fit()]
Angle = Annotated[Finite, Unit("rad"), Limits(0.0, 1e6), Fit(either_sign=math.pi)]
Length = Annotated[float, Unit("m"), Limits(0.0, 1e4)]
Efficiency = Annotated[Above0, Limits(0.1, 1.0), Fit(0.3, 1.0), Usual(0.7, 1.0)]
_ERROR = Usual(0.0, 2e-3, {"µm": 1e-6, "mm": 1e-3})


@dataclass(frozen=True)
class RigidMechanics(Checked):
    """One mass: M·v' = force − viscous·v − friction."""

    mass_kg: Mass  #: Everything that moves, rotating parts included as J/R² [kg]
    guide_damping_ns_per_m: Damping = 0.0  #: Viscous friction [N·s/m]

    @property
    def travel_per_motion(self) -> float:
        """Table travel per unit of motor position: 1, both are metres."""
        return 1.0


@dataclass(frozen=True)
class ThreeMassMechanics(Checked):
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
    lead_m: Annotated[Above0, Unit("m"), Limits(1e-6, 10.0), Usual(5e-4, 0.2, {"mm": 1e-3})]
    #: torsional_stiffness_nm_per_rad and axial_stiffness_n_per_m: Kθ, Ke
    torsional_stiffness_nm_per_rad: TorsionalStiffness
    axial_stiffness_n_per_m: Annotated[Stiffness, Usual(1e6, 1e10, {"N/µm": 1e6, "N/mm": 1e3})]
    #: screw_damping_nms_per_rad and guide_damping_ns_per_m: Cl, Ct
    screw_damping_nms_per_rad: TorsionalDamping = 0.0
    guide_damping_ns_per_m: Damping = 0.0
    #: torsional_damping_nms_per_rad and axial_damping_ns_per_m: Dθ, De: damping inside the springs; 0 in the source
    torsional_damping_nms_per_rad: TorsionalDamping = 0.0
    axial_damping_ns_per_m: Damping = 0.0

    @property
    def travel_per_motion(self) -> float:
        """R: table travel per radian of the motor [m/rad]."""
        return self.lead_m / (2.0 * math.pi)


Mechanics = RigidMechanics | ThreeMassMechanics


@dataclass(frozen=True)
class LuGre(Checked):
    """Bristles of the guide before it slides: z' = v − σ0·|v|/g(v)·z, force σ0·z + σ1·z'.

    g(v) is the sliding friction of the same `Friction`. Canudas de Wit, Olsson, Åström, Lischinsky (1995), IEEE
    Trans. Autom. Control 40(3), 419–425.
    """

    stiffness_n_per_m: Stiffness  #: σ0 [N/m]
    damping_ns_per_m: Damping = 0.0  #: σ1 [N·s/m]
    #: σ1 falls as exp(−(v/v_d)²), so that sliding is not damped twice and friction stays passive; 0: it does not fall
    fading_speed_m_per_s: Annotated[From0, Unit("m/s"), Limits(0.0, 1e3), Fit(up_to=0.1)] = 0.0


@dataclass(frozen=True)
class Friction(Checked):
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
    stribeck_speed_m_per_s: Annotated[Above0, Unit("m/s"), Limits(1e-9, 1e3), Fit(1e-4, 0.5)] = 0.01
    stribeck_exponent: Annotated[Above0, Limits(1e-3, 100.0), Fit(0.5, 4.0)] = 2.0
    offset_n: Annotated[Force, FINITE] = 0.0  #: Constant force against the positive direction: weight, cable [N]
    #: What v < 0 has of viscous friction beyond that of the mechanics [N·s/m]; linearised loops do without it
    viscous_negative_ns_per_m: Annotated[Damping, FINITE] = 0.0
    #: Dry friction of screw and bearings on the screw's speed [N·m]; three-mass axis only
    screw_coulomb_nm: Torque = 0.0
    #: η (F eq. 1): the nut takes R·|Fa|·(1/η − 1) of the screw beside that, against its turning: it drives with R·Fa/η,
    #: and is driven by the table with R·Fa·(2 − 1/η); three-mass axis only
    nut_efficiency: Efficiency = 1.0
    lugre: LuGre | None = None  #: Friction with memory instead of the jump at v = 0

    @property
    def directions(self) -> tuple[tuple[float, float], tuple[float, float]]:
        """(C, S) for v > 0, and for v < 0 [N]."""
        up = (self.coulomb_n, self.coulomb_n if self.static_n is None else self.static_n)
        if self.coulomb_negative_n is None and self.static_negative_n is None:
            return up, up
        coulomb = self.coulomb_n if self.coulomb_negative_n is None else self.coulomb_negative_n
        return up, (coulomb, coulomb if self.static_negative_n is None else self.static_negative_n)


@dataclass(frozen=True)
class Ripple(Checked):
    """One harmonic of the actuator: cogging, amplitude·sin(n·φ + phase), and ripple, a share of its own force.

    φ is 2π per `period` of motor position (2π rad for a motor that turns, the pole pitch in metres for a rigid axis).
    """

    harmonic: Annotated[Above0, Limits(1e-6, 1e6)]  #: n, periods per `period`
    #: Amplitude that does not depend on the current [N·m], or [N] for a rigid axis
    cogging: Annotated[Finite, Limits(0.0, 1e9), Fit()] = 0.0
    #: Amplitude as a share of the actuator's force
    share: Annotated[Finite, Limits(0.0, 100.0), Fit(either_sign=0.5)] = 0.0
    phase_rad: Angle = 0.0  #: Phase [rad]


@dataclass(frozen=True)
class Transmission(Checked):
    """Where the travel differs from lead × turns."""

    #: Lost motion at reversal, the whole gap [m]; three-mass axis only
    backlash_m: Annotated[Length, FROM_0, Fit(up_to=1e-3), _ERROR] = 0.0
    #: pitch_amplitude_m and pitch_phase_rad: Error that repeats with the lead: amplitude·sin(θl + phase) [m]; of a
    #: rigid axis θl is 2π a `ripple_period`
    pitch_amplitude_m: Annotated[Length, FROM_0, Fit(up_to=1e-4), _ERROR] = 0.0
    pitch_phase_rad: Angle = 0.0
    #: Cumulative pitch error, travel per travel (1e-6: 1 µm/m)
    pitch_slope: Annotated[Finite, Limits(0.0, 0.1), Fit(either_sign=1e-3)] = 0.0
    #: pitch_position_m and pitch_error_m: Table of cumulative pitch error over the nominal travel R·θl [m], straight
    #: between, constant beyond; may be empty
    pitch_position_m: tuple[Length, ...] = ()
    pitch_error_m: tuple[Length, ...] = ()

    def _misfits(self) -> Iterator[Misfit]:
        x, e = np.array(self.pitch_position_m), np.array(self.pitch_error_m)
        if len(x) != len(e) or not (np.isfinite(x).all() and np.isfinite(e).all()) or (np.diff(x) <= 0).any():
            found = f"{len(x)} positions and {len(e)} errors of pitch"
            expected = "as many errors as positions, positions that increase"
            advice = "sort the table of the pitch error and give one error a position"
            yield found, expected, "pitch_position_m", advice


@dataclass(frozen=True)
class AxialCompliance(Checked):
    """How the axial spring gives way under load and along the travel, instead of one stiffness Ke.

    Deflection = force·shaft(x) + joints(force). `shaft(x)` is x'/(E·A) of a screw held at one end, or of two lengths
    in parallel held at both, with x' = `origin_m` + table position.
    """

    #: force_n and joint_deflection_m: (n_points,): Deflection of nut and bearings together [m] at axial forces [N],
    #: both increasing through (0, 0)
    force_n: Vector
    joint_deflection_m: Vector
    shaft_n: Above0  #: E·A of the screw shaft [N]
    #: length_m and origin_m: Distance of the bearings; that of the nut from the fixed one at table position 0 [m]
    length_m: Above0
    origin_m: Above0
    both_ends: bool = True  #: Whether the screw is held axially at both ends

    def __post_init__(self) -> None:
        super().__post_init__()
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


MOST_WAITING = 300  #: Samples of the control that a command may wait, and that a measured speed may reach over.
KV = 1000.0 / 60.0  #: 1 m/(min·mm), the workshop's unit of the Kv factor, in 1/s.
_Limit = Annotated[Above0, Limits(1e-9, 1e9), Fit()]
_Waiting = Annotated[From0, Unit("s"), Usual(1e-6, 0.05, {"ms": 1e-3, "µs": 1e-6})]


@dataclass(frozen=True)
class Servo(Checked):
    """Cascade control: position P, velocity PI on the motor's speed, limits, sampling, delay, feed-forward.

    ``speed* = Kp·(r − y)/R + ff_v·r'/R``; ``u = Kvp·e + Kvi·∫e dt + ff_a·I·r''/(R·Kf)`` with
    e = speed* − motor speed and I the inertia of the whole axis at the motor; torque or force = Kf·u.
    F writes K_pp = Kp/R. Sampled: ∫e dt is the sum of sample_s·e over the samples before this one. The integral stands
    while u is limited; if a continuous one would leave the limit by standing and come back by moving on, it follows the
    limit, as a sampled one does by turns.
    """

    #: Kp, the "Kv factor" of the workshop [1/s]
    position_gain_per_s: Annotated[
        Above0, Unit("1/s"), Limits(1e-9, 1e9), Fit(), Usual(6.0, 600.0, {"m/(min·mm)": KV, "1/min": 1.0 / 60.0})
    ]
    #: velocity_gain and velocity_integral_gain: Kvp [actuator unit per motor speed], Kvi [the same per s]: A·s/rad,
    #: A/rad; or V·s/m, V/m
    velocity_gain: Annotated[Above0, Limits(1e-12, 1e12), Fit()]
    velocity_integral_gain: Annotated[From0, Fit()] = 0.0
    actuator_gain: _Limit = 1.0  #: Kf [N·m or N per actuator unit]
    #: command_limit and speed_limit: Largest |u| [actuator unit] and largest |speed*| [motor speed]
    command_limit: _Limit | None = None
    speed_limit: _Limit | None = None
    #: Period of both loops [s], u is held between; 0: continuous
    sample_s: Annotated[_Waiting, Limits(1e-6, 100.0)] = 0.0
    #: From the computed command to the actuator [s]
    delay_s: Annotated[_Waiting, Limits(0.0, 100.0), Fit(up_to=0.02)] = 0.0
    #: velocity_feedforward and acceleration_feedforward: Shares ff_v, ff_a, 1 = complete
    velocity_feedforward: Annotated[From0, Limits(0.0, 10.0), Fit(up_to=2.0)] = 0.0
    acceleration_feedforward: Annotated[From0, Limits(0.0, 10.0), Fit(up_to=2.0)] = 0.0
    #: {"table", "motor"}: Where the position is measured: scale on the table, or encoder of the motor × R
    feedback: Literal["table", "motor"] = "table"


@dataclass(frozen=True)
class Sensing(Checked):
    """What the control sees of position and current; zero: exactly."""

    #: Step of the motor's encoder [rad], or [m] for a rigid axis
    motor_resolution: Annotated[From0, Limits(1e-15, 1e3)] = 0.0
    #: Step of the linear scale [m]
    scale_resolution_m: Annotated[
        From0, Unit("m"), Limits(1e-15, 1e3), Usual(0.0, 1e-3, {"µm": 1e-6, "mm": 1e-3, "nm": 1e-9})
    ] = 0.0
    #: Speed as the difference of two encoder readings, as controls have it; else the true speed
    speed_from_encoder: bool = False
    #: Samples between these two readings; over more than one the speed is smoother and later, by half of them
    speed_samples: Annotated[int, Limits(1, MOST_WAITING)] = 1
    #: Standard deviation of noise on the command, drawn at every sample [actuator unit]
    current_noise: Annotated[From0, Limits(0.0, 1e6)] = 0.0

    def _misfits(self) -> Iterator[Misfit]:
        if self.speed_samples < 1 or (self.speed_samples > 1 and not self.speed_from_encoder):
            found = f"{self.speed_samples}" + ("" if self.speed_samples < 1 else " without a speed from the encoder")
            advice = "set speed_from_encoder, or leave speed_samples out"
            yield found, "1, or more with speed_from_encoder", "speed_samples", advice


@dataclass(frozen=True)
class Axis(Checked):
    """A feed axis: `servo` None leaves it to itself (free motion, or driven by given commands).

    InputError if a part needs a structure or a servo that the axis has not.
    """

    mechanics: Mechanics
    servo: Servo | None = None
    friction: Friction = field(default_factory=Friction)
    transmission: Transmission = field(default_factory=Transmission)
    ripple: tuple[Ripple, ...] = ()
    ripple_period: Above0 = 2.0 * math.pi
    compliance: AxialCompliance | None = None
    sensing: Sensing = field(default_factory=Sensing)

    def _misfits(self) -> Iterator[Misfit]:
        if isinstance(self.mechanics, RigidMechanics):
            advice = 'describe motor, screw and table (mechanics.kind = "three-mass", or parts), or leave this key out'
            for where, there in (
                ("transmission.backlash_m", self.transmission.backlash_m),
                ("friction.screw_coulomb_nm", self.friction.screw_coulomb_nm),
            ):
                if there > 0:
                    yield f"{there:g} in an axis of one mass", "0, or an axis of three masses", where, advice
            if self.compliance is not None:
                yield "an axial compliance in an axis of one mass", "an axis of three masses", "compliance", advice
        efficiency = self.friction.nut_efficiency
        if efficiency > 1.0 or (efficiency < 1.0 and isinstance(self.mechanics, RigidMechanics)):
            found, advice = f"an efficiency of {efficiency:g}", "give the share of the power that the nut hands on"
            yield found, "above 0 to 1, and 1 in an axis of one mass", "friction.nut_efficiency", advice
        if (down := self.mechanics.guide_damping_ns_per_m + self.friction.viscous_negative_ns_per_m) < 0.0:
            found, advice = (
                f"viscous friction of {down:g} N·s/m for v < 0",
                "it is what v < 0 has more: of less, say less",
            )
            yield found, "0 or more together with that of the guide", "friction.viscous_negative_ns_per_m", advice
        if self._least_travel <= 0.0:
            found = f"a pitch error that turns the travel back (least slope {self._least_travel:.3g})"
            advice = "give pitch errors in metres: 5 µm are 5e-6"
            yield found, "errors that change by less than the travel", "transmission", advice
        if self.servo is None or self.servo.sample_s == 0:
            advice = "give servo.sample_s, the period of the control in seconds, or leave this key out"
            if self.servo is not None and self.servo.delay_s > 0:
                yield "a delay in a continuous control", "a sampled control", "servo.delay_s", advice
            said = sorted(one.name for one in fields(Sensing) if getattr(self.sensing, one.name) != one.default)
            if said:
                yield f"{', '.join(said)} in a continuous control", "a sampled control", "sensing", advice

    @property
    def _least_travel(self) -> float:
        """A bound of the true travel per nominal one."""
        pitch, radius = self.transmission, self.mechanics.travel_per_motion
        rate = 2.0 * math.pi / self.ripple_period if isinstance(self.mechanics, RigidMechanics) else 1.0
        falls = [
            (error - before) / (at - since)
            for (since, before), (at, error) in pairwise(zip(pitch.pitch_position_m, pitch.pitch_error_m, strict=True))
        ]
        return 1.0 + pitch.pitch_slope + min(falls, default=0.0) - pitch.pitch_amplitude_m * rate / radius


def pitch_error_m(axis: Axis, screw: ArrayLike) -> tuple[Vector, Vector]:
    """Pitch error [m] at positions of the screw (of a rigid axis: of its mass), and its slope per unit of position."""
    pitch, travel = axis.transmission, axis.mechanics.travel_per_motion
    rate = 2.0 * math.pi / axis.ripple_period if isinstance(axis.mechanics, RigidMechanics) else 1.0
    nominal = travel * np.asarray(screw, dtype=np.float64)
    angle = rate * np.asarray(screw, dtype=np.float64) + pitch.pitch_phase_rad
    error = pitch.pitch_amplitude_m * np.sin(angle) + pitch.pitch_slope * nominal
    slope = pitch.pitch_amplitude_m * rate * np.cos(angle) + pitch.pitch_slope * travel
    if len(pitch.pitch_position_m) > 1:
        places, errors = np.array(pitch.pitch_position_m), np.array(pitch.pitch_error_m)
        rise = np.concatenate([[0.0], np.diff(errors) / np.diff(places), [0.0]])
        slope = slope + travel * rise[np.searchsorted(places, nominal, side="right")]
        error = error + np.interp(nominal, places, errors)
    elif len(pitch.pitch_position_m) == 1:
        error = error + pitch.pitch_error_m[0]
    return error, slope


@dataclass(frozen=True)
class AxisState(Checked):
    """Where everything is at one instant."""

    #: motor, motor_speed, screw and screw_speed: Positions and speeds [rad], [rad/s]; of a rigid axis `motor` is the
    #: mass [m], [m/s] and the screw is nothing
    motor: Finite = 0.0
    motor_speed: Finite = 0.0
    screw: Finite = 0.0
    screw_speed: Finite = 0.0
    #: table_m and table_speed_m_per_s: Position and speed of the table; of a rigid axis they follow from the motor
    table_m: Finite = 0.0
    table_speed_m_per_s: Finite = 0.0
    bristle_m: Finite = 0.0  #: Deflection of the bristles of the guide [m]
    integral: Finite = 0.0  #: Integral of the speed error of the servo [motor position]


def unloaded_state(axis: Axis, position_m: float, speed_m_per_s: float = 0.0) -> AxisState:
    """All masses in step at a position that the control sees, no spring under load, backlash in its middle.

    `position_m` [m] is the table's, or, as its `servo.feedback` says, the motor's × R; `speed_m_per_s` the table's
    [m/s].
    """
    travel = axis.mechanics.travel_per_motion
    motor = position_m / travel
    if axis.servo is None or axis.servo.feedback == "table":
        motor = _motor_for(axis, position_m)
    error, slope = (float(one) for one in pitch_error_m(axis, motor))
    motor_speed = speed_m_per_s / (travel + slope)
    if isinstance(axis.mechanics, RigidMechanics):
        return AxisState(motor, motor_speed, table_m=motor + error, table_speed_m_per_s=speed_m_per_s)
    table = travel * motor + error
    return AxisState(motor, motor_speed, motor, motor_speed, table, speed_m_per_s)


def _motor_for(axis: Axis, position_m: float) -> float:
    travel = axis.mechanics.travel_per_motion
    pitch = axis.transmission
    constant = pitch.pitch_amplitude_m + max((abs(error) for error in pitch.pitch_error_m), default=0.0)
    # a bound of the pitch error near this position
    largest = 2.0 * (constant + abs(pitch.pitch_slope) * (abs(position_m) + constant))
    if largest == 0.0:
        return position_m / travel
    ends = ((position_m - largest) / travel, (position_m + largest) / travel)
    return float(
        optimize.brentq(
            lambda q: travel * q + float(pitch_error_m(axis, q)[0]) - position_m, *ends, xtol=1e-14, rtol=1e-15
        )
    )


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
    alone: 2·(F/Ke + R·(R·F/η + Ts)/Kθ), F the mean of the two directions. None where it does not show as lost motion:
    one mass has no spring, and a control that sees the table takes it out again.
    """
    mechanics, servo = axis.mechanics, axis.servo
    if not isinstance(mechanics, ThreeMassMechanics) or servo is None or servo.feedback == "table":
        return None
    radius = mechanics.travel_per_motion
    (up, _), (down, _) = axis.friction.directions
    force = (up + down) / 2.0
    twisted = radius * force / axis.friction.nut_efficiency + axis.friction.screw_coulomb_nm
    turned = twisted / mechanics.torsional_stiffness_nm_per_rad
    return 2.0 * (force / mechanics.axial_stiffness_n_per_m + radius * turned)
