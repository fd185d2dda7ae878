"""How certain the time constants are: profile likelihood, with residuals that resemble their neighbours allowed for."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2

from selector.physics.thermal.mode_data import ModeData
from selector.physics.thermal.mode_fit import Fit
from selector.physics.thermal.mode_heldout import expected_rows, jacobian
from selector.physics.thermal.mode_search import limits, searched

Vector = NDArray[np.float64]
CONFIDENCE = 0.95
LOOSE = 1.2
"""A standard error of log τ above this is not followed: the interval spans more than a factor of 100."""


@dataclass(frozen=True)
class Intervals:
    """Confidence intervals of the time constants.

    Attributes
    ----------
    low_s, high_s : ndarray of shape (n_modes,)
        Bounds [s] in the order of the fit; NaN where the tests set none.
    resemblance : float
        Factor by which neighbouring residuals that resemble each other widen the variance.
    """

    low_s: Vector
    high_s: Vector
    resemblance: float


def resemblance(fit: Fit, data: ModeData) -> float:
    """1 + 2 Σ ρ_k of the weighted residuals within runs, up to the first pair of lags that adds nothing; at least 1."""
    total = np.zeros(60)
    for begin, end in data.bounds:
        for r in range(fit.weights.shape[1]):
            here = fit.solution.residual[begin:end, r][fit.weights[begin:end, r] > 0]
            n = min(len(here), len(total))
            total[:n] += [float(here[lag:] @ here[: len(here) - lag]) for lag in range(n)]
    if total[0] <= 0.0:
        return 1.0
    pairs = (total / total[0]).reshape(-1, 2).sum(axis=1)
    last = int(np.argmax(pairs <= 0.0)) if (pairs <= 0.0).any() else len(pairs)
    return max(1.0, 2.0 * float(pairs[:last].sum()) - 1.0)


def tau_intervals(fit: Fit, data: ModeData) -> Intervals:
    """Intervals in which the sum of squares stays within what chance explains, other parameters fitted anew."""
    modes = fit.spec.n_modes
    derivative = jacobian(fit, data, own_zeros=False)
    rows = np.vstack([derivative, expected_rows(fit, derivative.shape[1])])
    size = np.sqrt((rows**2).sum(axis=0))
    size[size == 0.0] = 1.0
    scaled = rows / size
    covariance = np.linalg.inv(scaled.T @ scaled + 1e-12 * np.eye(len(size))) / np.outer(size, size)
    n_free = max(int((fit.weights > 0).sum()) - derivative.shape[1], 1)
    widening = resemblance(fit, data)
    variance = max(fit.cost / n_free, 1e-12) * widening
    allowed = variance * float(chi2.ppf(CONFIDENCE, 1))
    low, high = np.full(modes, np.nan), np.full(modes, np.nan)
    bounds = limits(fit.spec, data)
    for k in range(modes):
        step = np.sqrt(allowed * covariance[k, k])
        if step > LOOSE * 1.96:
            continue
        slope = covariance[: len(fit.theta), k] / covariance[k, k]
        for sign, out in ((-1.0, low), (1.0, high)):
            edge = _edge(fit, data, k, sign * step, slope, allowed, (float(bounds[0][k]), float(bounds[1][k])))
            out[k] = np.exp(edge) if edge is not None else np.nan
    return Intervals(low, high, widening)


def _edge(
    fit: Fit, data: ModeData, k: int, step: float, slope: Vector, allowed: float, bounds: tuple[float, float]
) -> float | None:
    """Where the sum of squares has risen by what is allowed; its square root is nearly linear: secant steps."""
    centre, distance = float(fit.theta[k]), abs(step)
    sign = 1.0 if step > 0 else -1.0
    inside, outside = 0.0, np.inf
    for _ in range(8):
        place = centre + sign * distance
        if not bounds[0] < place < bounds[1]:
            return None
        start = fit.theta + slope * (place - centre)
        start[k] = place
        moved = searched(fit.spec, data, start, fit.weights, held=k, max_steps=6)
        rise = np.sqrt(max(moved.cost - fit.cost, 0.0) / allowed)
        if 0.93 < rise < 1.08:
            return centre + sign * distance / rise
        if rise < 1.0:
            inside = distance
        else:
            outside = distance
        aim = distance / max(rise, 0.3)
        if not inside < aim < outside:
            aim = 0.5 * (inside + outside) if np.isfinite(outside) else 2.0 * distance
        distance = aim
    return centre + sign * distance if np.isfinite(outside) else None
