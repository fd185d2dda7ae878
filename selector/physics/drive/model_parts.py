"""Which catalogue parts does a section of the model file describe; nothing about them is assumed in silence."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator
from dataclasses import replace
from typing import Any, get_args, get_type_hints

from selector.errors import InputError
from selector.physics.drive.catalogue import Parts, thc6350_x_axis
from selector.physics.drive.model_schema import PartsSection
from selector.physics.model_text import Contradiction, Key
from selector.physics.model_values import given, refused

LIKE = {"thc6350-x": thc6350_x_axis}
"""`like` of the file → parts that are known by a name."""

_KINDS: dict[str, Any] = get_type_hints(Parts)


def parts_of(section: PartsSection) -> Parts:
    """The parts: those of `like` with what is said here, or all of them said here.

    Keys that are left out without `like` are off: 0, or none.

    Raises
    ------
    InputError
        A value cannot be; `where` is its field.
    """
    return Parts(**{name: _part(section, name) for name in _KINDS})


def parts_contradictions(at: Key, section: PartsSection) -> Iterator[Contradiction]:
    """Keys that lack, and values that cannot be, in ``[axes.NAME.parts]``."""
    for name, kind in _KINDS.items():
        inside = getattr(section, name)
        off = _off(kind)
        lacking = [f.name for f in dataclasses.fields(kind) if f.name not in off.keys() | inside.model_fields_set]
        if section.like is None and lacking:
            advice = 'add it as the catalogue has it, or say like = "thc6350-x" for documented values'
            yield (*at, name, lacking[0]), f"no {lacking[0]!r}", "this key", advice
            return
        try:
            _part(section, name)
        except InputError as error:
            yield refused(error, (*at, name), inside)


def _part(section: PartsSection, name: str) -> Any:
    kind = _KINDS[name]
    said = given(kind, getattr(section, name))
    return kind(**(_off(kind) | said)) if section.like is None else replace(getattr(LIKE[section.like](), name), **said)


def _off(kind: Any) -> dict[str, Any]:
    """Fields that may be none, or whose default is 0, as that."""
    hints = get_type_hints(kind)
    return {
        field.name: None if type(None) in get_args(hints[field.name]) else field.default
        for field in dataclasses.fields(kind)
        if type(None) in get_args(hints[field.name]) or field.default == 0
    }
