"""The drawings of a diagnosis: map, courses before and after, evidence, runs that would tell, what is not seen."""

from __future__ import annotations

from selector.diagnosis.answer import Diagnosis
from selector.figures.diagnosis import before_after, detectability, evidence, mismatch_map, next_runs, told_apart
from selector.telling.account import Block, Drawing
from selector.telling.diagnosed.account import UNTESTED


def drawings(found: Diagnosis) -> dict[str, list[Block]]:
    """Section of the account → its drawings."""
    apart, runs, missed = told_apart(found), next_runs(found), detectability(found)
    courses = [before_after(found, name) for name in found.fit]
    is_tested = any(not one.note.startswith(UNTESTED) for one in found.evidence)
    return {
        "where": [Drawing(mismatch_map(found), _MAP)] if found.fit else [],
        "better": [Drawing(one, "" if k else _BEFORE_AFTER) for k, one in enumerate(courses)],
        "evidence": [Drawing(evidence(found), _EVIDENCE)] if is_tested else [],
        "apart": [Drawing(one) for one in (apart, runs) if one is not None],
        "detectability": [] if missed is None else [Drawing(missed, _DETECTABLE)],
    }


_MAP = (
    "Orange: more was recorded than simulated; blue: less; 1 is the rms that stands beside the response. In grey what "
    "the machine did, from its lowest (light) to its highest value (dark)."
)
_BEFORE_AFTER = "The shaded part was held out: nothing was fitted to it, and the error in the title is that part's."
_EVIDENCE = (
    "Every effect was fitted to some blocks of the record and judged on the others. Noise alone gains about nothing; p "
    "is the probability that noise gains as much, adjusted for all effects tested."
)
_DETECTABLE = (
    "Dotted: the error that is left. What is smaller than a dot may be there without being seen in this record."
)
