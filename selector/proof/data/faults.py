"""What can be wrong with the readings of one channel in one run: a fault by size, and when it acts."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Vector = NDArray[np.float64]
Reading = Callable[[Vector, Vector, float], Vector]
"""(times [s], course, size) → what is read."""


@dataclass(frozen=True)
class Fault:
    """A fault of one channel.

    Attributes
    ----------
    id : str
        Of the catalogue.
    reading : callable (times [s], course, size) -> course
    from_s : float
        When it begins.
    to_s : callable (size) -> float
        When it ends.
    """

    id: str
    reading: Reading
    from_s: float
    to_s: Callable[[float], float]


def late(length_s: float, unit_s: float, from_s: float = 0.0) -> Fault:
    """The clock is slow by size × `unit_s` from a moment on."""

    def reading(time_s: Vector, course: Vector, size: float) -> Vector:
        shifted = np.interp(time_s - size * unit_s, time_s, course)
        return np.where(time_s >= from_s, shifted, course)

    return Fault("data.clock", reading, from_s, lambda size: length_s)


def slow(length_s: float, unit_s: float) -> Fault:
    """The clock runs at another rate: size × `unit_s` are lost by the end of the run."""

    def reading(time_s: Vector, course: Vector, size: float) -> Vector:
        return np.interp(time_s * (1.0 - size * unit_s / length_s), time_s, course)

    return Fault("data.clock", reading, 0.0, lambda size: length_s)


def stretched(length_s: float, unit: float) -> Fault:
    """The scale is wrong by size × `unit`."""
    return Fault("data.gain", lambda time_s, course, size: course * (1.0 + size * unit), 0.0, lambda size: length_s)


def moved(length_s: float, unit: float) -> Fault:
    """The zero is off by size × `unit`."""
    return Fault("data.zero", lambda time_s, course, size: course + size * unit, 0.0, lambda size: length_s)


def running_away(length_s: float, unit: float, from_s: float, bend: float = 1.0) -> Fault:
    """The sensor runs away from a moment on, to size × `unit` at the end; with `bend` below 1 fast at first."""

    def reading(time_s: Vector, course: Vector, size: float) -> Vector:
        share = np.clip((time_s - from_s) / (length_s - from_s), 0.0, 1.0)
        return np.asarray(course + size * unit * share**bend)

    return Fault("data.drift", reading, from_s, lambda size: length_s)


def jumped(length_s: float, unit: float, from_s: float) -> Fault:
    """The sensor jumps by size × `unit` and stays."""

    def reading(time_s: Vector, course: Vector, size: float) -> Vector:
        return np.asarray(course + size * unit * (time_s >= from_s))

    return Fault("data.step", reading, from_s, lambda size: length_s)


def frozen(length_s: float, unit_s: float, from_s: float) -> Fault:
    """The reading freezes for size × `unit_s`, in steps of the recording; nothing before that is changed."""

    def end(size: float) -> float:
        return min(from_s + size * unit_s, length_s)

    def reading(time_s: Vector, course: Vector, size: float) -> Vector:
        first = int(np.searchsorted(time_s, from_s))
        last = int(np.searchsorted(time_s, end(size)))
        if last <= first:
            return course
        held = course.copy()
        held[first:last] = course[first]
        return held

    return Fault("data.stuck", reading, from_s, end)
