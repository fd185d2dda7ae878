"""Courses made of recorded courses, run by run: filled, risen, lagged, differentiated. Effects are made of these."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray
from scipy.signal import savgol_filter

from selector.diagnosis.comparison import Comparison

Vector = NDArray[np.float64]


def filled(comparison: Comparison, values: Vector) -> Vector:
    """The course with missing samples put in from both sides, run by run; 0 in a run that has no sample at all."""
    result = np.array(values, dtype=np.float64)
    for _, rows in comparison.rows_of_runs():
        part = result[rows]
        seen = np.isfinite(part)
        if not seen.all():
            time = comparison.time_s[rows]
            result[rows] = np.interp(time, time[seen], part[seen]) if seen.any() else 0.0
    return result


def course(comparison: Comparison, name: str) -> Vector:
    """The recorded channel without holes, in its canonical unit; of a channel that is only simulated, that."""
    return filled(comparison, comparison.recorded[name] if name in comparison.recorded else comparison.simulated[name])


def rise(comparison: Comparison, values: Vector, *, over_samples: int = 5) -> Vector:
    """What the course has risen since the start of its run (median of the first samples)."""
    result = np.array(values, dtype=np.float64)
    for _, rows in comparison.rows_of_runs():
        result[rows] -= np.median(result[rows][:over_samples])
    return result


def lagged(comparison: Comparison, values: Vector, tau_s: float, *, settled: bool = False) -> Vector:
    """First-order lag τ·s' = x − s of a course, exact for a source that is linear between samples.

    Starts at 0 in every run, or with `settled` at the first sample. No lag (`tau_s` 0) is the course itself.
    """
    if tau_s <= 0.0:
        return np.array(values, dtype=np.float64)
    result = np.empty(len(values))
    for _, rows in comparison.rows_of_runs():
        part = np.ascontiguousarray(values[rows], dtype=np.float64)
        result[rows] = _lag(part, comparison.time_s[rows], tau_s, part[0] if settled else 0.0)
    return result


@njit(cache=True, nogil=True)
def _lag(x, time_s, tau_s, start):  # type: ignore[no-untyped-def]
    s = np.empty(len(x))
    s[0] = start
    for k in range(1, len(x)):
        r = (time_s[k] - time_s[k - 1]) / tau_s
        e = np.exp(-r)
        m = (1.0 - e) / r if r > 1e-9 else 1.0
        s[k] = e * s[k - 1] + (m - e) * x[k - 1] + (1.0 - m) * x[k]
    return s


def rate(comparison: Comparison, values: Vector, *, over_samples: int = 1) -> Vector:
    """Time derivative [unit/s]; with `over_samples` > 2 of a quadratic through that many (odd number of) samples."""
    result = np.zeros(len(values))
    for _, rows in comparison.rows_of_runs():
        part, time = values[rows], comparison.time_s[rows]
        if len(part) < 3:
            continue
        if over_samples > 2 and len(part) > over_samples:
            part = savgol_filter(part, over_samples | 1, 2)
        result[rows] = np.gradient(part, time)
    return result


def start_decay(comparison: Comparison, tau_s: float) -> Vector:
    """exp(−t/τ) from the start of every run: what is left of a state that did not start at rest."""
    return np.asarray(np.exp(-comparison.time_s / tau_s))


def time_constants(comparison: Comparison, n: int = 8) -> Vector:
    """Time constants worth trying [s], even in their logarithm: from 4 samples to the length of the longest run."""
    low = max(4.0 * comparison.period_s, comparison.longest_s / 200.0)
    return np.geomspace(low, max(comparison.longest_s, 2.0 * low), n)


def in_run(comparison: Comparison, run: str, values: Vector) -> Vector:
    """The course in one run, 0 in all others."""
    return np.asarray(np.where(comparison.run_index == comparison.runs.index(run), values, 0.0))


def scaled(values: Vector) -> Vector:
    """The course divided by its root mean square (an all-zero course stays)."""
    rms = float(np.sqrt(np.mean(values**2)))
    return np.asarray(values / rms) if rms > 0.0 else values


def excited(values: Vector, resolution: float = 0.0) -> bool:
    """Whether a course moves at all: its spread is above rounding and above half its resolution.

    What takes few values far apart (a switch, steps of speed) has a resolution as large as its range, and moves.
    """
    step = resolution if resolution < 0.5 * float(np.ptp(values)) else 0.0
    return float(np.std(values)) > max(1e-9 * float(np.abs(values).max(initial=0.0)), 0.5 * step, 1e-300)
