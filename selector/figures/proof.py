"""What unseen runs say: the error of every run without and with the model, of sets of sensors, and the courses."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import plotly.graph_objects as go

from selector.figures import style
from selector.figures.panels import Traced, beside_each_other, common_ranges, telling_samples
from selector.figures.style import Changes, changed
from selector.number_text import number_text
from selector.selection import Selection
from selector.selection.exploration import HeldOutPart
from selector.selection.result import BEST_OF_SIZE, FIXED_SET, PROCEDURE, RunProof, Trace
from selector.types import Array

KINDS = {"run": "runs", "condition": "conditions", "block": "stretches"}
_BARS = (("without compensation, rms", style.BEFORE, -0.38), ("with the model, rms", style.PREDICTED, 0.0))
_ROOM_PX, _RUN_PX, _LEAST_PX = 150, 34, 120
MOST_ROWS = 30  #: Runs in one picture.

#: Errors of every run [µm]; of a set that was fixed before, the largest ones are not known.
RunErrors = Sequence[RunProof | HeldOutPart]


def telling_runs(errors: Mapping[str, float], most: int) -> tuple[list[str], str]:
    """The runs with these errors; of more than `most` the worst half and some of all sorts, and what is said of it."""
    if len(errors) <= most:
        return [*errors], ""
    ranked = sorted(errors, key=lambda run: -errors[run])
    worst, others = ranked[: most // 2], ranked[most // 2 :]
    spaced = np.linspace(0, len(others) - 1, most - len(worst)).round().astype(int).tolist()
    wanted = {*worst, *(others[i] for i in spaced)}
    which = f"the worst {len(worst)}, and {len(spaced)} spread evenly over the others from bad to good"
    return [run for run in errors if run in wanted], f"{len(wanted)} of {len(errors)} are drawn: {which}"


def _drawn(runs: RunErrors) -> tuple[list[RunProof | HeldOutPart], str]:
    wanted, few = telling_runs({one.name: one.rmse_um for one in runs}, MOST_ROWS)
    return [one for one in runs if one.name in wanted], few and f"; {few}"


def errors_per_run(selection: Selection, response: str) -> go.Figure:
    """Error of the unseen runs without compensation and with the model; of many those of `telling_runs`."""
    runs = selection.proof.per_response[response]
    title = run_errors_title(response, runs, KINDS[selection.proof.left_out])
    return changed(run_errors_picture(runs, title), run_error_changes(response, runs))


def run_errors_title(response: str, runs: RunErrors, kind: str) -> str:
    """On which runs the model is worse than none; `kind` is what they are called, e.g. ``"runs"``."""
    worse = [one.name for one in runs if one.rmse_um >= one.before_rmse_um]
    said = f"better with the model on all {len(runs)} {kind}"
    if worse:
        said = f"worse with the model than without on {len(worse)} of {len(runs)} {kind}: {style.listed(worse)}"
    return f"{style.label(response)} is {said}{_drawn(runs)[1]}"


def run_errors_picture(runs: RunErrors, title: str) -> go.Figure:
    """The frame for the errors of these runs; `run_error_changes` fills it."""
    rows = [*range(min(len(runs), MOST_ROWS))]
    drawn = style.figure(title, _ROOM_PX + max(_LEAST_PX, _RUN_PX * len(rows)))
    for name, colour, offset in _BARS:
        style.bars(drawn, None, rows, colour, name, f"{name}: %{{x:.4g}} µm", offset=offset, width=0.38)
    largest = "with the model, largest"
    look = {"symbol": "diamond-open", "line": {"width": 2}}
    is_known = any(isinstance(one, RunProof) for one in runs)
    middles = [row + 0.19 for row in rows]
    style.points(
        drawn, None, middles, style.RESIDUAL, largest, f"{largest}: %{{x:.4g}} µm", marker=look, visible=is_known
    )
    beside = {"xref": "paper", "xanchor": "left"}
    for row in rows:
        drawn.add_annotation(style.words("", 1.01, row, **beside))
    drawn.add_annotation(style.words("rms [µm]", 1.01, 1.0, **beside, yref="paper", yanchor="bottom"))
    drawn.update_layout(margin={"r": 120})
    drawn.update_xaxes(rangemode="tozero")
    drawn.update_yaxes(**style.rows_of([""] * len(rows)))
    return drawn


def run_error_changes(response: str, runs: RunErrors) -> Changes:
    """The errors of a response in as many runs, in the frame of `run_errors_picture`."""
    runs, _ = _drawn(runs)
    changes: dict[tuple[str | int, ...], object] = {
        ("layout", "yaxis", "ticktext"): [style.label(one.name) for one in runs],
        ("layout", "xaxis", "title", "text"): f"error of {style.label(response)} [µm]",
        ("data", 0, "x"): [one.before_rmse_um for one in runs],
        ("data", 1, "x"): [one.rmse_um for one in runs],
        ("data", 2, "x"): [one.max_um if isinstance(one, RunProof) else None for one in runs],
    }
    for row, one in enumerate(runs):
        both = f"{number_text(one.before_rmse_um)} → <b>{number_text(one.rmse_um)}</b>"
        changes["layout", "annotations", row, "text"] = both
    return changes


_FAMILIES = (
    ("best of all sensors", style.CHOSEN, "square"),
    ("best of the representatives", style.PREDICTED, "circle"),
)
_UNSEEN_INSIDE = "rgba(0,0,0,0)"


def _ring(colour: str) -> dict[str, Any]:
    return {"line": {"color": colour, "width": 3}}


@dataclass(frozen=True)
class SetError:
    """A set of sensors and its error [µm]."""

    sensors: tuple[str, ...]
    error_um: float


def set_errors_picture(height: int) -> go.Figure:
    """The frame for sets against their error; `set_error_changes` fills it. It has no title.

    A point of a line carries its sensors as ``customdata``, so that a click can take them.
    """
    drawn = style.figure("", height)
    drawn.update_layout(margin={"t": style.TITLE_MARGIN, "b": 60})
    style.curve(drawn, [], [], style.BASELINES["none"], "without compensation", width=2, dash="dash")
    for name, colour, symbol in _FAMILIES:
        look = {"mode": "lines+markers", "marker": {"symbol": symbol}}
        style.points(drawn, [], [], colour, name, "%{text}<br>%{y:.4g} µm", size=11, **look)
    style.points(drawn, [], [], _UNSEEN_INSIDE, "shown here", size=22, marker=_ring(style.RESIDUAL))
    style.curve(drawn, [], [], style.RESIDUAL, "target", width=2, dash="dot")
    drawn.update_xaxes(title_text="number of sensors [–]", dtick=1, showgrid=False)
    return drawn


def set_error_changes(
    response: str,
    everywhere: Sequence[SetError],
    cut: Sequence[SetError],
    taken: SetError,
    before_um: float,
    target_um: float | None = None,
) -> Changes:
    """The sets in the frame of `set_errors_picture`: the best of each size among all sensors, and among those of a cut.

    The set that is `taken` gets a ring; `before_um` is the error without any sensor, `target_um` the one that is to be
    reached, if any.
    """
    last = max(len(one.sensors) for one in (*everywhere, *cut, taken)) + 0.5
    wanted = [] if target_um is None else [target_um]
    values = [one.error_um for one in (*everywhere, *cut, taken)] + [before_um, *wanted]
    changes: dict[tuple[str | int, ...], object] = {
        ("data", 0, "x"): [0.5, last],
        ("data", 0, "y"): [before_um, before_um],
        ("data", 3, "x"): [len(taken.sensors)],
        ("data", 3, "y"): [taken.error_um],
        ("data", 4, "x"): [0.5, last],
        ("data", 4, "y"): 2 * wanted,
        ("data", 4, "showlegend"): bool(wanted),
        ("layout", "yaxis", "title", "text"): f"error of {style.label(response)}, rms [µm]",
        ("layout", "xaxis", "range"): [0.5, last],
    }
    for k, sets in enumerate((everywhere, cut), start=1):
        changes["data", k, "x"] = [len(one.sensors) for one in sets]
        changes["data", k, "y"] = [one.error_um for one in sets]
        changes["data", k, "text"] = [style.listed(one.sensors) for one in sets]
        changes["data", k, "customdata"] = [list(one.sensors) for one in sets]
    known = [value for value in values if value > 0] or [1.0]
    for key, value in style.log_axis(0.85 * min(known), 1.15 * max(known)).items():
        changes["layout", "yaxis", key] = value
    return changes


POINTS_PER_RUN = 400
_WAYS = {"none": "no compensation", "mean": "a constant", "all sensors": "linear regression on all sensors"}
_DASHES = {"none": "dash", "mean": "dot", "all sensors": "dot"}
_OTHER_DASHES = ("dashdot", "longdash", "longdashdot")
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
        f"{style.label(response)} with {size} sensor{'s' * (size != 1)} on unseen {KINDS[proof.left_out]}: {PROCEDURE} "
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
        colour, named = style.BASELINES.get(way, style.OTHER_BASELINE), f"{text}: {number_text(value)} µm"
        style.curve(drawn, [0.5, last], [value, value], colour, named, "%{fullData.name}", width=2, dash=dashes[way])
    x, y, names = zip(*single, strict=True) if single else ((), (), ())
    apart = f"single {KINDS[proof.left_out]}"
    told = {"text": style.labels(names), "marker": {"opacity": 0.6}}
    style.points(drawn, x, y, style.MUTED, apart, "%{text}: %{y:.3g} µm", size=5, **told)
    best = f"{BEST_OF_SIZE}, ± standard error"
    bars = {"mode": "lines+markers", "error_y": {"type": "data", "array": spread, "thickness": 1.5, "width": 5}}
    style.points(drawn, sizes, error, style.PREDICTED, best, "%{x} sensors: %{y:.3g} µm", size=8, **bars)
    fixed = selection.fixed_set_errors_um(response)
    look = {"symbol": "line-ew-open", "line": {"width": 2.5}}
    hover = "%{x} sensors, " + FIXED_SET + ": %{y:.3g} µm"
    fixed_best = f"{FIXED_SET}, best of that size"
    style.points(drawn, [*fixed], [*fixed.values()], style.CHOSEN, fixed_best, hover, size=11, marker=look)
    ring, named = _ring(style.CHOSEN), f"{PROCEDURE}: {number_text(achieved)} µm"
    style.points(drawn, [size], [achieved], _UNSEEN_INSIDE, named, f"{PROCEDURE}: %{{y:.3g}} µm", size=20, marker=ring)
    values = [
        value for value in (*error, achieved, *ways.values(), *fixed.values(), *(y for _, y, _ in single)) if value > 0
    ]
    drawn.update_xaxes(title_text="sensors [–]", range=[0.5, last], dtick=1, showgrid=False)
    low, high = min(values, default=0.0), max(values, default=1.0)
    is_near = low <= 0 or high / low < _ONE_FROM
    axis = {"rangemode": "tozero"} if is_near else style.log_axis(0.8 * low, 1.25 * high)
    drawn.update_yaxes(title_text=f"error of {style.label(response, 14)}<br>rms [µm]", **axis)
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
    most = number_text(selection.proof.max_um(response))
    others = f"the other {KINDS[selection.proof.left_out]}"
    title = f"{style.label(response)} measured and predicted from {others}: largest residual {most} µm"
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


def _drawn_samples(traces: Sequence[Trace], j: int) -> tuple[Array, Array, Array]:
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
