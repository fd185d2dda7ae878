"""How sure is a score: exact binomial intervals of shares, bootstrap intervals of everything else."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.stats import beta

Vector = NDArray[np.float64]
LEVEL = 0.95
_RESAMPLES = 2000


@dataclass(frozen=True)
class Measured:
    """A value with its 95 % interval, and of how many it was made; `value` is None where there were none."""

    value: float | None
    low: float | None
    high: float | None
    n: int


NOTHING = Measured(None, None, None, 0)


def share_measured(hits: Sequence[bool]) -> Measured:
    """Share of hits with the interval of Clopper and Pearson (Biometrika 26, 1934, 404)."""
    n, k = len(hits), sum(hits)
    if n == 0:
        return NOTHING
    tail = (1.0 - LEVEL) / 2.0
    low = 0.0 if k == 0 else float(beta.ppf(tail, k, n - k + 1))
    high = 1.0 if k == n else float(beta.ppf(1.0 - tail, k + 1, n - k))
    return Measured(k / n, low, high, n)


def bootstrapped(values: Vector, statistic: Callable[[Vector], float]) -> Measured:
    """A statistic of the rows of `values` with its percentile interval; the resamples are always the same."""
    n = len(values)
    if n == 0:
        return NOTHING
    draw = np.random.default_rng(0)
    drawn = [statistic(values[draw.integers(0, n, n)]) for _ in range(_RESAMPLES)]
    tail = 100.0 * (1.0 - LEVEL) / 2.0
    low, high = np.percentile([value for value in drawn if math.isfinite(value)], [tail, 100.0 - tail])
    return Measured(float(statistic(values)), float(low), float(high), n)
