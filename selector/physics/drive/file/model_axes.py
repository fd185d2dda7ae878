"""Which axis does a section of the model file describe, from masses and springs or from catalogue parts."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterator, Mapping, Sequence, Set
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, get_args, get_type_hints

from selector.physics.drive.file.model_schema import AxisSection, PartsSection
from selector.physics.drive.motion import ParameterCourse, Reference
from selector.physics.drive.parts.axis import MOST_WAITING, Axis, Sensing, Servo
from selector.physics.drive.parts.catalogue import Bearings, Coupling, Guide, Nut, Parts, Screw, thc6350_x_axis
from selector.physics.drive.parts.damping import dry_friction, parameter_course
from selector.physics.drive.parts.mechanics import (
    Friction,
    Mechanics,
    RigidMechanics,
    Ripple,
    ThreeMassMechanics,
    Transmission,
)
from selector.physics.drive.parts.stiffness import axial_compliance, three_mass_mechanics
from selector.physics.model_text import Contradiction, Entry, Key
from selector.physics.model_values import given, refusals, value_of

LIKE = {"thc6350-x": thc6350_x_axis}
"""`like` of the file → parts that are known by a name."""

OFF: Mapping[Any, Mapping[str, float]] = {
    Screw: {"damping_nms_per_rad": 0.0},
    Bearings: {"rigidity_share": 1.0},
    Guide: {"viscous_ns_per_m": 0.0},
}
"""Part → keys that no catalogue prints → what switches them off; left out without `like` they are that."""

_OF_HERTZ = frozenset({"ball_diameter_mm", "pitch_circle_mm", "contact_angle_deg", "conformity"})

INSTEAD: Mapping[Any, Mapping[str, frozenset[str]]] = {
    Coupling: {"stiffness_nm_per_rad": frozenset({"diameter_mm", "length_mm", "shear_modulus_gpa"})},
    Screw: {"inertia_kg_m2": frozenset({"density_kg_per_m3"})},
    Nut: {"rigidity_n_per_um": _OF_HERTZ | {"turns"}},
    Bearings: {"rigidity_n_per_um": _OF_HERTZ | {"balls", "per_direction"}},
}
"""Part → key → keys that count for nothing where it is said, and are not asked for."""

_KINDS: dict[str, Any] = get_type_hints(Parts)


def parts_of(section: PartsSection) -> Parts:
    """The parts: those of `like` with what is said here, or all of them said here.

    Keys that are left out without `like` are off: 0, or none. Those that another key takes the place of have the
    default of the part, which counts for nothing.

    InputError: a value cannot be; `where` is its field.
    """
    return Parts(**{name: _part(section, name) for name in _KINDS})


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
    parts: Parts | None  #: What it is built from, where the file says so
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
        asked = self.section.course
        return parameter_course(
            self.parts,
            reference,
            stiffness=asked.stiffness,
            damping=asked.damping,
            reversal_speed_m_per_s=asked.reversal_speed_m_per_s,
        )


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
    axis = Axis(
        mechanics=_mechanics(section, parts),
        friction=replace(_friction_of_parts(section, parts), **given(Friction, section.friction)),
        servo=Servo(**(_servo_of_parts(parts) | given(Servo, section.servo))),
        transmission=value_of(Transmission, section.transmission),
        sensing=value_of(Sensing, section.sensing),
        ripple=tuple(value_of(Ripple, one) for one in section.ripple),
        ripple_period=section.ripple_period or 2.0 * math.pi,
        compliance=axial_compliance(parts) if parts is not None and section.varying == "state" else None,
    )
    return FileAxis(axis, parts, section)


def axis_contradictions(name: str, section: AxisSection) -> Iterator[Contradiction]:
    """What cannot be, or does not fit together, in ``[axes.NAME]``."""
    at: Key = ("axes", name)
    wrong = [*_of_structure(at, section), *_refused(at, section)]
    yield from wrong or _misfits(at, section)


def _mechanics(section: AxisSection, parts: Parts | None) -> Mechanics:
    if parts is not None:
        return three_mass_mechanics(parts)
    if section.mechanics is None:
        raise ValueError("an axis without mechanics and parts, which the file's contradictions tell")
    if getattr(section.mechanics, "kind", None) == "three-mass":
        return value_of(ThreeMassMechanics, section.mechanics)
    return value_of(RigidMechanics, section.mechanics)


def _friction_of_parts(section: AxisSection, parts: Parts | None) -> Friction:
    # along the command dry friction is part of the damping
    return Friction() if parts is None or section.varying == "command" else dry_friction(parts)


def _servo_of_parts(parts: Parts | None) -> dict[str, Any]:
    if parts is None:
        return {}
    motor = parts.motor
    return {
        "actuator_gain": motor.torque_constant_nm_per_a,
        "command_limit": motor.peak_torque_nm / motor.torque_constant_nm_per_a,
        "speed_limit": motor.top_speed_rpm * math.pi / 30.0,
    }


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
    friction, transmission = value_of(Friction, section.friction), value_of(Transmission, section.transmission)
    servo, sensing = value_of(Servo, section.servo), value_of(Sensing, section.sensing)
    if section.parts is None and getattr(section.mechanics, "kind", None) != "three-mass":
        advice = 'describe motor, screw and table (mechanics.kind = "three-mass", or parts), or leave this key out'
        for part, key, value in (
            ("transmission", "backlash_m", transmission.backlash_m),
            ("friction", "screw_coulomb_nm", friction.screw_coulomb_nm),
        ):
            if value > 0:
                yield (*at, part, key), f"{value:g} in an axis of one mass", "0, or an axis of three masses", advice
    if section.varying == "command":
        advice = 'leave it out, or say varying = "state", where friction is dry'
        for key in ("coulomb_n", "coulomb_negative_n", "static_n", "static_negative_n", "lugre"):
            if getattr(friction, key):
                yield (*at, "friction", key), "friction of the guide twice", "that of the parts alone", advice
    if servo.sample_s > 0 and servo.delay_s > MOST_WAITING * servo.sample_s:
        found = f"{servo.delay_s / servo.sample_s:.6g} samples of the control"
        expected = f"a delay of at most {MOST_WAITING} of them, {MOST_WAITING * servo.sample_s:.6g} s here"
        yield (*at, "servo", "delay_s"), found, expected, "correct delay_s or sample_s, both in seconds"
    if servo.sample_s == 0:
        advice = "give servo.sample_s, the period of the control in seconds, or leave this key out"
        if servo.delay_s > 0:
            yield (*at, "servo", "delay_s"), "a delay in a continuous control", "a sampled control", advice
        if sensing != Sensing():
            found = f"{', '.join(sorted(section.sensing.model_fields_set))} in a continuous control"
            yield (*at, "sensing"), found, "a sampled control", advice
    yield from refusals(partial(file_axis, section), at, section)
