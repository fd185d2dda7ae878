"""Duty cycles (cyclograms): which spindle speed is held from when to when, and of which basic kind that is."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from selector.errors import InputError
from selector.types import Vector


@dataclass(frozen=True)
class Cyclogram:
    """A stepwise course of the spindle speed (C: cyclogram), beginning with a machine at rest and at zero.

    Raises
    ------
    InputError
        If times do not start at 0 or do not increase, if a value is missing or a speed is negative.
    """

    start_s: Vector  #: (n_segments,): Start of every segment [s]; the first is 0, they increase strictly
    #: (n_segments,): Speed held from there to the start of the next segment [r/min]; 0 = the spindle stands
    speed_rpm: Vector
    end_s: float  #: End of the last segment [s]

    def __post_init__(self) -> None:
        start = np.array(self.start_s, dtype=np.float64)
        speed = np.array(self.speed_rpm, dtype=np.float64)
        end = float(self.end_s)
        if start.ndim != 1 or start.shape != speed.shape or not len(start):
            _refuse(f"{start.size} times and {speed.size} speeds", "one time for every speed, at least one segment")
        missing = ~np.isfinite(start) | ~np.isfinite(speed)
        if missing.any():
            row = int(np.argmax(missing)) + 1
            _refuse(f"no number in segment {row}", "a time and a speed in every segment", _FILL)
        if start[0] != 0.0:
            _refuse(f"a first segment that starts at {start[0]:g} s", "a first segment that starts at 0 s", _FIRST)
        if (np.diff(start) <= 0).any():
            row = int(np.argmax(np.diff(start) <= 0)) + 2
            _refuse(
                f"segment {row} starts at {start[row - 1]:g} s, after {start[row - 2]:g} s",
                "times that increase",
                _ORDER,
            )
        if (speed < 0).any():
            row = int(np.argmax(speed < 0)) + 1
            _refuse(f"{speed[row - 1]:g} r/min in segment {row}", "a speed of 0 r/min or more", _SIGN)
        if not np.isfinite(end) or end <= start[-1]:
            _refuse(f"an end at {end:g} s", f"an end after the start of the last segment, {start[-1]:g} s", _END)
        start.setflags(write=False)
        speed.setflags(write=False)
        object.__setattr__(self, "start_s", start)
        object.__setattr__(self, "speed_rpm", speed)
        object.__setattr__(self, "end_s", end)

    @classmethod
    def of_segments(cls, *segments: tuple[float, float]) -> Cyclogram:
        """From (minutes, r/min) pairs, as a process plan is written."""
        ends = np.cumsum([minutes * 60.0 for minutes, _ in segments])
        return cls(np.r_[0.0, ends[:-1]], np.array([speed for _, speed in segments], dtype=np.float64), float(ends[-1]))

    def speed_at(self, time_s: Vector) -> Vector:
        """Speed [r/min] held at each time [s]; a time at which the speed changes has the new speed."""
        return self.speed_rpm[np.clip(np.searchsorted(self.start_s, time_s, side="right") - 1, 0, None)]


_FILL = "give every segment its time and speed; write 0 where the spindle stands"
_FIRST = "begin with a row for 0 s; write speed 0 if the spindle stands at first"
_ORDER = "sort the rows by time and keep one row a time"
_SIGN = "the sense of rotation does not matter here: give the speed without a sign"
_END = "add a last row with the time at which the duty cycle ends"


def _refuse(found: str, expected: str, advice: str = "correct the duty cycle") -> None:
    raise InputError(found, expected=expected, where="duty cycle", advice=advice)


Kind = Literal["idle", "continuous", "rising", "intermittent", "falling", "random"]


def cyclogram_kind(cyclogram: Cyclogram) -> Kind:
    """The kind of a duty cycle (C: three basic kinds, of which all others are combinations).

    ``continuous``: one speed; ``rising``, ``falling``: the speed only goes up, or only down, in steps;
    ``intermittent``: one speed and pauses; ``idle``: it never turns; ``random``: anything else.
    """
    speed = cyclogram.speed_rpm[np.r_[True, np.diff(cyclogram.speed_rpm) != 0]]
    turning = np.unique(speed[speed > 0])
    if not len(turning):
        return "idle"
    if len(speed) == 1:
        return "continuous"
    if len(turning) == 1 and (speed[1:] == 0).any():
        return "intermittent"
    if (np.diff(speed) > 0).all():
        return "rising"
    return "falling" if (np.diff(speed) < 0).all() else "random"
