"""The error of every unseen run, without compensation and with the model."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import plotly.graph_objects as go

from selector.figures import style
from selector.figures.changes import Changes, changed
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
    """The frame for the errors of these runs; `run_error_changes` fills it.

    Parameters
    ----------
    response : str
    runs : sequence of RunError
        Their names, and whether a largest error is known, are taken.
    title : str
        Plain text, as `style.label` makes it.
    """
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
    drawn.update_yaxes(
        range=[n - 0.5, -0.5],
        tickvals=rows,
        ticktext=[style.label(one.name) for one in runs],
        showgrid=False,
        ticks="",
    )
    return drawn


def run_error_changes(runs: Sequence[RunError]) -> Changes:
    """The errors of the same runs in the frame of `run_errors_picture`."""
    return {
        ("data", 0, "x"): [one.before_rmse_um for one in runs],
        ("data", 1, "x"): [one.rmse_um for one in runs],
        ("data", 2, "x"): [one.max_um for one in runs],
        **{
            ("layout", "annotations", row, "text"): (
                f"{style.number(one.before_rmse_um)} → <b>{style.number(one.rmse_um)}</b>"
            )
            for row, one in enumerate(runs)
        },
    }
