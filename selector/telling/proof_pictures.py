"""The drawings of the blind proof: power, confusion, confidence, gain, time and rivals."""

from __future__ import annotations

from selector.figures.proof_scores import (
    answerers_compared,
    confusion_matrix,
    gap_closed,
    power_by_effect,
    reliability,
    seconds_histogram,
)
from selector.telling.account import Block, Drawing
from selector.telling.proof_report import ProofPage


def drawings(page: ProofPage) -> dict[str, list[Block]]:
    """Section of the account → its drawings."""
    found: dict[str, list[Block]] = {"trust": _trust(page)}
    if page.found:
        found["found"] = [Drawing(power_by_effect(page.found, page.oracle, all_effects=page.all_found), _POWER)]
    if page.confusion.true:
        one = page.confusion
        found["confusion"] = [Drawing(confusion_matrix(one.true, one.said, one.counts, one.cases, one.right), _MATRIX)]
    if len(page.compared) > 1:
        false = {name: pair[0] for name, pair in page.compared.items()}
        right = {name: pair[1] for name, pair in page.compared.items()}
        found["rivals"] = [Drawing(answerers_compared(false, right, strength=6.0), _COMPARED)]
    return found


def _trust(page: ProofPage) -> list[Block]:
    shown: list[Block] = []
    if page.bins and page.calibration_error is not None:
        confidence, right, counts = zip(*page.bins, strict=True)
        shown.append(Drawing(reliability(confidence, right, counts, page.calibration_error), _RELIABILITY))
    if any(len(values) for values in page.gaps.values()):
        shown.append(Drawing(gap_closed(page.gaps), _GAP))
    if len(page.seconds):
        shown.append(Drawing(seconds_histogram(page.seconds, page.seconds_limits), _SECONDS))
    return shown


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
