"""Which leads the residuals of an axis repeat with along its position."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import median_filter

from selector.diagnosis.comparison import Comparison
from selector.diagnosis.effects.drive._forces import PLACES
from selector.diagnosis.shapes.force_response import felt
from selector.diagnosis.shapes.motion import Motion, motion
from selector.diagnosis.shapes.signals import excited, filled
from selector.diagnosis.shapes.simulated_axis import FORCE_ROLES

Vector = NDArray[np.float64]

SHORTEST_M = 5e-4
FEWEST_TURNS = 3.0
N_PEAKS = 6
N_LONG = 3
"""Of leads with few turns on the way: they stand beside what is slow, not beside noise."""
_FEW_TURNS = 12.0
_FINER = 6
_BACKGROUND_LINES = 60
"""Strokes that overlap little make one line as wide as several."""
_BINS = 2**13


@lru_cache(maxsize=16)
def leads(comparison: Comparison, axis: str | None, *, of_force: bool) -> tuple[float, ...]:
    """Leads [m] that the residuals of an axis repeat with over its position, longest first; fitted rows only.

    Of a position itself (in displacements and positions), or `of_force`: of a force, by all responses together, each
    passed back through what it does to them, so that a ripple that the loop turns with speed adds up.
    """
    moving = motion(comparison, axis)
    if moving is None:
        return ()
    used = (moving.sense != 0.0) & ~comparison.held_out
    place = moving.position_m[used]
    if len(place) < 50 or np.ptp(place) < FEWEST_TURNS * SHORTEST_M:
        return ()
    courses = []
    for name in comparison.responses:
        channel = comparison.channel(name)
        seen = FORCE_ROLES + PLACES if of_force else PLACES
        if channel.role not in seen or (axis is not None and channel.axis not in (None, axis)):
            continue
        left = _left(comparison, moving, name)
        if excited(left):
            courses.append((felt(comparison, name, left) if of_force else left)[used])
    return _highest(place, courses, comparison, np.abs(moving.velocity_m_per_s[used]))


def _left(comparison: Comparison, moving: Motion, name: str) -> Vector:
    """What motion, place and the simulated course do not explain of a residual in the fitted rows; 0 in the others."""
    own = np.column_stack([
        moving.velocity_m_per_s, moving.acceleration_m_per_s2, moving.sense, moving.position_m, moving.position_m**2,
        *(np.equal(comparison.run_index, k) for k in range(len(comparison.runs))),
        filled(comparison, comparison.simulated[name]),
    ])[~comparison.held_out]  # fmt: skip
    size = np.sqrt(np.mean(own**2, axis=0))
    own = own[:, size > 0.0] / size[size > 0.0]
    residual = filled(comparison, comparison.difference(name))[~comparison.held_out]
    left = np.zeros(len(comparison.time_s))
    left[~comparison.held_out] = residual - own @ np.linalg.lstsq(own, residual, rcond=None)[0]
    return left


def _highest(place: Vector, courses: list[Vector], comparison: Comparison, speed: Vector) -> tuple[float, ...]:
    way = float(np.ptp(place))
    width = way * _FINER / _BINS
    number = np.minimum(((place - place.min()) / way * _FINER**-1 * _BINS).astype(np.intp), _BINS - 1)
    frequency = np.fft.rfftfreq(_BINS, width)
    # at least four samples a turn at the usual speed
    travel = float(np.median(speed)) * comparison.period_s
    shortest = max(SHORTEST_M, 4.0 * travel, 4.0 * width)
    inside = (frequency >= FEWEST_TURNS / way) & (frequency <= 1.0 / shortest)
    if inside.sum() < 5 or not courses:
        return ()
    height = np.zeros(int(inside.sum()))
    for course in courses:
        sums = np.bincount(number, weights=course, minlength=_BINS)
        power = np.abs(np.fft.rfft(sums)[inside]) ** 2
        background = median_filter(power, min(_BACKGROUND_LINES * _FINER, len(power)), mode="reflect")
        height += power / np.maximum(background, 1e-300 + 1e-6 * float(power.max()))
    is_long = frequency[inside] * way < _FEW_TURNS
    taken = [*_apart(np.where(is_long, 0.0, height), N_PEAKS), *_apart(np.where(is_long, height, 0.0), N_LONG)]
    return tuple(sorted({float(1.0 / frequency[inside][k]) for k in taken}, reverse=True))


def _apart(height: Vector, most: int) -> list[int]:
    """The highest peaks, no two nearer than a line is wide."""
    padded = np.r_[0.0, height, 0.0]
    order = [k for k in range(len(height)) if height[k] > 0.0 and height[k] >= max(padded[k], padded[k + 2])]
    taken: list[int] = []
    for k in sorted(order, key=lambda k: -height[k]):
        if all(abs(k - other) > _FINER for other in taken):
            taken.append(k)
        if len(taken) == most:
            break
    return taken
