"""Which keys may the model file of a feed drive have, and between which numbers do they lie."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Annotated, Any, Literal, TypeAlias

from pydantic import BeforeValidator, Discriminator, Field, StringConstraints, Tag

from selector.physics.drive.ball_bar.circle import PairGeometry
from selector.physics.drive.parts.axis import Sensing, Servo
from selector.physics.drive.parts.catalogue import Bearings, Coupling, Guide, Motor, Nut, Screw, Table
from selector.physics.drive.parts.mechanics import Friction, RigidMechanics, Ripple, ThreeMassMechanics, Transmission
from selector.physics.model_fields import Unit, Usual
from selector.physics.model_text import (
    Bounds,
    Column,
    Entry,
    Name,
    Note,
    Seed,
    Signed,
    by_kind,
    choice_tag,
    limited,
)
from selector.physics.model_values import entry_of

MOST_POSITION_M, MOST_ACTING = 1e4, 1e9
"""In recordings and columns: positions [m; rad], and what acts on an axis [N; unit of the control]."""

MOST_STEPS = 20_000_000
"""Steps of the calculation in one run of one axis; some ten seconds."""

MOST_AXES = 6

if TYPE_CHECKING:
    FrictionSection: TypeAlias = Entry
    RippleSection: TypeAlias = Entry
    TransmissionSection: TypeAlias = Entry
    ServoSection: TypeAlias = Entry
    SensingSection: TypeAlias = Entry
    RigidSection: TypeAlias = Entry
    RotarySection: TypeAlias = Entry
    ThreeMassSection: TypeAlias = Entry
    MotorSection: TypeAlias = Entry
    CouplingSection: TypeAlias = Entry
    ScrewSection: TypeAlias = Entry
    NutSection: TypeAlias = Entry
    BearingsSection: TypeAlias = Entry
    GuideSection: TypeAlias = Entry
    TableSection: TypeAlias = Entry
    BallBarSection: TypeAlias = Entry
else:
    FrictionSection, RippleSection, TransmissionSection = entry_of(Friction), entry_of(Ripple), entry_of(Transmission)
    ServoSection, SensingSection = entry_of(Servo), entry_of(Sensing)
    RigidSection, RotarySection = entry_of(RigidMechanics, called="rigid"), entry_of(RigidMechanics, called="rotary")
    ThreeMassSection = entry_of(ThreeMassMechanics, called="three-mass")
    MotorSection, CouplingSection, ScrewSection = entry_of(Motor), entry_of(Coupling), entry_of(Screw)
    NutSection, BearingsSection = entry_of(Nut), entry_of(Bearings)
    GuideSection, TableSection = entry_of(Guide), entry_of(Table)
    BallBarSection = entry_of(PairGeometry, noise_um=(Annotated[float, limited(0, 1e4), Unit("µm")], 0.0))

AxisName = Annotated[str, StringConstraints(pattern=r"^[A-Za-z][A-Za-z0-9_]{0,15}$")]
Length = Annotated[float, limited(-1e5, 1e5), Unit("mm")]
Above = Annotated[float, limited(0, 1e6, above=True)]
Feed = Annotated[Above, Unit("mm/min")]
Degrees = Annotated[float, limited(-360, 360), Unit("°")]


ForceStep = tuple[Annotated[float, limited(0, 1e9)], Signed]


def _force_kind(value: Any) -> str:
    if isinstance(value, list | tuple):
        return _STEPS
    return _COLUMN if isinstance(value, Column | Mapping) else _NUMBER


_NUMBER, _STEPS, _COLUMN = (choice_tag(form) for form in ("number", "steps", "column"))

Force = Annotated[
    Annotated[Signed, Tag(_NUMBER)]
    | Annotated[tuple[ForceStep, ...], Field(min_length=1, max_length=10_000), Tag(_STEPS)]
    | Annotated[Column, Tag(_COLUMN)],
    Discriminator(_force_kind),
    Unit("N"),
]
"""A number that holds for the whole run, steps [from second, value], or a column of a file."""


class SineMotion(Entry):
    """``[motion]`` with ``kind = "sine"``: centre + amplitude·sin(2πft + phase)."""

    kind: Literal["sine"]
    axis: AxisName | None = None
    amplitude_mm: Annotated[float, limited(0, 1e5, above=True), Unit("mm")]
    frequency_hz: Annotated[float, limited(1e-6, 1e5), Unit("Hz")]
    duration_s: Annotated[Above, Unit("s")]
    centre_mm: Length = 0.0
    phase_deg: Degrees = 0.0
    force_n: Force = 0.0


class MovesMotion(Entry):
    """``[motion]`` with ``kind = "moves"``: from rest to rest, as fast as the limits allow."""

    kind: Literal["moves"]
    axis: AxisName | None = None
    targets_mm: Annotated[tuple[Length, ...], Field(min_length=1, max_length=10_000)]
    feed_mm_per_min: Feed
    acceleration_m_per_s2: Annotated[Above, Unit("m/s²"), Usual(1e-3, 200.0, {"mm/s²": 1e-3})]
    jerk_m_per_s3: (
        Annotated[float, limited(0, 1e9, above=True), Unit("m/s³"), Usual(1e-3, 1e5, {"mm/s³": 1e-3})] | None
    ) = None
    dwell_s: Annotated[float, limited(0, 1e6), Unit("s")] = 0.0
    start_mm: Length = 0.0
    repeat: Annotated[int, Field(strict=True, ge=1, le=10_000)] = 1
    force_n: Force = 0.0


class ColumnMotion(Entry):
    """``[motion]`` with ``kind = "column"``: positions from a recording in the folder of the model file."""

    kind: Literal["column"]
    axis: AxisName | None = None
    file: Name
    column: Annotated[str, Field(min_length=1, max_length=200)]
    unit: Literal["m", "mm", "um"] | None = None
    force_n: Force = 0.0


class TableBallSection(Entry):
    """``[motion.table_ball]``: where the ball of the workpiece stands on a rotary table."""

    distance_mm: Annotated[float, limited(0, 1e5), Unit("mm")]
    angle_deg: Degrees = -90.0
    ratio: Annotated[float, limited(-100, 100)] = 1.0


class CircleMotion(Entry):
    """``[motion]`` with ``kind = "circle"``: a ball-bar test, both directions at every feed."""

    kind: Literal["circle"]
    axes: Annotated[tuple[AxisName, ...], Field(min_length=2, max_length=3)] = ("X", "Y")
    radius_mm: Annotated[Above, Unit("mm")] = 100.0
    feeds_mm_per_min: Annotated[tuple[Feed, ...], Field(min_length=1, max_length=20)] = (100.0, 1000.0, 3000.0, 5000.0)
    centre_mm: Annotated[tuple[Length, Length], Field()] = (0.0, 0.0)
    start_angle_deg: Degrees = 0.0
    overshoot_deg: Annotated[float, limited(0, 360, above=True), Unit("°")] = 45.0
    table_ball: TableBallSection | None = None


MechanicsSection = Annotated[
    Annotated[RigidSection, Tag(choice_tag("rigid"))]
    | Annotated[RotarySection, Tag(choice_tag("rotary"))]
    | Annotated[ThreeMassSection, Tag(choice_tag("three-mass"))],
    by_kind("rigid", "rotary", "three-mass"),
]
MotionSection = Annotated[
    Annotated[SineMotion, Tag(choice_tag("sine"))]
    | Annotated[MovesMotion, Tag(choice_tag("moves"))]
    | Annotated[ColumnMotion, Tag(choice_tag("column"))]
    | Annotated[CircleMotion, Tag(choice_tag("circle"))],
    by_kind("sine", "moves", "column", "circle"),
]


class ModelSection(Entry):
    """``[model]``."""

    kind: Literal["drive"]
    name: Name
    note: Note = ""


class RunSection(Entry):
    """``[run]``: how often, how finely, with which noise."""

    period_s: Annotated[float, limited(1e-6, 1e3), Unit("s")] | None = None
    step_s: Annotated[float, limited(1e-8, 1e3), Unit("s")] | None = None
    seed: Seed = 0


class PartsSection(Entry):
    """``[axes.NAME.parts]``: what the axis is built from, all of it said here, or where it differs from `like`."""

    like: Literal["thc6350-x"] | None = None
    motor: MotorSection = MotorSection.model_construct()
    coupling: CouplingSection = CouplingSection.model_construct()
    screw: ScrewSection = ScrewSection.model_construct()
    nut: NutSection = NutSection.model_construct()
    bearings: BearingsSection = BearingsSection.model_construct()
    guide: GuideSection = GuideSection.model_construct()
    table: TableSection = TableSection.model_construct()


def _named_parts(value: Any) -> Any:
    """``parts = "thc6350-x"`` is short for ``parts = { like = "thc6350-x" }``."""
    return {"like": value} if isinstance(value, str) else value


class CourseSection(Entry):
    """``[axes.NAME.course]``: how stiffness and damping go along with the command, for ``varying = "command"``."""

    stiffness: Literal["two-sided", "published"] = "two-sided"
    damping: Literal["instant", "cycle", "vibration"] = "instant"
    reversal_speed_m_per_s: Annotated[float, limited(0, 100, above=True), Unit("m/s")] = 0.02


class AddedSection(Entry):
    """``[axes.NAME.recorded.added]``: what was added to the output of the control, behind it."""

    channel: Name
    factor: Signed = 1.0


def _named_channel(value: Any) -> Any:
    """``added = "pulse"`` is short for ``added = { channel = "pulse" }``."""
    return {"channel": value} if isinstance(value, str) else value


class RecordedSection(Entry):
    """``[axes.NAME.recorded]``: channels of a recording that belong to this axis, where role and name do not tell."""

    command: Name | None = None
    position: Name | None = None
    table: Name | None = None
    output: Name | None = None
    added: Annotated[AddedSection | None, BeforeValidator(_named_channel)] = None
    total: Name | None = None
    force: Name | None = None
    load: Name | None = None


class AxisSection(Entry):
    """``[axes.NAME]``."""

    mechanics: MechanicsSection | None = None
    parts: Annotated[PartsSection | None, BeforeValidator(_named_parts)] = None
    varying: Literal["constant", "command", "state"] | None = None
    course: CourseSection = CourseSection()
    friction: FrictionSection = FrictionSection()
    transmission: TransmissionSection = TransmissionSection()
    ripple: Annotated[tuple[RippleSection, ...], Field(max_length=50)] = ()
    ripple_period: Above | None = None
    servo: ServoSection
    sensing: SensingSection = SensingSection()
    output: Literal["current", "voltage", "force", "number"] = "current"
    recorded: RecordedSection = RecordedSection()


class DriveFile(Entry):
    """A feed drive: its axes and what they are asked to do."""

    model: ModelSection
    run: RunSection = RunSection()
    motion: MotionSection
    axes: Annotated[dict[AxisName, AxisSection], Field(min_length=1, max_length=MOST_AXES)]
    ball_bar: BallBarSection | None = None
    bounds: Bounds = Field(default_factory=dict)


KINDS: Mapping[str, type[DriveFile]] = {"drive": DriveFile}
