"""The findings of a diagnosis: how much each matters, what it means and what to do about it."""

from selector.findings import Kinds
from selector.quality.finding_table import FINDINGS as QUALITY

BEYOND_MEASURE = "beyond-measure"
NOT_COMPARED = "not-compared"
SLOW_REMAINDER = "slow-remainder"
SMALL_MISFIT = "small-misfit"
UNRECORDED_SWITCH = "unrecorded-switch"

FINDINGS = Kinds.beside(__file__)
FINDINGS["short-run"] = QUALITY["short-run"]
