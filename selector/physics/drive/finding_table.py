"""The findings of feed drives: how much each matters, what it means and what to do about it."""

from selector.findings import Kinds
from selector.physics.finding_table import FINDINGS as SHARED_FINDINGS

UNSTABLE_LOOP = "unstable-loop"

FINDINGS = Kinds.beside(__file__)
for id_ in ("channel-undecided", "output-not-recorded", "unlikely-value", "recorded-clock-jitter"):
    FINDINGS[id_] = SHARED_FINDINGS[id_]
