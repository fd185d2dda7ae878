"""The findings of vibration: how much each matters, what it means and what to do about it."""

from selector.findings import Kinds
from selector.physics.finding_table import FINDINGS as SHARED_FINDINGS

FINDINGS = Kinds.beside(__file__)
FINDINGS["recorded-gap"] = SHARED_FINDINGS["recorded-gap"]
FINDINGS["recorded-clock-jitter"] = SHARED_FINDINGS["recorded-clock-jitter"]
FINDINGS["input-not-recorded"] = SHARED_FINDINGS["input-not-recorded"]
