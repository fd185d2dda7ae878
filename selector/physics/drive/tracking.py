"""What does the tracking error go with, and does the table move in jerks."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from selector.physics.drive.motion import Motion
from selector.types import Vector

PARTS = ("speed", "acceleration", "direction", "constant")
REST = "rest"

_STANDSTILL = 1e-6
"""Share of the largest speed below which an axis is said to stand: its direction is that of its last motion."""

_ONE_SPEED = 0.01
"""Mean square of the speed about its mean, relative to its mean square, while the axis moves, below which it moves at
one speed only: a trapezoid that is ramp for less than 3 % of its time."""


@dataclass(frozen=True)
class ErrorParts:
    """A tracking error split by least squares into what goes with the commanded motion, and what is left.

    The parts describe, they do not prove: a lag through a loop of gain Kp goes with the speed, inertia and springs
    go with the acceleration, friction and lost motion with the direction, weight and scales with nothing. What a motion
    cannot tell apart is one part: direction and constant if it goes one way, speed and direction at one speed.
    """

    lag_s: float | None  #: Error per commanded speed [s]
    per_acceleration_s2: float | None  #: Error per commanded acceleration [s²]
    reversal_m: float | None  #: Half the difference between the two directions of travel [m]
    constant_m: float | None  #: What is always there [m]. These four are None where the motion does not tell.
    #: Root mean square that a part adds to those before it, the one that explains most first, ``rest`` last [m]: the
    #: squares add up to that of the error. Parts are called as in `PARTS`, those that are one with a + between.
    rms_m: Mapping[str, float]

    @property
    def largest(self) -> str:
        """Name of the part with the largest root mean square."""
        return max(self.rms_m, key=lambda name: self.rms_m[name])

    def share(self, name: str) -> float:
        """Share of a part in the mean square of the error; of nothing 0."""
        whole = sum(rms**2 for rms in self.rms_m.values())
        return self.rms_m[name] ** 2 / whole if whole > 0 else 0.0


def error_parts(motion: Motion) -> ErrorParts:
    """The parts of the tracking error of a motion."""
    error = motion.tracking_error_m
    speed = np.gradient(motion.reference_m, motion.time_s)
    rows = {
        "speed": speed,
        "acceleration": np.gradient(speed, motion.time_s),
        "direction": direction_of_travel(speed),
        "constant": np.ones_like(error),
    }
    groups = _told_apart(speed, rows["direction"])
    # where the direction is always the same, the constant stands for both
    names = [name for group in groups for name in group if not (name == "direction" and "constant" in group)]
    design = np.column_stack([rows[name] / float(np.abs(rows[name]).max()) for name in names])
    found, *_ = np.linalg.lstsq(design, error, rcond=1e-9)
    weights = {name: float(weight) / float(np.abs(rows[name]).max()) for name, weight in zip(names, found, strict=True)}
    alone = {group[0] for group in groups if len(group) == 1}
    lag, acceleration, reversal, constant = (weights[name] if name in alone else None for name in PARTS)
    columns = [[names.index(name) for name in group if name in names] for group in groups]
    added = _added_squares(design, error, columns)
    called = ["+".join(group) for group in groups]
    squares = {called[at]: square for at, square in added}
    squares[REST] = float(np.sum((error - design @ found) ** 2))
    rms_m = {name: float(np.sqrt(max(square, 0.0) / len(error))) for name, square in squares.items()}
    return ErrorParts(lag, acceleration, reversal, constant, rms_m)


def direction_of_travel(speed_m_per_s: Vector) -> Vector:
    """+1 or −1; while the axis stands that of its last motion, before the first motion 0."""
    sign = np.where(_moves(speed_m_per_s), np.sign(speed_m_per_s), 0.0)
    last = np.maximum.accumulate(np.where(sign != 0, np.arange(len(sign)), 0))
    return np.asarray(sign[last], dtype=np.float64)


def _moves(speed_m_per_s: Vector) -> NDArray[np.bool_]:
    size = np.abs(speed_m_per_s)
    return np.asarray(size > _STANDSTILL * float(size.max()), dtype=np.bool_)


def _told_apart(speed: Vector, direction: Vector) -> list[tuple[str, ...]]:
    """Names of parts, those together that this motion does not tell apart."""
    moving = np.abs(speed[_moves(speed)])
    if moving.size == 0:
        return [("constant",)]
    one_way = np.unique(direction[direction != 0]).size < 2
    one_speed = float(np.var(moving)) < _ONE_SPEED * float(np.mean(moving**2))
    accelerated: list[tuple[str, ...]] = [("acceleration",)] if np.ptp(speed) > _STANDSTILL * moving.max() else []
    if one_way and one_speed:
        return [("speed", "direction", "constant"), *accelerated]
    if one_way:
        return [("speed",), *accelerated, ("direction", "constant")]
    if one_speed:
        return [("speed", "direction"), *accelerated, ("constant",)]
    return [(name,) for name in PARTS]


def _added_squares(design: Vector, error: Vector, groups: list[list[int]]) -> list[tuple[int, float]]:
    """(group, sum of squares that it adds), the group that adds most first, then again among the others."""
    # least squares need no more of the rows than this triangle
    triangle = np.asarray(np.linalg.qr(np.column_stack([design, error]), mode="r"))
    target = triangle[:, -1]
    left, used = list(range(len(groups))), list[int]()
    added: list[tuple[int, float]] = []
    explained = 0.0
    while left:
        sums = {}
        for group in left:
            columns = triangle[:, [*used, *groups[group]]]
            fitted = columns @ np.linalg.lstsq(columns, target, rcond=1e-9)[0]
            sums[group] = float(fitted @ fitted)
        best = max(left, key=lambda group: sums[group])
        added.append((best, sums[best] - explained))
        explained = sums[best]
        used += groups[best]
        left.remove(best)
    return added


_CREEPS, _JUMPS = 0.5, 2.0
"""Shares of the commanded speed below which the table creeps and above which it jumps."""

_LEAST_SHARE, _LEAST_JUMPS = 0.5, 2
_IN_EARNEST = 0.05
"""Share of the largest commanded speed from which on an axis is said to be commanded to move."""


@dataclass(frozen=True)
class StickSlip:
    """A table that sticks and slips."""

    #: Share of the time that it is commanded to move in which it stands or goes at less than half that speed
    creeping_share: float
    #: How often it then catches up; the first time in each stretch of one direction, where it breaks loose, left out
    jumps: int


def stick_slip(motion: Motion) -> StickSlip | None:
    """Creeping and jumps of a motion that creeps for most of its time and jumps again and again; None of any other.

    Travel is looked at from sample to sample, so that no short jump is missed. A jump is a fall of the tracking error
    between the outer thirds of what it has for four fifths of the time: small vibrations do not count.
    """
    period_s = np.diff(motion.time_s)
    commanded = np.diff(motion.reference_m) / period_s
    moves = np.abs(commanded) > _IN_EARNEST * float(np.abs(commanded).max(initial=0.0))
    if not moves.any():
        return None
    direction = direction_of_travel(commanded)[moves]
    share = np.diff(motion.table_m)[moves] / period_s[moves] / commanded[moves]
    behind = direction * motion.tracking_error_m[1:][moves]
    creeping = float(np.mean(share < _CREEPS))
    if creeping < _LEAST_SHARE:
        return None
    turns = np.flatnonzero(np.diff(direction) != 0) + 1
    stretches = zip(np.split(share, turns), np.split(behind, turns), strict=True)
    jumps = sum(max(0, _falls(lag) - 1) for speed, lag in stretches if speed.max() > _JUMPS)
    return StickSlip(creeping, jumps) if jumps >= _LEAST_JUMPS else None


def _falls(course: Vector) -> int:
    """How often a course goes from the upper third to the lower third of what it is for four fifths of its samples."""
    low, high = np.quantile(course, [0.1, 0.9])
    third = (high - low) / 3.0
    marks = np.where(course < low + third, -1, np.where(course > high - third, 1, 0))
    marks = marks[marks != 0]
    return int(np.count_nonzero((marks[:-1] == 1) & (marks[1:] == -1)))
