"""Courses measured and predicted side by side, run by run, and what an exported program does over a run."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import plotly.graph_objects as go

from selector.adaptation.judged import JudgedRun
from selector.figures import style
from selector.figures.panels import Line, Panel, shown_samples, stacked
from selector.number_text import number_text
from selector.types import Array, Indices, Vector

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
