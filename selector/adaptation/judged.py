"""Does adaptation help? Each run is judged with what the other runs taught; and how often to probe.

Learnt are noise and drift, by maximum likelihood: every sample of the teaching runs, given what was known before it.
How often to probe so that the error stays within a limit is found by simulating each rate of probing on unseen runs.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np
from scipy.optimize import minimize

from selector.adaptation.drift import LAST_READING, Course, Drift, Known, Touches, known_before, probed_again, tracked
from selector.json_text import fields_of
from selector.types import Array

MOST_SAMPLES = 150  #: Of a run, evenly spread: more say the same.
#: Share of readings that may be anything: what is beyond five standard deviations counts as if it were there.
#:
#: One wrong reading among the teaching ones is not taken for noise, and a day that is unlike the others still teaches.
FALSE_SHARE = 1e-6
BELIEVABLE = 0.99  #: Share of the errors of the teaching runs that are no larger than the largest that is believed.
LARGEST_GAIN = 0.5
_ROOM = 2.0  #: The offset may become so many times as large as the largest error that the teaching runs have.
_LOW, _HIGH = 1e-7, 1e3  #: Bounds of a variance, in units of that of the error (per length of a run for drifts).
_SMALLEST_UM2 = 1e-4
#: Variances that the search begins with, in the same units: a gain hides behind an offset that walks fast.
_STARTS = np.array([[0.3, 0.3, 0.03, 0.03, 0.03], [0.03, 0.1, 0.03, 0.003, 0.3]])


def learnt_drift(courses: Sequence[Course], *, with_gain: bool, first: Drift | None = None) -> Drift:
    """The drift under which the samples of these courses were most likely, given the touch-offs before them.

    Each run has the same weight. The gain is 0 unless `with_gain`; `first` is where the search begins.
    """
    samples = _Samples(courses)
    error, size = samples.error_um, samples.size_um
    scale = np.array([error**2 / samples.longest_s, error**2, error**2])
    if with_gain:
        scale = np.r_[scale, (error / size) ** 2 / samples.longest_s, (error / size) ** 2]
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
    cost = samples.cost_of(lambda x: _drift(np.exp(x) * scale))
    how: Any = {"method": "L-BFGS-B", "bounds": bounds, "options": {"maxiter": 60, "ftol": 1e-7}}
    found = [minimize(cost, np.log(np.clip(start, low, _HIGH)), **how) for start in starts]
    drift = _drift(np.exp(min(found, key=lambda one: float(one.fun)).x) * scale)
    largest = math.sqrt(drift.gain_start + drift.gain_per_s * samples.longest_s)
    return replace(
        drift,
        offset_limit_um=max(1.0, math.ceil(_ROOM * samples.largest_um)),
        gain_limit=min(LARGEST_GAIN, 4.0 * largest) if with_gain else 0.0,
    )


def _drift(variances: Array) -> Drift:
    walk, start, noise, *gain = variances.tolist()
    of_walk, of_start = gain or (0.0, 0.0)
    return Drift(walk, of_walk, start, of_start, noise)


class _Samples:
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
        sizes = np.abs(self._error_um)
        # single false readings left out
        self.largest_um = float(np.quantile(sizes, BELIEVABLE)) if len(sizes) else 0.0
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


Kind = Literal["none", "offset", "offset+gain"]
KINDS: tuple[Kind, ...] = ("none", "offset", "offset+gain")

LEVEL = 0.9  #: Of the prediction intervals.
#: A richer kind has to leave less than this share of the error: on runs without drift chance alone makes 1 %.
WORTH = 0.98
#: When the first touch-off of a teaching run falls, in periods: a run teaches by several schedules.
PHASES = (0.25, 0.5, 0.75, 1.0)


@dataclass(frozen=True)
class Accuracy:
    """Errors of one response [µm], all over the same samples, each with what was known before it; None = unknown."""

    rmse_um: float | None
    max_um: float | None
    without_rmse_um: float | None  #: Of the model alone
    before_rmse_um: float | None  #: Without compensation
    touch_offs: int
    interval_share: float | None  #: Share of the samples inside their 90 % interval
    interval_um: float | None  #: Mean half width of these intervals

    def as_dict(self) -> dict[str, float | None]:
        """The fields of the contract."""
        return dict(vars(self))


@dataclass(frozen=True)
class Learnt:
    """What runs teach of one response."""

    drift: Drift
    widening: float  #: Half width of a 90 % interval in standard deviations


@dataclass(frozen=True, eq=False)
class JudgedRun:
    """One run, judged with what the others taught; all arrays are of shape (n_judged,)."""

    course: Course
    kind: Kind  #: As the other runs chose it
    time_s: Array
    recorded_um: Array
    modelled_um: Array
    predicted_um: Array  #: Adapted
    half_width_um: Array  #: Of the 90 % interval; NaN without adaptation

    @property
    def error_um(self) -> Array:
        """What the adapted model leaves."""
        return self.recorded_um - self.predicted_um


@dataclass(frozen=True, eq=False)
class Judged:
    """One response."""

    kind: Kind
    learnt: Learnt | None  #: By all runs; None: nothing is adapted
    runs: tuple[JudgedRun, ...]
    accuracy: Mapping[str, Accuracy]  #: By run
    overall: Accuracy
    rmse_um_of: Mapping[Kind, float]  #: Over all unseen runs, by kind; empty if it could not be judged
    #: Of each run, in their order, with the last reading as the offset; empty if it could not be judged
    last_reading_um: tuple[float, ...] = ()

    @property
    def last_reading_rmse_um(self) -> float | None:
        """Over all samples of all runs, with the last reading as the offset."""
        n = [len(one.time_s) for one in self.runs]
        if not self.last_reading_um:
            return None
        return float(np.sqrt(np.average(np.square(self.last_reading_um), weights=n)))


def judged(courses: Sequence[Course], every_s: float | None) -> Judged:
    """Adaptation of one response, each run with what the others taught.

    With `every_s` the recorded displacement is touched off in that period [s], and again where that is not believed;
    else as the courses say.
    """
    seen = [one for one in courses if len(one.judged)]
    actual = [one if every_s is None else one.touched_every(every_s) for one in seen]
    teaching = [[one] if every_s is None else [one.touched_every(every_s, phase) for phase in PHASES] for one in seen]
    is_touched = any(len(one.touched_at) for one in actual)
    if len(seen) < 2 or not is_touched:
        return _told("none", None, [_without(one) for one in actual], {})  # nothing was learnt
    lessons = {kind: _lessons(teaching, with_gain=kind == "offset+gain") for kind in KINDS[1:]}
    runs: dict[Kind, list[JudgedRun]] = {"none": [_without(one) for one in actual]}
    for kind, (_, each) in lessons.items():
        runs[kind] = [
            _judged_run(one if every_s is None else probed_again(learnt.drift, one), learnt, kind)
            for one, learnt in zip(actual, each, strict=True)
        ]
    sums = {kind: np.array([np.sum(one.error_um**2) for one in of]) for kind, of in runs.items()}
    n = sum(len(one.time_s) for one in runs["none"])
    chosen = [_chosen({kind: float(np.sum(of) - of[k]) for kind, of in sums.items()}) for k in range(len(seen))]
    # a kind that one run alone makes the best is none that the runs bear out
    final = min(chosen, key=KINDS.index)
    rmse = {kind: float(np.sqrt(np.sum(of) / n)) for kind, of in sums.items()}
    learnt = None if final == "none" else lessons[final][0]
    last = [_rms(one.recorded_um - one.modelled_um - known_before(LAST_READING, one.course).added_um)
            for one in runs["none"]]  # fmt: skip
    told = _told(final, learnt, [runs[kind][k] for k, kind in enumerate(chosen)], rmse)
    return replace(told, last_reading_um=tuple(last))


def _lessons(teaching: Sequence[Sequence[Course]], *, with_gain: bool) -> tuple[Learnt, list[Learnt]]:
    """What all runs teach, and what all but one do.

    How wide the intervals are is learnt from runs that did not teach the drift, either.
    """

    def drift(left_out: int | None, first: Drift | None) -> Drift:
        courses = [one for k, several in enumerate(teaching) if k != left_out for one in several]
        return learnt_drift(courses, with_gain=with_gain, first=first)

    whole = drift(None, None)
    each = [drift(k, whole) for k in range(len(teaching))]
    sizes = [
        np.concatenate([_standardised(of, course) for course in several])
        for of, several in zip(each, teaching, strict=True)
    ]
    widenings = [_quantile(sizes[:k] + sizes[k + 1 :]) for k in range(len(each))]
    return Learnt(whole, _quantile(sizes)), [Learnt(*one) for one in zip(each, widenings, strict=True)]


def _quantile(sizes: Sequence[Array]) -> float:
    """What `LEVEL` of the samples of another run stay below; each run has the same weight.

    A few runs do not show how different the next one can be: of what lies outside, one part in their number is kept in.
    """
    values = np.concatenate(sizes)
    weights = np.concatenate([np.full(len(one), 1.0 / len(one)) for one in sizes])
    order = np.argsort(values)
    share = np.cumsum(weights[order]) / np.sum(weights)
    level = LEVEL + (1.0 - LEVEL) / len(sizes)
    return float(values[order][min(int(np.searchsorted(share, level)), len(order) - 1)])


def _chosen(squares: Mapping[Kind, float]) -> Kind:
    """The simplest kind that a richer one does not clearly beat."""
    best: Kind = "none"
    for kind in KINDS[1:]:
        if squares[kind] < WORTH**2 * squares[best]:
            best = kind
    return best


def _standardised(drift: Drift, course: Course) -> Array:
    known, at = known_before(drift, course), course.judged
    left = course.recorded_um[at] - course.modelled_um[at] - known.added_um
    return np.asarray(np.abs(left) / np.sqrt(known.variance_um2))


def _judged_run(course: Course, learnt: Learnt, kind: Kind) -> JudgedRun:
    known, at = known_before(learnt.drift, course), course.judged
    m, width = course.modelled_um[at], learnt.widening * np.sqrt(known.variance_um2)
    return JudgedRun(course, kind, course.time_s[at], course.recorded_um[at], m, m + known.added_um, width)


def _without(course: Course) -> JudgedRun:
    at = course.judged
    m = course.modelled_um[at]
    return JudgedRun(course, "none", course.time_s[at], course.recorded_um[at], m, m, np.full(len(at), np.nan))


def _told(kind: Kind, learnt: Learnt | None, runs: Sequence[JudgedRun], rmse: Mapping[Kind, float]) -> Judged:
    accuracy = {one.course.run: accuracy_of([one]) for one in runs}
    return Judged(kind, learnt, tuple(runs), accuracy, accuracy_of(runs), rmse)


def accuracy_of(runs: Sequence[JudgedRun]) -> Accuracy:
    """Over all samples of these runs together."""
    touches = sum(len(one.course.touched_at) for one in runs)
    if not sum(len(one.time_s) for one in runs):
        return Accuracy(None, None, None, None, touches, None, None)

    def joined(of: Callable[[JudgedRun], Array]) -> Array:
        return np.concatenate([of(one) for one in runs])

    error, width = joined(lambda one: one.error_um), joined(lambda one: one.half_width_um)
    recorded, without = joined(lambda one: one.recorded_um), joined(lambda one: one.recorded_um - one.modelled_um)
    has_width = np.isfinite(width)
    return Accuracy(
        _rms(error),
        float(np.max(np.abs(error))),
        _rms(without),
        _rms(recorded),
        touches,
        float(np.mean(np.abs(error[has_width]) <= width[has_width])) if has_width.any() else None,
        float(np.mean(width[has_width])) if has_width.any() else None,
    )


def _rms(values: Array) -> float:
    return float(np.sqrt(np.mean(np.square(values))))


SHARE = 0.95  #: Of the time that the error has to stay within the limit.
DAY_S = 86_400.0
#: Periods of probing that a shop can keep, the rarest first; nobody probes more often than every five minutes.
RATES_S = (86400.0, 43200.0, 28800.0, 21600.0, 14400.0, 10800.0, 7200.0, 5400.0, 3600.0, 2700.0, 1800.0, 1200.0, 900.0,
           600.0, 300.0)  # fmt: skip


@dataclass(frozen=True)
class Policy:
    """When to probe."""

    within_um: float
    every_s: float | None  #: None: not at all
    #: Smallest share of the samples of any response within the limit, with this period, on runs that did not teach
    share_within: float
    share_within_unseen: float  #: The same where each run's period was chosen by the other runs
    is_reached: bool

    @property
    def touch_offs_per_day(self) -> float:
        """Probings in 24 h of running."""
        return 0.0 if self.every_s is None else DAY_S / self.every_s

    def as_dict(self) -> dict[str, object]:
        """The object of the contract."""
        names = ("within_um", "touch_offs_per_day", "share_within", "share_within_unseen", "every_s", "is_reached")
        return fields_of(self, *names)


def policy_within(
    within_um: float, courses: Mapping[str, Sequence[Course]], say: Callable[[str], None] | None = None
) -> tuple[Policy, dict[str, Judged]]:
    """The rarest period of probing that holds every response within ± `within_um`, and what it leaves of the errors.

    It has to whichever run is left out: a period that only one quiet day allows is none for the next. If none does,
    the period that held most.
    """
    nothing = np.zeros(0, dtype=np.intp)
    untouched = {name: [one.touched(nothing, np.zeros(0)) for one in several] for name, several in courses.items()}
    found: list[tuple[float | None, dict[str, Judged]]] = []
    shares: list[dict[str, np.ndarray]] = []
    is_reached = False
    for period in _periods(courses):
        if say is not None:
            say("without touch-offs" if period is None else f"a touch-off every {period / 60.0:g} min")
        of = {name: judged(several, period) for name, several in untouched.items()}
        found.append((period, of))
        shares.append({name: _inside(one, within_um) for name, one in of.items()})
        if is_reached := _holds(shares[-1]):
            break
    at = len(found) - 1 if is_reached else max(range(len(found)), key=lambda k: _share(shares[k]))
    period, of = found[at]
    return Policy(within_um, period, _share(shares[at]), _share_unseen(shares), is_reached), of


def _periods(courses: Mapping[str, Sequence[Course]]) -> list[float | None]:
    """None, and the rates that fall into the runs and are not faster than their samples."""
    runs = [one for several in courses.values() for one in several if len(one.judged) > 1]
    longest_s = max((float(one.time_s[-1] - one.time_s[0]) for one in runs), default=0.0)
    step_s = max((float(np.median(np.diff(one.time_s))) for one in runs), default=np.inf)
    return [None, *(rate for rate in RATES_S if 2.0 * step_s <= rate <= longest_s)]


def _inside(one: Judged, within_um: float) -> np.ndarray:
    """Per run, samples within and samples in all; of shape (n_runs, 2)."""
    counts = [(int(np.sum(np.abs(run.error_um) <= within_um)), len(run.time_s)) for run in one.runs]
    return np.array(counts).reshape(-1, 2)


def _share(of: Mapping[str, np.ndarray], left_out: int = -1) -> float:
    """The smallest share of any response, over all runs, or all but one."""
    sums = [counts[np.arange(len(counts)) != left_out].sum(axis=0) for counts in of.values()]
    return min((float(inside / n) if n else 0.0 for inside, n in sums), default=0.0)


def _holds(of: Mapping[str, np.ndarray]) -> bool:
    """Whether the share is enough over all runs, and over all but any one of them."""
    n_runs = max(map(len, of.values()), default=0)
    return all(_share(of, left_out=k) >= SHARE for k in [-1, *range(n_runs if n_runs > 1 else 0)])


def _share_unseen(shares: Sequence[Mapping[str, np.ndarray]]) -> float:
    """The smallest share of any response, each run probed as often as the other runs ask for.

    A run whose others ask for more than was looked at is probed as often as was looked at.
    """
    names = list(shares[0])
    n_runs = {name: len(shares[0][name]) for name in names}
    total = {name: np.zeros(2) for name in names}
    for k in range(max(n_runs.values(), default=0)):
        enough = [i for i, of in enumerate(shares) if _share(of, left_out=k) >= SHARE]
        best = enough[0] if enough else max(range(len(shares)), key=lambda i: _share(shares[i], left_out=k))
        for name in names:
            if k < n_runs[name]:
                total[name] += shares[best][name][k]
    return min((float(inside / n) for inside, n in total.values() if n), default=0.0)
