"""Where recording and simulation part: every response over time, and below it what the machine was doing."""

from __future__ import annotations

import numpy as np
import plotly.graph_objects as go
from numpy.typing import NDArray

from selector.diagnosis.answer import Diagnosis
from selector.diagnosis.comparison import Comparison
from selector.diagnosis.shapes.signals import course
from selector.diagnosis.wording import amount
from selector.figures import style
from selector.figures.run_axis import RunAxis

Vector = NDArray[np.float64]
_CELLS = 600
_ROW_PX = 44
_MOST_STATES = 6
_MOST_WINDOWS = 60
_LIMIT = 2.5
_SCALE = ((0.0, "#004a78"), (0.25, "#6baed6"), (0.5, "#ffffff"), (0.75, "#f4a26a"), (1.0, "#a33f00"))
_STATE_SCALE = ((0.0, "#f2f2f2"), (1.0, "#4d4d4d"))
_STATES = (
    "spindle_speed", "feed_rate", "velocity", "position_command", "position", "state", "flow", "temperature", "ambient",
    "force", "current",
)  # fmt: skip


def mismatch_map(found: Diagnosis) -> go.Figure:
    """What recalibration leaves of the difference, response by response over all runs; windows of the answer framed.

    A cell is the root mean square of its samples with the sign of their mean, in units of the root mean square of that
    response. The grey strip shows recorded channels from their lowest (light) to their highest value (dark).
    """
    comparison = found.comparison
    axis = RunAxis(comparison)
    unit, seconds = style.time_unit(axis.end_s)
    responses = [name for name in comparison.responses if name in found.fit]
    causes = [name for effect in found.effects for name in effect.sources]
    states = _states(comparison, causes)
    height = _ROW_PX * max(len(responses), 1) + (24 + 20 * len(states) if states else 0)
    drawn = style.figure(_title(found), height)
    top = int(drawn.layout.margin.t)
    drawn.update_layout(height=top + height + 50, margin={"b": 50, "r": 90}, showlegend=False)
    edges = _edges(comparison, axis)
    cells, texts, labels = [], [], []
    for name in responses:
        left = comparison.recorded[name] - found.fit[name].recalibrated
        scale = float(np.sqrt(np.nanmean(left**2))) or 1.0
        values = _binned(axis, left, edges)
        cells.append(np.clip(values / scale, -_LIMIT, _LIMIT))
        texts.append(values)
        labels.append(f"{style.label(name, 16)}<br>{amount(scale, found.fit[name].unit)} rms")
    split = 0.0 if not states else (20 * len(states)) / height
    scale_part = 1.0 - split if len(responses) > 1 else 1.0
    middles = 0.5 * (edges[1:] + edges[:-1]) / seconds
    drawn.add_heatmap(
        x=middles, y=list(range(len(responses))), z=np.array(cells), customdata=np.array(texts), zmin=-_LIMIT,
        zmax=_LIMIT, colorscale=[list(stop) for stop in _SCALE], ygap=3, yaxis="y",
        colorbar={"title": {"text": "× rms", "side": "top"}, "len": scale_part, "y": 1.0, "yanchor": "top",
                  "thickness": 12, "tickvals": [-2, 0, 2], "ticktext": ["−2", "0", "+2"], "x": 1.01},
        hovertemplate="%{customdata:.4g}: recorded − simulated<extra></extra>",
    )  # fmt: skip
    _frame(drawn, found, axis, responses, seconds)
    drawn.layout.xaxis = {
        "range": [0.0, axis.end_s / seconds],
        "anchor": "y2" if states else "y",
        "showgrid": False,
        "title": {"text": f"time from the start of each run [{unit}]"},
        **axis.ticks(seconds),
    }
    drawn.layout.yaxis = {
        "domain": [split + (24 / height if states else 0.0), 1.0],
        "anchor": "x",
        "tickvals": list(range(len(responses))),
        "ticktext": labels,
        "range": [len(responses) - 0.5, -0.5],
        "showgrid": False,
    }
    if states:
        strip = np.array([_scaled(_binned(axis, course(comparison, name), edges, signed=False)) for name in states])
        drawn.add_heatmap(
            x=middles, y=list(range(len(states))), z=strip, zmin=0.0, zmax=1.0, showscale=False, yaxis="y2", ygap=2,
            colorscale=[list(stop) for stop in _STATE_SCALE], hoverinfo="skip",
        )  # fmt: skip
        drawn.layout.yaxis2 = {
            "domain": [0.0, split],
            "anchor": "x",
            "tickvals": list(range(len(states))),
            "ticktext": [style.label(name, 16) for name in states],
            "range": [len(states) - 0.5, -0.5],
            "showgrid": False,
        }
    axis.name_runs(drawn, seconds)
    return drawn


def _title(found: Diagnosis) -> str:
    windows = [place for place in found.where if place.run is not None]
    if not windows:
        return "No part of the difference stands out from noise" if not found.where else "The difference over all runs"
    channels = list(dict.fromkeys(place.channel for place in windows))
    return f"The mismatch sits in {style.listed(channels)}; windows that are named are framed"


def _states(comparison: Comparison, causes: list[str]) -> list[str]:
    """Channels that say what the machine was doing, the most telling first; the causes that were named are kept."""
    moving = [
        channel
        for channel in comparison.channels
        if channel.role in _STATES
        and channel.name not in comparison.responses
        and np.nanstd(np.where(np.isfinite(comparison.recorded[channel.name]), comparison.recorded[channel.name], 0.0))
        > 0
    ]
    moving.sort(key=lambda channel: _STATES.index(channel.role))
    names = [channel.name for channel in moving]
    shown = [*(name for name in names if name in causes), *(name for name in names if name not in causes)][
        :_MOST_STATES
    ]
    return [name for name in names if name in shown]


def _edges(comparison: Comparison, axis: RunAxis) -> Vector:
    """Edges of the cells on the axis; none lies across two runs."""
    found = [0.0]
    stops = [*axis.starts_s[1:], axis.end_s * (1.0 + 1e-9)]
    for start, stop in zip(axis.starts_s, stops, strict=True):
        count = max(4, round(_CELLS * (stop - start) / axis.end_s))
        found += np.linspace(start, stop, count + 1)[1:].tolist()
    return np.array(found)


def _binned(axis: RunAxis, values: Vector, edges: Vector, *, signed: bool = True) -> Vector:
    """Root mean square of the samples of each cell with the sign of their mean, or their mean; NaN without samples."""
    time, shown = (np.concatenate(parts) for parts in zip(*axis.by_run(values), strict=True))
    seen = np.isfinite(shown)
    cell = np.clip(np.searchsorted(edges, time[seen], side="right") - 1, 0, len(edges) - 2)
    count = np.bincount(cell, minlength=len(edges) - 1).astype(np.float64)
    count[count == 0.0] = np.nan
    mean = np.bincount(cell, weights=shown[seen], minlength=len(edges) - 1) / count
    if not signed:
        return np.asarray(mean)
    square = np.bincount(cell, weights=shown[seen] ** 2, minlength=len(edges) - 1) / count
    return np.asarray(np.sign(mean) * np.sqrt(square))


def _scaled(values: Vector) -> Vector:
    low, high = float(np.nanmin(values)), float(np.nanmax(values))
    return np.asarray((values - low) / (high - low)) if high > low else values * 0.0


def _frame(drawn: go.Figure, found: Diagnosis, axis: RunAxis, responses: list[str], seconds: float) -> None:
    shown = [place for place in found.where if place.run in found.comparison.runs and place.channel in responses]
    for place in sorted(shown, key=lambda place: -place.share)[:_MOST_WINDOWS]:
        run = place.run or ""
        start = axis.place_s(run, 0.0 if place.from_s is None else place.from_s)
        stop = axis.place_s(run, np.inf if place.to_s is None else place.to_s)
        row = responses.index(place.channel)
        drawn.add_shape(
            type="rect", xref="x", yref="y", x0=start / seconds, x1=stop / seconds, y0=row - 0.46, y1=row + 0.46,
            line={"color": style.INK, "width": 1.4}, fillcolor="rgba(0,0,0,0)",
        )  # fmt: skip
