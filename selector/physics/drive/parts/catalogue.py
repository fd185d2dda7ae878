"""What a feed axis is built from, in the units of catalogues; defaults: a machining centre with 500 mm pallet.

Where each default comes from is told in docs/explanation/drive-stiffness.md. None was measured on a machine.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Annotated, Any

from selector.errors import Misfit
from selector.physics.checks import ABOVE_0, FROM_0, Above0, Checked, From0
from selector.physics.drive.parts import axis
from selector.physics.model_fields import Fit, Limits, Unit, Usual

_Millimetres = Annotated[Above0, Unit("mm"), Limits(1e-6, 1e6)]
_Diameter = Annotated[_Millimetres, Usual(3.0, 500.0, {"m": 1e3, "cm": 10.0})]
_BallDiameter = Annotated[_Millimetres, Usual(0.5, 50.0, {"m": 1e3, "cm": 10.0})]
_Modulus = Annotated[Above0, Unit("GPa"), Limits(1e-3, 1e12)]
_MODULUS_UNITS = {"Pa": 1e-9, "N/mm²": 1e-3, "TPa": 1e3}
_Density = Annotated[Above0, Unit("kg/m³"), Limits(1e-3, 1e6), Usual(1e3, 2e4, {"g/cm³": 1e3})]
_ShearModulus = Annotated[_Modulus, Usual(10.0, 300.0, _MODULUS_UNITS)]
_Preload = Annotated[Above0, Unit("N"), Limits(0.0, 1e7), Fit(), Usual(10.0, 1e6, {"kN": 1e3})]
_RIGIDITY_UNITS = {"N/m": 1e-6, "N/mm": 1e-3, "kN/µm": 1e3}
_Rigidity = Annotated[Above0, Unit("N/µm"), Limits(1e-6, 1e7), Fit(), Usual(5.0, 2e4, _RIGIDITY_UNITS)]
_RigidityPreload = Annotated[Above0, Unit("N"), Limits(1e-3, 1e7)]
_RigidityShare = Annotated[Above0, Fit(0.1, 1.0)]
_ContactAngle = Annotated[float, Unit("°"), Limits(0.0, 360.0)]
_Conformity = Annotated[float, Fit(0.505, 0.6)]


@dataclass(frozen=True)
class Motor(Checked):
    """Servo motor: rotor inertia [kg·m²], torque per current [N·m/A], largest torque [N·m] and speed [r/min]."""

    inertia_kg_m2: axis.Inertia = 0.0053
    torque_constant_nm_per_a: Annotated[
        Above0, Unit("N·m/A"), Limits(1e-9, 1e6), Fit(), Usual(0.01, 50.0, {"mN·m/A": 1e-3})
    ] = 0.79
    peak_torque_nm: Annotated[axis.Torque, ABOVE_0] = 76.0
    top_speed_rpm: Annotated[Above0, Unit("r/min"), Limits(1e-6, 1e7), Fit(), Usual(50.0, 6e4, {"1/s": 60.0})] = 4000.0

    @property
    def limits(self) -> dict[str, Any]:
        """Gain of the actuator, and limits of current and speed, of a `Servo` of this motor."""
        return {
            "actuator_gain": self.torque_constant_nm_per_a,
            "command_limit": self.peak_torque_nm / self.torque_constant_nm_per_a,
            "speed_limit": self.top_speed_rpm * math.pi / 30.0,
        }


@dataclass(frozen=True)
class Coupling(Checked):
    """Coupling between motor and screw: its catalogue stiffness [N·m/rad], or None: a solid cylinder, πGD⁴/(32L)."""

    inertia_kg_m2: Annotated[axis.Inertia, FROM_0] = 0.0009
    stiffness_nm_per_rad: axis.TorsionalStiffness | None = 76_000.0
    diameter_mm: _Diameter = 40.0
    length_mm: _Millimetres = 80.0
    shear_modulus_gpa: _ShearModulus = 79.0


@dataclass(frozen=True)
class Screw(Checked):
    """Ball screw."""

    #: diameter_mm and root_diameter_mm: Nominal diameter, which gives the inertia; that of the core, which carries [mm]
    diameter_mm: _Diameter = 40.0
    root_diameter_mm: _Diameter = 34.91
    #: Travel per revolution [mm]
    lead_mm: Annotated[Above0, Unit("mm"), Limits(1e-3, 1e4), Usual(0.5, 200.0, {"m": 1e3, "µm": 1e-3})] = 20.0
    #: length_mm and overhang_mm: Between the axial bearings; from the coupling to the first of them [mm]
    length_mm: Annotated[_Millimetres, Usual(20.0, 5e4, {"m": 1e3, "µm": 1e-3})] = 1200.0
    overhang_mm: Annotated[_Millimetres, FROM_0] = 100.0
    origin_mm: _Millimetres = 600.0  #: From the first bearing to the nut at table position 0 [mm]
    both_ends: bool = True  #: Held axially at both ends, else at the motor's only
    #: modulus_gpa, shear_modulus_gpa and density_kg_per_m3: Of its steel
    modulus_gpa: Annotated[_Modulus, Usual(20.0, 700.0, _MODULUS_UNITS)] = 206.0
    shear_modulus_gpa: _ShearModulus = 79.0
    density_kg_per_m3: _Density = 7850.0
    inertia_kg_m2: axis.Inertia | None = None  #: Of the whole screw; None: a cylinder of the nominal diameter
    damping_nms_per_rad: axis.TorsionalDamping = 0.004  #: Viscous friction of screw, nut and bearings [N·m·s/rad]
    #: torsional_damping_nms_per_rad and axial_damping_ns_per_m: Damping inside the two springs; none in F
    torsional_damping_nms_per_rad: axis.TorsionalDamping = 0.0
    axial_damping_ns_per_m: axis.Damping = 0.0

    def _misfits(self) -> Iterator[Misfit]:
        if self.root_diameter_mm > self.diameter_mm:
            yield _wrong(self.root_diameter_mm, f"at most diameter_mm, {self.diameter_mm:g}", "root_diameter_mm")
        if self.origin_mm >= self.length_mm:
            yield _wrong(self.origin_mm, f"less than length_mm, {self.length_mm:g}: the nut is outside", "origin_mm")


@dataclass(frozen=True)
class Nut(Checked):
    """Preloaded ball nut: double, or single with oversize balls."""

    preload_n: _Preload = 3000.0  #: Preload [N]
    #: ball_diameter_mm and pitch_circle_mm: Of the balls; of the circle of their centres [mm]
    ball_diameter_mm: _BallDiameter = 6.35
    pitch_circle_mm: _Diameter = 41.4
    turns: Above0 = 4.0  #: Loaded turns of balls for each direction
    contact_angle_deg: _ContactAngle = 45.0  #: Between a contact and the plane across the axis
    conformity: _Conformity = 0.54  #: Radius of the groove / diameter of the balls
    #: rigidity_n_per_um and rigidity_preload_n: Catalogue rigidity and the preload that it holds for; None: Hertz
    #: contact alone
    rigidity_n_per_um: _Rigidity | None = 1150.0
    rigidity_preload_n: _RigidityPreload | None = 5130.0
    #: What of either is left in a machine: housing, thread and load distribution take the rest
    rigidity_share: _RigidityShare = 0.8
    drag_torque_nm: axis.Torque = 1.2  #: Friction from the preload [N·m]
    efficiency: axis.Efficiency = 1.0  #: η of the load, the preload's friction aside

    def _misfits(self) -> Iterator[Misfit]:
        return _of_contact(self)


@dataclass(frozen=True)
class Bearings(Checked):
    """Preloaded angular-contact bearings at one end of the screw; if it is held at both ends, these are at each."""

    preload_n: _Preload = 3350.0  #: Preload of the set [N]
    #: N, bearings that carry each direction: 1 in a pair, 2 in a set of four
    per_direction: Annotated[int, ABOVE_0, Limits(1, 100)] = 1
    #: ball_diameter_mm, pitch_circle_mm and balls: Of one bearing
    ball_diameter_mm: _BallDiameter = 7.144
    pitch_circle_mm: _Diameter = 46.4
    balls: Annotated[int, ABOVE_0, Limits(1, 10_000)] = 18
    #: contact_angle_deg and conformity: As of `Nut`
    contact_angle_deg: _ContactAngle = 60.0
    conformity: _Conformity = 0.52
    #: rigidity_n_per_um and rigidity_preload_n: Catalogue rigidity of the set and its preload; None: Hertz contact
    #: alone
    rigidity_n_per_um: _Rigidity | None = None
    rigidity_preload_n: _RigidityPreload | None = None
    rigidity_share: _RigidityShare = 1.0  #: What of either is left in a machine
    drag_torque_nm: axis.Torque = 0.3  #: Friction of the set [N·m]

    def _misfits(self) -> Iterator[Misfit]:
        return _of_contact(self)


@dataclass(frozen=True)
class Guide(Checked):
    """Preloaded linear guides: friction μ·(weight + 2·carriages·preload) + seals, and viscous friction.

    Balls of both rows of a carriage carry its preload, hence the 2.
    """

    friction_coefficient: Annotated[From0, Fit(), Usual(0.0, 0.5, {"%": 0.01})] = 0.004
    carriages: Annotated[int, FROM_0, Limits(0, 1000)] = 4
    carriage_preload_n: axis.Force = 4000.0
    seal_n: axis.Force = 20.0
    viscous_ns_per_m: axis.Damping = 600.0


@dataclass(frozen=True)
class Table(Checked):
    """What slides, with what lies on it [kg]."""

    mass_kg: axis.CarriedMass = 1000.0


@dataclass(frozen=True)
class Parts:
    """The parts of one feed axis."""

    motor: Motor = field(default_factory=Motor)
    coupling: Coupling = field(default_factory=Coupling)
    screw: Screw = field(default_factory=Screw)
    nut: Nut = field(default_factory=Nut)
    bearings: Bearings = field(default_factory=Bearings)
    guide: Guide = field(default_factory=Guide)
    table: Table = field(default_factory=Table)


def thc6350_x_axis() -> Parts:
    """Parts as an X axis of a horizontal machining centre with 500 mm pallet has them; F's own table is lost.

    The defaults of the parts, and 2 to 4 % of critical damping inside the springs, which F leaves out.
    """
    return Parts(screw=Screw(torsional_damping_nms_per_rad=0.3, axial_damping_ns_per_m=2e4))


def thc6350_servo() -> axis.Servo:
    """Continuous cascade control for `thc6350_x_axis`: Kv 40/s, velocity loop of about 40 Hz, limits of the motor."""
    return axis.Servo(40.0, 6.0, 300.0, **Motor().limits)


def _of_contact(part: Nut | Bearings) -> Iterator[Misfit]:
    if not 0.0 < part.contact_angle_deg < 90.0:
        yield _wrong(part.contact_angle_deg, "an angle between 0 and 90 degrees", "contact_angle_deg")
    if not 0.5 < part.conformity < 1.0:
        yield _wrong(part.conformity, "more than 0.5 and less than 1: groove radius / ball diameter", "conformity")
    if part.pitch_circle_mm <= 2.0 * part.ball_diameter_mm:
        yield _wrong(part.pitch_circle_mm, "more than two ball diameters", "pitch_circle_mm")
    if (part.rigidity_n_per_um is None) != (part.rigidity_preload_n is None):
        expected = "rigidity_n_per_um with rigidity_preload_n, the preload that it holds for"
        advice = "give both as the catalogue has them, or neither"
        yield "a rigidity or a preload alone", expected, "rigidity_n_per_um", advice


def _wrong(value: float, expected: str, key: str) -> Misfit:
    return f"{value:g}", expected, key, "correct this parameter"
