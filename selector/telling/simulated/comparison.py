"""How far a simulation is from the recordings that drove it: sentences, a table, drawings, and the JSON."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from selector.json_text import fields_of
from selector.number_text import number_text
from selector.physics.channel_differences import ChannelDifference
from selector.telling.account import Captioned, Drawing, Note, Section, Table, section, table
from selector.telling.numbers import NONE, span_text

if TYPE_CHECKING:
    import plotly.graph_objects as go

MOST_DRAWN = 6
MOST_ROWS = 60

WHAT = {
    "position": "position",
    "table": "position of the table",
    "error": "tracking error",
    "output": "output of the control",
    "total": "output of the control with what is added",
    "force": "force of the drive",
}
_FIRST = (("position", "table"), ("error",), ("total", "output"), ("force",))  #: What is told first of an axis.
_UNITS = {"um": "µm", "urad": "µrad", "degC": "°C", "rpm": "r/min", "1": ""}
_EQUAL = 1e-9  #: Difference, as a share of what was recorded, below which it is rounding.

_READ = (
    "Simulated minus recorded. Long courses are drawn with the lowest and highest sample of each of 300 stretches; the "
    "numbers count all."
)


def main_difference(differences: Sequence[ChannelDifference]) -> ChannelDifference | None:
    """The one to be told first: of axes the worst position, else the worst channel for the size of its course."""
    for kinds in _FIRST:
        ones = [one for one in differences if one.kind in kinds]
        if ones:
            return max(ones, key=lambda one: one.rms if math.isfinite(one.rms) else math.inf)
    return max(differences, key=lambda one: -1.0 if one.relative is None else one.relative, default=None)


def comparison_sentences(differences: Sequence[ChannelDifference]) -> list[str]:
    """How far simulated and recorded are apart where that matters most."""
    first = main_difference(differences)
    if first is None:
        return []
    what = first.channel
    if first.kind:
        what = WHAT[first.kind] + ("" if first.channel == WHAT[first.kind] else f" ({first.channel})")
        what += f" of {first.axis}" if len({one.axis for one in differences}) > 1 else ""
    what += f" in {first.run}, the worst run," if len({one.run for one in differences}) > 1 else ""
    told = (
        f"Simulated and recorded {what} differ by {_amount(first.rms, first)} rms, at most by "
        f"{_amount(first.largest, first)} after {span_text(first.largest_at_s)}"
    )
    share = f"; that is {relative_text(first)} of what was recorded, about its mean" if first.relative else ""
    return [f"{told}{share}."]


def comparison_section(differences: Sequence[ChannelDifference], *, drawn: bool) -> Section | None:
    """All numbers as a table, and drawings of the first channels that differ; None if nothing was recorded."""
    if not differences:
        return None
    several = len({one.run for one in differences}) > 1
    telling = [one for one in differences if one.kind or one.largest > _EQUAL * float(np.abs(one.recorded).max())]
    drawings = [
        Drawing(_drawn(one, f"{one.channel}, {one.run}" if several else one.channel), _READ)
        for one in telling[: MOST_DRAWN if drawn else 0]
    ]
    more = len(telling) - MOST_DRAWN
    note = Note(f"{more} more channels were compared and are not drawn.") if drawn and more > 0 else None
    numbers = Captioned("Simulated minus recorded", comparison_table(differences))
    return section("comparison", "Simulated and recorded", *drawings, note, numbers)


def comparison_table(differences: Sequence[ChannelDifference]) -> Table:
    """Every channel in every run."""
    axes = any(one.axis for one in differences)
    rows = [
        (
            one.run,
            *((one.axis,) if axes else ()),
            one.channel,
            *((WHAT[one.kind],) if axes else ()),
            one.rms,
            one.largest,
            number_text(one.largest_at_s, 4),
            _UNITS.get(one.unit, one.unit) or NONE,
            relative_text(one),
        )
        for one in differences[:MOST_ROWS]
    ]
    more = len(differences) - MOST_ROWS
    note = (
        "Simulated minus recorded at the samples of the recording. Relative: ‖difference‖ / ‖recorded about its mean‖."
        + (f" {more} more are in the JSON." if more > 0 else "")
    )
    heads = ["run", "axis", "channel", "what"] if axes else ["run", "channel"]
    return table([*heads, ">rms", ">largest", ">at [s]", "unit", ">relative"], rows, note)


def comparison_data(differences: Sequence[ChannelDifference] | None) -> list[dict[str, Any]] | None:
    """`comparison` of `selector.simulation/1`."""
    if differences is None:
        return None
    return [
        {
            "run": one.run,
            **({"axis": one.axis} if one.axis else {}),
            "channel": one.channel,
            **({"kind": one.kind} if one.kind else {}),
            **fields_of(one, "unit", "rms", "largest", "largest_at_s", "relative"),
            "samples": len(one.time_s),
        }
        for one in differences
    ]


def relative_text(one: ChannelDifference) -> str:
    """The relative difference as a percentage, a dash for none."""
    return NONE if one.relative is None else f"{number_text(100 * one.relative)} %"


def _drawn(one: ChannelDifference, name: str) -> go.Figure:
    from selector.figures.simulated.drive import recorded_and_simulated

    # courses of axes are drawn in mm, vibrations in µm
    unit = one.unit if one.kind else _UNITS.get(one.unit, one.unit)
    return recorded_and_simulated(one.time_s, one.recorded, one.simulated, name, unit)


def _amount(value: float, one: ChannelDifference) -> str:
    return f"{number_text(value)} {_UNITS.get(one.unit, one.unit)}".rstrip()
