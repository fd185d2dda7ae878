"""Where a model was learnt: pairs of its inputs, the hull of the training samples, and samples outside it."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations

import numpy as np
import plotly.graph_objects as go
from numpy.typing import NDArray
from scipy.spatial import ConvexHull, QhullError

from selector.figures import style
from selector.models.hull import ValidityHull

POINTS = 1500
MOST_PAIRS = 6
INSIDE, FAR = 0.1, 1.0
"""Distances in standard deviations of the inputs: up to the first a sample is inside, but for noise; beyond the second
one it is far outside. With many inputs hardly a sample is inside: no two days are alike in all of them."""

_COLUMNS = 3
_PANEL_PX = 290


def validity_pairs(
    hull: ValidityHull,
    axes: Sequence[tuple[str, str]],
    samples: NDArray[np.float64],
    beyond: NDArray[np.float64] | None = None,
    known: str = "what the model has learnt from",
) -> go.Figure:
    """Pairs of inputs with the outline of the hull; samples that lie outside what is known stand out.

    A sample may lie outside the hull of all inputs and inside that of every pair; it is marked in each picture. At
    most `POINTS` samples are judged and drawn, evenly spaced, and at most `MOST_PAIRS` pairs, those of the first
    inputs.

    Parameters
    ----------
    hull : ValidityHull
        Of the training samples, as a `Selection` has it.
    axes : sequence of (str, str)
        Its variables and their units, two at least.
    samples : ndarray of shape (n_samples, n_inputs)
        In the unit of the inputs, e.g. another run.
    beyond : ndarray of shape (n_samples,), optional
        Distance of each sample to what is known, in standard deviations; default: to the hull.
    known : str
        What that is, for the title.
    """
    keep = np.unique(np.linspace(0, len(samples) - 1, min(POINTS, len(samples))).astype(np.int64))
    shown = samples[keep]
    distance = beyond[keep] if beyond is not None else hull.distance(shown) if len(shown) else np.zeros(0)
    far = distance > FAR
    pairs = sorted(combinations(range(len(axes)), 2), key=lambda pair: pair[1])[:MOST_PAIRS]
    title = f"{style.share(far).capitalize()} of the samples lie" if far.any() else "No sample lies"
    title += f" more than one standard deviation outside {known}"
    classes = (
        (distance <= INSIDE, "inside", style.MUTED),
        ((distance > INSIDE) & ~far, "outside by up to 1 standard deviation", style.HARM_SCALE[1][1]),
        (far, "farther outside", style.HARM_SCALE[-1][1]),
    )
    rows = max(-(-len(pairs) // _COLUMNS), 1)
    drawn = style.figure(title, 60 + _PANEL_PX * rows)
    drawn.update_layout(margin={"b": 10})
    wide = min(_COLUMNS, len(pairs))
    for k, (i, j) in enumerate(pairs):
        row, column = divmod(k, _COLUMNS)
        axis = {"xaxis": f"x{k + 1}", "yaxis": f"y{k + 1}"}
        around = _outline(hull.points[:, [i, j]] * hull.scale[[i, j]])
        drawn.add_scatter(
            x=around[:, 0], y=around[:, 1], **axis, mode="lines", fill="toself", name="learnt from", legendgroup="hull",
            line={"color": style.CHOSEN, "width": 1.5}, fillcolor="rgba(0,158,115,0.12)", hoverinfo="skip",
            showlegend=k == 0,
        )  # fmt: skip
        for mask, name, colour in classes:
            drawn.add_scatter(
                x=shown[mask, i].astype(np.float32), y=shown[mask, j].astype(np.float32), **axis, mode="markers",
                name=f"{name}: {style.share(mask)}", legendgroup=name, showlegend=k == 0 and bool(mask.any()),
                marker={"color": colour, "size": 4, "opacity": 0.7}, hovertemplate="%{x:.3g}, %{y:.3g}<extra></extra>",
            )  # fmt: skip
        left, right = column / wide, (column + 1) / wide
        top, bottom = 1 - row / rows, 1 - (row + 1) / rows
        number = str(k + 1) if k else ""
        drawn.layout[f"xaxis{number}"] = {
            "domain": [left + 0.05, right - 0.01], "anchor": f"y{k + 1}",
            "title": {"text": _axis_text(*axes[i]), "standoff": 2},
        }  # fmt: skip
        drawn.layout[f"yaxis{number}"] = {
            "domain": [bottom + 0.20 / rows, top - 0.04 / rows], "anchor": f"x{k + 1}",
            "title": {"text": _axis_text(*axes[j]), "standoff": 2},
        }  # fmt: skip
    return drawn


def _axis_text(name: str, unit: str) -> str:
    return f"{style.label(name, 24)} [{unit}]"


def _outline(points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Corners around points of a plane, the first one again at the end; the points themselves where they are a line."""
    try:
        corners = points[ConvexHull(points).vertices]
    except QhullError:
        corners = points[np.argsort(points[:, 0])]
    return np.vstack([corners, corners[:1]])
