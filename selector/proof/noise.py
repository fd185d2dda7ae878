"""What the readings of a response carry besides the truth: noise of known colour, and how an oracle whitens it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numba import njit
from numpy.typing import NDArray
from scipy.signal import lfilter

Vector = NDArray[np.float64]
Matrix = NDArray[np.float64]


@dataclass(frozen=True)
class Noise:
    """Stationary noise, sample by sample, independent from run to run.

    Attributes
    ----------
    sd : float
        Standard deviation of the coloured part [unit of the response].
    phi : float
        Correlation from one sample to the next, AR(1): 0 = white, 0.85, 0.995 = almost a random walk.
    tails : float or None
        Degrees of freedom of Student's t of the innovations (more than 2); None = normal.
    step : float
        What the readings are rounded to [unit]; adds the variance step²/12.
    cycle_samples, cycle_sd : int, float
        A course of that many samples and that standard deviation [unit] that every run repeats from its start.
    """

    sd: float
    phi: float = 0.0
    tails: float | None = None
    step: float = 0.0
    cycle_samples: int = 0
    cycle_sd: float = 0.0

    def drawn(self, generator: np.random.Generator, starts: Sequence[int]) -> Vector:
        """One realisation over runs that begin at `starts` (last: the number of rows), before rounding."""
        result = np.empty(starts[-1])
        for first, stop in pairwise(starts):
            if self.tails is None:
                innovations = generator.standard_normal(stop - first)
            else:
                innovations = generator.standard_t(self.tails, stop - first) * np.sqrt(1.0 - 2.0 / self.tails)
            innovations[1:] *= np.sqrt(1.0 - self.phi**2)
            result[first:stop] = self.sd * lfilter([1.0], [1.0, -self.phi], innovations)
        if self.cycle_samples:
            course = generator.standard_normal(self.cycle_samples)
            smooth = np.real(np.fft.ifft(np.fft.fft(course) / (1.0 + np.minimum(*_harmonics(self.cycle_samples)))))
            smooth -= smooth.mean()
            result += self.cycle_sd * (smooth / smooth.std())[self._phase(starts)]
        return result

    def rounded(self, values: Vector) -> Vector:
        """The values as they are read: in multiples of `step`."""
        return np.asarray(np.round(values / self.step) * self.step) if self.step > 0.0 else values

    def whitened(self, columns: Matrix, starts: Sequence[int]) -> Matrix:
        """Columns in units of the noise of a sample, innovations of AR(1) plus white noise of the rounding.

        Of shape (n_rows, n_columns); a repeated course is not whitened but projected off, see `repeated`.
        """
        result = np.empty_like(columns, dtype=np.float64)
        rounding = self.step**2 / 12.0
        for first, stop in pairwise(starts):
            part = np.ascontiguousarray(columns[first:stop], dtype=np.float64)
            result[first:stop] = _innovations(part, self.sd**2, self.phi, rounding)
        return result

    def repeated(self, starts: Sequence[int]) -> Matrix:
        """A column for every sample of the cycle that runs repeat, shape (n_rows, cycle_samples); none without one."""
        if not self.cycle_samples:
            return np.empty((starts[-1], 0))
        return np.asarray(np.eye(self.cycle_samples)[self._phase(starts)])

    def _phase(self, starts: Sequence[int]) -> NDArray[np.intp]:
        lengths = np.diff(np.asarray(starts))
        return np.concatenate([np.arange(length) % self.cycle_samples for length in lengths])


def _harmonics(n: int) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    order = np.arange(n)
    return order, n - order


@njit(cache=True, nogil=True)
def _innovations(columns, variance, phi, rounding):  # type: ignore[no-untyped-def]
    n, m = columns.shape
    result = np.empty((n, m))
    state = np.zeros(m)
    spread = variance
    for k in range(n):
        total = spread + rounding
        gain = spread / total
        for j in range(m):
            surprise = columns[k, j] - state[j]
            result[k, j] = surprise / np.sqrt(total)
            state[j] = phi * (state[j] + gain * surprise)
        spread = phi * phi * spread * (1.0 - gain) + (1.0 - phi * phi) * variance
    return result
