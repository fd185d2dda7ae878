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

from selector.proof.judging import FAILED, Named, is_hidden
from selector.proof.runner import Outcome
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


def scores(outcomes: Sequence[Outcome]) -> Mapping[str, Measured]:
    """Every score by its key, see `selector.proof.scoring.ROWS`; of one answerer's outcomes."""
    return {key: measure(outcomes) for key, measure in _MEASURES.items()}


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


def _credits(outcomes: Iterable[Outcome], d_prime: float | None) -> list[str]:
    return [credit for one in outcomes if _asked(one, d_prime) for credit in one.judged.credits]


def _asked(outcome: Outcome, d_prime: float | None) -> bool:
    return outcome.d_prime_asked == d_prime


def _strong(outcomes: Iterable[Outcome]) -> list[Outcome]:
    return [one for one in outcomes if one.d_prime_asked is None or one.d_prime_asked >= STRONG]


def _found(d_prime: float | None) -> Callable[[Sequence[Outcome]], Measured]:
    return lambda outcomes: share_measured([credit != "missed" for credit in _credits(outcomes, d_prime)])


def _exact(d_prime: float | None) -> Callable[[Sequence[Outcome]], Measured]:
    return lambda outcomes: share_measured([credit == "exact" for credit in _credits(outcomes, d_prime)])


def _first(outcomes: Sequence[Outcome]) -> Measured:
    return share_measured([credit in ("exact", "first") for credit in _credits(outcomes, STRONG)])


def _unexplained(outcomes: Sequence[Outcome]) -> Measured:
    hits = [one.judged.unexplained_right for one in _strong(outcomes)]
    return share_measured([hit for hit in hits if hit is not None])


def _false_outside(outcomes: Sequence[Outcome]) -> Measured:
    return share_measured([bool(o.judged.false_names) for o in outcomes if o.judged.unexplained_right is not None])


def _false_on_clean(outcomes: Sequence[Outcome]) -> Measured:
    return share_measured([bool(one.judged.false_names) for one in outcomes if is_clean(one)])


def _false_on_all(outcomes: Sequence[Outcome]) -> Measured:
    return share_measured([bool(one.judged.false_names) for one in outcomes if one.truth is not None])


def _channel(outcomes: Sequence[Outcome]) -> Measured:
    hits = [one.judged.channel_right for one in _strong(outcomes)]
    return share_measured([hit for hit in hits if hit is not None])


def _iou(outcomes: Sequence[Outcome]) -> Measured:
    values = [one.judged.window_iou for one in _strong(outcomes)]
    return bootstrapped(np.array([value for value in values if value is not None]), _median)


def _gap(outcomes: Sequence[Outcome]) -> Measured:
    values = [one.judged.gap_closed for one in _strong(outcomes) if one.judged.credits]
    return bootstrapped(np.array([value for value in values if value is not None]), _median)


def _placebo(outcomes: Sequence[Outcome]) -> Measured:
    values = [value for one in outcomes for value, _, _ in one.judged.placebo]
    return bootstrapped(np.array(values), _mean)


def _placebo_covers(outcomes: Sequence[Outcome]) -> Measured:
    return share_measured([low <= 0.0 <= high for one in outcomes for _, low, high in one.judged.placebo])


def _ece(outcomes: Sequence[Outcome]) -> Measured:
    return bootstrapped(_confidences(outcomes), _calibration_error)


def _seconds(outcomes: Sequence[Outcome]) -> Measured:
    return bootstrapped(np.array([one.seconds for one in outcomes if one.truth is not None]), _median)


def _verdicts(*kinds: str) -> Callable[[Sequence[Outcome]], Measured]:
    def measure(outcomes: Sequence[Outcome]) -> Measured:
        return share_measured([one.judged.verdict_right for one in outcomes if not kinds or one.kind in kinds])

    return measure


def _failed(outcomes: Sequence[Outcome]) -> Measured:
    return share_measured([one.failed for one in outcomes])


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


def _median(values: Vector) -> float:
    return float(np.median(values))


def _mean(values: Vector) -> float:
    return float(np.mean(values))


_MEASURES: Mapping[str, Callable[[Sequence[Outcome]], Measured]] = {
    "false_on_clean": _false_on_clean,
    "found_6": _found(6.0),
    "exact_6": _exact(6.0),
    "first_6": _first,
    "found_3": _found(3.0),
    "exact_3": _exact(3.0),
    "found_12": _found(12.0),
    "exact_12": _exact(12.0),
    "found_real": _found(None),
    "unexplained": _unexplained,
    "false_outside": _false_outside,
    "window_iou": _iou,
    "channel": _channel,
    "gap_closed": _gap,
    "placebo": _placebo,
    "placebo_covers": _placebo_covers,
    "calibration": _ece,
    "seconds": _seconds,
    "verdict": _verdicts(),
    "verdict_miscalibrated": _verdicts("miscalibrated"),
    "verdict_data": _verdicts("data"),
    "false_on_all": _false_on_all,
    "failed": _failed,
}


Better = Literal["low", "high", "zero", "neither"]


@dataclass(frozen=True)
class Score:
    """What a score is: its key, name, unit (``"share"``, ``"1"``, ``"s"``), and what would be good enough.

    `better` says on which side of `bar` and `goal` it has to be: "low", "high", or "zero" = 0 within the interval or
    above it.
    """

    key: str
    title: str
    better: Better = "neither"
    bar: float | None = None
    goal: float | None = None
    unit: str = "share"


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


ROWS: tuple[Score, ...] = (
    Score("false_on_clean", "any false name on clean cases", "low", 0.05, 0.01),
    Score("found_6", "right name, or a set that contains it, at d′ = 6", "high", 0.90, 0.95),
    Score("exact_6", "exactly the right name at d′ = 6", "high", 0.75, 0.90),
    Score("unexplained", "outside the catalogue, d′ ≥ 6: unexplained and no wrong name", "high", 0.80, 0.95),
    Score("window_iou", "windows: intersection over union, median, d′ ≥ 6", "high", 0.5, 0.8, "1"),
    Score("channel", "channel right, d′ ≥ 6", "high", 0.90, 0.98),
    Score("gap_closed", "held-out gap recalibrated → oracle closed, median, d′ ≥ 6", "high", 0.70, 0.90),
    Score("placebo", "gain of placebos, mean", "zero", 0.0, 0.0),
    Score("calibration", "calibration error of the confidence (ECE)", "low", 0.10, 0.05, "1"),
    Score("seconds", "seconds a case, median", "low", 60.0, 10.0, "s"),
    Score("first_6", "right name first, whatever else is in the set, at d′ = 6"),
    Score("found_3", "right name, or a set that contains it, at d′ = 3"),
    Score("exact_3", "exactly the right name at d′ = 3"),
    Score("found_12", "right name, or a set that contains it, at d′ = 12"),
    Score("exact_12", "exactly the right name at d′ = 12"),
    Score("found_real", "right name, or a set that contains it, where no strength can be chosen"),
    Score("verdict", "verdict right, all cases"),
    Score("verdict_miscalibrated", "verdict right, miscalibrated cases"),
    Score("verdict_data", "verdict right, faults of the data"),
    Score("false_on_all", "any false name, all cases"),
    Score("false_outside", "any false name, outside the catalogue"),
    Score("placebo_covers", "placebos whose own interval holds 0"),
    Score("failed", "cases that raised an error"),
)


def score_table(measured: Mapping[str, Measured]) -> tuple[Row, ...]:
    """The rows in order, judged against first bar and goal."""
    return tuple(
        Row(
            score,
            measured[score.key],
            _meets(score, score.bar, measured[score.key]),
            _meets(score, score.goal, measured[score.key]),
        )
        for score in ROWS
    )


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
