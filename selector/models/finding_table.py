"""The findings of fitting sets of columns: how much each matters, what it means and what to do about it."""

from selector.findings import Kinds

FINDINGS = Kinds.beside(__file__)
