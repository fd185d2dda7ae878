"""The findings of models that are applied to recordings: how much each matters, what it means and what to do."""

from selector.findings import Kinds
from selector.quality.finding_table import FINDINGS as QUALITY

FINDINGS = Kinds.beside(__file__)
FINDINGS["gauge-not-zeroed"] = QUALITY["gauge-not-zeroed"]
