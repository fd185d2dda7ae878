"""What may the model file of a feed drive say, and which axis does a section of it describe."""

import dataclasses
import math
from collections.abc import Iterator, Mapping, Sequence, Set
from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING, Annotated, Any, Literal, TypeAlias, get_args, get_type_hints

from pydantic import BeforeValidator, Discriminator, Field, StringConstraints, Tag

from selector.physics.drive.ball_bar.circle import PairGeometry
from selector.physics.drive.parts import catalogue
from selector.physics.drive.parts import stiffness as stiffnesses
from selector.physics.drive.parts.axis import (
    MOST_WAITING,
    Axis,
    Friction,
    Mechanics,
    RigidMechanics,
    Ripple,
    Sensing,
    Servo,
    ThreeMassMechanics,
    Transmission,
)
from selector.physics.drive.trajectory import ParameterCourse, Reference
from selector.physics.model_fields import SectionOf, Unit, Usual, entry_of, given, refusals, value_of
from selector.physics.model_text import (
    Bounds,
    Column,
    Contradiction,
    Entry,
    Key,
    Name,
    Note,
    Seed,
    Signed,
    by_kind,
    choice_tag,
    limited,
)

#: In recordings and columns: positions [m; rad], and what acts on an axis [N; unit of the control].
MOST_POSITION_M, MOST_ACTING = 1e4, 1e9
MOST_STEPS = 20_000_000  #: Steps of the calculation in one run of one axis; some ten seconds.
MOST_AXES = 6

if TYPE_CHECKING:
    RigidSection: TypeAlias = Entry
    RotarySection: TypeAlias = Entry
    ThreeMassSection: TypeAlias = Entry
    BallBarSection: TypeAlias = Entry
else:
    RigidSection, RotarySection = entry_of(RigidMechanics, called="rigid"), entry_of(RigidMechanics, called="rotary")
    ThreeMassSection = entry_of(ThreeMassMechanics, called="three-mass")
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

#: A number that holds for the whole run, steps [from second, value], or a column of a file.
Force = Annotated[
    Annotated[Signed, Tag(_NUMBER)]
    | Annotated[tuple[ForceStep, ...], Field(min_length=1, max_length=10_000), Tag(_STEPS)]
    | Annotated[Column, Tag(_COLUMN)],
    Discriminator(_force_kind),
    Unit("N"),
]


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
    motor: SectionOf[catalogue.Motor] = SectionOf[catalogue.Motor].model_construct()
    coupling: SectionOf[catalogue.Coupling] = SectionOf[catalogue.Coupling].model_construct()
    screw: SectionOf[catalogue.Screw] = SectionOf[catalogue.Screw].model_construct()
    nut: SectionOf[catalogue.Nut] = SectionOf[catalogue.Nut].model_construct()
    bearings: SectionOf[catalogue.Bearings] = SectionOf[catalogue.Bearings].model_construct()
    guide: SectionOf[catalogue.Guide] = SectionOf[catalogue.Guide].model_construct()
    table: SectionOf[catalogue.Table] = SectionOf[catalogue.Table].model_construct()


def _short_for(key: str) -> BeforeValidator:
    """``parts = "thc6350-x"`` is short for ``parts = { like = "thc6350-x" }``, whose `key` is like."""
    return BeforeValidator(lambda value: {key: value} if isinstance(value, str) else value)


class CourseSection(Entry):
    """``[axes.NAME.course]``: how stiffness and damping go along with the command, for ``varying = "command"``."""

    stiffness: Literal["two-sided", "published"] = "two-sided"
    damping: Literal["instant", "cycle", "vibration"] = "instant"
    reversal_speed_m_per_s: Annotated[float, limited(0, 100, above=True), Unit("m/s")] = 0.02


class AddedSection(Entry):
    """``[axes.NAME.recorded.added]``: what was added to the output of the control, behind it."""

    channel: Name
    factor: Signed = 1.0


class RecordedSection(Entry):
    """``[axes.NAME.recorded]``: channels of a recording that belong to this axis, where role and name do not tell."""

    command: Name | None = None
    position: Name | None = None
    table: Name | None = None
    output: Name | None = None
    added: Annotated[AddedSection | None, _short_for("channel")] = None
    total: Name | None = None
    force: Name | None = None
    load: Name | None = None


class AxisSection(Entry):
    """``[axes.NAME]``."""

    mechanics: MechanicsSection | None = None
    parts: Annotated[PartsSection | None, _short_for("like")] = None
    varying: Literal["constant", "command", "state"] | None = None
    course: CourseSection = CourseSection()
    friction: SectionOf[Friction] = SectionOf[Friction]()
    transmission: SectionOf[Transmission] = SectionOf[Transmission]()
    ripple: Annotated[tuple[SectionOf[Ripple], ...], Field(max_length=50)] = ()
    ripple_period: Above | None = None
    servo: SectionOf[Servo]
    sensing: SectionOf[Sensing] = SectionOf[Sensing]()
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

LIKE = {"thc6350-x": catalogue.thc6350_x_axis}  #: `like` of the file → parts that are known by a name.

#: Part → keys that no catalogue prints → what switches them off; left out without `like` they are that.
OFF: Mapping[Any, Mapping[str, float]] = {
    catalogue.Screw: {"damping_nms_per_rad": 0.0},
    catalogue.Nut: {"efficiency": 1.0},
    catalogue.Bearings: {"rigidity_share": 1.0},
    catalogue.Guide: {"viscous_ns_per_m": 0.0},
}

_OF_HERTZ = frozenset({"ball_diameter_mm", "pitch_circle_mm", "contact_angle_deg", "conformity"})

#: Part → key → keys that count for nothing where it is said, and are not asked for.
INSTEAD: Mapping[Any, Mapping[str, frozenset[str]]] = {
    catalogue.Coupling: {"stiffness_nm_per_rad": frozenset({"diameter_mm", "length_mm", "shear_modulus_gpa"})},
    catalogue.Screw: {"inertia_kg_m2": frozenset({"density_kg_per_m3"})},
    catalogue.Nut: {"rigidity_n_per_um": _OF_HERTZ | {"turns"}},
    catalogue.Bearings: {"rigidity_n_per_um": _OF_HERTZ | {"balls", "per_direction"}},
}

_KINDS: dict[str, Any] = get_type_hints(catalogue.Parts)


def parts_of(section: PartsSection) -> catalogue.Parts:
    """The parts: those of `like` with what is said here, or all of them said here.

    Keys that are left out without `like` are off: 0, or none. Those that another key takes the place of have the
    default of the part, which counts for nothing.

    InputError: a value cannot be; `where` is its field.
    """
    return catalogue.Parts(**{name: _part(section, name) for name in _KINDS})


def parts_contradictions(at: Key, section: PartsSection) -> Iterator[Contradiction]:
    """Keys that lack, all of a part at once, and values that cannot be, in ``[axes.NAME.parts]``."""
    for name, kind in _KINDS.items():
        inside = getattr(section, name)
        lacking = _lacking(kind, inside.model_fields_set) if section.like is None else []
        if lacking:
            one = len(lacking) == 1
            found = f"no {', '.join(repr(key) for key in lacking)}"
            key = (*at, name, lacking[0]) if one else (*at, name)
            yield key, found, "this key" if one else "these keys", _advice(kind, lacking)
            return
        yield from refusals(partial(_part, section, name), (*at, name), inside)


def _lacking(kind: Any, said: Set[str]) -> list[str]:
    """Keys of a part that are neither said, nor off, nor spared by another one."""
    spared = {key for instead, keys in INSTEAD.get(kind, {}).items() if instead in said for key in keys}
    needless = spared | said | _off(kind).keys()
    return [field.name for field in dataclasses.fields(kind) if field.name not in needless]


def _advice(kind: Any, lacking: Sequence[str]) -> str:
    them = "it" if len(lacking) == 1 else "them"
    advice = f"add {them} as the catalogue has {them}"
    for instead, keys in INSTEAD.get(kind, {}).items():
        spared = [key for key in lacking if key in keys]
        if spared:
            advice += f"; {instead} takes the place of {', '.join(spared)}"
    return f'{advice}; or say like = "thc6350-x" for documented values'


def _part(section: PartsSection, name: str) -> Any:
    kind = _KINDS[name]
    said = given(kind, getattr(section, name))
    return kind(**(_off(kind) | said)) if section.like is None else replace(getattr(LIKE[section.like](), name), **said)


def _off(kind: Any) -> dict[str, Any]:
    """Fields that may be none, whose default is 0, or that no catalogue prints, switched off."""
    hints = get_type_hints(kind)
    off: dict[str, Any] = dict(OFF.get(kind, {}))
    for field in dataclasses.fields(kind):
        if type(None) in get_args(hints[field.name]):
            off[field.name] = None
        elif field.default == 0:
            off[field.name] = field.default
    return off


_VALUES: dict[str, type] = {"friction": Friction, "transmission": Transmission, "servo": Servo, "sensing": Sensing}


@dataclass(frozen=True)
class FileAxis:
    """An axis of a model file."""

    axis: Axis  #: Its values
    parts: catalogue.Parts | None  #: What it is built from, where the file says so
    section: AxisSection  #: Its section of the file

    @property
    def rotary(self) -> bool:
        """Whether it turns: rad, kg·m² and N·m in the place of m, kg and N."""
        return is_rotary(self.section)

    def course(self, reference: Reference) -> ParameterCourse | None:
        """Stiffness and damping along a reference, with ``varying = "command"``; else None.

        InputError: the reference moves the nut off the screw.
        """
        if self.parts is None or self.section.varying != "command":
            return None
        return stiffnesses.parameter_course(self.parts, reference, **dict(self.section.course))


def is_rotary(section: AxisSection) -> bool:
    """Whether the axis turns: rad, kg·m² and N·m in the place of m, kg and N."""
    return getattr(section.mechanics, "kind", None) == "rotary"


def file_axis(section: AxisSection) -> FileAxis:
    """The axis of a section.

    With parts, mechanics, friction and what the motor can give come from them; keys of `friction` and `servo` that are
    said count more.

    InputError: a value cannot be, or two do not fit together.
    """
    parts = None if section.parts is None else parts_of(section.parts)
    # along the command dry friction is part of the damping
    own = Friction() if parts is None or section.varying == "command" else stiffnesses.dry_friction(parts)
    axis = Axis(
        mechanics=_mechanics(section, parts),
        friction=replace(own, **given(Friction, section.friction)),
        servo=Servo(**(({} if parts is None else parts.motor.limits) | given(Servo, section.servo))),
        transmission=value_of(Transmission, section.transmission),
        sensing=value_of(Sensing, section.sensing),
        ripple=tuple(value_of(Ripple, one) for one in section.ripple),
        ripple_period=section.ripple_period or 2.0 * math.pi,
        compliance=stiffnesses.axial_compliance(parts) if parts is not None and section.varying == "state" else None,
    )
    return FileAxis(axis, parts, section)


def axis_contradictions(name: str, section: AxisSection) -> Iterator[Contradiction]:
    """What cannot be, or does not fit together, in ``[axes.NAME]``."""
    at: Key = ("axes", name)
    wrong = [*_of_structure(at, section), *_refused(at, section)]
    yield from wrong or _misfits(at, section)


def _mechanics(section: AxisSection, parts: catalogue.Parts | None) -> Mechanics:
    if parts is not None:
        return stiffnesses.three_mass_mechanics(parts)
    if section.mechanics is None:
        raise ValueError("an axis without mechanics and parts, which the file's contradictions tell")
    if getattr(section.mechanics, "kind", None) == "three-mass":
        return value_of(ThreeMassMechanics, section.mechanics)
    return value_of(RigidMechanics, section.mechanics)


def _of_structure(at: Key, section: AxisSection) -> Iterator[Contradiction]:
    if (section.mechanics is None) == (section.parts is None):
        found = "neither mechanics nor parts" if section.parts is None else "mechanics and parts"
        advice = "describe the masses under mechanics, or the catalogue parts under parts"
        yield at, found, "one of them", advice
    if section.parts is None:
        for key in ("varying", "course"):
            if key in section.model_fields_set:
                yield (*at, key), f"{key} without parts", "parts, which say how", "leave it out, or give the parts"
    elif section.varying is None:
        advice = 'add varying = "constant", "command" (F\'s time-varying model) or "state" (the spring itself)'
        yield (*at, "varying"), "no 'varying'", "this key, which parts need", advice
    elif section.varying != "command" and "course" in section.model_fields_set:
        yield (*at, "course"), f'varying = "{section.varying}"', 'varying = "command"', "leave the section out"


def _refused(at: Key, section: AxisSection) -> Iterator[Contradiction]:
    if section.parts is not None:
        yield from parts_contradictions((*at, "parts"), section.parts)
    elif section.mechanics is not None:
        yield from refusals(partial(_mechanics, section, None), (*at, "mechanics"), section.mechanics)
    for name, kind in _VALUES.items():
        said: Entry = getattr(section, name)
        yield from refusals(partial(value_of, kind, said), (*at, name), said)
    for number, ripple in enumerate(section.ripple):
        yield from refusals(partial(value_of, Ripple, ripple), (*at, "ripple", number), ripple)


def _misfits(at: Key, section: AxisSection) -> Iterator[Contradiction]:
    friction, servo = value_of(Friction, section.friction), value_of(Servo, section.servo)
    if section.varying == "command":
        advice = 'leave it out, or say varying = "state", where friction is dry'
        for key in ("coulomb_n", "coulomb_negative_n", "static_n", "static_negative_n", "lugre"):
            if getattr(friction, key):
                yield (*at, "friction", key), "friction of the guide twice", "that of the parts alone", advice
    if servo.sample_s > 0 and servo.delay_s > MOST_WAITING * servo.sample_s:
        found = f"{servo.delay_s / servo.sample_s:.6g} samples of the control"
        expected = f"a delay of at most {MOST_WAITING} of them, {MOST_WAITING * servo.sample_s:.6g} s here"
        yield (*at, "servo", "delay_s"), found, expected, "correct delay_s or sample_s, both in seconds"
    yield from refusals(partial(file_axis, section), at, section)
