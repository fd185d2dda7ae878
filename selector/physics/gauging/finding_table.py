"""The findings of in-process gauging: how much each matters, what it means and what to do about it."""

from selector.findings import Kinds
from selector.physics.finding_table import FINDINGS as SHARED_FINDINGS

FINDINGS = Kinds.beside(__file__)
for id_ in ("channel-undecided", "recorded-gap", "recorded-clock-jitter", "output-not-recorded"):
    FINDINGS[id_] = SHARED_FINDINGS[id_]
