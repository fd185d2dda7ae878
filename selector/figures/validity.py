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
_COLUMNS = 3
_OUTSIDE = 1e-9


def validity_pairs(
    hull: ValidityHull, inputs: Sequence[str], samples: NDArray[np.float64], *, rise: bool = True
) -> go.Figure:
    """Every pair of inputs with the outline of the hull; samples that lie outside the whole hull stand out.

    A sample may lie outside the hull of all inputs and inside that of every pair; it is marked in each picture. At
    most `POINTS` samples are judged and drawn, evenly spaced, and at most `MOST_PAIRS` pairs.

    Parameters
    ----------
    hull : ValidityHull
        Of the training samples, as a `Selection` has it.
    inputs : sequence of str
        Names of its variables, two at least.
    samples : ndarray of shape (n_samples, n_inputs)
        In the unit of the inputs, e.g. another run.
    rise : bool
        Whether inputs are differences to the start of a run.
    """
    keep = np.unique(np.linspace(0, len(samples) - 1, min(POINTS, len(samples))).astype(np.int64))
    shown = samples[keep]
    outside = hull.distance(shown) > _OUTSIDE if len(shown) else np.zeros(0, dtype=np.bool_)
    share = float(outside.mean()) if len(outside) else 0.0
    pairs = list(combinations(range(len(inputs)), 2))[:MOST_PAIRS]
    all_pairs = len(inputs) * (len(inputs) - 1) // 2
    title = (
        "No sample lies outside what the model has learnt from"
        if not outside.any()
        else f"{100 * share:.3g} % of the samples lie outside what the model has learnt from"
    ) + (f"; {len(pairs)} of {all_pairs} pairs of inputs are drawn" if len(pairs) < all_pairs else "")
    rows = -(-len(pairs) // _COLUMNS)
    drawn = style.figure(title, 90 + 290 * max(rows, 1))
    sign, unit = ("Δ", "K") if rise else ("", "°C")
    for k, (i, j) in enumerate(pairs):
        row, column = divmod(k, _COLUMNS)
        wide = min(_COLUMNS, len(pairs))
        axis = {"xaxis": f"x{k + 1}", "yaxis": f"y{k + 1}"}
        around = _outline(hull.points[:, [i, j]] * hull.scale[[i, j]])
        drawn.add_scatter(
            x=around[:, 0], y=around[:, 1], **axis, mode="lines", fill="toself", name="learnt from", legendgroup="hull",
            line={"color": style.CHOSEN, "width": 1.5}, fillcolor="rgba(0,158,115,0.12)", hoverinfo="skip",
            showlegend=k == 0,
        )  # fmt: skip
        for mask, name, colour in ((~outside, "inside", style.MUTED), (outside, "outside", style.RESIDUAL)):
            drawn.add_scatter(
                x=shown[mask, i].astype(np.float32), y=shown[mask, j].astype(np.float32), **axis, mode="markers",
                name=name, legendgroup=name, marker={"color": colour, "size": 4, "opacity": 0.7},
                hovertemplate="%{x:.3g}, %{y:.3g}<extra></extra>", showlegend=k == 0,
            )  # fmt: skip
        left, right = column / wide, (column + 1) / wide
        top, bottom = 1 - row / rows, 1 - (row + 1) / rows
        number = str(k + 1) if k else ""
        drawn.layout[f"xaxis{number}"] = {
            "domain": [left + 0.05, right - 0.01], "anchor": f"y{k + 1}",
            "title": {"text": f"{sign}{style.label(inputs[i], 14)} [{unit}]", "standoff": 2},
        }  # fmt: skip
        drawn.layout[f"yaxis{number}"] = {
            "domain": [bottom + 0.20 / rows, top - 0.04 / rows], "anchor": f"x{k + 1}",
            "title": {"text": f"{sign}{style.label(inputs[j], 14)} [{unit}]", "standoff": 2},
        }  # fmt: skip
    return drawn


def _outline(points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Corners around points of a plane, the first one again at the end; the points themselves where they are a line."""
    try:
        corners = points[ConvexHull(points).vertices]
    except QhullError:
        corners = points[np.argsort(points[:, 0])]
    return np.vstack([corners, corners[:1]])
