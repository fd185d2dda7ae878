"""How good are the answers: every score with its interval beside its bar and goal, and what is taken for what."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray
from scipy.stats import beta

from proving_ground.judging import FAILED, Credit, Named, is_hidden
from proving_ground.runner import Outcome
from selector.types import Vector

LEVEL = 0.95
_RESAMPLES = 2000


@dataclass(frozen=True)
class Measured:
    """A value with its 95 % interval, and of how many it was made; `value` is None where there were none."""

    value: float | None
    low: float | None
    high: float | None
    n: int


NOTHING = Measured(None, None, None, 0)


def share_measured(hits: Sequence[bool]) -> Measured:
    """Share of hits with the interval of Clopper and Pearson (Biometrika 26, 1934, 404)."""
    n, k = len(hits), sum(hits)
    if n == 0:
        return NOTHING
    tail = (1.0 - LEVEL) / 2.0
    low = 0.0 if k == 0 else float(beta.ppf(tail, k, n - k + 1))
    high = 1.0 if k == n else float(beta.ppf(1.0 - tail, k + 1, n - k))
    return Measured(k / n, low, high, n)


def bootstrapped(values: Vector, statistic: Callable[[Vector], float]) -> Measured:
    """A statistic of the rows of `values` with its percentile interval; the resamples are always the same."""
    n = len(values)
    if n == 0:
        return NOTHING
    draw = np.random.default_rng(0)
    drawn = [statistic(values[draw.integers(0, n, n)]) for _ in range(_RESAMPLES)]
    tail = 100.0 * (1.0 - LEVEL) / 2.0
    low, high = np.percentile([value for value in drawn if math.isfinite(value)], [tail, 100.0 - tail])
    return Measured(float(statistic(values)), float(low), float(high), n)


STRONG = 6.0
"""d′ from which on place, gain and what lies outside the catalogue are scored."""
_BINS = 10


@dataclass(frozen=True)
class Bin:
    """Named effects of like confidence: their mean confidence, the share that is right, and how many they are."""

    confidence: float
    right: Measured


@dataclass(frozen=True)
class Power:
    """How often the effects of one id were found at one strength: named, or in a set."""

    id: str
    d_prime: float
    found: Measured
    exact: Measured


def is_clean(outcome: Outcome) -> bool:
    """Whether nothing at all is missing: no effect was put in, and the parameters are not wrong either."""
    return outcome.truth is not None and not outcome.truth.effects and outcome.kind in ("clean", "decoy")


def calibration(outcomes: Iterable[Outcome]) -> tuple[Bin, ...]:
    """Confidence against the share that is right, in bins of equal width; empty bins are left out."""
    pairs = _confidences(outcomes)
    bins = []
    for rows in _binned(pairs):
        bins.append(Bin(float(pairs[rows, 0].mean()), share_measured([bool(right) for right in pairs[rows, 1]])))
    return tuple(bins)


def power(outcomes: Iterable[Outcome]) -> tuple[Power, ...]:
    """How often each effect of the catalogue was found, by id and strength asked for."""
    given: dict[tuple[str, float], list[str]] = {}
    for outcome in outcomes:
        if outcome.truth is None or outcome.d_prime_asked is None:
            continue
        inside = [effect.id for effect in outcome.truth.effects if not is_hidden(effect)]
        for name, credit in zip(inside, outcome.judged.credits, strict=True):
            given.setdefault((name, outcome.d_prime_asked), []).append(credit)
    return tuple(
        Power(name, d_prime, share_measured([c != "missed" for c in got]), share_measured([c == "exact" for c in got]))
        for (name, d_prime), got in sorted(given.items())
    )


Better = Literal["low", "high", "zero", "neither"]
Measure = Callable[[Sequence[Outcome]], Measured]


@dataclass(frozen=True)
class Score:
    """What a score is: its key, name, what measures it, unit (``"share"``, ``"1"``, ``"s"``), what is good enough.

    `better` says on which side of `bar` and `goal` it has to be: "low", "high", or "zero" = 0 within the interval or
    above it.
    """

    key: str
    title: str
    measure: Measure
    better: Better = "neither"
    bar: float | None = None
    goal: float | None = None
    unit: str = "share"


def is_strong(outcome: Outcome) -> bool:
    """Whether place, gain and what lies outside the catalogue are scored."""
    return outcome.d_prime_asked is None or outcome.d_prime_asked >= STRONG


def _share(hits: Callable[[Outcome], Iterable[bool | None]]) -> Measure:
    """Of all hits of all outcomes; None counts neither way."""
    return lambda outcomes: share_measured([hit for one in outcomes for hit in hits(one) if hit is not None])


def _of(values: Callable[[Outcome], Iterable[float | None]], statistic: Callable[[Vector], np.floating]) -> Measure:
    """A statistic over the values of all outcomes; None counts neither way."""

    def measure(outcomes: Sequence[Outcome]) -> Measured:
        known = [value for one in outcomes for value in values(one) if value is not None]
        return bootstrapped(np.array(known, dtype=np.float64), lambda drawn: float(statistic(drawn)))

    return measure


def _credited(d_prime: float | None, *given: Credit) -> Measure:
    """Share of the true effects, in cases of this strength, that one of these credits was given for."""
    return _share(lambda one: [credit in given for credit in one.judged.credits if one.d_prime_asked == d_prime])


def _false(asked: Callable[[Outcome], bool]) -> Measure:
    """Share of these cases in which a false name was given."""
    return _share(lambda one: [bool(one.judged.false_names)] if asked(one) else [])


def _verdicts(*kinds: str) -> Measure:
    return _share(lambda one: [one.judged.verdict_right] if not kinds or one.kind in kinds else [])


def _calibration(outcomes: Sequence[Outcome]) -> Measured:
    return bootstrapped(_confidences(outcomes), _calibration_error)


def _confidences(outcomes: Iterable[Outcome]) -> Vector:
    pairs = [pair for one in outcomes for pair in one.judged.confidences]
    return np.array(pairs, dtype=np.float64).reshape(-1, 2)


def _binned(pairs: Vector) -> list[NDArray[np.intp]]:
    number = np.minimum((pairs[:, 0] * _BINS).astype(int), _BINS - 1)
    return [rows for k in range(_BINS) if len(rows := np.flatnonzero(number == k))]


def _calibration_error(pairs: Vector) -> float:
    """Expected calibration error: mean of |share right − mean confidence| over bins, weighted by their sizes."""
    gaps = [len(rows) * abs(pairs[rows, 1].mean() - pairs[rows, 0].mean()) for rows in _binned(pairs)]
    return float(sum(gaps) / len(pairs))


_FOUND: tuple[Credit, ...] = ("exact", "first", "set")
_IN_SET = "right name, or a set that contains it"
_UNEXPLAINED = _share(lambda one: [one.judged.unexplained_right if is_strong(one) else None])
_CHANNEL = _share(lambda one: [one.judged.channel_right if is_strong(one) else None])
_WINDOWS = _of(lambda one: [one.judged.window_iou if is_strong(one) else None], np.median)
_GAP = _of(lambda one: [one.judged.gap_closed if is_strong(one) and one.judged.credits else None], np.median)
_PLACEBO = _of(lambda one: [value for value, _, _ in one.judged.placebo], np.mean)
_COVERS = _share(lambda one: [low <= 0.0 <= high for _, low, high in one.judged.placebo])
_SECONDS = _of(lambda one: [one.seconds if one.truth is not None else None], np.median)
_OUTSIDE = _false(lambda one: one.judged.unexplained_right is not None)

ROWS: tuple[Score, ...] = (
    Score("false_on_clean", "any false name on clean cases", _false(is_clean), "low", 0.05, 0.01),
    Score("found_6", f"{_IN_SET}, at d′ = 6", _credited(6.0, *_FOUND), "high", 0.90, 0.95),
    Score("exact_6", "exactly the right name at d′ = 6", _credited(6.0, "exact"), "high", 0.75, 0.90),
    Score(
        "unexplained", "outside the catalogue, d′ ≥ 6: unexplained and no wrong name", _UNEXPLAINED, "high", 0.8, 0.95
    ),
    Score("window_iou", "windows: intersection over union, median, d′ ≥ 6", _WINDOWS, "high", 0.5, 0.8, "1"),
    Score("channel", "channel right, d′ ≥ 6", _CHANNEL, "high", 0.90, 0.98),
    Score("gap_closed", "held-out gap recalibrated → oracle closed, median, d′ ≥ 6", _GAP, "high", 0.70, 0.90),
    Score("placebo", "gain of placebos, mean", _PLACEBO, "zero", 0.0, 0.0),
    Score("calibration", "calibration error of the confidence (ECE)", _calibration, "low", 0.10, 0.05, "1"),
    Score("seconds", "seconds a case, median", _SECONDS, "low", 60.0, 10.0, "s"),
    Score("first_6", "right name first, whatever else is in the set, at d′ = 6", _credited(6.0, "exact", "first")),
    Score("found_3", f"{_IN_SET}, at d′ = 3", _credited(3.0, *_FOUND)),
    Score("exact_3", "exactly the right name at d′ = 3", _credited(3.0, "exact")),
    Score("found_12", f"{_IN_SET}, at d′ = 12", _credited(12.0, *_FOUND)),
    Score("exact_12", "exactly the right name at d′ = 12", _credited(12.0, "exact")),
    Score("found_real", f"{_IN_SET}, where no strength can be chosen", _credited(None, *_FOUND)),
    Score("verdict", "verdict right, all cases", _verdicts()),
    Score("verdict_miscalibrated", "verdict right, miscalibrated cases", _verdicts("miscalibrated")),
    Score("verdict_data", "verdict right, faults of the data", _verdicts("data")),
    Score("false_on_all", "any false name, all cases", _false(lambda one: one.truth is not None)),
    Score("false_outside", "any false name, outside the catalogue", _OUTSIDE),
    Score("placebo_covers", "placebos whose own interval holds 0", _COVERS),
    Score("failed", "cases that raised an error", _share(lambda one: [one.failed])),
)


def scores(outcomes: Sequence[Outcome]) -> Mapping[str, Measured]:
    """Every score by its key, see `ROWS`; of one answerer's outcomes."""
    return {score.key: score.measure(outcomes) for score in ROWS}


@dataclass(frozen=True)
class Row:
    """A score, what was measured, and whether that meets first bar and goal; None where there is none, or no case."""

    score: Score
    measured: Measured
    meets_bar: bool | None
    meets_goal: bool | None

    def as_dict(self) -> dict[str, Any]:
        """The row as JSON values."""
        return {
            "score": self.score.title,
            "unit": self.score.unit,
            **vars(self.measured),
            "first_bar": self.score.bar,
            "goal": self.score.goal,
            "meets_first_bar": self.meets_bar,
            "meets_goal": self.meets_goal,
        }


def score_table(measured: Mapping[str, Measured]) -> tuple[Row, ...]:
    """The rows in order, judged against first bar and goal."""
    known = [(score, measured[score.key]) for score in ROWS]
    return tuple(Row(score, one, _meets(score, score.bar, one), _meets(score, score.goal, one)) for score, one in known)


def _meets(score: Score, limit: float | None, measured: Measured) -> bool | None:
    if limit is None or measured.value is None or measured.low is None:
        return None
    if score.better == "zero":
        return measured.low <= 0.0
    return measured.value <= limit if score.better == "low" else measured.value >= limit


SET, UNEXPLAINED, NOTHING_NAMED, CLEAN = "right, in a set", "unexplained", "nothing", "(nothing missing)"
_LAST = (SET, UNEXPLAINED, NOTHING_NAMED, FAILED)


@dataclass(frozen=True, eq=False)
class Confusion:
    """Counts of answers: a row for each true id, a column for each thing that was said.

    A true effect counts once, under its right name if that was given. Names beside it that are false count in the row
    of the first true effect, so that a row may hold more than there were cases.
    """

    true: tuple[str, ...]
    said: tuple[str, ...]
    counts: NDArray[np.int64]
    cases: tuple[int, ...]


def confusion(outcomes: Iterable[Outcome], *, least_d_prime: float = 0.0) -> Confusion:
    """True effects against what was named, over cases from this strength on; clean cases have a row of their own."""
    counts: Counter[tuple[str, str]] = Counter()
    cases: Counter[str] = Counter()
    for outcome in outcomes:
        if outcome.truth is None or (outcome.d_prime_asked or np.inf) < least_d_prime:
            continue
        for true, said in _pairs(outcome):
            counts[true, said] += 1
        cases.update([effect.id for effect in outcome.truth.effects] or [_clean_name(outcome)])
    rows = sorted(cases, key=lambda name: (name.startswith(("(", "hidden.")), name))
    named = {said for _, said in counts}
    columns = sorted(named - set(_LAST)) + [said for said in _LAST if said in named]
    table = np.array([[counts[true, said] for said in columns] for true in rows], dtype=np.int64)
    return Confusion(
        tuple(rows), tuple(columns), table.reshape(len(rows), len(columns)), tuple(cases[name] for name in rows)
    )


def _clean_name(outcome: Outcome) -> str:
    return CLEAN if outcome.kind != "miscalibrated" else "(miscalibrated)"


def _pairs(outcome: Outcome) -> list[tuple[str, str]]:
    """(true id, what was said) of every true effect and every false name of a case."""
    assert outcome.truth is not None
    effects = outcome.truth.effects
    false = list(dict.fromkeys(outcome.judged.false_names))
    if not effects:
        return [(_clean_name(outcome), said) for said in false or [_silence(outcome)]]
    pairs = []
    for effect in effects:
        said = None if is_hidden(effect) else _right_name(effect.accept, outcome.stated.effects, effect.id)
        if said is not None:
            pairs.append((effect.id, said))
        elif not false:
            pairs.append((effect.id, _silence(outcome)))
    return pairs + [(effects[0].id, said) for said in false]


def _right_name(accept: tuple[str, ...], named: tuple[Named, ...], id: str) -> str | None:  # noqa: A002
    ids = [one.id for one in named if one.id in accept]
    if ids:
        return id if id in ids else ids[0]
    return SET if any(set(accept) & set(one.ids) for one in named) else None


def _silence(outcome: Outcome) -> str:
    verdict = outcome.stated.verdict
    return verdict if verdict in (FAILED, UNEXPLAINED) else NOTHING_NAMED
