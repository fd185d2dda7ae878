"""Does the table move in jerks: it stands or creeps while it is commanded to move, and then jumps."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from selector.physics.drive.error_parts import direction_of_travel
from selector.physics.drive.motion import Motion

Vector = NDArray[np.float64]

_CREEPS, _JUMPS = 0.5, 2.0
"""Shares of the commanded speed below which the table creeps and above which it jumps."""

_LEAST_SHARE, _LEAST_JUMPS = 0.5, 2
_IN_EARNEST = 0.05
"""Share of the largest commanded speed from which on an axis is said to be commanded to move."""


@dataclass(frozen=True)
class StickSlip:
    """A table that sticks and slips.

    Attributes
    ----------
    creeping_share : float
        Share of the time that it is commanded to move in which it stands or goes at less than half that speed.
    jumps : int
        How often it then catches up; the first time in each stretch of one direction, where it breaks loose, left out.
    """

    creeping_share: float
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
