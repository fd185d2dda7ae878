"""What is wished of each sensor, as two pages ask it: whether it may, must or must never be used, and its cost."""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence
from typing import Any

from selector.errors import OptionError
from selector.selection import Options

USES = ("may be used", "must be kept", "never")


def use_of(options: Options, name: str) -> str:
    """One of `USES`."""
    return USES[1] if name in options.must else USES[2] if name in options.never else USES[0]


def cost_of(options: Options, name: str) -> str:
    """The cost as it stands in a field."""
    return f"{options.cost.get(name, 1.0):g}"


def wishes(
    names: Sequence[str], uses: Sequence[str], costs: Sequence[str | None], known: Collection[str]
) -> dict[str, Any]:
    """Options ``must``, ``never`` and ``cost`` from what stands beside the names; unknown names are left out.

    Raises
    ------
    OptionError
        A cost is no number.
    """
    rows = [row for row in zip(names, uses, costs, strict=True) if row[0] in known]
    asked = {name: _cost(text, name) for name, _, text in rows}
    return {
        "must": tuple(name for name, use, _ in rows if use == USES[1]),
        "never": tuple(name for name, use, _ in rows if use == USES[2]),
        "cost": {name: cost for name, cost in asked.items() if cost != 1.0},
    }


def _cost(text: str | None, name: str) -> float:
    try:
        cost = float(text or "1")
    except ValueError:
        cost = math.nan
    if not math.isfinite(cost):
        raise OptionError(repr(text), expected="a number", where=f"cost of {name}", advice="e.g. 2")
    return cost
