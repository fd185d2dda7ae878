"""The findings of fitting sets of columns: how much each matters, what it means and what to do about it."""

from selector.findings import Kinds

FINDINGS = Kinds.of(
    """
constant-column [warning] columns do not vary: they add nothing to any set
    → leave them out
dependent-columns [warning] columns are linearly dependent: several sets of them explain the same
    → keep one of them, or forbid the ones that are harder to measure
"""
)
