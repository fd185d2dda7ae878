"""The cycle that a machine repeats, read off the simulated courses: what comes back with it may be noise or missing."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.signal import fftconvolve
from scipy.sparse import csr_matrix, identity
from scipy.sparse.linalg import splu

from selector.diagnosis.comparison import Comparison
from selector.diagnosis.shapes.signals import even_runs
from selector.types import Matrix, Vector

Rows = NDArray[np.bool_] | NDArray[np.intp]
_ALIKE = 0.9  #: Correlation of a course with itself one cycle later; a machine that goes on warming repeats no closer.
#: Below it a course has turned into something else since: what comes back after is a cycle, and not the same slope.
_APART = 0.5
_FEWEST = 3
_SHORTEST = 8
_SAME = 0.01  #: Of a period: runs whose cycles differ by less repeat the same cycle.


@dataclass(frozen=True, eq=False)
class MachineCycle:
    """A cycle that runs repeat."""

    period_s: float
    samples: int  #: Rows in a cycle: what it repeats is a polygon of as many knots
    time_s: Vector  #: (n_rows,): From the start of the run [s]; NaN in runs that do not repeat the cycle

    def repeated(self, values: Matrix, rows: Rows) -> Matrix:
        """The part of `values` (n_rows, m) that comes back with every cycle, by least squares over some of the `rows`.

        0 in the runs that do not repeat the cycle.
        """
        part = self._polygon[rows]
        gram = (part.T @ part + 1e-9 * identity(self.samples)).tocsc()
        return np.asarray(self._polygon @ splu(gram).solve(part.T @ values[rows]))

    @cached_property
    def _polygon(self) -> csr_matrix:
        here = np.flatnonzero(np.isfinite(self.time_s))
        place = self.time_s[here] / self.period_s % 1.0 * self.samples
        first = np.floor(place).astype(np.intp)
        share = place - first
        return csr_matrix(
            (np.r_[1.0 - share, share], (np.r_[here, here], np.r_[first, first + 1] % self.samples)),
            shape=(len(self.time_s), self.samples),
        )


def machine_cycle(comparison: Comparison) -> MachineCycle | None:
    """The cycle that most of the runs repeat three times or more, all at one period; None if there is none."""
    periods: dict[int, float] = {}
    responses = [comparison.simulated_course(name) for name in comparison.responses]
    for k, run in enumerate(even_runs(comparison)):
        found = _samples([run.on(course) for course in responses])
        if found is not None:
            periods[k] = found * comparison.period_s
    if not periods:
        return None
    period = float(np.median(list(periods.values())))
    same = [k for k, value in periods.items() if abs(value / period - 1.0) < _SAME]
    fitted = {int(k) for k in np.unique(comparison.run_index[~comparison.held_out])}
    if len(fitted & set(same)) <= 0.5 * len(fitted):
        return None
    begins = comparison.time_s[np.asarray(comparison.starts[:-1])][comparison.run_index]
    repeats = np.isin(comparison.run_index, same)
    samples = round(period / comparison.period_s)
    return MachineCycle(period, samples, np.where(repeats, comparison.time_s - begins, np.nan))


def _samples(courses: list[Vector]) -> float | None:
    """Samples of one cycle, read off as many cycles at once as the run has."""
    correlation = _autocorrelation(courses)
    if correlation is None:
        return None
    away = np.flatnonzero(correlation < _APART)
    longest = len(correlation) - 1
    if not len(away) or away[0] >= longest:
        return None
    later = correlation[away[0] : longest // _FEWEST * 2 + 1]
    high = np.flatnonzero(later > _ALIKE)
    if not len(high):
        return None
    stop = high[0] + int(np.argmax(later[high[0] :] < _ALIKE)) if (later[high[0] :] < _ALIKE).any() else len(later)
    first = int(away[0] + high[0] + np.argmax(later[high[0] : stop]))
    if first < _SHORTEST or first * _FEWEST > longest:
        return None
    period = float(first)
    for times in range(2, longest * 2 // 3 // first + 1):
        near = round(times * period) + np.arange(-max(1, first // 10), max(1, first // 10) + 1)
        near = near[(near > 0) & (near < len(correlation))]
        if not len(near) or correlation[near].max() < _ALIKE:
            break
        period = float(near[np.argmax(correlation[near])]) / times
    return period


def _autocorrelation(courses: list[Vector]) -> Vector | None:
    """Of courses each of variance 1, per lag over the rows that overlap; None if nothing moves."""
    moving = [
        (course - course.mean()) / course.std() for course in courses if len(course) > _SHORTEST and course.std() > 0
    ]
    if not moving:
        return None
    n = len(moving[0])
    product = np.sum([fftconvolve(course, course[::-1])[n - 1 :] for course in moving], axis=0)
    squares = np.sum([np.r_[0.0, np.cumsum(course**2)] for course in moving], axis=0)
    lags = np.arange(n)
    return np.asarray(product / np.sqrt(np.maximum(squares[n - lags] * (squares[n] - squares[lags]), 1e-300)))
