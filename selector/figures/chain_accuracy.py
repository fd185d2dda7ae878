"""At which frequencies does each chain agree with the coupled structure, and what is to blame where it does not."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import plotly.graph_objects as go
from numpy.typing import NDArray

from selector.figures import style
from selector.figures.log_axis import log_ticks
from selector.figures.panels import shown_samples
from selector.physics.vibration.chain_error import ChainAccuracy

Vector = NDArray[np.float64]

LIMITS = (0.1, 0.3, 1.0)
"""Errors at which the colour changes: within 10 %, within 30 %, within 100 %, and beyond."""

MOST_STRIPS = 60
_COLOURS = (style.CHOSEN, "#c8dfae", "#f0b86a", "#b34a00")
_NAMES = ("within 10 %", "10 to 30 %", "30 to 100 %", "above 100 %")
_STRIP_PX = 22
_POINTS = 400
_LEAST, _MOST = 0.1, 1e3
"""Errors [%] between which the axis is drawn."""

_PARTS = (
    ("published", "chain as published", style.INK, "solid"),
    ("one_way", "one way: no back reaction", style.PREDICTED, "dash"),
    ("cut_out", "cut out: merged, held, left out", style.RESIDUAL, "dot"),
)


def accuracy_strips(accuracy: Sequence[ChainAccuracy], title: str) -> go.Figure:
    """A strip over frequency for each chain and source, in the colour of its error against the coupled structure."""
    shown = accuracy[:MOST_STRIPS]
    drawn = style.figure(title, 120 + _STRIP_PX * len(shown))
    for level, (colour, name) in enumerate(zip(_COLOURS, _NAMES, strict=True)):
        x: list[float | None] = []
        y: list[float | None] = []
        for row, one in enumerate(shown):
            for start, stop in _stretches(one, level):
                x += [start, stop, None]
                y += [row, row, None]
        drawn.add_scatter(
            x=x, y=y, mode="lines", name=name, line={"color": colour, "width": _STRIP_PX - 7}, hoverinfo="skip"
        )
    ends = [extreme(one.frequency_hz[one.frequency_hz > 0]) for one in shown for extreme in (np.min, np.max)]
    low, high = float(np.log10(min(ends))), float(np.log10(max(ends)))
    drawn.update_xaxes(type="log", title_text="frequency [Hz]", range=[low, high], **log_ticks(low, high))
    drawn.update_yaxes(
        range=[len(shown) - 0.4, -0.6], tickvals=list(range(len(shown))), ticktext=[chain_text(one) for one in shown],
        showgrid=False, ticks="",
    )  # fmt: skip
    return drawn


def error_of_chains(accuracy: Sequence[ChainAccuracy], title: str) -> go.Figure:
    """Error over frequency of one chain, with what the two simplifications make of it; the others are in a menu."""
    drawn = style.figure(title, 440)
    # the menu stands above, where legends stand elsewhere
    drawn.update_layout(margin={"b": 92}, legend={"y": -0.2, "yanchor": "top"})
    courses = [_courses(one) for one in accuracy[:MOST_STRIPS]]
    for (_, name, colour, dash), (x, y) in zip(_PARTS, courses[0], strict=True):
        drawn.add_scatter(
            x=x, y=y, mode="lines", name=name, line={"color": colour, "width": 1.8, "dash": dash},
            hovertemplate="%{x:.4g} Hz: %{y:.3g} %<extra></extra>",
        )  # fmt: skip
    drawn.add_shape(
        type="rect", xref="x domain", x0=0, x1=1, yref="y", y0=_LEAST, y1=100 * LIMITS[0], fillcolor=style.CHOSEN,
        opacity=0.14, line={"width": 0}, layer="below",
    )  # fmt: skip
    # the ranges of chains are shorter than all of them together
    drawn.update_xaxes(type="log", title_text="frequency [Hz]", **log_ticks(0.0, 0.0))
    drawn.update_yaxes(
        type="log", title_text="error [%]", dtick=1, exponentformat="none",
        range=[np.log10(_LEAST).item(), np.log10(_MOST).item()],
    )  # fmt: skip
    if len(courses) > 1:
        buttons: list[dict[str, Any]] = [
            {
                "label": chain_text(one),
                "method": "restyle",
                "args": [{"x": [x for x, _ in course], "y": [y for _, y in course]}],
            }
            for one, course in zip(accuracy, courses, strict=False)
        ]
        drawn.update_layout(
            updatemenus=[
                {
                    "buttons": buttons, "direction": "down", "x": 0, "xanchor": "left", "y": 1.0, "yanchor": "bottom",
                    "bgcolor": "#ffffff", "font": {"size": 12}, "pad": {"b": 4},
                }
            ]
        )  # fmt: skip
    return drawn


def chain_text(one: ChainAccuracy) -> str:
    """A chain and the source that drives it, as Plotly shows it."""
    return style.label(one.chain, 20) + (f", {style.label(one.source, 12)}" if one.source else "")


def _stretches(one: ChainAccuracy, level: int) -> list[tuple[float, float]]:
    """Frequencies between which the error is of one colour; neighbours meet in the middle between two of them."""
    error, frequency = one.published.error, one.frequency_hz
    inside = np.digitize(error, LIMITS, right=True) == level
    edges = np.diff(np.concatenate([[0], inside.astype(np.int8), [0]]))
    middles = np.concatenate([frequency[:1], (frequency[:-1] + frequency[1:]) / 2.0, frequency[-1:]])
    starts, ends = middles[np.flatnonzero(edges == 1)], middles[np.flatnonzero(edges == -1)]
    return [(float(start), float(end)) for start, end in zip(starts, ends, strict=True) if start > 0]


def _courses(one: ChainAccuracy) -> list[tuple[list[float], list[float]]]:
    """Error [%] over frequency of the published chain and of its two simplifications, peaks kept."""
    found = []
    for name, *_ in _PARTS:
        error = np.clip(100.0 * getattr(one, name).error, _LEAST / 10.0, 10.0 * _MOST)
        at = shown_samples(np.log(np.maximum(one.frequency_hz, 1e-9)), np.log(error), points=_POINTS)
        found.append(([float(f"{f:.5g}") for f in one.frequency_hz[at]], [float(f"{e:.4g}") for e in error[at]]))
    return found
