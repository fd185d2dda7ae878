"""Pictures of the proof: what unseen runs say about the model."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import plotly.graph_objects as go
from numpy.typing import NDArray

from selector.figures import style
from selector.figures.traces import Traced, beside_each_other, common_ranges, telling_samples
from selector.number_text import number_text
from selector.selection import Selection
from selector.selection.result import BEST_OF_SIZE, FIXED_SET, PROCEDURE, Trace

POINTS_PER_RUN = 400
_WAYS = {
    "none": "no compensation",
    "mean": "a constant",
    "all sensors": "linear regression on all sensors",
}
_DASHES = {"none": "dash", "mean": "dot", "all sensors": "dot"}
_OTHER_DASHES = ("dashdot", "longdash", "longdashdot")
_UNSEEN = {"run": "unseen runs", "condition": "unseen conditions", "block": "unseen stretches"}
_ONE_FROM = 8.0


def error_against_sensors(selection: Selection, response: str) -> go.Figure:
    """Held-out error against the number of sensors, with its standard error, single runs, and other ways as lines."""
    proof = selection.proof
    j = list(selection.models).index(response)
    sizes = [point.n_sensors for point in proof.curve]
    error = [point.rmse_um[j] for point in proof.curve]
    spread = np.nan_to_num([point.standard_error_um[j] for point in proof.curve], posinf=0.0, neginf=0.0).tolist()
    ways = proof.baselines_um[response]
    size, achieved = len(selection.chosen), proof.rmse_um(response)
    than = "against" if achieved < ways["none"] else "no better than the"
    of_size = [f", {BEST_OF_SIZE} {number_text(error[sizes.index(size)])} µm"] if size in sizes else []
    title = (
        f"{style.label(response)} with {size} sensor{'s' * (size != 1)} on {_UNSEEN[proof.left_out]}: {PROCEDURE} "
        f"(ring) {number_text(achieved)} µm{''.join(of_size)}, {than} {number_text(ways['none'])} µm without "
        "compensation"
    )
    drawn = style.figure(title, 480)
    parts = proof.per_response[response]
    single = [
        (point.n_sensors, value, parts[k].name if len(parts) == len(point.per_group_um) else str(k + 1))
        for point in proof.curve
        for k, value in enumerate(row[j] for row in point.per_group_um)
    ]
    last = max([*sizes, size]) + 0.5
    others = [way for way in ways if way not in _WAYS]
    dashes = _DASHES | {way: _OTHER_DASHES[i % len(_OTHER_DASHES)] for i, way in enumerate(others)}
    for way, value in ways.items():
        text = _WAYS.get(way) or f"the same procedure, {way.removeprefix('chosen, ')}"
        drawn.add_scatter(
            x=[0.5, last],
            y=[value, value],
            mode="lines",
            line={"color": style.BASELINES.get(way, style.OTHER_BASELINE), "width": 2, "dash": dashes[way]},
            name=f"{text}: {number_text(value)} µm",
            hoverinfo="name",
        )
    drawn.add_scatter(
        x=[x for x, _, _ in single],
        y=[y for _, y, _ in single],
        mode="markers",
        name=f"single {_UNSEEN[proof.left_out].split()[1]}",
        marker={"color": style.MUTED, "size": 5, "opacity": 0.6},
        text=[style.label(name) for _, _, name in single],
        hovertemplate="%{text}: %{y:.3g} µm<extra></extra>",
    )
    drawn.add_scatter(
        x=sizes,
        y=error,
        error_y={"type": "data", "array": spread, "thickness": 1.5, "width": 5},
        mode="lines+markers",
        name=f"{BEST_OF_SIZE}, ± standard error",
        line={"color": style.PREDICTED, "width": 2},
        marker={"size": 8},
        hovertemplate="%{x} sensors: %{y:.3g} µm<extra></extra>",
    )
    fixed = selection.fixed_set_errors_um(response)
    drawn.add_scatter(
        x=list(fixed),
        y=list(fixed.values()),
        mode="markers",
        name=f"{FIXED_SET}, best of that size",
        marker={"color": style.CHOSEN, "size": 11, "symbol": "line-ew-open", "line": {"width": 2.5}},
        hovertemplate="%{x} sensors, " + FIXED_SET + ": %{y:.3g} µm<extra></extra>",
    )
    drawn.add_scatter(
        x=[size],
        y=[achieved],
        mode="markers",
        name=f"{PROCEDURE}: {number_text(achieved)} µm",
        marker={"color": "rgba(0,0,0,0)", "size": 20, "line": {"color": style.CHOSEN, "width": 3}, "symbol": "circle"},
        hovertemplate=f"{PROCEDURE}: %{{y:.3g}} µm<extra></extra>",
    )
    values = [
        value for value in (*error, achieved, *ways.values(), *fixed.values(), *(y for _, y, _ in single)) if value > 0
    ]
    drawn.update_xaxes(title_text="sensors [–]", range=[0.5, last], dtick=1, showgrid=False)
    drawn.update_yaxes(title_text=f"error of {style.label(response, 14)}<br>rms [µm]", **_value_axis(values))
    drawn.update_layout(margin={"b": 110}, legend={"yref": "container", "y": 0.0, "yanchor": "bottom"})
    return drawn


def measured_and_predicted(selection: Selection, response: str, runs: Sequence[str] | None = None) -> go.Figure:
    """Measured and predicted displacement of left-out runs (default: all), the residual below; thinned for drawing."""
    j = list(selection.models).index(response)
    traces: dict[str, list[Trace]] = {}
    for trace in selection.proof.traces:
        traces.setdefault(trace.run, []).append(trace)
    wanted = [run for run in (traces if runs is None else runs) if run in traces]
    proofs = {part.name: part for part in selection.proof.per_response[response]}
    source = {
        "run": "predicted from the other runs",
        "condition": "predicted from other conditions",
        "block": "predicted from the rest of the run",
    }[selection.proof.left_out]
    most = number_text(selection.proof.max_um(response))
    title = f"{style.label(response)} measured and {source}: largest residual {most} µm"
    shown = []
    for run in wanted:
        time_s, measured, predicted = _drawn_samples(traces[run], j)
        part = proofs.get(run)
        more = f"rms {number_text(part.rmse_um)} µm, largest {number_text(part.max_um)} µm" if part else ""
        shown.append(Traced(run, more, time_s, measured, predicted))
    ranges = common_ranges(
        [trace.measured_um[:, j] for trace in selection.proof.traces],
        [trace.predicted_um[:, j] for trace in selection.proof.traces],
    )
    return beside_each_other(title, shown, response, *ranges)


def _drawn_samples(
    traces: Sequence[Trace], j: int
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Time, measured, predicted of the parts of a run in order of time, a gap between parts."""
    times, measured, predicted = [], [], []
    for trace in sorted(traces, key=lambda trace: float(trace.time_s[0])):
        keep = telling_samples(
            trace.measured_um[:, j] - trace.predicted_um[:, j], max(20, POINTS_PER_RUN // len(traces))
        )
        times += [trace.time_s[keep], trace.time_s[keep[-1:]]]
        measured += [trace.measured_um[keep, j], [np.nan]]
        predicted += [trace.predicted_um[keep, j], [np.nan]]
    return np.concatenate(times)[:-1], np.concatenate(measured)[:-1], np.concatenate(predicted)[:-1]


def _value_axis(values: Sequence[float]) -> dict[str, object]:
    """A linear axis from zero, or a logarithmic one where values part by more than a factor of eight."""
    low, high = min(values, default=0.0), max(values, default=1.0)
    if low <= 0 or high / low < _ONE_FROM:
        return {"rangemode": "tozero"}
    return style.log_axis(0.8 * low, 1.25 * high)
