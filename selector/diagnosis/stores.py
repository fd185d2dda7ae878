"""Which stores in a row a simulated level looks like, and what it would be if they had brims.

Store j empties by c_j·h_j^p (p = ½: Torricelli's outflow), the first is filled by the recorded inflow. The
simulation has no noise, so the constants and the levels at the start are found by least squares on its course.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray
from scipy.optimize import least_squares as nonlinear_least_squares

from selector.diagnosis.comparison import Comparison

Vector = NDArray[np.float64]

_FITS, _WELL = 0.05, 0.01
"""Root mean square that may be left, and that needs no second look, over the spread of the course."""


@dataclass(frozen=True, eq=False)
class Stores:
    """One or two stores whose last level is the simulated course.

    Attributes
    ----------
    inflow : ndarray of shape (n_rows,)
        What fills the first store, of size about 1.
    rates : ndarray of shape (5,)
        Of filling, leak, emptying of the first and of the last store, power of the outflow.
    first, last : ndarrays of shape (n_runs,)
        Levels at the start of every run.
    zero, size : float
        Course = zero + size·level.
    n : int
        Number of stores.
    """

    inflow: Vector
    rates: Vector
    first: Vector
    last: Vector
    zero: float
    size: float
    n: int

    def levels(
        self, comparison: Comparison, first_brim: float = np.inf, last_brim: float = np.inf, caught: float = 0.0
    ) -> tuple[Vector, Vector]:
        """Level of the first store [its own unit] and the course of the last, with brims in these units.

        `caught` is the share of what the first store spills that the second one gets.
        """
        brim = (last_brim - self.zero) / self.size
        h, y = np.zeros(len(comparison.time_s)), np.zeros(len(comparison.time_s))
        for k, (_, rows) in enumerate(comparison.rows_of_runs()):
            h[rows], y[rows] = _filled(
                self.inflow[rows],
                comparison.time_s[rows],
                self.rates,
                self.first[k],
                self.last[k],
                self.n,
                first_brim,
                brim,
                caught,
            )
        return h, self.zero + self.size * y


def stores_of(comparison: Comparison, simulated: Vector, inflow: Vector) -> Stores | None:
    """One store, or else two, that fill with the inflow like the simulated course does; None if neither does."""
    scale = float(np.std(inflow))
    size = float(np.ptp(simulated))
    if scale <= 0.0 or size <= 0.0:
        return None
    u = inflow / max(float(np.abs(inflow).max()), 1e-300)
    best: tuple[float, Stores] | None = None
    for n, fills in ((1, 15.0), (2, 8.0), (2, 30.0)):
        if best is None or best[0] > _WELL * float(np.std(simulated)):
            found = _fitted(comparison, simulated, u, n, size, fills)
            best = found if best is None or found[0] < 0.5 * best[0] else best
    return best[1] if best is not None and best[0] < _FITS * float(np.std(simulated)) else None


def _fitted(
    comparison: Comparison, simulated: Vector, u: Vector, n: int, size: float, fills: float
) -> tuple[float, Stores]:
    """Fitted from a filling time of `fills` time constants per longest run on; (root mean square left, stores)."""
    n_runs = len(comparison.runs)
    low = float(simulated.min())
    rate = fills / comparison.longest_s
    begins = np.array([max((simulated[rows][0] - low) / size, 0.05) for _, rows in comparison.rows_of_runs()])
    guess = np.r_[np.log([rate, rate, rate]), 0.5, 0.0, low / size, begins, begins]

    def made(x: Vector) -> Stores:
        rates = np.array([np.exp(x[0]), x[4] * np.exp(x[0]), np.exp(x[1]), np.exp(x[2]), x[3]])
        first, last = np.abs(x[6 : 6 + n_runs]), np.abs(x[6 + n_runs :])
        return Stores(u, rates, first, last, float(x[5] * size), size, n)

    def left(x: Vector) -> Vector:
        course = made(x).levels(comparison)[1]
        return np.asarray(np.where(np.isfinite(course), course - simulated, size) / size)

    wide = np.full(2 * n_runs, 5.0)
    bounds = (
        np.r_[guess[:3] - 6.0, 0.1, -2.0, guess[5] - 3.0, 0 * wide],
        np.r_[guess[:3] + 6.0, 1.3, 2.0, guess[5] + 3.0, wide],
    )
    found = nonlinear_least_squares(left, guess, bounds=bounds, x_scale="jac", max_nfev=40)
    return float(np.sqrt(np.mean(found.fun**2))) * size, made(found.x)


@njit(cache=True, nogil=True)
def _filled(u, time_s, rates, first, last, n, first_brim, last_brim, caught):  # type: ignore[no-untyped-def]
    fill, leak, c1, c2, power = rates
    h, y = first, last
    levels, course = np.empty(len(u)), np.empty(len(u))
    for i in range(len(u)):
        if i > 0:
            step = (time_s[i] - time_s[i - 1]) / 2
            for j in range(2):
                inflow = fill * (u[i - 1] + (u[i] - u[i - 1]) * (j + 0.5) / 2) + leak
                between, spill = inflow, 0.0
                if n == 2:
                    between = c1 * max(h, 0.0) ** power
                    h = max(h + step * (inflow - between), 0.0)
                    if h > first_brim:
                        spill = (h - first_brim) / step
                        h = first_brim
                y = min(max(y + step * (between + caught * spill - c2 * max(y, 0.0) ** power), 0.0), last_brim)
        levels[i], course[i] = h, y
    return levels, course
