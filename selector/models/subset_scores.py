"""Criteria that rank subsets of different size, from the residual sum of squares alone."""

from __future__ import annotations

import math
from typing import Literal

Criterion = Literal["adjusted_r2", "aicc", "bic", "cp"]
CRITERIA: tuple[Criterion, ...] = ("adjusted_r2", "aicc", "bic", "cp")


def adjusted_r2(r2: float, n_samples: float, n_terms: int, intercept: bool = True) -> float:
    """R² corrected for the number of terms (P §5: R'² = 1 - (m-1)/(m-p-1)·(1 - R²), m samples, p terms).

    Without an intercept the formula changes to 1 - m/(m-p)·(1 - R²), **and so does R² itself**: it then measures
    against zero instead of the mean. Never rank models with and without an intercept together by it.

    Parameters
    ----------
    r2 : float
        Share of the sum of squares explained, about the mean with an intercept, about zero without.
    n_samples, n_terms : number
        Terms do not count the intercept.

    Returns
    -------
    float
        NaN when there are not more samples than coefficients.
    """
    free = n_samples - n_terms - intercept
    return 1.0 - (n_samples - intercept) / free * (1.0 - r2) if free > 0 else math.nan


def aicc(rss: float, n_samples: float, n_terms: int, intercept: bool = True) -> float:
    """Akaike's criterion with the small-sample correction (Hurvich and Tsai 1989), up to a constant of the data.

    The noise variance counts as a parameter. NaN when there are too few samples for the correction.
    """
    k = n_terms + intercept + 1
    free = n_samples - k - 1
    return _deviance(rss, n_samples) + 2.0 * k + 2.0 * k * (k + 1) / free if free > 0 else math.nan


def bic(rss: float, n_samples: float, n_terms: int, intercept: bool = True) -> float:
    """Schwarz's criterion, up to a constant of the data; the noise variance counts as a parameter."""
    return _deviance(rss, n_samples) + (n_terms + intercept + 1) * math.log(n_samples)


def mallows_cp(rss: float, n_samples: float, n_terms: int, noise_variance: float, intercept: bool = True) -> float:
    """Mallows' Cp = RSS/σ² - m + 2·(number of coefficients); NaN when σ² of the full model is not known."""
    if not noise_variance > 0.0:
        return math.nan
    return rss / noise_variance - n_samples + 2.0 * (n_terms + intercept)


def _deviance(rss: float, n_samples: float) -> float:
    return n_samples * math.log(rss / n_samples) if rss > 0.0 else -math.inf
