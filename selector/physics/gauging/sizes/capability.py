"""How capable is the process: its tolerance over its spread (ISO 22514-2), with what a sample leaves open."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy import special

from selector.physics.gauging.process import Tolerance

LOW_SHARE, HIGH_SHARE = 0.00135, 0.99865
"""Quantiles of a normal distribution at ± 3 standard deviations, by which ISO 22514-2 measures any other."""

CONFIDENCE = 0.95
"""Of the intervals, two-sided."""

LEAST_PARTS = 2
LEAST_PARTS_OF_QUANTILES = math.ceil(1.0 / LOW_SHARE)
"""Fewer have no quantile of 0.135 %."""


@dataclass(frozen=True)
class Capability:
    """Capability of a process from a sample of its sizes."""

    count: int  #: Parts
    #: mean_um and sd_um: [µm]
    mean_um: float
    sd_um: float
    #: cp, cp_low and cp_high: (U − L)/6·sd; its interval is that of the standard deviation of normal sizes (chi-square)
    cp: float
    cp_low: float
    cp_high: float
    #: cpk, cpk_low and cpk_high: Distance of the mean to the nearer limit over 3·sd; interval by Bissell (1990),
    #: Applied Statistics 39, 331–340
    cpk: float
    cpk_low: float
    cpk_high: float
    #: cp_quantiles and cpk_quantiles: The same with the distances of the 0.135 % and 99.865 % quantiles from the median
    #: in place of 3·sd, for sizes of any distribution; None of fewer than 741 parts, and where one of them is 0
    cp_quantiles: float | None
    cpk_quantiles: float | None
    #: share_below and share_above: Expected out of tolerance, of normal sizes
    share_below: float
    share_above: float
    #: share_outside, share_outside_low and share_outside_high: Counted out of tolerance, whatever the distribution;
    #: interval by Clopper and Pearson
    share_outside: float
    share_outside_low: float
    share_outside_high: float


def capability(size_um: ArrayLike, tolerance: Tolerance) -> Capability | None:
    """Capability from finished sizes, shape (n_parts,) [µm]; None where they do not differ, or are fewer than two."""
    sizes = np.asarray(size_um, dtype=np.float64).ravel()
    count = len(sizes)
    mean, sd = (float(sizes.mean()), float(sizes.std(ddof=1))) if count >= LEAST_PARTS else (0.0, 0.0)
    # the rounding of equal sizes is no spread
    if sd <= 1e-12 * max(abs(mean), tolerance.upper_um - tolerance.lower_um):
        return None
    width = tolerance.upper_um - tolerance.lower_um
    cp = width / (6.0 * sd)
    cpk = min(tolerance.upper_um - mean, mean - tolerance.lower_um) / (3.0 * sd)
    alpha = 1.0 - CONFIDENCE
    chi_low, chi_high = (float(special.chdtri(count - 1, above)) for above in (1 - alpha / 2, alpha / 2))
    half = float(special.ndtri(1 - alpha / 2)) * math.sqrt(1.0 / (9.0 * count) + cpk**2 / (2.0 * (count - 1)))
    outside = int(np.count_nonzero((sizes < tolerance.lower_um) | (sizes > tolerance.upper_um)))
    low = float(special.betaincinv(outside, count - outside + 1, alpha / 2)) if outside > 0 else 0.0
    high = float(special.betaincinv(outside + 1, count - outside, 1 - alpha / 2)) if outside < count else 1.0
    by_quantiles = _by_quantiles(sizes, tolerance)
    return Capability(
        count, mean, sd,
        cp, cp * math.sqrt(chi_low / (count - 1)), cp * math.sqrt(chi_high / (count - 1)),
        cpk, cpk - half, cpk + half,
        by_quantiles[0], by_quantiles[1],
        float(special.ndtr((tolerance.lower_um - mean) / sd)), float(special.ndtr((mean - tolerance.upper_um) / sd)),
        outside / count, low, high,
    )  # fmt: skip


def _by_quantiles(
    sizes: np.ndarray[tuple[int], np.dtype[np.float64]], tolerance: Tolerance
) -> tuple[float | None, ...]:
    if len(sizes) < LEAST_PARTS_OF_QUANTILES:
        return None, None
    low, middle, high = (float(value) for value in np.quantile(sizes, [LOW_SHARE, 0.5, HIGH_SHARE]))
    if not low < middle < high:
        return None, None
    cp = (tolerance.upper_um - tolerance.lower_um) / (high - low)
    return cp, min((tolerance.upper_um - middle) / (high - middle), (middle - tolerance.lower_um) / (middle - low))
