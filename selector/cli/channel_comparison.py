"""How far a simulation that followed recordings is from them, channel by channel, as JSON and on the screen."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from selector.cli import showing

if TYPE_CHECKING:
    from rich.console import Console

    from selector.physics.channel_differences import ChannelDifference

_MOST_ROWS = 12


def comparison_object(differences: Sequence[ChannelDifference]) -> list[dict[str, Any]]:
    """`comparison` of `selector.simulation/1`, of models whose channels stand for themselves."""
    return [
        {
            "run": one.run,
            "channel": one.channel,
            "unit": one.unit,
            "rms": one.rms,
            "largest": one.largest,
            "largest_at_s": one.largest_at_s,
            "relative": one.relative,
            "samples": len(one.time_s),
        }
        for one in differences
    ]


def show_comparison(console: Console, differences: Sequence[ChannelDifference]) -> None:
    """Differences as a table; of many runs the worst of each channel."""
    told, title = list(differences), "Simulated minus recorded"
    if len(told) > _MOST_ROWS:
        worst: dict[str, ChannelDifference] = {}
        for one in told:
            kept = worst.get(one.channel)
            worst[one.channel] = one if kept is None or one.rms > kept.rms else kept
        told, title = list(worst.values()), f"{title}, worst run of each channel"
    rows = [
        (
            one.run,
            one.channel,
            one.rms,
            one.largest,
            one.largest_at_s,
            {"um": "µm"}.get(one.unit, one.unit),
            None if one.relative is None else f"{100 * one.relative:.3g} %",
        )
        for one in told
    ]
    columns = ["run", "channel", "rms", "largest", "at s", "unit", "relative"]
    if rows:
        console.print(showing.table(title, columns, rows, numeric=["rms", "largest", "at s", "relative"]))
