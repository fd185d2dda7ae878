"""A number of a model that could be fitted again: value, unit and bounds, where it stands, and whether it is usual."""

from __future__ import annotations

import copy
import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any, TypeVar

from selector.errors import ModelFileError, OptionError
from selector.findings import Finding, Where
from selector.physics.finding_table import FINDINGS
from selector.physics.model_text import Key, key_text, plain_values

_File = TypeVar("_File", bound=Any)


@dataclass(frozen=True)
class Parameter:
    """A number of a model: its value, its unit, and the bounds between which a fit may look for it."""

    value: float
    low: float
    high: float
    unit: str


def numbers_in(value: Any, path: Key) -> Iterator[Key]:
    """Places of all numbers inside plain values, below `path`."""
    if isinstance(value, Mapping):
        for key, inner in value.items():
            yield from numbers_in(inner, (*path, key))
    elif isinstance(value, list | tuple):
        for position, inner in enumerate(value):
            yield from numbers_in(inner, (*path, position))
    elif isinstance(value, int | float) and not isinstance(value, bool):
        yield path


def value_at(values: Any, path: Key) -> Any:
    """What stands at a place of plain values."""
    for part in path:
        values = values[part]
    return values


def put_at(values: Any, path: Key, number: float) -> None:
    """Sets a number; arrays on the way become lists, which can be changed, and sections that lack are made."""
    for part, following in pairwise(path):
        if isinstance(values, dict) and part not in values:
            values[part] = [] if isinstance(following, int) else {}
        if isinstance(values[part], tuple):
            values[part] = list(values[part])
        values = values[part]
    values[path[-1]] = number


@dataclass(frozen=True)
class Number:
    """A number of a model file that could be fitted again."""

    path: Key  #: Where it stands in the plain values of the file
    value: float
    #: low and high: Bounds of a fit, unless ``[bounds]`` of the file says otherwise
    low: float
    high: float
    unit: str
    name: str = ""  #: Default: the keys that lead to it, arrays counted from 1
    limits: tuple[float, float] = (-math.inf, math.inf)  #: What its key may have, which no bounds may pass

    @property
    def called(self) -> str:
        """Its name."""
        return self.name or ".".join(str(part + 1) if isinstance(part, int) else part for part in self.path)


def parameters_of(file: Any, numbers: Iterable[Number]) -> dict[str, Parameter]:
    """Name → parameter; ``[bounds]`` of the file goes before the bounds of a number.

    Raises ModelFileError: ``[bounds]`` names what is no parameter, excludes the value of one, or allows what its key
    does not.
    """
    found: dict[str, Parameter] = {}
    for one in numbers:
        least, most = one.limits
        around = max(min(one.low, one.value), least), min(max(one.high, one.value), most)
        low, high = file.bounds.get(one.called, around)
        if not low <= one.value <= high:
            raise _bad_bounds(one.called, f"[{low:g}, {high:g}]", f"limits around the value, {one.value:g}")
        if low < least or high > most:
            expected = f"limits between {least:g} and {most:g}, as its key has them"
            raise _bad_bounds(one.called, f"[{low:g}, {high:g}]", expected)
        found[one.called] = Parameter(one.value, low, high, one.unit)
    for name in file.bounds:
        if name not in found:
            raise _bad_bounds(name, "no parameter of this name", "one of " + ", ".join(list(found)[:12]) + ", …")
    return found


def file_with(
    file: _File,
    values: Mapping[str, float],
    numbers: Iterable[Number],
    checked: Callable[..., _File],
    plain: Mapping[str, Any] | None = None,
) -> _File:
    """The model file with other values of some parameters, checked as if it were read.

    `values` are by the names of the parameters, `checked` makes a file of plain values; `plain` are those of the file,
    if they are more than it says.

    Raises OptionError: there is no such parameter, or the value is outside the bounds that the file gives it. Raises
    ModelFileError: a value is impossible, e.g. a negative mass.
    """
    changed = copy.deepcopy(dict(plain_values(file) if plain is None else plain))
    paths = {one.called: one.path for one in numbers}
    for name, value in values.items():
        _require_settable(name, value, list(paths), file.bounds, file.model.name)
        put_at(changed, paths[name], float(value))
    return checked(changed, where=f"model {file.model.name!r}")


def _require_settable(
    name: str, value: float, known: Sequence[str], bounds: Mapping[str, tuple[float, float]], model: str
) -> None:
    """Refuses a value for a name that no parameter of the model has, or outside the bounds that its file gives."""
    if name not in known:
        raise OptionError(
            f"no parameter {name!r}",
            expected="one of " + ", ".join(known[:12]) + ", …",
            where=f"model {model!r}",
            advice="look the names up in `parameters`",
        )
    low, high = bounds.get(name, (-math.inf, math.inf))
    if value < low or value > high:
        raise OptionError(
            f"{name} = {value:g}",
            expected=f"{low:g} to {high:g}, its bounds in the model file",
            where=f"model {model!r}",
            advice="stay within the bounds, or widen them in the file",
        )


def _bad_bounds(name: str, found: str, expected: str) -> ModelFileError:
    """The error for an entry of ``[bounds]`` that cannot be."""
    return ModelFileError(
        found,
        expected=expected,
        where=f"key bounds.{name}",
        advice="correct the name and the limits, or leave them out",
    )


@dataclass(frozen=True)
class UsualRange:
    """Between which numbers machines lie, and in which units people think beside that of the key."""

    #: low and high: Least and most that is usual, in the unit of the key; 0 is always allowed: it switches something
    #: off
    low: float
    high: float
    units: Mapping[str, float]  #: Another unit → how many of the unit of the key it is; the likeliest first


def unlikely_numbers(
    values: Mapping[str, Any],
    usual: Mapping[str, UsualRange],
    unit_of_key: Callable[[str], str],
    channel_of: Callable[[Key], str | None] = lambda path: None,
) -> Iterator[Finding]:
    """Warnings on numbers of a model file that no machine has; each with the unit that was perhaps meant.

    `usual` is by section and key, as in ``probe.mass_kg``, or by a key of sections that the file names; `channel_of`
    gives the channel or axis that a place in the file is about, if it is about one.
    """
    for path in numbers_in(values, ()):
        names = [part for part in path if isinstance(part, str)]
        span = usual.get(".".join(names[-2:])) or usual.get(names[-1])
        value = float(value_at(values, path))
        if span is None or value == 0 or span.low <= abs(value) <= span.high:
            continue
        key, unit = key_text(path), unit_of_key(names[-1]).removeprefix("1")
        meant = next(
            (
                (name, value * times)
                for name, times in span.units.items()
                if span.low <= abs(value * times) <= span.high
            ),
            None,
        )
        most = f"up to {span.high:g}" if span.low == 0 else f"{span.low:g} to {span.high:g}"
        said = f"{key} is {value:.6g} {unit}".rstrip() + f"; machines have {most} {unit}".rstrip() + "."
        if meant is not None:
            said += f" {value:.6g} {meant[0]} would be {meant[1]:.6g} {unit}".rstrip() + "."
        yield FINDINGS.finding(
            "unlikely-value",
            said,
            Where(channel=channel_of(path)),
            evidence={"key": key, "value": value, "low": span.low, "high": span.high, "perhaps": meant and meant[1]},
            suggestion="correct it if it is a slip"
            if meant is None
            else f"write {key} = {meant[1]:.6g} if {meant[0]} was meant",
        )
