"""Which catalogue parts does a section of the model file describe; nothing about them is assumed in silence."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator, Mapping, Sequence, Set
from dataclasses import replace
from typing import Any, get_args, get_type_hints

from selector.errors import InputError
from selector.physics.drive.catalogue import Bearings, Coupling, Guide, Nut, Parts, Screw, thc6350_x_axis
from selector.physics.drive.model_schema import PartsSection
from selector.physics.model_text import Contradiction, Key
from selector.physics.model_values import given, refused

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

    Raises
    ------
    InputError
        A value cannot be; `where` is its field.
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
        try:
            _part(section, name)
        except InputError as error:
            yield refused(error, (*at, name), inside)


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
