"""What is wished of each sensor, as two pages ask it: whether it may, must or must never be used, and its cost."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from typing import Any

from selector.recording import SENSOR_ROLES
from selector.selection import Options
from selector.workbench import parts, typed
from selector.workbench.bench import Bench
from selector.workbench.typed import FIELDS

USES = ("may be used", FIELDS["--must"], FIELDS["--never"])
COLUMNS = ("sensor", "place", "use", "cost", "x [m]", "y [m]", "z [m]")


def use_of(options: Options, name: str) -> str:
    """One of `USES`."""
    return USES[1] if name in options.must else USES[2] if name in options.never else USES[0]


def cost_of(options: Options, name: str) -> str:
    """The cost as it stands in a field."""
    return f"{options.cost.get(name, 1.0):.12g}"


def wishes(
    names: Sequence[str], uses: Sequence[str], costs: Sequence[str | None], known: Collection[str]
) -> dict[str, Any]:
    """Options ``must``, ``never`` and ``cost`` from what stands beside the names; unknown names are left out.

    Raises
    ------
    OptionError
        A cost is no number of 0 or more.
    """
    rows = [row for row in zip(names, uses, costs, strict=True) if row[0] in known]
    asked = {name: typed.number(text or "1", f"cost of {name}", 0.0) for name, _, text in rows}
    return {
        "must": tuple(name for name, use, _ in rows if use == USES[1]),
        "never": tuple(name for name, use, _ in rows if use == USES[2]),
        "cost": {name: cost for name, cost in asked.items() if cost != 1.0},
    }


def choose(
    bench: Bench, page: str, ids: Sequence[dict[str, str]], uses: Sequence[str], costs: Sequence[str | None]
) -> None:
    """Takes over the rows of a page's table; where they are refused, they show again what counts.

    Parameters
    ----------
    page : str
        ``ID`` of the page, with which the ids of the fields begin.
    ids : sequence of mapping
        Of the fields for the use, ``{"type": …, "sensor": name}``.
    uses, costs : sequences of str
        An empty cost is 1.

    Raises
    ------
    OptionError
        A cost is no number of 0 or more, or more sensors must be kept than a set may have.
    """
    reading = bench.material.reading
    known = () if reading is None else reading.recording.names
    names = [one["sensor"] for one in ids]
    boxes = [{"type": f"{page}-{kind}", "sensor": name} for kind in ("use", "cost") for name in names]

    def counting() -> list[str]:
        return [said(bench.options, name) for said in (use_of, cost_of) for name in names]

    with parts.showing_what_counts(boxes, [*uses, *costs], counting):
        if bench.choose(**wishes(names, uses, costs, known)):
            parts.tell(bench)


def rows(bench: Bench) -> list[list[object]]:
    """A row for each sensor under `COLUMNS`: what is wished of it, and where it sits."""
    reading, asked = bench.material.reading, bench.options
    return [
        [one.name, one.place or "", use_of(asked, one.name), asked.cost.get(one.name, 1.0), *(one.xyz_m or ())]
        for one in (() if reading is None else reading.recording.channels)
        if one.role in SENSOR_ROLES
    ]
