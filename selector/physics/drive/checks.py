"""Parameters that cannot be: refused with their name when a value is made."""

from __future__ import annotations

import math

from selector.errors import InputError


def require_positive(values: object, *names: str) -> None:
    """Raises InputError, naming the first of these fields that is not above 0; None is allowed."""
    for name in names:
        value = getattr(values, name)
        if value is not None and not (math.isfinite(value) and value > 0):
            raise InputError(f"{value:g}", expected="a number above 0", where=name, advice="correct this parameter")


def require_not_negative(values: object, *names: str) -> None:
    """Raises InputError, naming the first of these fields that is not 0 or more; None is allowed."""
    for name in names:
        value = getattr(values, name)
        if value is not None and not (math.isfinite(value) and value >= 0):
            raise InputError(f"{value:g}", expected="0 or more", where=name, advice="correct this parameter")


def require_finite(values: object, *names: str) -> None:
    """Raises InputError, naming the first of these fields that is not finite; None is allowed."""
    for name in names:
        if not math.isfinite(getattr(values, name)):
            raise InputError(
                f"{getattr(values, name):g}", expected="a finite number", where=name, advice="correct this parameter"
            )


def too_far_apart() -> InputError:
    """Numbers of an axis that are each possible, and together beyond what can be calculated."""
    return InputError(
        "masses, stiffnesses, damping, gains or times of the axis are too far apart to be calculated with",
        expected="numbers of a machine in SI units",
        where="feed axis",
        advice="look for a wrong power of ten: mm for m, µm for m, g·cm² for kg·m²",
    )
