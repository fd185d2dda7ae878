"""A number of a model that could be fitted again: value, unit and bounds; where it stands in the plain values."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

from selector.errors import ModelFileError, OptionError
from selector.physics.model_text import Key


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


def require_settable(
    name: str, value: float, known: Sequence[str], bounds: Mapping[str, tuple[float, float]], model: str
) -> None:
    """Refuses a value for a name that no parameter of the model has, or outside the bounds that its file gives.

    Raises
    ------
    OptionError
        Which of the two, and what could be said instead.
    """
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


def bad_bounds(name: str, found: str, expected: str) -> ModelFileError:
    """The error for an entry of ``[bounds]`` that cannot be."""
    return ModelFileError(
        found,
        expected=expected,
        where=f"key bounds.{name}",
        advice="correct the name and the limits, or leave them out",
    )
