"""How good are the answers: every score of the proof, counted over judged outcomes, with its interval."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from selector.proof.intervals import Measured, bootstrapped, share_measured
from selector.proof.judging import is_hidden
from selector.proof.runner import Outcome

Vector = NDArray[np.float64]
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
    """Every score by its key, see `selector.proof.score_table.ROWS`; of one answerer's outcomes."""
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
