"""What stands at a field of a model file: its unit, where a fit may look for it, what machines have.

A field says it once, as in ``mass_kg: Annotated[float, limited(1e-6, 1e6), Unit("kg"), Fit(), Usual(0.1, 1e4)]``;
parameters, their bounds, warnings about slips and the reference page come from there.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any, get_args, get_origin, get_type_hints

from pydantic import BaseModel
from pydantic.fields import FieldInfo

from selector.findings import Finding
from selector.physics.model_parameters import Number, UsualRange, unlikely_numbers
from selector.physics.model_text import Entry, Key, plain_values

_TIMES = 10.0


@dataclass(frozen=True)
class Unit:
    """The unit of a number."""

    text: str

    def __get_pydantic_json_schema__(self, core_schema: Any, handler: Any) -> dict[str, Any]:
        """The schema of the number, with its unit."""
        return {**handler(core_schema), "unit": self.text}


@dataclass(frozen=True)
class Limits:
    """What a file may say: the least size of what is not 0, and the most."""

    least: float
    most: float


@dataclass(frozen=True)
class Fit:
    """That a fit may look for a number, and where: a tenth to ten times its value unless said otherwise."""

    low: float | None = None  #: Least, whatever the value is
    high: float | None = None  #: Most, whatever the value is
    up_to: float | None = None  #: The number may be 0, which switches something off; how far at least it may go up
    either_sign: float | None = None  #: The number may have either sign; how far at least it may go
    at_zero: float | None = None  #: How far a number may go that is 0, in place of a tenth to ten times
    around: float | None = None  #: How far to both sides, in place of a tenth to ten times

    def bounds(self, value: float) -> tuple[float, float]:
        """Lower and upper bound, always around the value."""
        low, high = sorted((value / _TIMES, value * _TIMES))
        if self.around is not None:
            low, high = value - self.around, value + self.around
        if self.up_to is not None:
            low, high = 0.0, max(self.up_to, _TIMES * value)
        if self.either_sign is not None:
            high = max(self.either_sign, _TIMES * abs(value))
            low = -high
        if value == 0.0 and self.at_zero is not None:
            low, high = (0.0 if self.either_sign is None else -self.at_zero), self.at_zero
        low, high = (low if self.low is None else self.low), (high if self.high is None else self.high)
        return min(low, value), max(high, value)


@dataclass(frozen=True)
class Usual:
    """Between which numbers machines lie, and units that are easily taken for that of the key."""

    low: float
    high: float
    units: Mapping[str, float] = field(
        default_factory=dict, hash=False
    )  #: Another unit → how many of the unit of the key it is


def numbers_of(value: Any, path: Key = (), said: Iterable[Any] = ()) -> Iterator[Number]:
    """Every number in a model file, a part of it or a dataclass that says where a fit may look for it.

    `said` stands at the value itself, if it is not a section.
    """
    if isinstance(value, BaseModel) or dataclasses.is_dataclass(value):
        for name, inner, told in _members(value):
            yield from numbers_of(inner, (*path, name), told)
    elif isinstance(value, Mapping):
        for key, inner in value.items():
            yield from numbers_of(inner, (*path, key), said)
    elif isinstance(value, tuple | list):
        for position, inner in enumerate(value):
            yield from numbers_of(inner, (*path, position), said)
    elif isinstance(value, float | int):
        for fit in (one for one in said if isinstance(one, Fit)):
            yield Number(path, float(value), *fit.bounds(float(value)), unit_in(said))


def unit_in(said: Iterable[Any]) -> str:
    """The unit among what a field says; "1" if none."""
    return next((one.text for one in said if isinstance(one, Unit)), "1")


def _members(section: Any) -> Iterator[tuple[str, Any, tuple[Any, ...]]]:
    """(name, value, what is said) of every field."""
    if isinstance(section, BaseModel):
        for name, told in type(section).model_fields.items():
            yield name, getattr(section, name), said_of(told)
        return
    for name, hint in get_type_hints(type(section), include_extras=True).items():
        yield name, getattr(section, name), _said_in(hint)


def unlikely_values(file: Entry, channel_of: Callable[[Key], str | None] = lambda path: None) -> Iterator[Finding]:
    """Warnings on numbers of a model file that no machine has; each with the unit that was perhaps meant."""
    usual: dict[str, UsualRange] = {}
    units: dict[str, str] = {}
    for section, name, told in _fields(type(file)):
        said = said_of(told)
        units[name] = unit_in(said)
        range_ = next((one for one in said if isinstance(one, Usual)), None)
        if range_ is not None:
            usual[f"{section}.{name}" if section else name] = UsualRange(range_.low, range_.high, range_.units)
    yield from unlikely_numbers(plain_values(file), usual, lambda key: units.get(key, "1"), channel_of)


def _fields(schema: type[BaseModel], section: str = "") -> Iterator[tuple[str, str, Any]]:
    """(key of the section, empty if the file names it, key, field) of everything in a schema."""
    for name, told in schema.model_fields.items():
        yield section, name, told
        for inner in _schemas_in(told.annotation):
            yield from _fields(inner, "" if get_origin(told.annotation) is dict else name)


def _schemas_in(annotation: Any) -> Iterator[type[BaseModel]]:
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        yield annotation
    for inner in get_args(annotation):
        yield from _schemas_in(inner)


def said_of(told: FieldInfo) -> tuple[Any, ...]:
    """All that is said at a field of a schema, also where it may be left out."""
    return (*told.metadata, *_said_in(told.annotation))


def _said_in(hint: Any) -> tuple[Any, ...]:
    inside = (one for inner in get_args(hint) for one in getattr(inner, "__metadata__", ()))
    return (*getattr(hint, "__metadata__", ()), *inside)
