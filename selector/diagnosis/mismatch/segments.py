"""When does something act: rows in which a course is large, or in which a residual is more than its quiet noise."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from numba import njit
from numpy.typing import NDArray

from selector.diagnosis.comparison import Comparison
from selector.diagnosis.mismatch.background import background, seen_rows, spectrum

Vector = NDArray[np.float64]
Mask = NDArray[np.bool_]
Rows = NDArray[np.intp]
_LARGE = 0.25
"""A course acts where it is at least this part of its largest amount."""
_LARGE_IN_NOISE = 0.3
"""The same in a residual, of what nine tenths of its active rows stay below."""
_GAP = 0.025
"""Gaps shorter than this part of the run are no gaps."""
_ALWAYS = 0.85
"""Something that acts in more than this part of a run acts in all of it."""
_SCALES = (1, 4, 16, 64)
_POWERS = np.array([1.0, 2.5, 6.0, 16.0, 40.0, 120.0, 400.0, 2000.0])
"""Mean squares that a state may have, in those of quiet noise; the first is quiet."""
_SWITCH, _CHANGE = 4.0, 1.5
"""What it costs to begin or end, and to change the size of what acts [logarithm of a probability]."""
_ROUNDS = 5
_FEWEST = 40


def large_rows(comparison: Comparison, course: Vector) -> Mask:
    """Rows in which a course without noise acts: at least a quarter of its largest amount."""
    if not np.any(course):
        return np.zeros(len(course), dtype=np.bool_)
    return _without_gaps(comparison, np.abs(course) >= _LARGE * float(np.abs(course).max()))


def noisy_rows(comparison: Comparison, residual: Vector) -> Mask:
    """Rows in which a residual is more than its quiet noise; none if it is the same throughout.

    Every row is quiet or active with one of several sizes; the likeliest course of these states (Viterbi 1967) for
    normal values, whose likelihood counts the less the longer the noise remembers. What is quiet, its mean and its
    memory are estimated anew with the states. Of the residual smoothed over 1 to 64 samples that one is taken in which
    the states explain most. Rows that are small beside the rest of what acts are then left out.
    """
    parts = [here for here in seen_rows(comparison, residual) if len(here) >= _FEWEST]
    if not parts:
        return np.zeros(len(residual), dtype=np.bool_)
    memory = _memory(residual, parts)
    best, active, course = -np.inf, np.zeros(len(residual), dtype=np.bool_), np.zeros(len(residual))
    for scale in _SCALES:
        if min(len(part) for part in parts) < 8 * scale:
            continue
        smooth = np.zeros(len(residual))
        for part in parts:
            smooth[part] = _smoothed(residual[part] - np.median(residual[part]), scale)
        least = max(0.5 * memory, 2.0 * scale / 3.0 + (0.5 * memory if memory > 4.0 else 0.0))
        found, centred, gain = _states(smooth, parts, least)
        if gain > best:
            best, active, course = gain, found, _amount(centred, parts, scale)
    if not active.any():
        return active
    return _without_gaps(comparison, active & (course >= _LARGE_IN_NOISE * float(np.quantile(course[active], 0.9))))


def _states(values: Vector, parts: list[Rows], memory: float) -> tuple[Mask, Vector, float]:
    """(active rows, values about the mean of the quiet ones, logarithm of the likelihood gained by switching)."""
    values = values.copy()
    seen = np.concatenate(parts)
    active = np.zeros(len(values), dtype=np.bool_)
    blocks = [
        float(np.mean(block**2))
        for part in parts
        for block in np.array_split(values[part], max(4, min(40, int(len(part) / max(10.0, 2.0 * memory)))))
    ]
    quiet, least, gain = max(float(np.quantile(blocks, 0.3)), 1e-300), memory, -np.inf
    for _ in range(_ROUNDS):
        likely = 0.0
        for part in parts:
            logs = -0.5 * (np.log(_POWERS) + values[part, None] ** 2 / quiet / _POWERS) / memory
            states = _viterbi(logs, _SWITCH, _CHANGE)
            active[part] = states > 0
            switches = int(np.sum(np.diff((states > 0).astype(np.int8)) != 0))
            likely += float(logs[np.arange(len(part)), states].sum()) - _SWITCH * switches
        power = max(float(np.mean(values[seen] ** 2)) / quiet, 1e-300)
        gain = likely + 0.5 * (np.log(power) + 1.0) * len(seen) / memory
        rest = seen[~active[seen]]
        if len(rest) < 0.1 * len(seen):
            break
        for part in parts:
            still = part[~active[part]]
            if len(still) > _FEWEST // 2:
                values[part] -= values[still].mean()
        quiet = max(float(np.mean(values[rest] ** 2)), 1e-300)
        beside = np.diff(rest) == 1
        follows = float(np.mean(values[rest][1:][beside] * values[rest][:-1][beside])) / quiet if beside.any() else 0.0
        follows = float(np.clip(follows, 0.0, 0.98))
        memory = max(least, (1.0 + follows**2) / (1.0 - follows**2))
    return active, values, float(gain)


@njit(cache=True, nogil=True)
def _viterbi(logs, switch, change):  # type: ignore[no-untyped-def]
    n, count = logs.shape
    origin = np.empty((n, count), np.int64)
    score, following = logs[0].copy(), np.empty(count)
    for t in range(1, n):
        for k in range(count):
            best, at = -np.inf, 0
            for j in range(count):
                cost = 0.0 if j == k else (switch if j == 0 or k == 0 else change)
                if score[j] - cost > best:
                    best, at = score[j] - cost, j
            following[k], origin[t, k] = best + logs[t, k], at
        score[:] = following
    states = np.empty(n, np.int64)
    states[n - 1] = np.argmax(score)
    for t in range(n - 1, 0, -1):
        states[t - 1] = origin[t, states[t]]
    return states


def _memory(residual: Vector, parts: list[Rows]) -> float:
    """Samples after which squares of the noise say something new, from its spectrum at short scales."""
    values = np.where(np.isfinite(residual), residual, 0.0)[None, :]
    levels = background(spectrum(values, parts), wanders=False).levels[0]
    ends = np.ones(len(levels))
    ends[[0, -1]] = 0.5
    lags = np.cos(np.outer(np.arange(60), np.linspace(0.0, np.pi, len(levels)))) @ (levels * ends)
    return float(1.0 + 2.0 * np.sum((lags[1:] / max(lags[0], 1e-300)) ** 2))


def _smoothed(values: Vector, width: int) -> Vector:
    kernel = np.ones(width)
    return np.asarray(np.convolve(values, kernel, "same") / np.convolve(np.ones(len(values)), kernel, "same"))


def _amount(values: Vector, parts: list[Rows], scale: int) -> Vector:
    result = np.zeros(len(values))
    for part in parts:
        result[part] = _smoothed(np.abs(values[part]), max(5, scale))
    return result


def _without_gaps(comparison: Comparison, active: Mask) -> Mask:
    """Active rows with short gaps filled; a run that is active nearly throughout is so as a whole."""
    active = active.copy()
    for _, rows in comparison.rows_of_runs():
        part, time = active[rows], comparison.time_s[rows]
        longest = _GAP * float(time[-1] - time[0])
        for last, first in pairwise(np.flatnonzero(part)):
            if first - last > 1 and time[first] - time[last] <= longest:
                part[last:first] = True
        if part.mean() > _ALWAYS:
            part[:] = True
    return active
