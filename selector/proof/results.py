"""What comes out of the proof: the score as JSON, a line and a CSV row for every case, texts of the table."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from typing import Any

from selector import __version__
from selector.csv_text import csv_text
from selector.proof.confusion import confusion
from selector.proof.intervals import Measured
from selector.proof.runner import TOOL, Outcome
from selector.proof.score_table import Row, score_table
from selector.proof.scoring import STRONG, calibration, power, scores
from selector.proof.sealing import seal_of, sealed_text, sha256_of_text

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
