"""When something acts: windows of time in every run, and the state of the machine that tells them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from selector.diagnosis.answer import Place
from selector.diagnosis.comparison import Comparison
from selector.diagnosis.mismatch.background import seen_rows
from selector.diagnosis.mismatch.regimes import in_words
from selector.diagnosis.mismatch.segments import large_rows, noisy_rows

Vector = NDArray[np.float64]
Matrix = NDArray[np.float64]
Mask = NDArray[np.bool_]
_TRIFLE = 0.002
"""Windows with a smaller share of a course are not worth a word."""


def active_windows(comparison: Comparison, response: str, course: Vector) -> tuple[Place, ...]:
    """Windows in which something acts.

    `course` is an effect's fitted course, which acts where it is at least a quarter of its largest amount, or a
    residual, in which it acts where that is more than quiet noise. What acts in most of a run acts in all of it. A
    state of the machine stands beside the windows if it tells when they are. `share` is of the course's sum of squares.
    """
    clean = np.nan_to_num(course)
    if _is_clean(comparison, course):
        active = large_rows(comparison, clean)
    else:
        active = noisy_rows(comparison, course)
        if not active.any():
            active = np.isfinite(course)
    regime = in_words(comparison, active)
    total = float(np.sum(clean[active] ** 2)) or 1.0
    places = []
    for run, rows in comparison.rows_of_runs():
        edges = np.flatnonzero(np.diff(np.concatenate([[0], active[rows].astype(np.int8), [0]])))
        for first, end in zip(edges[::2], edges[1::2], strict=True):
            window = slice(rows.start + first, rows.start + end)
            share = float(np.sum(clean[window] ** 2)) / total
            if share < _TRIFLE:
                continue
            start, stop = float(comparison.time_s[window][0]), float(comparison.time_s[window][-1])
            places.append(Place(response, _place(comparison, response), run, start, stop, regime, share))
    return tuple(places)


def _is_clean(comparison: Comparison, course: Vector) -> bool:
    """Whether a course has no noise: complete, and its innovations are a small part of it."""
    if not np.isfinite(course).all():
        return False
    rows = seen_rows(comparison, course)
    if sum(len(here) for here in rows) == 0 or not np.any(course):
        return True
    # A noisy course changes its sense of motion at every other sample.
    turns = [np.mean(np.diff(np.sign(np.diff(course[here]))) != 0.0) for here in rows if len(here)]
    return float(np.mean(turns)) < 0.35


def _place(comparison: Comparison, response: str) -> str | None:
    return comparison.channel(response).place
