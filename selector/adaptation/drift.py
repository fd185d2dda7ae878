"""The error of a model as an offset and a gain that walk at random, followed by a Kalman filter from touch to touch.

A control does the same, one touch after the other (`selector.controllers.program.statements`; the equations:
docs/explanation/the-guard.md, *Touch-offs*).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numba import njit

from selector.types import Array, Indices, Mask

#: A reading so many standard deviations from what was expected is not believed before a second one agrees with it.
#:
#: Beyond the limit of the offset, farther than the teaching runs ever were, it takes a third one.
GATE = 4.0
AGREEING = 0.5  #: Two readings agree when they are so much nearer to each other than to what was expected.


@dataclass(frozen=True)
class Drift:
    """How the error of one output moves, and how well a touch-off is read."""

    offset_um2_per_s: float  #: Growth of the variance of the offset
    gain_per_s: float  #: Growth of the variance of the gain; 0 with `gain_start`: there is no gain
    offset_start_um2: float  #: Variance of the offset at the start of a run
    gain_start: float  #: Variance of the gain at the start of a run
    noise_um2: float  #: Variance of one reading
    offset_limit_um: float = np.inf  #: Largest magnitude of the offset
    gain_limit: float = np.inf  #: Largest magnitude of the gain

    @property
    def has_gain(self) -> bool:
        """Whether the prediction is scaled, too."""
        return self.gain_per_s > 0.0 or self.gain_start > 0.0


@dataclass(frozen=True, eq=False)
class Course:
    """One response in one run; NaN is what is not known. All arrays are of shape (n_samples,) or (n_touches,)."""

    run: str
    time_s: Array  #: Increases
    modelled_um: Array
    recorded_um: Array
    touched_at: Indices  #: Samples at which the true displacement was probed, or just before it was; increasing
    touched_um: Array

    def touched_every(self, period_s: float, first: float = 1.0) -> Course:
        """The same with touch-offs at the samples nearest after ``period_s · (first + 0, 1, 2 …)``."""
        known = self.judged
        if len(known) == 0:
            return self.touched(known[:0], np.zeros(0))
        times = self.time_s[known] - self.time_s[0]
        wanted = np.arange(first * period_s, times[-1] + 1e-9 * period_s, period_s)
        at = np.unique(np.searchsorted(times, wanted - 1e-9 * period_s))
        at = known[at[at < len(times)]]
        return self.touched(at, self.recorded_um[at])

    def touched(self, at: Indices, um: Array) -> Course:
        """The same with these touch-offs."""
        return Course(self.run, self.time_s, self.modelled_um, self.recorded_um, at, um)

    @property
    def judged(self) -> Indices:
        """Samples whose displacement is modelled and known."""
        return np.flatnonzero(np.isfinite(self.modelled_um) & np.isfinite(self.recorded_um))


#: The last reading is the offset: it walks without bound, and readings have no noise.
LAST_READING = Drift(1e6, 0.0, 1e9, 0.0, 1e-6)


class Tracked(NamedTuple):
    """What is known after 0, 1, 2 … touch-offs of each course; all of shape (n_courses, 1 + n_touches)."""

    since_s: Array  #: When it was last brought up to date
    offset: Array
    gain: Array
    offset_variance: Array
    covariance: Array
    gain_variance: Array
    is_believed: Mask  #: Whether the touch-off before was; true of the start


class Touches(NamedTuple):
    """Touch-offs of several courses beside each other, those of short ones filled up with NaN; (n_courses, n)."""

    time_s: Array
    error_um: Array  #: What was measured minus what the model says
    modelled_um: Array
    start_s: Array  #: (n_courses,)

    @classmethod
    def of(cls, courses: Sequence[Course]) -> Touches:
        """Those that the model has a prediction for."""
        most = max((len(one.touched_at) for one in courses), default=0)
        table = np.full((3, len(courses), most), np.nan)
        for k, one in enumerate(courses):
            n, modelled = len(one.touched_at), one.modelled_um[one.touched_at]
            table[:, k, :n] = one.time_s[one.touched_at], one.touched_um - modelled, modelled
        return cls(table[0], table[1], table[2], np.array([one.time_s[0] for one in courses]))


def tracked(drift: Drift, touches: Touches) -> Tracked:
    """The Kalman filter with its gate, over courses beside each other."""
    n_courses, n = touches.error_um.shape
    known, is_believed = np.zeros((6, n_courses, n + 1)), np.ones((n_courses, n + 1), dtype=np.bool_)
    _filter(touches, tuple(map(float, vars(drift).values())), known, is_believed)
    return Tracked._make([*known, is_believed])


@njit(cache=True, nogil=True, error_model="numpy")
def _filter(touches: Touches, drift: tuple[float, ...], known: Array, is_believed: Mask) -> None:
    """Fills the tables of `Tracked`, the first six in `known`; `drift` are the fields of a `Drift`."""
    offset_um2_per_s, gain_per_s, offset_start_um2, gain_start, noise_um2, offset_limit_um, gain_limit = drift
    time_s, error_um, modelled_um, start_s = touches
    n_courses, n = error_um.shape
    for i in range(n_courses):
        since, offset, gain, v, c, u = start_s[i], 0.0, 0.0, offset_start_um2, 0.0, gain_start
        doubted, doubts = np.nan, 0
        for k in range(n + 1):
            for row, value in enumerate((since, offset, gain, v, c, u)):
                known[row, i, k] = value
            if k == n:
                break
            e, m, believed = error_um[i, k], modelled_um[i, k], False
            if np.isfinite(e):
                passed = time_s[i, k] - since
                since += passed
                v, u = v + offset_um2_per_s * passed, u + gain_per_s * passed
                surprise = e - (offset + gain * m)
                of_offset, of_gain = v + c * m, c + u * m
                variance = of_offset + of_gain * m + noise_um2
                square = surprise * surprise
                is_far = square > GATE * GATE * variance
                # NaN, nothing doubted, agrees with nothing
                agrees = is_far and (e - doubted) * (e - doubted) <= AGREEING * AGREEING * square
                enough = agrees and doubts >= (1 if e * e <= offset_limit_um * offset_limit_um else 2)
                believed = not is_far or enough
                if enough:
                    v, of_offset, variance = v + square, of_offset + square, variance + square
                if believed:
                    doubted, doubts = np.nan, 0
                    share, of = of_offset / variance, of_gain / variance
                    offset = min(max(offset + share * surprise, -offset_limit_um), offset_limit_um)
                    gain = min(max(gain + of * surprise, -gain_limit), gain_limit)
                    v, c, u = v - share * of_offset, c - share * of_gain, u - of * of_gain
                else:
                    doubted, doubts = e, 2 if agrees else 1
            is_believed[i, k + 1] = believed


def probed_again(drift: Drift, course: Course) -> Course:
    """The same where a touch-off that is not believed is repeated at once, at the next sample with a displacement.

    Twice at most: a third reading that agrees is believed wherever it is.
    """
    repeats: dict[int, int] = {}
    while True:
        believed = tracked(drift, Touches.of([course])).is_believed[0, 1:]
        for at in course.touched_at[~believed].tolist():
            later = course.judged[course.judged > at]
            if len(later) and repeats.get(at, 0) < 2 and later[0] not in course.touched_at:
                repeats[int(later[0])] = repeats.get(at, 0) + 1
                touched_at = np.sort(np.append(course.touched_at, later[0]))
                course = course.touched(touched_at, course.recorded_um[touched_at])
                break
        else:
            return course


class Known(NamedTuple):
    """What is known before each sample; all of shape (n_samples,)."""

    added_um: Array  #: What is to be added to the model's prediction
    variance_um2: Array  #: Of a reading there

    @classmethod
    def before(cls, drift: Drift, of: Tracked, course: Indices, touches: Indices, time_s: Array, m: Array) -> Known:
        """At these samples of these courses, before which so many touch-offs were."""
        at = course * of[0].shape[1] + touches
        since_s, offset, gain, v, c, u = (table.take(at) for table in of[:6])
        passed = time_s - since_s
        v, u = v + drift.offset_um2_per_s * passed, u + drift.gain_per_s * passed
        return cls(offset + gain * m, v + 2.0 * c * m + u * m * m + drift.noise_um2)


def known_before(drift: Drift, course: Course) -> Known:
    """What was known before each judged sample; that of a touch-off counts with the state before it."""
    at = course.judged
    passed = np.searchsorted(course.touched_at, at, side="left")
    first, now = np.zeros(len(at), dtype=np.intp), tracked(drift, Touches.of([course]))
    return Known.before(drift, now, first, passed, course.time_s[at], course.modelled_um[at])
