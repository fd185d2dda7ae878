"""Which ticks has a logarithmic axis, so that there are some also where it is shorter than a power of ten."""

from __future__ import annotations

from typing import Any

_MOST_DECADES = 3.7
"""Above so many powers of ten there is room for these alone."""

_POWERS = range(-9, 10)
_STEPS = (1, 2, 5)


def log_ticks(low: float, high: float) -> dict[str, Any]:
    """Ticks of an axis from 10^low to 10^high: 1, 2, 5 of each power of ten, or these alone; more fit a zoomed axis."""
    steps = _STEPS if high - low < _MOST_DECADES else (1,)
    values = [step * 10.0**power for power in _POWERS for step in steps]
    return {"tickvals": values, "ticktext": [f"{value:.10g}" for value in values]}
