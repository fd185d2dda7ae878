"""Numbers with units, as sentences about faults of data say them."""

from __future__ import annotations

from selector.diagnosis.shown_units import displayed

_SHOWN = {"um": "µm", "degC": "K", "1": ""}


def step_unit(unit: str) -> str:
    """The unit of a difference of two readings."""
    return "K" if unit == "degC" else unit


def amount(value: float, unit: str) -> str:
    """The size of a difference with its unit."""
    factor, shown = displayed(_SHOWN.get(unit, unit), value)
    return f"{abs(factor * value):.3g} {shown}".strip()
