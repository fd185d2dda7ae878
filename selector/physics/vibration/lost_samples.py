"""What was where nothing was recorded: a course that goes on as it went, before, after and in between.

An autoregression of the samples nearby (J. P. Burg) foretells the next sample from those before. A steady sine goes on
as one, noise fades to its mean. Samples lost in between are those that it foretells best from both sides (A. J. E. M.
Janssen, R. N. J. Veldhuis, L. B. Vries, IEEE Trans. ASSP 34, 1986).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy import linalg, signal

Vector = NDArray[np.float64]

_NEAR = 16384
"""Samples from which an end is continued."""
_ORDER = 256
_AROUND = 4096
"""Samples on either side of what is lost from which it is told."""
_BRIDGE_ORDER = 96
_MOST_ENTRIES = 20_000_000
_NOTHING = 1e-26
_RIDGE = 1e-13


def autoregression(values: Vector, order: int) -> Vector:
    """Coefficients a of Σ a_k·x_(n−k) = e_n, a_0 = 1, of at most this order; stable."""
    forward = backward = np.asarray(values, dtype=np.float64)
    found = np.ones(1)
    power = float(forward @ forward)
    for _ in range(min(order, len(values) - 1)):
        ahead, behind = forward[1:], backward[:-1]
        both = float(ahead @ ahead + behind @ behind)
        if both <= _NOTHING * power:
            break
        reflected = -2.0 * float(ahead @ behind) / both
        forward, backward = ahead + reflected * behind, behind + reflected * ahead
        longer = np.append(found, 0.0)
        found = longer + reflected * longer[::-1]
    return found


def continued(values: Vector, count: int, proved: int = 0) -> Vector:
    """The next `count` samples of a course without a mean, as it went on at its end.

    As far as that would have foretold its last `proved` samples: wholly, if half their power and more, else in part.
    A single blow is not repeated.
    """
    near = values[-_NEAR:]
    model = autoregression(near, min(_ORDER, len(near) // 3))
    if len(model) == 1 or count == 0:
        return np.zeros(count)
    next_ones = _next(near, model, count)
    proved = min(proved, len(near) // 4)
    if proved == 0:
        return next_ones
    last = near[-proved:]
    missed = last - _next(near[:-proved], model, proved)
    power = float(last @ last)
    return next_ones * min(max(2.0 - 2.0 * float(missed @ missed) / power, 0.0), 1.0) if power > 0.0 else next_ones


def _next(values: Vector, model: Vector, count: int) -> Vector:
    state = signal.lfiltic([1.0], model, values[: -len(model) : -1])
    return np.asarray(signal.lfilter([1.0], model, np.zeros(count), zi=state)[0])


def bridged(values: Vector, known: NDArray[np.bool_]) -> Vector:
    """A course with the samples that are not `known` as those around foretell them; at least one must be."""
    if known.all():
        return values
    seen = np.flatnonzero(known)
    places = np.arange(len(values))
    filled = np.interp(places, seen, values[seen])  # straight where nothing better is known
    within = slice(int(seen[0]), int(seen[-1]) + 1)
    there = filled[within]
    _bridge(there, known[within])
    level = there[:_NEAR].mean(), there[-_NEAR:].mean()
    filled[: seen[0]] = level[0] + continued(there[_NEAR::-1] - level[0], int(seen[0]))[::-1]
    filled[seen[-1] + 1 :] = level[1] + continued(there - level[1], len(values) - 1 - int(seen[-1]))
    return filled


def _bridge(filled: Vector, known: NDArray[np.bool_]) -> None:
    lost = np.flatnonzero(~known)
    while len(lost):
        # those within reach of the same neighbourhood together
        group = lost[: np.searchsorted(lost, lost[0] + _AROUND)]
        while len(group) < len(lost) and lost[len(group)] == group[-1] + 1:
            more = np.flatnonzero(np.diff(lost[len(group) - 1 :]) > 1)
            group = lost[: len(group) + int(more[0]) if len(more) else len(lost)]
        low, high = max(int(group[0]) - _AROUND, 0), int(group[-1]) + _AROUND + 1
        filled[group] = _foretold(filled[low:high], known[low:high])[group - low]
        lost = lost[len(group) :]


def _foretold(values: Vector, known: NDArray[np.bool_]) -> Vector:
    lost, level = np.flatnonzero(~known), float(values[known].mean())
    course = values - level
    model = _model_of_known(course, known, max(2, min(_BRIDGE_ORDER, _MOST_ENTRIES // len(lost))))
    if model is not None:
        _put_in(course, model, lost)
    return course + level


def _model_of_known(course: Vector, known: NDArray[np.bool_], most: int) -> Vector | None:
    """Coefficients with the least sum of squares forward and backward, by the known samples; None if too few are."""
    order = min(most, len(known) // 3)
    while order >= 1:
        whole = np.lib.stride_tricks.sliding_window_view(known, order + 1).all(axis=1)
        if whole.sum() >= 2 * order:
            row = np.lib.stride_tricks.sliding_window_view(course, order + 1)[whole]
            product = row.T @ row
            product += product[::-1, ::-1]  # the same backward
            inner = product[1:, 1:] + _RIDGE * max(np.trace(product), 1e-300) * np.eye(order)
            return np.concatenate(([1.0], -linalg.solve(inner, product[1:, 0], assume_a="pos")))
        order //= 2
    return None


def _put_in(course: Vector, model: Vector, lost: NDArray[np.int64]) -> None:
    """The lost samples with the least sum of squares of what the model foretells wrongly, forward and backward."""
    order, count = len(model) - 1, len(course)
    weight = 2.0 * np.correlate(model, model, "full")[order:]
    # sums that would reach beyond the ends are none
    beyond = linalg.toeplitz(model[:-1], np.zeros(order)).T @ linalg.toeplitz(model[:-1], np.zeros(order))
    beyond += linalg.hankel(model[1:]).T @ linalg.hankel(model[1:])
    course[lost] = 0.0
    load = signal.oaconvolve(course, np.concatenate((weight[:0:-1], weight)), "same")
    load[:order] -= beyond @ course[:order]
    load[-order:] -= (beyond @ course[: -order - 1 : -1])[::-1]
    band = np.zeros((min(order, len(lost) - 1) + 1, len(lost)))
    for beside in range(len(band)):
        first, second = lost[: len(lost) - beside], lost[beside:]
        near = second - first <= order
        entry = np.where(near, weight[np.minimum(second - first, order)], 0.0)
        entry[second < order] -= beyond[first[second < order], second[second < order]]
        last = first >= count - order
        entry[last] -= beyond[count - 1 - first[last], count - 1 - second[last]]
        band[beside, : len(entry)] = entry
    band[0] += _RIDGE * weight[0]
    course[lost] = linalg.solveh_banded(band, -load[lost], lower=True)
