"""A heated body that loses heat faster while something blows or flows: the lag whose rate is switched."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from selector.diagnosis.comparison import Comparison

Vector = NDArray[np.float64]


def cooled(comparison: Comparison, source: Vector, gate: Vector, tau_s: float, extra_per_s: float) -> Vector:
    """Solution of x' = (s − x)/τ − r·g·x, source s, gate g, from 0 in every run; r = `extra_per_s` [1/s].

    Source and gate count as their means between two samples. With r = 0 it is a lag of first order.
    """
    result = np.empty(len(source))
    for _, rows in comparison.rows_of_runs():
        part = np.ascontiguousarray(source[rows], dtype=np.float64)
        blown = np.ascontiguousarray(gate[rows], dtype=np.float64)
        result[rows] = _cooled(part, blown, comparison.time_s[rows], tau_s, extra_per_s)
    return result


@njit(cache=True, nogil=True)
def _cooled(source, gate, time_s, tau_s, extra_per_s):  # type: ignore[no-untyped-def]
    x = np.empty(len(source))
    x[0] = 0.0
    for k in range(1, len(source)):
        step_s = time_s[k] - time_s[k - 1]
        rate = 1.0 / tau_s + extra_per_s * 0.5 * (gate[k] + gate[k - 1])
        steady = 0.5 * (source[k] + source[k - 1]) / (tau_s * rate)
        x[k] = steady + (x[k - 1] - steady) * np.exp(-rate * step_s)
    return x
