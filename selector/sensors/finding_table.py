"""The findings of comparing and grouping sensors: how much each matters, what it means and what to do about it."""

from selector.findings import Kinds

CONSTANT_SENSOR = "constant-sensor"
ROUND_WITHOUT_EFFECT = "round-without-effect"

FINDINGS = Kinds.beside(__file__)
