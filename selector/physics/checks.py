"""Numbers that cannot be: refused with their name and place."""

import math
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cache
from typing import Annotated, Any, get_args, get_type_hints

import numpy as np

from selector.errors import InputError, Misfit, refuse
from selector.types import Array


@dataclass(frozen=True)
class Must:
    """What a number must be, at its field."""

    expected: str
    least: float = -math.inf
    above: bool = False  #: Whether `least` itself is too little

    def refuse(self, values: object, name: str) -> None:
        """Raises InputError, naming the field, if its value is something else; None is allowed."""
        value = getattr(values, name)
        if value is None:
            return
        if not (math.isfinite(value) and (value > self.least if self.above else value >= self.least)):
            raise InputError(f"{value:g}", expected=self.expected, where=name, advice="correct this parameter")


ABOVE_0 = Must("a number above 0", 0.0, above=True)
FROM_0 = Must("0 or more", 0.0)
FINITE = Must("a finite number")
Above0 = Annotated[float, ABOVE_0]
From0 = Annotated[float, FROM_0]
Finite = Annotated[float, FINITE]


class Checked:
    """A dataclass whose numbers are refused where they are not what their fields say, then what is none together."""

    def __post_init__(self) -> None:
        own: Any = type(self)
        for name, must in _musts(own):
            must.refuse(self, name)
        refuse(self._misfits())

    def _misfits(self) -> Iterable[Misfit]:
        return ()


@cache
def _musts(kind: type) -> tuple[tuple[str, Must], ...]:
    """What the numbers of a class must be; what stands at a field goes before what its type says."""
    hints = get_type_hints(kind, include_extras=True)
    told = {
        name: [one for inside in (hint, *get_args(hint)) for one in getattr(inside, "__metadata__", ())]
        for name, hint in hints.items()
    }
    musts = {name: [one for one in said if isinstance(one, Must)] for name, said in told.items()}
    return tuple((name, found[-1]) for name, found in musts.items() if found)


def keep_arrays(values: object, *names: str) -> None:
    """Makes these fields of a frozen dataclass arrays of float64 that nobody can change; None stays."""
    for name in names:
        if getattr(values, name) is not None:
            array = np.array(getattr(values, name), dtype=np.float64)
            array.setflags(write=False)
            object.__setattr__(values, name, array)


@contextmanager
def errors_name(what: str, *, of_keys: bool = False) -> Iterator[None]:
    """Errors inside say `what` they are about, an axis or a run; with `of_keys` also those of keys of the file."""
    try:
        yield
    except InputError as error:
        is_key = error.where.startswith("key ")
        if is_key and not of_keys:
            raise
        where = f"{error.where}, {what}" if is_key else f"{what}, {error.where}"
        raise error.at(where) from error


def require_within(values: Array, time_s: Array, most: float, unit: str) -> None:
    """Raises InputError if a value of a course is beyond what any machine has; missing ones are allowed.

    The caller says with `errors_name` which course it is.
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
