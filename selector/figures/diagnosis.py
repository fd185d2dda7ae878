"""Pictures of a diagnosis: where recording and simulation part, and the fit."""

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
import plotly.graph_objects as go

from selector.diagnosis.answer import Diagnosis
from selector.diagnosis.comparison import Comparison
from selector.diagnosis.shapes.signals import course
from selector.diagnosis.shown_units import displayed
from selector.diagnosis.wording import amount, name_of
from selector.figures import style
from selector.figures.panels import Line, Panel, stacked
from selector.number_text import number_text
from selector.physics.ranges import true_stretches
from selector.types import Vector

_GAP = 0.015
_WIDTH_PX = 780.0
_TICK_PX, _NAME_PX = 46.0, 60.0
_STEPS_S: tuple[float, ...] = (
    *(0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1, 2, 5, 10, 20, 30),
    *(minutes * 60.0 for minutes in (1, 2, 5, 10, 20, 30)),
    *(hours * 3600.0 for hours in (1, 2, 4, 6, 12, 24, 48, 120, 240, 1000)),
)


class RunAxis:
    """Where every sample stands; starts of all runs, and the end of the axis [s]."""

    def __init__(self, comparison: Comparison) -> None:
        self._comparison = comparison
        self._lengths = [float(np.ptp(comparison.time_s[rows][[0, -1]])) for _, rows in comparison.rows_of_runs()]
        gap = _GAP * sum(self._lengths)
        starts = np.cumsum([0.0, *(length + gap for length in self._lengths)])
        self.starts_s = tuple(float(start) for start in starts[:-1])
        self.end_s = float(starts[-1] - gap)

    def by_run(self, values: Vector) -> list[tuple[Vector, Vector]]:
        """(times on the axis, values) of every run."""
        rows = [part for _, part in self._comparison.rows_of_runs()]
        time = self._comparison.time_s
        pairs = zip(self.starts_s, rows, strict=True)
        return [(start + time[part] - time[part][0], values[part]) for start, part in pairs]

    def place_s(self, run: str, time_s: float) -> float:
        """Where a time from the start of a run stands."""
        k = self._comparison.runs.index(run)
        return self.starts_s[k] + float(np.clip(time_s, 0.0, self._lengths[k]))

    def held_out_s(self) -> list[tuple[float, float]]:
        """Stretches of the axis that nothing was fitted to."""
        found = []
        for start, (_, rows) in zip(self.starts_s, self._comparison.rows_of_runs(), strict=True):
            time = self._comparison.time_s[rows] - self._comparison.time_s[rows][0]
            found += [
                (start + float(time[a]), start + float(time[b - 1]))
                for a, b in true_stretches(self._comparison.held_out[rows])
                if b - a > 1
            ]
        return found

    def ticks(self, seconds: float) -> dict[str, Sequence[object]]:
        """Ticks of a Plotly axis whose unit has that many seconds: the time from the start of each run."""
        per_px = self.end_s / _WIDTH_PX
        step = next((one for one in _STEPS_S if one >= _TICK_PX * per_px), _STEPS_S[-1])
        values: list[float] = []
        texts: list[str] = []
        for start, length in zip(self.starts_s, self._lengths, strict=True):
            if values and start / seconds - values[-1] < 0.4 * _TICK_PX * per_px / seconds:
                continue
            for k in range(int(length // step) + 1):
                if k == 0 or k * step <= length - 0.25 * _TICK_PX * per_px:
                    values.append((start + k * step) / seconds)
                    texts.append(f"{k * step / seconds:.4g}")
        return {"tickvals": values, "ticktext": texts}

    def name_runs(self, drawn: go.Figure, seconds: float) -> None:
        """Writes the names of the runs above the picture, and that a run is held out.

        Pictures over this axis are linked: what is dragged across one of them is marked in all.
        """
        drawn.update_layout(meta={"linked": True}, dragmode=False)
        room = self.end_s * _NAME_PX / _WIDTH_PX
        last = -np.inf
        for run, start, length, (_, rows) in zip(
            self._comparison.runs, self.starts_s, self._lengths, self._comparison.rows_of_runs(), strict=True
        ):
            if start - last < room:
                continue
            last = start
            is_held = bool(self._comparison.held_out[rows].all()) and length > 2 * room
            text = f"<b>{style.label(run, 18)}</b>" + (" (held out)" if is_held else "")
            above = {"xref": "x", "xanchor": "left", "yref": "paper", "yanchor": "bottom"}
            drawn.add_annotation(style.words(text, start / seconds, 1.0, **above))


_MOST_EFFECTS = 4


def before_after(found: Diagnosis, response: str) -> go.Figure:
    """A response as recorded, as simulated, and with what was found; the error below; held-out parts shaded."""
    comparison, fit = found.comparison, found.fit[response]
    axis = RunAxis(comparison)
    factor, unit = displayed(fit.unit, float(np.nanmax(np.abs(fit.before - np.nanmean(fit.before)), initial=0.0)))
    fine, fine_unit = displayed(fit.unit, fit.train.rmse_before)
    recorded = comparison.recorded[response]
    is_better = any(response in effect.courses for effect in found.effects)
    after, name = (fit.after, "with it") if is_better else (fit.recalibrated, "recalibrated")
    error = fit.heldout.rmse_after if is_better else fit.recalibrated_heldout
    courses = [("simulated", factor * fit.before, style.BEFORE), ("recorded", factor * recorded, style.MEASURED)]
    courses.append((name, factor * after, style.PREDICTED))
    errors = [
        ("before", fine * (recorded - fit.before), style.BEFORE),
        ("after", fine * (recorded - after), style.RESIDUAL),
    ]
    panels = [
        Panel(f"{style.label(response, 12)} [{unit}]", [line for one in courses for line in _lines(axis, *one)], 220),
        Panel(f"error [{fine_unit}]", [line for one in errors for line in _lines(axis, *one)], 130),
    ]
    shown = [effect for effect in found.effects if response in effect.courses][:_MOST_EFFECTS]
    if shown:
        colours = [style.GROUPS[(k + 2) % len(style.GROUPS)] for k in range(len(shown))]
        effects = [
            (style.label(name_of(one.id), 24), fine * one.courses[response], c)
            for one, c in zip(shown, colours, strict=True)
        ]
        lines = [line for one in effects for line in _lines(axis, *one)]
        panels.append(Panel(f"found [{fine_unit}]", lines, 110, least=0.0))
    if np.isfinite(error):
        change = f"{number_text(fine * fit.heldout.rmse_before)} to {number_text(fine * error)} {fine_unit}"
        fallen = "falls" if error < fit.heldout.rmse_before else "goes"
        title = f"The error of {style.label(response)} on what was held out {fallen} from {change}"
    else:
        title = f"{style.label(response)}: nothing of it was held out to check the fit on"
    drawn = stacked(title, panels, axis.end_s, spans_s=axis.held_out_s())
    _, seconds = style.time_unit(axis.end_s)
    for number in range(1, len(panels) + 1):
        last = drawn.layout[f"xaxis{'' if number == 1 else number}"].update(axis.ticks(seconds))
    last.title.text = last.title.text.replace("time", "time from the start of each run")
    axis.name_runs(drawn, seconds)
    return drawn


def _lines(axis: RunAxis, name: str, values: Vector, colour: str) -> list[Line]:
    """A line for each run in which there is anything; the last one carries the name."""
    parts = [(time, part) for time, part in axis.by_run(values) if np.isfinite(part).any()]
    last = len(parts) - 1
    return [Line(name if k == last else "", time, part, colour, width=1.4) for k, (time, part) in enumerate(parts)]


_CELLS = 600
_ROW_PX = 44
_MOST_STATES = 6
_MOST_WINDOWS = 60
_LIMIT = 2.5
_KEY = 90  #: Pixels of the scale that its three numbers need, beside however few rows.
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
    edges = _edges(axis)
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
        colorbar={"title": {"text": "× rms", "side": "top"}, "lenmode": "pixels", "len": max(_KEY, scale_part * height),
                  "y": 1.0, "yanchor": "top", "x": 1.01, "thickness": 12, "tickvals": [-2, 0, 2],
                  "ticktext": ["−2", "0", "+2"]},
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
    drawn.layout.yaxis = _rows(labels, split + (24 / height if states else 0.0), 1.0)
    if states:
        strip = np.array([_scaled(_binned(axis, course(comparison, name), edges, signed=False)) for name in states])
        drawn.add_heatmap(
            x=middles, y=list(range(len(states))), z=strip, zmin=0.0, zmax=1.0, showscale=False, yaxis="y2", ygap=2,
            colorscale=[list(stop) for stop in _STATE_SCALE], hoverinfo="skip",
        )  # fmt: skip
        drawn.layout.yaxis2 = _rows(style.labels(states, 16), 0.0, split)
    axis.name_runs(drawn, seconds)
    return drawn


def _rows(labels: Sequence[str], bottom: float, top: float) -> dict[str, object]:
    """An axis with a labelled row for each of several channels, the first one on top."""
    return {"domain": [bottom, top], "anchor": "x", **style.rows_of(labels)}


def _title(found: Diagnosis) -> str:
    windows = [place for place in found.where if place.run is not None]
    if not windows:
        return "No part of the difference stands out from noise" if not found.where else "The difference over all runs"
    channels = list(dict.fromkeys(place.channel for place in windows))
    return f"The mismatch sits in {style.listed(channels)}; windows that are named are framed"


def _states(comparison: Comparison, causes: list[str]) -> list[str]:
    """Channels that say what the machine was doing, the most telling first; the causes that were named are kept."""
    courses = {name: comparison.recorded[name] for name in comparison.with_role(*_STATES)}
    moving = [name for name, of in courses.items() if np.std(np.where(np.isfinite(of), of, 0.0)) > 0]
    names = sorted(moving, key=lambda name: _STATES.index(comparison.channel(name).role))
    shown = sorted(names, key=lambda name: name not in causes)[:_MOST_STATES]
    return [name for name in names if name in shown]


def _edges(axis: RunAxis) -> Vector:
    """Edges of the cells on the axis; none lies across two runs."""
    found = [0.0]
    for start, stop in pairwise([*axis.starts_s, axis.end_s * (1.0 + 1e-9)]):
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
