"""Courses in panels: one above the other with names at their ends; measured beside predicted, run by run."""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Any

import numpy as np
import plotly.graph_objects as go

from selector.adaptation.judged import JudgedRun
from selector.figures import style
from selector.number_text import number_text
from selector.types import Array, Indices, Vector

POINTS = 900  #: Points of a line, about one a pixel.

_GAP_PX = 16
_LABEL_PX = 17
_BOTTOM_PX = 44
_MARGIN_RIGHT_PX = 150
#: Letters of a name at the end of a line, the width of one, and what stands beside it.
_LONGEST_NAME, _LETTER_PX, _BESIDE_PX = 24, 7.3, 14
_ROOM = 0.08
_FEWEST_TICKS = 5  #: At most so many: with steps of 1, 2 or 5 an axis then has two at least.

_NARROW = 0.01
#: Share of the time axis below which a stretch is a few pixels wide and needs a stronger shade to be seen.
_SPAN_OPACITY, _NARROW_OPACITY = 0.15, 0.6


@dataclass(frozen=True)
class Line:
    """A course: its name (empty: none is shown), times [s], values, colour; steps are held from each time on."""

    name: str
    time_s: Vector
    values: Vector
    colour: str
    steps: bool = False
    dash: str = "solid"
    width: float = 1.8


@dataclass(frozen=True)
class Panel:
    """A panel: the title of its axis with the unit, its lines, its height [px], and a band of values that is shaded.

    `spans_s`: stretches of time [s] that are shaded in this panel alone, and what stands at them.
    """

    axis: str
    lines: Sequence[Line]
    height_px: int = 160
    band: tuple[float, float] | None = None
    least: float | None = None  #: A value that the axis shows in any case.
    spans_s: Mapping[tuple[float, float], str] = field(default_factory=dict)


def stacked(
    title: str,
    panels: Sequence[Panel],
    end_s: float,
    marks_s: Sequence[float] = (),
    spans_s: Sequence[tuple[float, float]] = (),
) -> go.Figure:
    """Panels one above the other; hovering and zooming go through all of them.

    Dotted lines go through all panels at `marks_s`, and the stretches of time `spans_s` are shaded.
    """
    heights = [max(panel.height_px, _LABEL_PX * sum(bool(line.name) for line in panel.lines)) for panel in panels]
    drawn = style.rows(title, heights, _GAP_PX, _BOTTOM_PX)
    letters = max((min(len(line.name), _LONGEST_NAME) for panel in panels for line in panel.lines), default=0)
    right = max(_MARGIN_RIGHT_PX, _BESIDE_PX + _LETTER_PX * letters)
    shapes, annotations = list[dict[str, Any]](), list[dict[str, Any]]()
    unit, seconds = style.time_unit(end_s)
    drawn.update_xaxes(range=[0.0, end_s / seconds], ticks="")
    drawn.update_xaxes(ticks="outside", title_text=f"time [{unit}]", row=len(panels))
    for number, (panel, height) in enumerate(zip(panels, heights, strict=True), start=1):
        key = "" if number == 1 else str(number)
        ticks = {"nticks": max(_FEWEST_TICKS, height // 32), "exponentformat": "none"}
        drawn.update_yaxes(title_text=panel.axis, range=_range(panel), **ticks, row=number)
        if panel.band is not None:
            shapes.append(style.zone(*panel.band, style.CHOSEN, 0.12, across=True, panel=key))
        for (start, stop), text in [*((span, "") for span in spans_s), *panel.spans_s.items()]:
            opacity = _SPAN_OPACITY if stop - start > _NARROW * end_s else _NARROW_OPACITY
            shapes.append(style.zone(start / seconds, stop / seconds, style.RESIDUAL, opacity, panel=key))
            if text:
                place = {"xref": f"x{key}", "xanchor": "left", "yref": f"y{key} domain", "yanchor": "top"}
                annotations.append(style.words(style.label(text), start / seconds, 1.0, style.RESIDUAL, 11, **place))
        for mark in marks_s:
            shapes.append(style.rule(mark / seconds, panel=key, layer="below"))
        for line in panel.lines:
            at = shown_samples(line.time_s, line.values, line.steps)
            hover = f"%{{x:.4g}} {unit}: %{{y:.5g}}<extra>{style.label(line.name)}</extra>"
            style.curve(
                drawn, line.time_s[at] / seconds, line.values[at], line.colour, style.label(line.name), hover,
                width=line.width, dash=line.dash, line={"shape": "hv" if line.steps else "linear"}, xaxis=f"x{key}",
                yaxis=f"y{key}",
            )  # fmt: skip
        annotations += _line_names(panel, key, height)
    # at once: of every further one Plotly copies all that are there
    drawn.update_layout(margin={"r": right}, showlegend=False, shapes=shapes, annotations=annotations)
    return drawn


def shown_samples(time_s: Vector, values: Vector, steps: bool = False, points: int = POINTS) -> Indices:
    """Positions of the samples that draw a course: of each stretch the ends, the lowest and the highest; all steps."""
    n = len(values)
    if n <= points:
        return np.arange(n)
    if steps:
        changes = np.flatnonzero(np.diff(values) != 0) + 1
        if len(changes) <= points:
            return np.unique([0, *changes.tolist(), n - 1])
    edges = np.searchsorted(time_s, np.linspace(time_s[0], time_s[-1], points // 3 + 1)).tolist()
    kept, known = {0, n - 1, *edges[:-1]}, ~np.isnan(values)
    low, high = np.where(known, values, np.inf), np.where(known, values, -np.inf)
    for a, b in pairwise(edges):
        if known[a:b].any():
            kept |= {a + int(low[a:b].argmin()), a + int(high[a:b].argmax())}
    return np.array(sorted(kept))


def _range(panel: Panel) -> list[float]:
    ends = [float(extreme(line.values)) for line in panel.lines for extreme in (np.nanmin, np.nanmax)]
    ends += panel.band or ()
    if panel.least is not None:
        ends.append(panel.least)
    low, high = min(ends), max(ends)
    room = _ROOM * max(high - low, 1e-3 * max(abs(low), abs(high)), 1e-9)
    return [low - room, high + room]


def _line_names(panel: Panel, key: str, height_px: int) -> Iterator[dict[str, Any]]:
    """Names to the right of the panel in the order of the lines' ends, each beside its end where there is room."""
    low, high = _range(panel)
    named = [line for line in panel.lines if line.name]
    names = style.labels([line.name for line in named], _LONGEST_NAME)
    ends = [float(line.values[np.isfinite(line.values)][-1]) for line in named]
    order = sorted(range(len(named)), key=lambda k: ends[k])
    wanted = [height_px * (ends[k] - low) / (high - low) for k in order]
    for k, at in zip(order, style.spaced(wanted, _LABEL_PX, height_px), strict=True):
        place = {**style.BESIDE, "y": at / height_px, "yref": f"y{key} domain"}
        yield style.words(names[k], colour=named[k].colour, **place)


_ROW_PX = 290
_HEAD_PX = 42  #: For the two lines above a panel, on paper too, where a row is lower.


@dataclass(frozen=True)
class Traced:
    """One run of a picture: its name, a remark below it, times [s] and displacements [µm], NaN where there is none."""

    run: str
    remark: str
    time_s: Vector
    measured_um: Vector
    predicted_um: Vector


def beside_each_other(
    title: str, runs: Sequence[Traced], response: str, value_range: Sequence[float], residual_range: Sequence[float]
) -> go.Figure:
    """All runs in two columns, the same scales everywhere; samples are drawn as they come, see `telling_samples`."""
    columns = 1 if len(runs) == 1 else 2
    rows = max(1, math.ceil(len(runs) / columns))
    drawn = style.figure(title, 90 + _ROW_PX * rows)
    drawn.update_layout(margin={"b": 10})
    unit, seconds = style.time_unit(max((float(one.time_s[-1]) for one in runs), default=1.0))
    for k, one in enumerate(runs):
        row, column = divmod(k, columns)
        x, upper, lower = f"x{k + 1}", f"y{2 * k + 1}", f"y{2 * k + 2}"
        for values, name, colour, yaxis in (
            (one.measured_um, "measured", style.MEASURED, upper),
            (one.predicted_um, "predicted", style.PREDICTED, upper),
            (one.measured_um - one.predicted_um, "residual", style.RESIDUAL, lower),
        ):
            hover, place = f"%{{x:.3g}} {unit}, {name} %{{y:.4g}} µm", {"xaxis": x, "yaxis": yaxis}
            legend = {"legendgroup": name, "showlegend": k == 0}
            style.curve(drawn, one.time_s / seconds, values, colour, name, hover, width=1.6, **place, **legend)
        top, bottom = 1 - row / rows, 1 - (row + 1) / rows
        gap = min(0.30, 56 / _ROW_PX) / rows
        middle = bottom + gap + (top - bottom - gap) * 0.34
        left = column / columns + (0.035 if column else 0.0)
        right = (column + 1) / columns - (0.035 if columns == 2 and not column else 0.0)
        is_first = column == 0
        layout = drawn.layout
        layout[f"xaxis{k + 1 if k else ''}"] = {
            "domain": [left, right],
            "anchor": lower,
            "title": {"text": f"time [{unit}]", "standoff": 2},
        }
        layout[f"yaxis{2 * k + 1 if k else ''}"] = {
            "domain": [middle + 0.012 / rows * 2, top - _HEAD_PX / _ROW_PX / rows],
            "anchor": x,
            "title": {"text": f"{style.label(response, 14)}<br>[µm]" if is_first else ""},
            "range": list(value_range),
        }
        layout[f"yaxis{2 * k + 2}"] = {
            "domain": [bottom + gap, middle],
            "anchor": x,
            "title": {"text": "residual<br>[µm]" if is_first else ""},
            "range": list(residual_range),
            "zeroline": True,
            "zerolinecolor": style.MUTED,
            "nticks": 4,
        }
        told = "<br>".join(filter(None, [f"<b>{style.label(one.run)}</b>", one.remark]))
        at = {"xref": "paper", "yref": "paper", "xanchor": "left", "yanchor": "bottom", "align": "left"}
        drawn.add_annotation(style.words(told, left, top - (_HEAD_PX - 2) / _ROW_PX / rows, **at))
    return drawn


def common_ranges(measured_um: Sequence[Vector], predicted_um: Sequence[Vector]) -> tuple[list[float], list[float]]:
    """Ranges of displacement and residual that all runs fit in, so that pictures can be compared."""
    values = [*measured_um, *predicted_um]
    low, high = min(float(np.nanmin(v)) for v in values), max(float(np.nanmax(v)) for v in values)
    errors = [m - p for m, p in zip(measured_um, predicted_um, strict=True)]
    least = min(0.0, *(float(np.nanmin(e)) for e in errors))
    most = max(0.0, *(float(np.nanmax(e)) for e in errors))
    rooms = 0.06 * max(high - low, 1e-9), 0.12 * max(most - least, 1e-9)
    return [low - rooms[0], high + rooms[0]], [least - rooms[1], most + rooms[1]]


def telling_samples(residual: Vector, points: int) -> Indices:
    """Of each of `points` / 2 stretches the first sample and the one with the largest residual: no peak is lost."""
    n = len(residual)
    if n <= points:
        return np.arange(n)
    edges = np.linspace(0, n, points // 2 + 1).astype(np.int64)
    size = np.nan_to_num(np.abs(residual))
    peaks = [a + int(np.argmax(size[a:b])) for a, b in pairwise(edges.tolist())]
    return np.unique([*edges[:-1].tolist(), *peaks, n - 1])


def replayed_run(
    run: str, output: str, time_s: np.ndarray, correction_um: np.ndarray, recorded_um: np.ndarray
) -> go.Figure:
    """Recorded displacement of one run and what is left of it with the correction of the program.

    Recorded displacement is NaN where there is none: then the correction alone is drawn.
    """
    title = f"{style.label(output)} in run {style.label(run)}: as recorded, and with this program"
    lines = [Line("correction", time_s, correction_um, style.PREDICTED)]
    if np.isfinite(recorded_um).any():
        left = Line("with the correction", time_s, recorded_um + correction_um, style.RESIDUAL)
        lines = [Line("recorded", time_s, recorded_um, style.MEASURED), left, *lines]
    return stacked(title, [Panel("[µm]", lines, 300)], float(time_s[-1]))


def adapted_run(run: JudgedRun, response: str, without_rmse_um: float, rmse_um: float) -> go.Figure:
    """The error with and without touch-offs, and the 90 % interval that was expected; dotted: touch-offs."""
    time_s = run.time_s - run.course.time_s[0]

    def line(name: str, values: Array, colour: str, dash: str = "solid") -> Line:
        shown = shown_samples(time_s, values)
        return Line(name, time_s[shown], values[shown], colour, dash=dash)

    lines = [
        line("model alone", run.recorded_um - run.modelled_um, style.BEFORE),
        line("with touch-offs", run.error_um, style.RESIDUAL),
    ]
    if run.kind != "none":
        ends = (("90 % interval", run.half_width_um), ("", -run.half_width_um))
        lines += [line(name, end, style.MUTED, "dot") for name, end in ends]
    touched = run.course.time_s[run.course.touched_at] - run.course.time_s[0]
    return stacked(
        f"{style.label(run.course.run)}: {number_text(rmse_um)} µm of {style.label(response)} are left with "
        f"{len(touched)} touch-offs, {number_text(without_rmse_um)} µm without",
        [Panel("error [µm]", lines, height_px=230, least=0.0)],
        float(time_s[-1]) if len(time_s) else 1.0,
        marks_s=touched.tolist(),
    )
