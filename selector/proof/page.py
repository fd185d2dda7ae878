"""What of the proof stands on its page: judged outcomes as the plain values that the report draws."""

from __future__ import annotations

from collections.abc import Sequence

from selector.figures.proof_scores import Share
from selector.proof.confusion import NOTHING, SET, UNEXPLAINED, confusion
from selector.proof.intervals import Measured, share_measured
from selector.proof.oracle import detection_probability
from selector.proof.results import answers_sha256, by_answerer, judgement, measured_text, named_texts, row_texts
from selector.proof.rivals import RIVALS
from selector.proof.runner import TOOL, Outcome
from selector.proof.score_table import ROWS, score_table
from selector.proof.scoring import STRONG, calibration, power, scores
from selector.proof.sealing import seal_of
from selector.report.proof_report import ConfusionOnPage, ProofPage

_RIVAL_SCORES = ("false_on_clean", "found_6", "exact_6", "unexplained", "gap_closed", "false_on_all", "seconds")
_ALL = "all"


def page_of(outcomes: Sequence[Outcome], *, is_exam: bool) -> ProofPage:
    """Everything that the page shows."""
    parts = by_answerer(outcomes)
    own = parts.get(TOOL, ())
    measured = {name: scores(part) for name, part in parts.items()}
    rows = score_table(measured[TOOL])
    units = {score.key: score.unit for score in ROWS}
    limits = next(score for score in ROWS if score.key == "seconds")
    strengths = sorted({one.d_prime_asked for one in own if one.d_prime_asked is not None})
    titles = {rival.name: rival.title for rival in RIVALS}
    by_id: dict[str, dict[float, Share]] = {}
    for one in power(own):
        if (share := _share(one.found)) is not None:
            by_id.setdefault(one.id, {})[one.d_prime] = share
    compared = {
        name: (_share(values["false_on_clean"]), _share(values["found_6"])) for name, values in measured.items()
    }
    return ProofPage(
        is_exam=is_exam,
        scores=[row_texts(row) for row in rows],
        unmet=[number for number, row in enumerate(rows) if row.meets_bar is False],
        n_cases=len(own),
        n_scenarios=len({one.scenario for one in own}),
        confusion=_confusion(own),
        found=by_id,
        all_found={d: share for d in strengths if (share := _share(_found_at(own, d))) is not None},
        oracle={d: float(detection_probability(d)) for d in strengths},
        bins=[(one.confidence, share, one.right.n) for one in calibration(own) if (share := _share(one.right))],
        calibration_error=measured[TOOL]["calibration"].value,
        gaps={name: _gaps(part) for name, part in parts.items()},
        seconds=[one.seconds for one in own if one.truth is not None],
        seconds_limits=tuple(limit for limit in (limits.goal, limits.bar) if limit is not None),
        rivals=[
            (titles.get(name, name), *(measured_text(values[key], units[key]) for key in _RIVAL_SCORES))
            for name, values in measured.items()
        ],
        compared={name: (clean, found) for name, (clean, found) in compared.items() if clean and found},
        families=[_family(name, own) for name in (*sorted({one.family for one in own}), _ALL)],
        wrong=[_wrong(one) for one in own if _is_wrong(one)],
        told={
            "seeds": ", ".join(str(seed) for seed in sorted({one.seed for one in own})),
            "SHA-256 of all cases": seal_of(one.seal for one in own if one.seal),
            "SHA-256 of all answers": answers_sha256(own),
        },
    )


def _share(measured: Measured) -> Share | None:
    if measured.value is None or measured.low is None or measured.high is None:
        return None
    return Share(measured.value, measured.low, measured.high)


def _found_at(outcomes: Sequence[Outcome], d_prime: float) -> Measured:
    asked = [one for one in outcomes if one.d_prime_asked == d_prime]
    return share_measured([credit != "missed" for one in asked for credit in one.judged.credits])


def _confusion(outcomes: Sequence[Outcome]) -> ConfusionOnPage:
    matrix = confusion(outcomes, least_d_prime=STRONG)
    accepted: dict[str, set[str]] = {}
    for outcome in outcomes:
        for effect in () if outcome.truth is None else outcome.truth.effects:
            accepted.setdefault(effect.id, set()).update(effect.accept)
    right: list[tuple[str, ...]] = []
    for name in matrix.true:
        if name.startswith("hidden."):
            right.append((UNEXPLAINED,))
        elif name.startswith("("):
            right.append((NOTHING,))
        else:
            right.append((*sorted(accepted.get(name, ())), SET))
    return ConfusionOnPage(matrix.true, matrix.said, matrix.counts, matrix.cases, tuple(right))


def _gaps(outcomes: Sequence[Outcome]) -> list[float]:
    strong = [one for one in outcomes if one.d_prime_asked is None or one.d_prime_asked >= STRONG]
    return [one.judged.gap_closed for one in strong if one.judged.gap_closed is not None and one.judged.credits]


def _family(name: str, outcomes: Sequence[Outcome]) -> tuple[str, ...]:
    part = [one for one in outcomes if name in (_ALL, one.family)]
    strong = [one for one in part if one.d_prime_asked is not None and one.d_prime_asked >= STRONG]
    credits_given = [credit for one in strong for credit in one.judged.credits]
    shares = (
        share_measured([credit != "missed" for credit in credits_given]),
        share_measured([credit == "exact" for credit in credits_given]),
        share_measured([bool(one.judged.false_names) for one in part]),
        share_measured([one.judged.verdict_right for one in part]),
    )
    return (name, str(len(part)), *(measured_text(share, "share") for share in shares))


def _is_wrong(outcome: Outcome) -> bool:
    judged = outcome.judged
    weak = outcome.d_prime_asked is not None and outcome.d_prime_asked < STRONG
    missed = not judged.verdict_right or "missed" in judged.credits
    return bool(judged.false_names) or outcome.failed or (missed and not weak)


def _wrong(outcome: Outcome) -> tuple[str, ...]:
    effects = () if outcome.truth is None else outcome.truth.effects
    return (
        outcome.scenario,
        "" if outcome.d_prime_asked is None else f"{outcome.d_prime_asked:g}",
        str(outcome.seed),
        ", ".join(effect.id for effect in effects),
        outcome.stated.verdict,
        ", ".join(named_texts(outcome)),
        outcome.stated.error or judgement(outcome),
    )
