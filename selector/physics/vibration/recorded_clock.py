"""Where do the samples of a recording lie on an even grid, which of the grid have none, and which stamps have no grid.

Samples keep their own places on a grid of the usual step, so that a lost row or a gap shifts nothing. Stamps that stray
by less than a quarter of a step are those of an even clock, unless what was recorded went along with them; others are
uneven, and their course is brought to a finer grid by cubic splines. A gap longer than the memory of what is driven
parts a run into stretches of their own.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

Vector = NDArray[np.float64]
Mask = NDArray[np.bool_]

STRAY = 0.25
"""Share of a step by which the stamps of an even clock may stray."""
GAP = 3.0
"""Usual steps from one stamp to the next beyond which it is a gap, and no lost row or two."""
_EVEN = 1e-3
_CERTAIN = 4.0
"""Standard errors from which on stray stamps are believed."""
_FINER = 4
"""Steps of the finer grid in a usual step of an uneven clock."""
_MOST_PLACES = 1 << 23
_FEWEST = 8
_WITHIN_1_PERCENT = (0.01 * 384.0 / 5.0) ** 0.25 / (2.0 * math.pi)
"""Steps in a period up to which a cubic spline is within 1 % of a sine: 5/384·(ω·h)⁴ (C. A. Hall, W. W. Meyer 1976)."""


@dataclass(frozen=True, eq=False)
class Stretch:
    """Rows of a run that are answered together, and their even grid.

    Attributes
    ----------
    first, end : int
        Rows of the run, `end` the one behind the last.
    step_s : float
        Of the grid [s].
    at : ndarray of shape (n_rows,)
        Place of every row on the grid; whole numbers if `even`.
    count : int
        Places of the grid.
    even : bool
        Whether the clock is even but for lost rows and stray stamps.
    stray, stray_rms : float
        Largest and root mean square distance of a stamp from its place, as a share of the step; 0 if uneven.
    widest_s : float
        Largest step between stamps that is no gap [s].
    """

    first: int
    end: int
    step_s: float
    at: Vector
    count: int
    even: bool
    stray: float
    stray_rms: float
    widest_s: float

    @property
    def good_to_hz(self) -> float:
        """Frequency up to which the values on the grid are within 1 % of an even sine's [Hz].

        Of stray stamps: if the samples were taken when the stamps say, not when the clock ticked.
        """
        half_hz = 0.5 / (self.step_s if self.even else self.widest_s)
        if self.even:
            return min(half_hz, 0.01 / (2.0 * math.pi * max(self.stray_rms, 1e-300) * self.step_s))
        return min(half_hz, _WITHIN_1_PERCENT / self.widest_s)

    def on_grid(self, values: Vector) -> tuple[Vector, Mask]:
        """Values on the grid, and where they are known; `values` of shape (n_rows,) may hold NaN."""
        grid, known = np.zeros(self.count), np.zeros(self.count, dtype=np.bool_)
        seen = np.isfinite(values)
        at, kept = self.at[seen], values[seen]
        if self.even or len(at) < 4:
            places = np.rint(at).astype(np.int64)
            grid[places], known[places] = kept, True
            return grid, known
        widest = self.widest_s / self.step_s * (1.0 + 1e-9)
        for piece in np.split(np.arange(len(at)), np.flatnonzero(np.diff(at) > widest) + 1):
            places = np.arange(math.ceil(at[piece[0]] - 1e-9), math.floor(at[piece[-1]] + 1e-9) + 1)
            if len(piece) < 4:
                places = np.unique(np.rint(at[piece]).astype(np.int64))
                grid[places] = np.interp(places, at[piece], kept[piece])
            else:
                grid[places] = CubicSpline(at[piece], kept[piece])(places)
            known[places] = True
        return grid, known

    def at_rows(self, grid: Vector) -> Vector:
        """Course on the grid, shape (…, count), at the rows, shape (…, n_rows)."""
        if self.even or self.count < 4:
            return grid[..., np.rint(self.at).astype(np.int64)]
        return np.asarray(CubicSpline(np.arange(self.count), grid, axis=-1)(self.at))


def stretches(time_s: Vector, part_s: float, values: Sequence[Vector] = ()) -> tuple[Stretch, ...]:
    """The stretches of a run with these increasing stamps [s], parted at gaps that are longer than `part_s` [s].

    `values`, courses of shape (n_rows,) that were recorded, tell whether stray stamps are true.
    """
    steps = np.diff(time_s)
    usual_s = _usual_step_s(steps)
    part_s = min(max(part_s, GAP * usual_s), 0.25 * _MOST_PLACES * usual_s)
    edges = [0, *(np.flatnonzero(steps > part_s) + 1).tolist(), len(time_s)]
    return tuple(
        _stretch(time_s[first:end], first, usual_s, [one[first:end] for one in values])
        for first, end in itertools.pairwise(edges)
    )


def gaps(time_s: Vector) -> Vector:
    """First and last moment of every gap between stamps, shape (n_gaps, 2) [s]."""
    steps = np.diff(time_s)
    rows = np.flatnonzero(steps > GAP * _wide_step_s(steps, _usual_step_s(steps)))
    return np.column_stack((time_s[rows], time_s[rows + 1]))


def _stretch(time_s: Vector, first: int, usual_s: float, values: Sequence[Vector]) -> Stretch:
    end, steps = first + len(time_s), np.diff(time_s)
    if len(steps) and len(time_s) >= _FEWEST:
        usual_s = _usual_step_s(steps)
    grid = _even_grid(time_s, usual_s)
    if grid is not None and not any(_went_along(one, grid[1], grid[2]) for one in values):
        step_s, places, stray = grid
        at = places.astype(np.float64)
        rms = float(np.sqrt(np.mean(stray**2)))
        return Stretch(first, end, step_s, at, int(places[-1]) + 1, True, float(np.abs(stray).max()), rms, step_s)
    duration_s = float(time_s[-1] - time_s[0])
    step_s = max(usual_s / _FINER, duration_s / _MOST_PLACES)
    at = (time_s - time_s[0]) / step_s
    near = steps[steps <= GAP * _wide_step_s(steps, usual_s)]
    return Stretch(first, end, step_s, at, math.ceil(at[-1]) + 1, False, 0.0, 0.0, float(near.max()))


def _even_grid(time_s: Vector, step_s: float) -> tuple[float, NDArray[np.int64], Vector] | None:
    """Step, places and strays of the grid that the stamps lie on; None if there is none."""
    if len(time_s) == 1:
        return step_s, np.zeros(1, dtype=np.int64), np.zeros(1)
    places = np.concatenate(([0], np.cumsum(np.maximum(np.rint(np.diff(time_s) / step_s), 1.0)))).astype(np.int64)
    begin_s = float(time_s[0])
    for _ in range(3):
        if len(time_s) >= _FEWEST:
            centre, mean_s = places.mean(), float(time_s.mean())
            step_s = float((places - centre) @ (time_s - mean_s) / ((places - centre) @ (places - centre)))
            begin_s = mean_s - step_s * float(centre)
        places = np.rint((time_s - begin_s) / step_s).astype(np.int64)
        places -= places[0]
        if (np.diff(places) < 1).any() or places[-1] >= _MOST_PLACES:
            return None
    off = time_s - step_s * places
    stray = (off - off.mean()) / step_s
    return (step_s, places, stray) if np.abs(stray).max() <= STRAY else None


def _went_along(values: Vector, places: NDArray[np.int64], stray: Vector) -> bool:
    """Whether samples lie beside those around them as slope times stray: so they were taken when the stamps say.

    Not if they change so quickly that a spline would be worse than the wrong times.
    """
    if len(values) < 8 * _FEWEST or np.abs(stray).max() <= _EVEN:
        return False
    middle = np.arange(2, len(values) - 2)
    middle = middle[places[middle + 2] - places[middle - 2] == 4]
    beside = (
        values[middle] - (4 * (values[middle - 1] + values[middle + 1]) - values[middle - 2] - values[middle + 2]) / 6
    )
    expected = (values[middle + 1] - values[middle - 1]) / 2 * stray[middle]
    seen = np.isfinite(beside)  # NaN where a value lacks
    beside, expected, course = beside[seen], expected[seen], values[middle][seen]
    power, size = float(expected @ expected), float(np.sum((course - course.mean()) ** 2)) if len(course) else 0.0
    if power == 0.0 or size == 0.0:
        return False
    quick = values[middle + 1][seen] - course
    turn = math.sqrt(float(quick @ quick) / size)  # 2·sin ½ω·h
    if 5.0 / 384.0 * turn**3 > math.sqrt(float(np.mean(stray**2))):
        return False
    slope, scatter = float(beside @ expected) / power, float(np.sqrt(np.sum((beside * expected) ** 2))) / power
    return slope > 0.5 and slope > _CERTAIN * scatter


def _usual_step_s(steps: Vector) -> float:
    """Mean of the steps that are no more than one: of rounded stamps the median is none of the clock."""
    median_s = float(np.median(steps))
    return float(steps[steps < 1.5 * median_s].mean())


def _wide_step_s(steps: Vector, usual_s: float) -> float:
    """Step that an uneven clock may well have: the usual one of an even clock."""
    return usual_s if np.mean(np.abs(steps / usual_s - 1.0) < 2.0 * STRAY) > 0.8 else float(np.quantile(steps, 0.9))
