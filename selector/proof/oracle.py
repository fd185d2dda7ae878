"""What could be reached at best: by somebody who knows the course of the effect and the noise."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.stats import chi2, ncx2

from selector.proof.case import HeldOut


def detection_probability(d_prime: ArrayLike, *, false_alarm: float = 0.01, n_looks: int = 1) -> NDArray[np.float64]:
    """Chance that a matched filter finds an effect of unknown size and sign.

    The squared statistic of the filter is χ² with one degree of freedom, non-central by d′² where the effect is there
    (S. M. Kay, Fundamentals of Statistical Signal Processing II, 1998, section 7.4.2).

    Parameters
    ----------
    d_prime : array_like
    false_alarm : float
        Of all looks together.
    n_looks : int
        Effects that are tried, each with its own course; Bonferroni.
    """
    threshold = chi2.isf(false_alarm / n_looks, 1)
    return np.asarray(ncx2.sf(threshold, 1, np.square(np.asarray(d_prime, dtype=np.float64))))


def error_floor(held_out: HeldOut) -> float:
    """Share of the recalibrated held-out error that the oracle, too, leaves."""
    return held_out.oracle / held_out.recalibrated if held_out.recalibrated > 0 else 1.0
