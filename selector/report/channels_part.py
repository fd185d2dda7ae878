"""The part of a page that lays the channels of a simulation beside those of the recordings that drove it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from selector.figures.comparison import recorded_and_simulated
from selector.physics.channel_differences import ChannelDifference
from selector.report.numbers import NONE, number_text, span_text
from selector.report.page import Pictures
from selector.report.tables import Table, table

MOST_DRAWN = 6
MOST_ROWS = 60
_EQUAL = 1e-9
"""Difference, as a share of what was recorded, below which it is rounding."""

_UNITS = {"um": "µm", "degC": "°C", "rpm": "r/min", "1": ""}


def difference_sentence(differences: Sequence[ChannelDifference]) -> str:
    """How far simulated and recorded are apart where that is most, as a share of what was recorded; empty for none."""
    if not differences:
        return ""
    worst = max(differences, key=lambda one: one.relative if one.relative is not None else -1.0)
    several = f" in {worst.run}, the worst run," if len({one.run for one in differences}) > 1 else ""
    text = (
        f"Simulated and recorded {worst.channel}{several} differ by {_amount(worst.rms, worst)} rms, at most by "
        f"{_amount(worst.largest, worst)} after {span_text(worst.largest_at_s)}"
    )
    return text + (f"; that is {_relative(worst)} of what was recorded, about its mean." if worst.relative else ".")


def channels_part(pictures: Pictures, differences: Sequence[ChannelDifference]) -> dict[str, Any]:
    """Pictures of the first channels that differ at all, and all numbers as a table."""
    several = len({one.run for one in differences}) > 1
    telling = [one for one in differences if one.largest > _EQUAL * float(np.abs(one.recorded).max())]
    drawn = [
        pictures.add(
            recorded_and_simulated(
                one.time_s,
                one.recorded,
                one.simulated,
                f"{one.channel}, {one.run}" if several else one.channel,
                _UNITS.get(one.unit, one.unit),
            ),
            _READ,
        )
        for one in telling[:MOST_DRAWN]
    ]
    return {"pictures": drawn, "table": _table(differences), "more": max(0, len(telling) - MOST_DRAWN)}


def _table(differences: Sequence[ChannelDifference]) -> Table:
    rows = [
        (
            one.run,
            one.channel,
            number_text(one.rms),
            number_text(one.largest),
            number_text(one.largest_at_s, 4),
            _UNITS.get(one.unit, one.unit) or NONE,
            _relative(one),
        )
        for one in differences[:MOST_ROWS]
    ]
    more = len(differences) - MOST_ROWS
    note = (
        "Simulated minus recorded at the samples of the recording. Relative: ‖difference‖ / ‖recorded about its mean‖."
        + (f" {more} more are in the JSON." if more > 0 else "")
    )
    return table(["run", "channel", ">rms", ">largest", ">at [s]", "unit", ">relative"], rows, note)


def _relative(one: ChannelDifference) -> str:
    return NONE if one.relative is None else f"{number_text(100 * one.relative)} %"


def _amount(value: float, one: ChannelDifference) -> str:
    return f"{number_text(value)} {_UNITS.get(one.unit, one.unit)}".rstrip()


_READ = (
    "Simulated minus recorded. Long courses are drawn with the lowest and highest sample of each of 300 stretches; the "
    "numbers count all."
)
