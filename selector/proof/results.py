"""What comes out of the proof: the score as JSON, rows for every case, and what stands on its page."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from typing import Any

from selector import __version__
from selector.csv_text import csv_text
from selector.figures.proof_scores import Share
from selector.proof.case import detection_probability, seal_of, sealed_text, sha256_of_text
from selector.proof.rivals import RIVALS
from selector.proof.runner import TOOL, Outcome
from selector.proof.scoring import (
    NOTHING_NAMED,
    ROWS,
    SET,
    STRONG,
    UNEXPLAINED,
    Measured,
    Row,
    calibration,
    confusion,
    power,
    score_table,
    scores,
    share_measured,
)
from selector.telling.proof_report import ConfusionOnPage, ProofPage

SCHEMA = "selector.proof/1"
_NONE = "–"


def by_answerer(outcomes: Sequence[Outcome]) -> dict[str, tuple[Outcome, ...]]:
    """Answerer → its outcomes, this program first."""
    names = sorted({one.answerer for one in outcomes}, key=lambda name: (name != TOOL, name))
    return {name: tuple(one for one in outcomes if one.answerer == name) for name in names}


def tables(outcomes: Sequence[Outcome]) -> dict[str, tuple[Row, ...]]:
    """Answerer → score table."""
    return {name: score_table(scores(part)) for name, part in by_answerer(outcomes).items()}


def score_object(outcomes: Sequence[Outcome], *, is_exam: bool) -> dict[str, Any]:
    """The JSON of ``selector.proof/1``: scores, rivals, confusion, power, calibration, failures, hashes."""
    parts = by_answerer(outcomes)
    own = parts.get(TOOL, ())
    matrix = confusion(own, least_d_prime=STRONG)
    return {
        "schema": SCHEMA,
        "version": __version__,
        "exam": is_exam,
        "cases": len(own),
        "scenarios": len({one.scenario for one in own}),
        "seeds": sorted({one.seed for one in own}),
        "seal": seal_of(one.seal for one in own if one.seal),
        "answers_sha256": answers_sha256(own),
        "scores": [row.as_dict() for row in score_table(scores(own))],
        "rivals": {
            name: [row.as_dict() for row in score_table(scores(part))] for name, part in parts.items() if name != TOOL
        },
        "confusion": {
            "least_d_prime": STRONG,
            "true": list(matrix.true),
            "said": list(matrix.said),
            "counts": matrix.counts.tolist(),
            "cases": list(matrix.cases),
        },
        "power": [
            {"id": one.id, "d_prime": one.d_prime, "found": vars(one.found), "exact": vars(one.exact)}
            for one in power(own)
        ],
        "calibration": [{"confidence": one.confidence, "right": vars(one.right)} for one in calibration(own)],
        "failures": [
            {"scenario": one.scenario, "d_prime": one.d_prime_asked, "seed": one.seed, "error": one.stated.error}
            for one in own
            if one.failed
        ],
    }


def answers_sha256(outcomes: Sequence[Outcome]) -> str:
    """SHA-256 of all answers and judgements; equal whatever the number of processes (seconds are left out)."""
    content = {
        f"{one.scenario} d={one.d_prime_asked} seed={one.seed} {one.answerer}": {
            "stated": dataclasses.asdict(one.stated),
            "judged": dataclasses.asdict(one.judged),
        }
        for one in outcomes
    }
    return sha256_of_text(sealed_text(content))


def line_of(outcome: Outcome) -> str:
    """One case in a line: name, strength, seed, verdict, names with confidence, right or not, seconds."""
    strength = "" if outcome.d_prime_asked is None else f" d′={outcome.d_prime_asked:g}"
    names = ", ".join(named_texts(outcome)) or _NONE
    who = "" if outcome.answerer == TOOL else f" [{outcome.answerer}]"
    line = f"{outcome.scenario}{strength} seed {outcome.seed}{who}: {outcome.stated.verdict} | {names} | "
    line += f"{judgement(outcome)} | {outcome.seconds:.1f} s"
    return line + (f" | {outcome.stated.error}" if outcome.stated.error else "")


def judgement(outcome: Outcome) -> str:
    """The judgement in a few words."""
    judged = outcome.judged
    words = ["verdict right" if judged.verdict_right else "verdict wrong"]
    if judged.credits:
        words.append("/".join(judged.credits))
    if judged.false_names:
        words.append("FALSE " + ", ".join(judged.false_names))
    if judged.window_iou is not None:
        words.append(f"IoU {judged.window_iou:.2f}")
    if judged.gap_closed is not None:
        words.append(f"gap {100 * judged.gap_closed:.0f} %")
    return ", ".join(words)


def cases_csv(outcomes: Sequence[Outcome]) -> str:
    """Every outcome as a row of a CSV table."""
    rows: list[Sequence[object]] = []
    for one in outcomes:
        judged, truth = one.judged, one.truth
        rows.append(
            [
                one.answerer,
                one.scenario,
                one.family,
                one.kind,
                _cell(one.d_prime_asked),
                _cell(None if truth is None else truth.d_prime),
                one.seed,
                " ".join(truth.verdicts) if truth else "",
                " ".join(effect.id for effect in truth.effects) if truth else "",
                " ".join(f"{c.kind}={c.measured:.4g}" for c in truth.concealed) if truth else "",
                one.stated.verdict,
                " ".join(named_texts(one)),
                judged.verdict_right,
                " ".join(judged.credits),
                " ".join(judged.false_names),
                _cell(judged.unexplained_right),
                _cell(judged.channel_right),
                _cell(judged.window_iou),
                _cell(judged.gap_closed),
                f"{one.seconds:.3f}",
                one.seal,
                one.stated.error,
            ]
        )
    return csv_text(_COLUMNS, rows)


def row_texts(row: Row) -> tuple[str, str, str, str, str, str, str]:
    """Cells of a row of the score table: score, measured, interval, n, first bar, goal, whether they are met."""
    measured, score = row.measured, row.score
    interval = (
        _NONE if measured.low is None else f"{_value(measured.low, score.unit)} … {_value(measured.high, score.unit)}"
    )
    limits = [_limit(row, limit) for limit in (score.bar, score.goal)]
    met = "goal" if row.meets_goal else "first bar" if row.meets_bar else "NOT MET" if row.meets_bar is False else ""
    return (score.title, measured_text(measured, score.unit), interval, str(measured.n), limits[0], limits[1], met)


def measured_text(measured: Measured, unit: str) -> str:
    """The value alone."""
    return _value(measured.value, unit)


def _limit(row: Row, limit: float | None) -> str:
    if limit is None:
        return ""
    sign = {"low": "≤ ", "high": "≥ ", "zero": "no more than "}.get(row.score.better, "")
    return sign + _value(limit, row.score.unit)


def _value(value: float | None, unit: str) -> str:
    if value is None:
        return _NONE
    shown = {"share": f"{100 * value:.1f} %", "s": f"{value:.3g} s"}
    return shown.get(unit, f"{value:.3f}").replace("-0.0 %", "0.0 %").replace("-", "−")


def named_texts(outcome: Outcome) -> list[str]:
    """What was named: id, confidence, ``?`` where only suspected, and after ``|`` what it is not told from."""
    texts = []
    for one in outcome.stated.effects:
        text = one.id if one.confidence is None else f"{one.id}({one.confidence:.2f})"
        text += "?" if one.suspected else ""
        texts.append(text + "".join(f"|{other}" for other in one.cannot_be_told_from if other != one.id))
    return texts


def _cell(value: float | bool | None) -> str:
    return "" if value is None else str(value)


_COLUMNS = (
    "answerer",
    "scenario",
    "family",
    "kind",
    "d_prime_asked",
    "d_prime",
    "seed",
    "verdicts",
    "effects",
    "concealment",
    "verdict",
    "named",
    "verdict_right",
    "credits",
    "false_names",
    "unexplained_right",
    "channel_right",
    "window_iou",
    "gap_closed",
    "seconds",
    "seal",
    "error",
)


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
            right.append((NOTHING_NAMED,))
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
