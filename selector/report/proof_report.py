"""The report of the blind proof: is it good enough, what is taken for what, and who else sat the same exam."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from selector import __version__
from selector.figures.proof_scores import (
    Share,
    answerers_compared,
    confusion_matrix,
    gap_closed,
    power_by_effect,
    reliability,
    seconds_histogram,
)
from selector.report.page import Picture, Pictures, rendered
from selector.report.tables import table

MOST_WRONG = 200


@dataclass(frozen=True, eq=False)
class ConfusionOnPage:
    """What was put in against what was said, see `selector.figures.proof_scores.confusion_matrix`."""

    true: tuple[str, ...]
    said: tuple[str, ...]
    counts: NDArray[np.int64]
    cases: tuple[int, ...]
    right: tuple[tuple[str, ...], ...]


@dataclass(frozen=True, eq=False)
class ProofPage:
    """What the report of the proof shows.

    Attributes
    ----------
    is_exam : bool
    scores : sequence of tuple of str
        Score, measured, interval, n, first bar, goal, which of them is met.
    unmet : sequence of int
        Rows of `scores` that miss the first bar.
    n_cases, n_scenarios : int
    confusion : ConfusionOnPage
    found : mapping of str to mapping of float to Share
        Id → strength d′ → share found.
    all_found, oracle : mappings of float
        The same over all effects; the oracle's chance.
    bins : sequence of (confidence, Share, count)
    calibration_error : float or None
    gaps : mapping of str to sequence of float
        Answerer → share of the gap closed, case by case.
    seconds : sequence of float
        [s].
    seconds_limits : tuple of float
        First bar and goal [s].
    rivals : sequence of tuple of str
        Answerer, clean false names, found, exact, unexplained, gap, false names on all, seconds.
    compared : mapping of str to (false on clean, found)
        Shares by answerer.
    families : sequence of tuple of str
        Family, cases, found, exact, false names, verdict right.
    wrong : sequence of tuple of str
        Scenario, strength, seed, put in, verdict, named, judgement.
    told : mapping of str to str
        Seeds, hashes.
    """

    is_exam: bool
    scores: Sequence[tuple[str, ...]]
    unmet: Sequence[int]
    n_cases: int
    n_scenarios: int
    confusion: ConfusionOnPage
    found: Mapping[str, Mapping[float, Share]]
    all_found: Mapping[float, Share]
    oracle: Mapping[float, float]
    bins: Sequence[tuple[float, Share, int]]
    calibration_error: float | None
    gaps: Mapping[str, Sequence[float]]
    seconds: Sequence[float]
    seconds_limits: tuple[float, ...]
    rivals: Sequence[tuple[str, ...]]
    compared: Mapping[str, tuple[Share, Share]]
    families: Sequence[tuple[str, ...]]
    wrong: Sequence[tuple[str, ...]] = ()
    told: Mapping[str, str] = field(default_factory=dict)


def proof_html(page: ProofPage) -> str:
    """The report as one HTML text that needs no network."""
    pictures = Pictures()
    values: dict[str, Any] = {
        "title": "Blind proof: what a simulation left out",
        "version": __version__,
        "verdict": "bad" if page.unmet else "good",
        "first": _first(page),
        "more": _more(page),
        "scores": table(
            ["score", ">measured", ">95 % interval", ">n", ">first bar", ">goal", "met"],
            page.scores,
            "Shares with the exact binomial interval, all others with a bootstrap over cases.",
        ),
        "compared": _compared(pictures, page),
        "rivals": table(_RIVAL_COLUMNS, page.rivals) if len(page.rivals) > 1 else None,
        "found": _found(pictures, page),
        "families": table(_FAMILY_COLUMNS, page.families) if page.families else None,
        "confusion": pictures.add(_matrix(page.confusion), _MATRIX) if page.confusion.true else None,
        "trust": _trust(pictures, page),
        "wrong": table(
            ["scenario", ">d′", ">seed", "put in", "verdict", "named", "judgement"],
            page.wrong[:MOST_WRONG],
            f"{len(page.wrong) - MOST_WRONG} more are in cases.csv." if len(page.wrong) > MOST_WRONG else "",
        )
        if page.wrong
        else None,
        "origin": table(["", ""], list(page.told.items())),
    }
    return rendered("proof.html", values)


def _first(page: ProofPage) -> str:
    if page.unmet:
        names = "; ".join(page.scores[row][0] for row in page.unmet)
        return f"Not good enough yet: {len(page.unmet)} of the scores miss their first bar ({names})."
    judged = sum(bool(row[6]) for row in page.scores)
    reached = sum(row[6] == "goal" for row in page.scores)
    return f"Every first bar is met; {reached} of {judged} scores reach their goal."


def _more(page: ProofPage) -> list[str]:
    seeds = (
        "These are seeds of the exam, which nobody has developed with."
        if page.is_exam
        else "These are seeds of development: the program was improved on such cases. Only --exam tells how good it is."
    )
    return [f"{page.n_cases} cases of {page.n_scenarios} scenarios. {seeds}"]


def _compared(pictures: Pictures, page: ProofPage) -> Picture | None:
    if len(page.compared) < 2:
        return None
    false = {name: pair[0] for name, pair in page.compared.items()}
    found = {name: pair[1] for name, pair in page.compared.items()}
    return pictures.add(answerers_compared(false, found, strength=6.0), _COMPARED)


def _found(pictures: Pictures, page: ProofPage) -> Picture | None:
    if not page.found:
        return None
    return pictures.add(power_by_effect(page.found, page.oracle, all_effects=page.all_found), _POWER)


def _matrix(one: ConfusionOnPage) -> Any:
    return confusion_matrix(one.true, one.said, one.counts, one.cases, one.right)


def _trust(pictures: Pictures, page: ProofPage) -> list[Picture]:
    shown = []
    if page.bins and page.calibration_error is not None:
        confidence, right, counts = zip(*page.bins, strict=True)
        shown.append(pictures.add(reliability(confidence, right, counts, page.calibration_error), _RELIABILITY))
    if any(len(values) for values in page.gaps.values()):
        shown.append(pictures.add(gap_closed(page.gaps), _GAP))
    if len(page.seconds):
        shown.append(pictures.add(seconds_histogram(page.seconds, page.seconds_limits), _SECONDS))
    return shown


_RIVAL_COLUMNS = (
    "who",
    ">false on clean",
    ">right or in a set, d′ = 6",
    ">exactly right, d′ = 6",
    ">unexplained right",
    ">gap closed",
    ">false on all",
    ">seconds",
)
_FAMILY_COLUMNS = ("family", ">cases", ">found, d′ ≥ 6", ">exact, d′ ≥ 6", ">false names", ">verdict right")
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
