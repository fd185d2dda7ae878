"""The findings of thermal models: how much each matters, what it means and what to do about it."""

from selector.findings import Kinds
from selector.physics.finding_table import FINDINGS as SHARED_FINDINGS

FINDINGS = Kinds.beside(__file__)
FINDINGS["input-not-recorded"] = SHARED_FINDINGS["input-not-recorded"]
FINDINGS["output-not-recorded"] = SHARED_FINDINGS["output-not-recorded"]
