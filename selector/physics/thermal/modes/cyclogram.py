"""Duty cycles (cyclograms): which spindle speed is held from when to when, and of which basic kind that is."""

from dataclasses import dataclass
from typing import Literal

import numpy as np

from selector.physics.checks import keep_arrays
from selector.types import Vector


@dataclass(frozen=True)
class Cyclogram:
    """A stepwise course of the spindle speed (C: cyclogram), beginning with a machine at rest and at zero."""

    start_s: Vector  #: (n_segments,): Start of every segment [s]; the first is 0, they increase strictly
    #: (n_segments,): Speed held from there to the start of the next segment [r/min]; 0 = the spindle stands
    speed_rpm: Vector
    end_s: float  #: End of the last segment [s]

    def __post_init__(self) -> None:
        keep_arrays(self, "start_s", "speed_rpm")

    def within(self, fastest_rpm: float) -> "Cyclogram":
        """The duty cycle with what is faster held there."""
        return Cyclogram(self.start_s, np.minimum(self.speed_rpm, fastest_rpm), self.end_s)

    def speed_at(self, time_s: Vector) -> Vector:
        """Speed [r/min] held at each time [s]; a time at which the speed changes has the new speed."""
        return self.speed_rpm[np.clip(np.searchsorted(self.start_s, time_s, side="right") - 1, 0, None)]


@dataclass(frozen=True)
class AmbientCourse:
    """Temperatures around the machine during a duty cycle: straight between these times, constant beyond them."""

    time_s: Vector  #: (n_times,): Increasing times [s]; the first is 0
    ambient_degc: Vector  #: (n_times, n_halls): Temperatures [°C]
    names: tuple[str, ...] = ()  #: The channels of which it is said; others stay

    @classmethod
    def constant(cls, ambient_degc: Vector) -> "AmbientCourse":
        """Temperatures (n_halls,) that do not move."""
        return cls(np.zeros(1), np.asarray(ambient_degc)[None])


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
