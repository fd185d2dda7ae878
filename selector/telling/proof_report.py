"""What is told of the blind proof: is it good enough, what is taken for what, and who else sat the same exam."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from selector.telling.account import Account, Block, Captioned, Section, section, sections, table

if TYPE_CHECKING:
    from selector.figures.proof_scores import Share

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
    """What the report of the proof shows."""

    is_exam: bool
    scores: Sequence[tuple[str, ...]]  #: Score, measured, interval, n, first bar, goal, which of them is met
    unmet: Sequence[int]  #: Rows of `scores` that miss the first bar
    n_cases: int
    n_scenarios: int
    confusion: ConfusionOnPage
    found: Mapping[str, Mapping[float, Share]]  #: Id → strength d′ → share found
    #: all_found and oracle: The same over all effects; the oracle's chance
    all_found: Mapping[float, Share]
    oracle: Mapping[float, float]
    bins: Sequence[tuple[float, Share, int]]
    calibration_error: float | None
    gaps: Mapping[str, Sequence[float]]  #: Answerer → share of the gap closed, case by case
    seconds: Sequence[float]  #: [s]
    seconds_limits: tuple[float, ...]  #: First bar and goal [s]
    #: Answerer, clean false names, found, exact, unexplained, gap, false names on all, seconds
    rivals: Sequence[tuple[str, ...]]
    compared: Mapping[str, tuple[Share, Share]]  #: Shares by answerer
    families: Sequence[tuple[str, ...]]  #: Family, cases, found, exact, false names, verdict right
    wrong: Sequence[tuple[str, ...]] = ()  #: Scenario, strength, seed, put in, verdict, named, judgement
    told: Mapping[str, str] = field(default_factory=dict)  #: Seeds, hashes


def proof_account(page: ProofPage, data: Mapping[str, Any] | None = None, *, drawn: bool = False) -> Account:
    """What is told of a proof; `data` is its JSON, and `drawn` says whether a page needs the drawings too."""
    drawings: Mapping[str, Sequence[Block]] = {}
    if drawn:
        from selector.telling.proof_pictures import drawings as drawings_of

        drawings = drawings_of(page)
    families = Captioned("By family", table(_FAMILY_COLUMNS, page.families)) if page.families else None
    rivals = Captioned("", table(_RIVAL_COLUMNS, page.rivals)) if len(page.rivals) > 1 else None
    return Account(
        "Blind proof: what a simulation left out",
        (_first(page), _more(page)),
        sections(
            section("scores", "Scores", Captioned("", table(_SCORE_COLUMNS, page.scores, _SCORES))),
            section("found", "How often it is found", *drawings.get("found", ()), families, link="By effect"),
            section("confusion", "What is taken for what", *drawings.get("confusion", ())),
            section("trust", "Confidence, gain and time", *drawings.get("trust", ()), link="Confidence, gain, time"),
            section("rivals", "Rivals at the same exam", *drawings.get("rivals", ()), rivals, link="Rivals"),
            _wrong(page),
            section("origin", "Origin", Captioned("", table(["", ""], list(page.told.items())))),
        ),
        verdict="bad" if page.unmet else "good",
        data=data or {},
        footer="The same seeds give the same answers.",
    )


def _first(page: ProofPage) -> str:
    if page.unmet:
        names = "; ".join(page.scores[row][0] for row in page.unmet)
        return f"Not good enough yet: {len(page.unmet)} of the scores miss their first bar ({names})."
    judged = sum(bool(row[6]) for row in page.scores)
    reached = sum(row[6] == "goal" for row in page.scores)
    return f"Every first bar is met; {reached} of {judged} scores reach their goal."


def _more(page: ProofPage) -> str:
    seeds = (
        "These are seeds of the exam, which nobody has developed with."
        if page.is_exam
        else "These are seeds of development: the program was improved on such cases. Only --exam tells how good it is."
    )
    return f"{page.n_cases} cases of {page.n_scenarios} scenarios. {seeds}"


def _wrong(page: ProofPage) -> Section | None:
    if not page.wrong:
        return None
    left = len(page.wrong) - MOST_WRONG
    columns = ["scenario", ">d′", ">seed", "put in", "verdict", "named", "judgement"]
    told = table(columns, page.wrong[:MOST_WRONG], f"{left} more are in cases.csv." if left > 0 else "")
    return section("wrong", "Wrong answers", Captioned("", told))


_SCORE_COLUMNS = ("score", ">measured", ">95 % interval", ">n", ">first bar", ">goal", "met")
_SCORES = "Shares with the exact binomial interval, all others with a bootstrap over cases."
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
