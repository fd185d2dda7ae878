"""Numbers that cannot be: refused with their name and place."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager

import numpy as np
from numpy.typing import NDArray

from selector.errors import InputError


def require_positive(values: object, *names: str) -> None:
    """Raises InputError, naming the first of these fields that is not above 0; None is allowed."""
    _require(values, names, lambda value: value > 0, "a number above 0")


def require_not_negative(values: object, *names: str) -> None:
    """Raises InputError, naming the first of these fields that is not 0 or more; None is allowed."""
    _require(values, names, lambda value: value >= 0, "0 or more")


def require_finite(values: object, *names: str) -> None:
    """Raises InputError, naming the first of these fields that is not finite; None is allowed."""
    _require(values, names, lambda value: True, "a finite number")


def _require(values: object, names: Iterable[str], fits: Callable[[float], bool], expected: str) -> None:
    for name in names:
        value = getattr(values, name)
        if value is not None and not (math.isfinite(value) and fits(value)):
            raise InputError(f"{value:g}", expected=expected, where=name, advice="correct this parameter")


def keep_arrays(values: object, *names: str) -> None:
    """Makes these fields of a frozen dataclass arrays of float64 that nobody can change; None stays."""
    for name in names:
        if getattr(values, name) is not None:
            array = np.array(getattr(values, name), dtype=np.float64)
            array.setflags(write=False)
            object.__setattr__(values, name, array)


@contextmanager
def told_of(what: str, *, of_keys: bool = False) -> Iterator[None]:
    """Errors inside say `what` they are about, an axis or a run; with `of_keys` also those of keys of the file."""
    try:
        yield
    except InputError as error:
        is_key = error.where.startswith("key ")
        if is_key and not of_keys:
            raise
        where = f"{error.where}, {what}" if is_key else f"{what}, {error.where}"
        raise type(error)(error.found, expected=error.expected, where=where, advice=error.advice) from error


def require_within(values: NDArray[np.float64], time_s: NDArray[np.float64], most: float, unit: str) -> None:
    """Raises InputError if a value of a course is beyond what any machine has; missing ones are allowed.

    The caller says with `told_of` which course it is.
    """
    beyond = np.flatnonzero(np.abs(values) > most)
    if len(beyond):
        first = int(beyond[0])
        raise InputError(
            f"{values[first]:g} {unit} at {time_s[first]:.6g} s (row {first + 1})",
            expected=f"numbers from {-most:g} to {most:g} {unit}",
            where="recorded course",
            advice="correct or cut this part of the recording; check the unit of the channel",
        )
