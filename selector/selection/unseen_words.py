"""The three errors on unseen data that a selection has, and the same words for them wherever they stand."""

from __future__ import annotations

PROCEDURE = "whole procedure"
BEST_OF_SIZE = "best of each size"
FIXED_SET = "fixed set"


def told_apart(left_out: str) -> str:
    """What each of the errors lets be chosen anew; `left_out` is that of `Proof`."""
    part = {"run": "run", "condition": "condition", "block": "stretch"}[left_out]
    return (
        f"{_capital(PROCEDURE)}: number and choice of sensors made anew without each {part}, the error to expect. "
        f"{_capital(BEST_OF_SIZE)}: that many sensors, chosen anew without each {part}. "
        f"{_capital(FIXED_SET)}: one set for all, only its coefficients refitted without each {part}; the choice "
        f"compares these errors, and as it has seen every {part} they are too small to promise."
    )


def _capital(words: str) -> str:
    return words[0].upper() + words[1:]
