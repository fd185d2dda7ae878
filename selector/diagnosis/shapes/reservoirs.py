"""Which stores in a row a simulated level looks like, and what it would be if they had brims.

Store j empties by c_j·h_j^p (p = ½: Torricelli's outflow), the first is filled by the recorded inflow. The
simulation has no noise, so the constants and the levels at the start are found by least squares on its course.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit
from scipy.optimize import least_squares as nonlinear_least_squares

from selector.diagnosis.comparison import Comparison
from selector.types import Vector

_FITS, _WELL = 0.05, 0.01
"""Root mean square that may be left, and that needs no second look, over the spread of the course."""


@dataclass(frozen=True, eq=False)
class Stores:
    """One or two stores whose last level is the simulated course."""

    inflow: Vector  #: (n_rows,): What fills the first store, of size about 1
    #: (6,): Of filling, leak, emptying of the first and of the last store, power of the outflow; how far the inflow
    #: runs along a line between samples (0: it is held, 1: it does)
    rates: Vector
    #: first and last: (n_runs,): Levels at the start of every run
    first: Vector
    last: Vector
    #: zero and size: Course = zero + size·level
    zero: float
    size: float
    n: int  #: Number of stores

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
    for n, fills, torricelli in ((1, 15.0, True), (2, 8.0, True), (2, 30.0, True), (2, 8.0, False), (2, 30.0, False)):
        if best is None or best[0] > _WELL * float(np.std(simulated)):
            found = _fitted(comparison, simulated, u, n, size, fills, torricelli=torricelli)
            best = found if best is None or found[0] < 0.5 * best[0] else best
    return best[1] if best is not None and best[0] < _FITS * float(np.std(simulated)) else None


def _fitted(
    comparison: Comparison, simulated: Vector, u: Vector, n: int, size: float, fills: float, *, torricelli: bool
) -> tuple[float, Stores]:
    """Fitted from a filling time of `fills` time constants per longest run on; (root mean square left, stores).

    With `torricelli` the outflow goes with the root of the level, and nothing leaks or is read off zero.
    """
    n_runs = len(comparison.runs)
    low = float(simulated.min())
    rate = fills / comparison.longest_s
    begins = np.array([max((simulated[rows][0] - low) / size, 0.05) for _, rows in comparison.rows_of_runs()])
    guess = np.r_[np.log([rate, rate, rate]), 0.5, 0.0, 0.0 if torricelli else low / size, 0.5, begins, begins]
    if torricelli:
        guess[7:] += low / size
    free = np.ones(len(guess), dtype=bool)
    free[3:6] = not torricelli

    def made(x: Vector) -> Stores:
        rates = np.array([np.exp(x[0]), x[4] * np.exp(x[0]), np.exp(x[1]), np.exp(x[2]), x[3], x[6]])
        first, last = np.abs(x[7 : 7 + n_runs]), np.abs(x[7 + n_runs :])
        return Stores(u, rates, first, last, float(x[5] * size), size, n)

    def put(part: Vector) -> Vector:
        x = np.array(guess)
        x[free] = part
        return x

    def left(part: Vector) -> Vector:
        course = made(put(part)).levels(comparison)[1]
        return np.asarray(np.where(np.isfinite(course), course - simulated, size) / size)

    wide = np.full(2 * n_runs, 5.0)
    bounds = (
        np.r_[guess[:3] - 6.0, 0.1, -2.0, guess[5] - 3.0, 0.0, 0 * wide],
        np.r_[guess[:3] + 6.0, 1.3, 2.0, guess[5] + 3.0, 1.0, wide],
    )
    start = np.clip(guess, bounds[0] + 1e-9, bounds[1] - 1e-9)[free]
    limits = (bounds[0][free], bounds[1][free])
    found = nonlinear_least_squares(left, start, bounds=limits, x_scale="jac", max_nfev=40)
    return float(np.sqrt(np.mean(found.fun**2))) * size, made(put(found.x))


Brims = tuple[float, float, float]
"""Of the first store [its unit], of the last [unit of the course]; share of the first spill that the last gets."""


def refitted(
    comparison: Comparison, stores: Stores, recorded: Vector, brims: Brims | None
) -> tuple[float, Stores, Brims | None]:
    """Filling, leak, emptying, zero and the brims, if there are some, fitted to a recorded course in the fitted rows.

    Levels at the start of the first runs are fitted too; of held-out runs they stay. Returns (root mean square left
    [unit of the course], stores, brims).
    """
    rows = np.isfinite(recorded) & ~comparison.held_out
    free = [k for k, (_, part) in enumerate(comparison.rows_of_runs()) if not comparison.held_out[part][0]]
    moving = [k for k in (0, 1) if brims is not None and np.isfinite(brims[k])]
    whole, plain = stores.levels(comparison)
    sizes = (max(float(np.ptp(whole)), 1e-9), float(np.ptp(plain)))

    def made(x: Vector) -> tuple[Stores, Brims | None]:
        rates = stores.rates * np.exp(np.r_[x[0], x[0], x[1], x[2], 0.0, 0.0])
        rates[1] += x[3] * rates[0]
        first, last = np.array(stores.first), np.array(stores.last)
        first[free] = np.abs(first[free] + x[5 : 5 + len(free)])
        last[free] = np.abs(last[free] + x[5 + len(free) : 5 + 2 * len(free)])
        other = np.setdiff1d(np.arange(len(first)), free)
        first[other] *= float(np.sum(first[free]) / max(float(np.sum(stores.first[free])), 1e-12))
        last[other] = np.maximum(last[other] - x[4], 0.0)
        anew = Stores(stores.inflow, rates, first, last, stores.zero + x[4] * stores.size, stores.size, stores.n)
        if brims is None:
            return anew, None
        levels = list(brims)
        for k, change in zip(moving, x[5 + 2 * len(free) :], strict=False):
            levels[k] += change * sizes[k]
        if 0 in moving:
            levels[2] = float(np.clip(brims[2] + x[-1], 0.0, 1.0))
        return anew, (levels[0], levels[1], levels[2])

    def left(x: Vector) -> Vector:
        anew, levels = made(x)
        course = anew.levels(comparison, *levels)[1] if levels is not None else anew.levels(comparison)[1]
        return np.asarray((course - recorded)[rows] / stores.size)

    n = 5 + 2 * len(free) + len(moving) + (0 in moving)
    found = nonlinear_least_squares(
        left, np.zeros(n), bounds=(-np.full(n, 1.5), np.full(n, 1.5)), max_nfev=40, diff_step=np.full(n, 1e-4)
    )
    return float(np.sqrt(np.mean(found.fun**2))) * stores.size, *made(found.x)


@njit(cache=True, nogil=True)
def _filled(u, time_s, rates, first, last, n, first_brim, last_brim, caught):  # type: ignore[no-untyped-def]
    fill, leak, c1, c2, power, line = rates
    h, y = first, last
    levels, course = np.empty(len(u)), np.empty(len(u))
    for i in range(len(u)):
        if i > 0:
            step = (time_s[i] - time_s[i - 1]) / 2
            for j in range(2):
                inflow = fill * (u[i - 1] + line * (u[i] - u[i - 1]) * (j + 0.5) / 2) + leak
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
