"""Sets of sensors against their error: which of them are on offer, and which one is taken."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import plotly.graph_objects as go

from selector.figures import style
from selector.figures.changes import Changes

_FAMILIES = (
    ("all", "best of all sensors", style.CHOSEN, "square"),
    ("cut", "best of the representatives", style.PREDICTED, "circle"),
)


@dataclass(frozen=True)
class SetError:
    """A set of sensors and its error [µm]."""

    sensors: tuple[str, ...]
    error_um: float


def set_errors_picture(response: str, height: int) -> go.Figure:
    """The frame for sets against their error; `set_error_changes` fills it. It has no title.

    A point of a line carries its sensors as ``customdata``, so that a click can take them.
    """
    drawn = style.figure("", height)
    drawn.update_layout(margin={"t": style.TITLE_MARGIN, "b": 60})
    drawn.add_scatter(
        mode="lines",
        name="without compensation",
        line={"color": style.BASELINES["none"], "width": 2, "dash": "dash"},
        hoverinfo="skip",
    )
    for _, name, colour, symbol in _FAMILIES:
        drawn.add_scatter(
            mode="lines+markers",
            name=name,
            line={"color": colour, "width": 2},
            marker={"size": 11, "symbol": symbol},
            hovertemplate="%{text}<br>%{y:.4g} µm<extra></extra>",
        )
    drawn.add_scatter(
        mode="markers",
        name="shown here",
        marker={"color": "rgba(0,0,0,0)", "size": 22, "line": {"color": style.RESIDUAL, "width": 3}},
        hoverinfo="skip",
    )
    drawn.update_xaxes(title_text="sensors [–]", dtick=1, showgrid=False)
    drawn.update_yaxes(title_text=f"error of {style.label(response)}, rms [µm]")
    return drawn


def set_error_changes(
    everywhere: Sequence[SetError], cut: Sequence[SetError], taken: SetError, before_um: float
) -> Changes:
    """The sets in the frame of `set_errors_picture`.

    Parameters
    ----------
    everywhere : sequence of SetError
        The best of each size among all sensors.
    cut : sequence of SetError
        The best of each size among the representatives of a cut.
    taken : SetError
        Gets a ring.
    before_um : float
        The error without any sensor [µm].
    """
    last = max(len(one.sensors) for one in (*everywhere, *cut, taken)) + 0.5
    values = [one.error_um for one in (*everywhere, *cut, taken)] + [before_um]
    changes: dict[tuple[str | int, ...], object] = {
        ("data", 0, "x"): [0.5, last],
        ("data", 0, "y"): [before_um, before_um],
        ("data", 3, "x"): [len(taken.sensors)],
        ("data", 3, "y"): [taken.error_um],
        ("layout", "xaxis", "range"): [0.5, last],
    }
    for k, sets in enumerate((everywhere, cut), start=1):
        changes["data", k, "x"] = [len(one.sensors) for one in sets]
        changes["data", k, "y"] = [one.error_um for one in sets]
        changes["data", k, "text"] = [style.listed(one.sensors) for one in sets]
        changes["data", k, "customdata"] = [list(one.sensors) for one in sets]
    for key, value in _value_axis(values).items():
        changes["layout", "yaxis", key] = value
    return changes


def _value_axis(values: Sequence[float]) -> dict[str, object]:
    """A logarithmic axis that holds them, with ticks at 1, 2, 5 of each power of ten."""
    known = [value for value in values if value > 0] or [1.0]
    low, high = 0.85 * min(known), 1.15 * max(known)
    ticks = [digit * 10.0**power for power in range(-4, 7) for digit in (1, 2, 5)]
    shown = [tick for tick in ticks if low <= tick <= high]
    return {
        "type": "log",
        "range": [math.log10(low), math.log10(high)],
        "tickvals": shown,
        "ticktext": [f"{tick:g}" for tick in shown],
    }
