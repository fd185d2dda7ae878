"""The findings of models that are applied to recordings: how much each matters, what it means and what to do."""

from selector.findings import Kinds
from selector.quality.finding_table import FINDINGS as QUALITY

FINDINGS = Kinds.of(
    """
start-missing [warning] a sensor has no reading at the start of a run; its rise counts from its first reading
    → record from the start of the run, or use a model that was selected with --reference absolute
"""
)
FINDINGS["gauge-not-zeroed"] = QUALITY["gauge-not-zeroed"]
