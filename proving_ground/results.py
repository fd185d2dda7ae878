"""What comes out of the proof: the score as JSON, rows for every case, and what is told of it: is it good enough."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from typing import Any

from proving_ground import scoring
from proving_ground.case import detection_probability, seal_of, sealed_text, sha256_of_text
from proving_ground.pictures import (
    Share,
    answerers_compared,
    confusion_matrix,
    gap_closed,
    power_by_effect,
    reliability,
    seconds_histogram,
)
from proving_ground.rivals import RIVALS
from proving_ground.runner import TOOL, Outcome
from proving_ground.scoring import (
    ROWS,
    STRONG,
    Confusion,
    Measured,
    Row,
    calibration,
    confusion,
    is_strong,
    power,
    score_table,
    scores,
    share_measured,
)
from selector import __version__
from selector.csv_text import csv_text
from selector.telling.account import Account, Block, Captioned, Drawing, Section, section, sections, table

SCHEMA = "selector.proof/1"
_NONE = "–"


def by_answerer(outcomes: Sequence[Outcome]) -> dict[str, tuple[Outcome, ...]]:
    """Answerer → its outcomes, this program first."""
    names = sorted({one.answerer for one in outcomes}, key=lambda name: (name != TOOL, name))
    return {name: tuple(one for one in outcomes if one.answerer == name) for name in names}


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
    rows = [_columns(one) for one in outcomes]
    return csv_text(list(rows[0]) if rows else [], [list(row.values()) for row in rows])


def _columns(one: Outcome) -> dict[str, object]:
    judged, truth = one.judged, one.truth
    cells = {
        "answerer": one.answerer,
        "scenario": one.scenario,
        "family": one.family,
        "kind": one.kind,
        "d_prime_asked": one.d_prime_asked,
        "d_prime": None if truth is None else truth.d_prime,
        "seed": one.seed,
        "verdicts": " ".join(truth.verdicts) if truth else "",
        "effects": " ".join(effect.id for effect in truth.effects) if truth else "",
        "concealment": " ".join(f"{c.kind}={c.measured:.4g}" for c in truth.concealed) if truth else "",
        "verdict": one.stated.verdict,
        "named": " ".join(named_texts(one)),
        "verdict_right": judged.verdict_right,
        "credits": " ".join(judged.credits),
        "false_names": " ".join(judged.false_names),
        "unexplained_right": judged.unexplained_right,
        "channel_right": judged.channel_right,
        "window_iou": judged.window_iou,
        "gap_closed": judged.gap_closed,
        "seconds": f"{one.seconds:.3f}",
        "seal": one.seal,
        "error": one.stated.error,
    }
    return {name: "" if cell is None else cell for name, cell in cells.items()}


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


MOST_WRONG = 200
_RIVAL_SCORES = {
    "false_on_clean": ">false on clean",
    "found_6": ">right or in a set, d′ = 6",
    "exact_6": ">exactly right, d′ = 6",
    "unexplained": ">unexplained right",
    "gap_closed": ">gap closed",
    "false_on_all": ">false on all",
    "seconds": ">seconds",
}
_SCORE_COLUMNS = ("score", ">measured", ">95 % interval", ">n", ">first bar", ">goal", "met")
_SCORES = "Shares with the exact binomial interval, all others with a bootstrap over cases."
_FAMILY_COLUMNS = ("family", ">cases", ">found, d′ ≥ 6", ">exact, d′ ≥ 6", ">false names", ">verdict right")
_ALL = "all"

Answered = Mapping[str, Sequence[Outcome]]


def proof_account(
    outcomes: Sequence[Outcome], data: Mapping[str, Any] | None = None, *, is_exam: bool, drawn: bool = False
) -> Account:
    """What is told of a proof; `data` is its JSON, and `drawn` says whether a page needs the drawings too."""
    parts = by_answerer(outcomes)
    own = parts.get(TOOL, ())
    measured = {name: scores(part) for name, part in parts.items()}
    rows = score_table(measured[TOOL])
    drawings = _drawings(parts, measured) if drawn else {}
    families = [_family(name, own) for name in (*sorted({one.family for one in own}), _ALL)]
    units, titles = {score.key: score.unit for score in ROWS}, {rival.name: rival.title for rival in RIVALS}
    rivals = [
        (titles.get(name, name), *(measured_text(values[key], units[key]) for key in _RIVAL_SCORES))
        for name, values in measured.items()
    ]
    compared = Captioned("", table(("who", *_RIVAL_SCORES.values()), rivals)) if len(rivals) > 1 else None
    told = {
        "seeds": ", ".join(str(seed) for seed in sorted({one.seed for one in own})),
        "SHA-256 of all cases": seal_of(one.seal for one in own if one.seal),
        "SHA-256 of all answers": answers_sha256(own),
    }
    return Account(
        "Blind proof: what a simulation left out",
        (_first(rows), _more(own, is_exam)),
        sections(
            section(
                "scores", "Scores", Captioned("", table(_SCORE_COLUMNS, [row_texts(row) for row in rows], _SCORES))
            ),
            section(
                "found",
                "How often it is found",
                *drawings.get("found", ()),
                Captioned("By family", table(_FAMILY_COLUMNS, families)),
                link="By effect",
            ),
            section("confusion", "What is taken for what", *drawings.get("confusion", ())),
            section("trust", "Confidence, gain and time", *drawings.get("trust", ()), link="Confidence, gain, time"),
            section("rivals", "Rivals at the same exam", *drawings.get("rivals", ()), compared, link="Rivals"),
            _wrong(own),
            section("origin", "Origin", Captioned("", table(["", ""], list(told.items())))),
        ),
        verdict="bad" if any(row.meets_bar is False for row in rows) else "good",
        data=data or {},
        footer="The same seeds give the same answers.",
    )


def _first(rows: Sequence[Row]) -> str:
    unmet = [row.score.title for row in rows if row.meets_bar is False]
    if unmet:
        return f"Not good enough yet: {len(unmet)} of the scores miss their first bar ({'; '.join(unmet)})."
    met = [row_texts(row)[-1] for row in rows]
    return f"Every first bar is met; {met.count('goal')} of {len(met) - met.count('')} scores reach their goal."


def _more(own: Sequence[Outcome], is_exam: bool) -> str:
    seeds = (
        "These are seeds of the exam, which nobody has developed with."
        if is_exam
        else "These are seeds of development: the program was improved on such cases. Only --exam tells how good it is."
    )
    return f"{len(own)} cases of {len({one.scenario for one in own})} scenarios. {seeds}"


def _family(name: str, outcomes: Sequence[Outcome]) -> tuple[str, ...]:
    part = [one for one in outcomes if name in (_ALL, one.family)]
    given = [
        credit for one in part if one.d_prime_asked is not None and is_strong(one) for credit in one.judged.credits
    ]
    shares = (
        share_measured([credit != "missed" for credit in given]),
        share_measured([credit == "exact" for credit in given]),
        share_measured([bool(one.judged.false_names) for one in part]),
        share_measured([one.judged.verdict_right for one in part]),
    )
    return (name, str(len(part)), *(measured_text(share, "share") for share in shares))


def _wrong(outcomes: Sequence[Outcome]) -> Section | None:
    wrong = [one for one in outcomes if _is_wrong(one)]
    if not wrong:
        return None
    rows = [
        (
            one.scenario,
            "" if one.d_prime_asked is None else f"{one.d_prime_asked:g}",
            str(one.seed),
            ", ".join(effect.id for effect in (() if one.truth is None else one.truth.effects)),
            one.stated.verdict,
            ", ".join(named_texts(one)),
            one.stated.error or judgement(one),
        )
        for one in wrong[:MOST_WRONG]
    ]
    left = len(wrong) - MOST_WRONG
    columns = ["scenario", ">d′", ">seed", "put in", "verdict", "named", "judgement"]
    told = table(columns, rows, f"{left} more are in cases.csv." if left > 0 else "")
    return section("wrong", "Wrong answers", Captioned("", told))


def _is_wrong(outcome: Outcome) -> bool:
    judged = outcome.judged
    missed = not judged.verdict_right or "missed" in judged.credits
    return bool(judged.false_names) or outcome.failed or (missed and is_strong(outcome))


def _drawings(parts: Answered, measured: Mapping[str, Mapping[str, Measured]]) -> dict[str, list[Block]]:
    """Section of the account → its drawings."""
    own = parts.get(TOOL, ())
    drawn: dict[str, list[Block]] = {"trust": _trust(parts, measured[TOOL]["calibration"].value)}
    by_id: dict[str, dict[float, Share]] = {}
    for one in power(own):
        if (share := _share(one.found)) is not None:
            by_id.setdefault(one.id, {})[one.d_prime] = share
    if by_id:
        strengths = sorted({one.d_prime_asked for one in own if one.d_prime_asked is not None})
        asked = {d: [one for one in own if one.d_prime_asked == d] for d in strengths}
        found = {d: [credit != "missed" for one in part for credit in one.judged.credits] for d, part in asked.items()}
        everything = {d: share for d, hits in found.items() if (share := _share(share_measured(hits))) is not None}
        oracle = {d: float(detection_probability(d)) for d in strengths}
        drawn["found"] = [Drawing(power_by_effect(by_id, oracle, all_effects=everything), _POWER)]
    matrix = confusion(own, least_d_prime=STRONG)
    if matrix.true:
        right = _right(matrix, own)
        picture = confusion_matrix(matrix.true, matrix.said, matrix.counts, matrix.cases, right)
        drawn["confusion"] = [Drawing(picture, _MATRIX)]
    shares = {name: (_share(values["false_on_clean"]), _share(values["found_6"])) for name, values in measured.items()}
    false = {name: clean for name, (clean, named) in shares.items() if clean and named}
    named = {name: found for name, (clean, found) in shares.items() if clean and found}
    if len(named) > 1:
        drawn["rivals"] = [Drawing(answerers_compared(false, named, strength=6.0), _COMPARED)]
    return drawn


def _trust(parts: Answered, error: float | None) -> list[Block]:
    own, shown = parts.get(TOOL, ()), list[Block]()
    bins = [(one.confidence, share, one.right.n) for one in calibration(own) if (share := _share(one.right))]
    if bins and error is not None:
        confidence, right, counts = zip(*bins, strict=True)
        shown.append(Drawing(reliability(confidence, right, counts, error), _RELIABILITY))
    gaps = {
        name: [one.judged.gap_closed for one in part if is_strong(one) and one.judged.credits]
        for name, part in parts.items()
    }
    closed = {name: [value for value in values if value is not None] for name, values in gaps.items()}
    if any(closed.values()):
        shown.append(Drawing(gap_closed(closed), _GAP))
    seconds = [one.seconds for one in own if one.truth is not None]
    if seconds:
        limits = next((score.goal, score.bar) for score in ROWS if score.key == "seconds")
        shown.append(Drawing(seconds_histogram(seconds, [one for one in limits if one is not None]), _SECONDS))
    return shown


def _share(measured: Measured) -> Share | None:
    if measured.value is None or measured.low is None or measured.high is None:
        return None
    return Share(measured.value, measured.low, measured.high)


def _right(matrix: Confusion, outcomes: Sequence[Outcome]) -> list[tuple[str, ...]]:
    """What is right of what was said, row by row."""
    accepted: dict[str, set[str]] = {}
    for outcome in outcomes:
        for effect in () if outcome.truth is None else outcome.truth.effects:
            accepted.setdefault(effect.id, set()).update(effect.accept)
    return [
        (scoring.UNEXPLAINED,)
        if name.startswith("hidden.")
        else (scoring.NOTHING_NAMED,)
        if name.startswith("(")
        else (*sorted(accepted.get(name, ())), scoring.SET)
        for name in matrix.true
    ]


_COMPARED = "All sit the same cases and choose from the same columns. Lines: 95 % intervals."
_POWER = (
    "d′ is how far an oracle, who knows the course of the effect and the noise, could tell it from nothing, in "
    "standard deviations. Dotted: how often the oracle finds it at 1 % false alarms. Lines: 95 % intervals."
)
_MATRIX = (
    "Strengths d′ ≥ 6. Blue is right, orange is not; the colour is the share of the row's cases, the number counts "
    "them. Ids that are accepted for a row are right there, too. A row may say more than it has cases, where false "
    "names stand beside right ones."
)
_RELIABILITY = "Named effects in bins of their confidence. On the dashed line the answer is as sure as it is right."
_GAP = "Held-out rows. Each case counts once; values beyond −1 and 1.5 are drawn there. d′ ≥ 6 and real recordings."
_SECONDS = "Wall time of an answer, one thread. Dotted: goal and first bar of the median."
