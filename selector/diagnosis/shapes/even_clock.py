"""How the runs stand on an even clock, which filters and spectra need: run by run, there and back."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from selector.diagnosis.comparison import Comparison

Vector = NDArray[np.float64]

_JITTER = 0.02
"""Stamps that are off by less than this share of a period are even: what a filter makes of it is below 1 %."""
_MOST_FILLED = 20
"""A run is stretched to at most so many times its rows; beyond, its gaps are too long for a filter anyway."""


@dataclass(frozen=True, eq=False)
class EvenRun:
    """A run on an even clock.

    Attributes
    ----------
    rows : slice
        Its rows in the comparison.
    time_s : ndarray of shape (n_rows,)
        Their stamps [s].
    clock_s : ndarray of shape (n_even,)
        The even clock [s]; of a run that is even already, the stamps.
    """

    rows: slice
    time_s: Vector
    clock_s: Vector

    def on(self, values: Vector) -> Vector:
        """The run's part of a course without holes, on the even clock."""
        part = values[self.rows]
        return part if self.is_even else np.interp(self.clock_s, self.time_s, part)

    def back(self, values: Vector) -> Vector:
        """A course of the even clock at the rows of the run."""
        return values if self.is_even else np.interp(self.time_s, self.clock_s, values)

    @property
    def is_even(self) -> bool:
        """Whether nothing had to be interpolated."""
        return self.clock_s is self.time_s


def even_runs(comparison: Comparison) -> tuple[EvenRun, ...]:
    """Every run on the even clock of the median period."""
    period = comparison.period_s
    found = []
    for _, rows in comparison.rows_of_runs():
        time = comparison.time_s[rows]
        n = round((time[-1] - time[0]) / period) + 1 if len(time) else 0
        clock = time[:1] + period * np.arange(min(n, _MOST_FILLED * len(time)))
        even = n == len(time) and float(np.abs(clock - time).max(initial=0.0)) <= _JITTER * period
        found.append(EvenRun(rows, time, time if even else clock))
    return tuple(found)
