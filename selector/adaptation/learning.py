"""Noise and drift by maximum likelihood: every sample of the teaching runs, given what was known before it."""

import math
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from scipy.optimize import minimize

from selector.adaptation.drift import Course, Drift, Known, Touches, tracked
from selector.types import Array

MOST_SAMPLES = 150
"""Of a run, evenly spread: more say the same."""

FALSE_SHARE = 1e-6
"""Share of readings that may be anything: what is beyond five standard deviations counts as if it were there.

One wrong reading among the teaching ones is not taken for noise, and a day that is unlike the others still teaches.
"""

BELIEVABLE = 0.99
"""Share of the errors of the teaching runs that are no larger than the largest that is believed."""

LARGEST_GAIN = 0.5
_ROOM = 2.0
"""The offset may become so many times as large as the largest error that the teaching runs have."""

_LOW, _HIGH = 1e-7, 1e3
"""Bounds of a variance, in units of that of the error (per length of a run for drifts)."""
_SMALLEST_UM2 = 1e-4
_STARTS = np.array([[0.3, 0.3, 0.03, 0.03, 0.03], [0.03, 0.1, 0.03, 0.003, 0.3]])
"""Variances that the search begins with, in the same units: a gain hides behind an offset that walks fast."""


def learnt_drift(courses: Sequence[Course], *, with_gain: bool, first: Drift | None = None) -> Drift:
    """The drift under which the samples of these courses were most likely, given the touch-offs before them.

    Each run has the same weight. The gain is 0 unless `with_gain`; `first` is where the search begins.
    """
    material = _Material(courses)
    error, size = material.error_um, material.size_um
    scale = np.array([error**2 / material.longest_s, error**2, error**2])
    if with_gain:
        scale = np.r_[scale, (error / size) ** 2 / material.longest_s, (error / size) ** 2]
    low = np.full(len(scale), _LOW)
    low[2] = min(max(1e-4, _SMALLEST_UM2 / scale[2]), 1.0)
    starts = _STARTS[: 2 if with_gain else 1, : len(scale)]
    if first is not None:
        start = np.array(starts[0])
        start[:3] = np.array([first.offset_um2_per_s, first.offset_start_um2, first.noise_um2]) / scale[:3]
        if with_gain and first.has_gain:
            start[3:] = np.array([first.gain_per_s, first.gain_start]) / scale[3:]
        starts = start[None, :]
    bounds = [(math.log(a), math.log(_HIGH)) for a in low]
    cost = material.cost_of(lambda x: _drift(np.exp(x) * scale))
    found = [
        minimize(
            cost,
            np.log(np.clip(start, low, _HIGH)),
            method="L-BFGS-B",
            bounds=bounds,
            options={"maxiter": 60, "ftol": 1e-7},
        )
        for start in starts
    ]
    drift = _drift(np.exp(min(found, key=lambda one: float(one.fun)).x) * scale)
    largest = math.sqrt(drift.gain_start + drift.gain_per_s * material.longest_s)
    return replace(
        drift,
        offset_limit_um=max(1.0, math.ceil(_ROOM * material.largest_um)),
        gain_limit=min(LARGEST_GAIN, 4.0 * largest) if with_gain else 0.0,
    )


def _drift(variances: Array) -> Drift:
    walk, start, noise, *gain = variances.tolist()
    of_walk, of_start = gain or (0.0, 0.0)
    return Drift(walk, of_walk, start, of_start, noise)


class _Material:
    """Samples of several courses, thinned, each with the number of touch-offs before it."""

    def __init__(self, courses: Sequence[Course]) -> None:
        self._touches = Touches.of(courses)
        parts = []
        for k, one in enumerate(courses):
            at = one.judged
            at = at[np.unique(np.linspace(0, len(at) - 1, min(len(at), MOST_SAMPLES)).astype(np.intp))]
            passed = np.searchsorted(one.touched_at, at, side="left")
            of = np.full(len(at), 1.0 / max(len(at), 1))
            error = one.recorded_um[at] - one.modelled_um[at]
            parts.append(np.array([np.full(len(at), k), passed, one.time_s[at], one.modelled_um[at], error, of]))
        course, passed, self._time_s, self._modelled_um, self._error_um, self._weight = np.concatenate(parts, axis=1)
        self._course, self._passed = course.astype(np.intp), passed.astype(np.intp)
        self._weight = self._weight / max(float(np.sum(self._weight)), 1e-300)
        self.error_um = max(float(np.sqrt(np.sum(self._weight * self._error_um**2))), 0.01)
        self.size_um = max(float(np.sqrt(np.sum(self._weight * self._modelled_um**2))), 0.01)
        self.largest_um = _largest_believable(self._error_um)
        self.longest_s = max((float(one.time_s[-1] - one.time_s[0]) for one in courses), default=1.0) or 1.0

    def cost_of(self, drift_of: Callable[[Array], Drift]) -> Callable[[Array], float]:
        """Minus the mean log likelihood of a sample."""
        wide = (10.0 * self.error_um) ** 2

        def cost(x: Array) -> float:
            drift = drift_of(x)
            known = Known.before(
                drift, tracked(drift, self._touches), self._course, self._passed, self._time_s, self._modelled_um
            )
            left = self._error_um - known.added_um
            variance = np.maximum(known.variance_um2, 1e-12)
            of_true = math.log(1.0 - FALSE_SHARE) - 0.5 * (np.log(variance) + left * left / variance)
            variance = variance + wide
            of_false = math.log(FALSE_SHARE) - 0.5 * (np.log(variance) + left * left / variance)
            return -float(np.sum(self._weight * np.logaddexp(of_true, of_false)))

        return cost


def _largest_believable(error_um: Array) -> float:
    """The largest magnitude, single false readings left out."""
    sizes = np.abs(error_um)
    return float(np.quantile(sizes, BELIEVABLE)) if len(sizes) else 0.0
