"""The error of every unseen run without and with the model, and of sets of sensors."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import plotly.graph_objects as go

from selector.figures import style
from selector.figures.style import Changes, changed
from selector.number_text import number_text
from selector.selection import Selection

KINDS = {"run": "runs", "condition": "conditions", "block": "stretches"}
_BARS = (("without compensation, rms", style.BEFORE, -0.38), ("with the model, rms", style.PREDICTED, 0.0))
_ROOM_PX, _RUN_PX, _LEAST_PX = 150, 34, 120


@dataclass(frozen=True)
class RunError:
    """Errors of one run [µm]; the largest one is None where it is not known."""

    name: str
    before_rmse_um: float
    rmse_um: float
    max_um: float | None = None


def errors_per_run(selection: Selection, response: str) -> go.Figure:
    """Error of every unseen run without compensation and with the model."""
    runs = [
        RunError(part.name, part.before_rmse_um, part.rmse_um, part.max_um)
        for part in selection.proof.per_response[response]
    ]
    title = run_errors_title(response, runs, KINDS[selection.proof.left_out])
    return changed(run_errors_picture(response, runs, title), run_error_changes(runs))


def run_errors_title(response: str, runs: Sequence[RunError], kind: str) -> str:
    """On which runs the model is worse than none; `kind` is what they are called, e.g. ``"runs"``."""
    worse = [one.name for one in runs if one.rmse_um >= one.before_rmse_um]
    if not worse:
        return f"{style.label(response)} is better with the model on all {len(runs)} {kind}"
    return (
        f"{style.label(response)} is worse with the model than without on {len(worse)} of {len(runs)} {kind}: "
        f"{style.listed(worse)}"
    )


def run_errors_picture(response: str, runs: Sequence[RunError], title: str) -> go.Figure:
    """The frame for the errors of these runs; `run_error_changes` fills it."""
    n = len(runs)
    drawn = style.figure(title, _ROOM_PX + max(_LEAST_PX, _RUN_PX * n))
    rows = list(range(n))
    for name, colour, offset in _BARS:
        drawn.add_bar(
            y=rows,
            orientation="h",
            offset=offset,
            width=0.38,
            name=name,
            marker={"color": colour},
            hovertemplate=f"{name}: %{{x:.4g}} µm<extra></extra>",
        )
    drawn.add_scatter(
        y=[row + 0.19 for row in rows],
        mode="markers",
        name="with the model, largest",
        marker={"symbol": "diamond-open", "size": 9, "color": style.RESIDUAL, "line": {"width": 2}},
        hovertemplate="with the model, largest: %{x:.4g} µm<extra></extra>",
        visible=any(one.max_um is not None for one in runs),
    )
    for row in rows:
        drawn.add_annotation(text="", x=1.01, y=row, xref="paper", xanchor="left", showarrow=False)
    drawn.add_annotation(
        text="rms [µm]", x=1.01, y=1.0, xref="paper", yref="paper", xanchor="left", yanchor="bottom", showarrow=False
    )
    drawn.update_layout(margin={"r": 120})
    drawn.update_xaxes(title_text=f"error of {style.label(response)} [µm]", rangemode="tozero")
    drawn.update_yaxes(**style.rows_of([style.label(one.name) for one in runs]))
    return drawn


def run_error_changes(runs: Sequence[RunError]) -> Changes:
    """The errors of the same runs in the frame of `run_errors_picture`."""
    return {
        ("data", 0, "x"): [one.before_rmse_um for one in runs],
        ("data", 1, "x"): [one.rmse_um for one in runs],
        ("data", 2, "x"): [one.max_um for one in runs],
        **{
            ("layout", "annotations", row, "text"): (
                f"{number_text(one.before_rmse_um)} → <b>{number_text(one.rmse_um)}</b>"
            )
            for row, one in enumerate(runs)
        },
    }


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
    """The sets in the frame of `set_errors_picture`: the best of each size among all sensors, and among those of a cut.

    The set that is `taken` gets a ring; `before_um` is the error without any sensor.
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
    known = [value for value in values if value > 0] or [1.0]
    for key, value in style.log_axis(0.85 * min(known), 1.15 * max(known)).items():
        changes["layout", "yaxis", key] = value
    return changes
