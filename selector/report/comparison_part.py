"""The part of a page that lays a simulation beside the recordings that it followed: sentences, table, pictures."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from selector.figures.comparison import recorded_and_simulated
from selector.physics.drive.comparison import Difference, main_difference
from selector.report.numbers import NONE, number_text, span_text
from selector.report.page import Pictures
from selector.report.tables import Table, table

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
_UNITS = {"um": "µm", "urad": "µrad", "1": ""}


def comparison_sentences(differences: Sequence[Difference]) -> list[str]:
    """How far simulated and recorded are apart, the position first."""
    first = main_difference(tuple(differences))
    if first is None:
        return []
    told = [_sentence(first, len({one.run for one in differences}) > 1, len({one.axis for one in differences}) > 1)]
    others = [one for one in differences if one.run == first.run and one.axis == first.axis and one is not first]
    if others:
        said = ", ".join(f"{WHAT[one.kind]} ({one.channel}) {_amount(one.rms, one)}" for one in others)
        told.append(f"Of the same run, rms of simulated minus recorded: {said}.")
    return told


def comparison_part(pictures: Pictures, differences: Sequence[Difference]) -> dict[str, Any]:
    """Pictures of the first channels, and all numbers as a table."""
    drawn = [
        pictures.add(
            recorded_and_simulated(one.time_s, one.recorded, one.simulated, _called(one, differences), one.unit), _READ
        )
        for one in differences[:MOST_DRAWN]
    ]
    return {"pictures": drawn, "table": _table(differences), "more": max(0, len(differences) - MOST_DRAWN)}


def _sentence(one: Difference, several_runs: bool, several_axes: bool) -> str:
    of = (f" of {one.axis}" if several_axes else "") + (f" in {one.run}, the worst run," if several_runs else "")
    what = WHAT[one.kind] + ("" if one.channel == WHAT[one.kind] else f" ({one.channel})") + of
    text = (
        f"Simulated and recorded {what} differ by {_amount(one.rms, one)} rms, at most by {_amount(one.largest, one)} "
    )
    text += f"after {span_text(one.largest_at_s)}"
    return text + (f"; that is {relative_text(one)} of what was recorded, about its mean." if one.relative else ".")


def _table(differences: Sequence[Difference]) -> Table:
    rows = [
        (
            one.run,
            one.axis,
            one.channel,
            WHAT[one.kind],
            number_text(one.rms),
            number_text(one.largest),
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
    heads = ["run", "axis", "channel", "what", ">rms", ">largest", ">at [s]", "unit", ">relative"]
    return table(heads, rows, note)


def relative_text(one: Difference) -> str:
    """The relative difference as a percentage, a dash for none."""
    return NONE if one.relative is None else f"{number_text(100 * one.relative)} %"


def _called(one: Difference, among: Sequence[Difference]) -> str:
    return f"{one.channel}, {one.run}" if len({other.run for other in among}) > 1 else one.channel


def _amount(value: float, one: Difference) -> str:
    return f"{number_text(value)} {_UNITS.get(one.unit, one.unit)}".rstrip()


_READ = (
    "Simulated minus recorded. Long courses are drawn with the lowest and highest sample of each of 300 stretches; the "
    "numbers count all."
)
