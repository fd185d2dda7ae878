"""Pictures of the grouping: who moves with whom, and what every λ would give."""

from __future__ import annotations

import math

import numpy as np
import plotly.graph_objects as go

from selector.figures import style
from selector.figures.sensor_tree import add_step_marks, cut_of, level_at, level_span, step_changes
from selector.figures.style import changed
from selector.number_text import number_text
from selector.selection import Selection
from selector.sensors.groups import dendrogram, transitive_closure

_NUMBERS_UP_TO = 14
_FOUR_DECIMALS_UP_TO = 9
_LONGEST_CELL_LABEL = 16


def similarity_and_closure(selection: Selection) -> go.Figure:
    """Similarity r below the diagonal and closure t above it, ordered as in the tree, groups outlined.

    A cell and its mirror image differ where two sensors are grouped through others (a chain), not directly.
    """
    similarity = selection.grouping.similarity.matrix
    order = dendrogram(similarity).leaf_order
    names = [selection.sensors[i] for i in order]
    n = len(names)
    r = similarity[np.ix_(order, order)]
    t = transitive_closure(similarity)[np.ix_(order, order)]
    both = np.where(np.arange(n)[:, None] >= np.arange(n), r, t)
    off = both[~np.eye(n, dtype=bool)]
    low, high = (float(off.min()), float(min(off.max(), 1 - 1e-6))) if n > 1 else (0.0, 0.5)
    np.fill_diagonal(both, np.nan)
    first, last = float(style.nines(low)), max(float(style.nines(high)), float(style.nines(low)) + 0.1)
    groups = cut_of(selection).groups
    title = (
        f"{n} sensors move in {len(groups)} group{'s' * (len(groups) != 1)} "
        f"at λ = {style.level_text(selection.grouping.chosen.level)}"
    )
    labels = [_sensor_label(selection, name, _LONGEST_CELL_LABEL) for name in names]
    longest = max(len(style.label(name, _LONGEST_CELL_LABEL)) for name in names)
    is_turned = n > 8 or longest > 6
    # four decimals must fit into a cell on paper, too
    cell = 20 if n > _NUMBERS_UP_TO else 46 if n > _FOUR_DECIMALS_UP_TO else 58
    drawn = style.figure(title, 120 + cell * n + (7 * longest if is_turned else 20))
    hover = [
        [
            f"{style.label(names[max(i, j)])} with {style.label(names[min(i, j)])}"
            f"<br>r = {r[i, j]:.6f}<br>t = {t[i, j]:.6f}"
            for j in range(n)
        ]
        for i in range(n)
    ]
    drawn.add_heatmap(
        z=style.nines(both).astype(np.float32),
        x=list(range(n)),
        y=list(range(n)),
        zmin=first,
        zmax=last,
        colorscale=style.LIKENESS_SCALE,
        xgap=1,
        ygap=1,
        hoverongaps=False,
        text=[[_cell(value, n) for value in row] for row in both] if n <= _NUMBERS_UP_TO else None,
        texttemplate="%{text}" if n <= _NUMBERS_UP_TO else None,
        textfont={"size": 11 if n <= _FOUR_DECIMALS_UP_TO else 9},
        customdata=hover,
        hovertemplate="%{customdata}<extra></extra>",
        showscale=n > _NUMBERS_UP_TO,
        colorbar={
            "title": {"text": "r, t [–]", "side": "top"},
            "thickness": 14,
            "outlinewidth": 0,
            **style.level_axis(low, high, room=0.08),
        },
    )
    ticks = {
        "tickvals": list(range(n)),
        "ticktext": labels,
        "showgrid": False,
        "showline": False,
        "ticks": "",
        "tickfont": {"size": 12 if n <= 20 else 10},
        "constrain": "domain",
    }
    drawn.update_xaxes(range=[-0.5, n - 0.5], tickangle=-90 if is_turned else 0, constraintoward="left", **ticks)
    drawn.update_yaxes(range=[n - 0.5, -0.5], scaleanchor="x", **ticks)
    position = {sensor: k for k, sensor in enumerate(order)}
    for group in groups:
        start, stop = min(position[i] for i in group) - 0.5, max(position[i] for i in group) + 0.5
        corners = {"x0": start, "x1": stop, "y0": start, "y1": stop}
        drawn.add_shape(type="rect", **corners, line={"color": style.INK, "width": 2})
    drawn.add_annotation(
        text="below the diagonal: similarity r; above it: closure t",
        x=0.0,
        y=1.0,
        xref="paper",
        yref="paper",
        xanchor="left",
        yanchor="bottom",
        yshift=6,
        showarrow=False,
        font={"color": "#555555"},
    )
    return drawn


def lambda_scan(selection: Selection) -> go.Figure:
    """Number of groups, F-statistic and held-out error over λ, for every distinct partition."""
    grouping = selection.grouping
    axis = grouping.axis
    chosen = grouping.chosen
    first, end = level_span(np.array(axis.levels))
    error = "" if math.isnan(chosen.error) else f", held-out error {number_text(chosen.error)} of the spread"
    f = "" if chosen.f is None or not math.isfinite(chosen.f.value) else f", F = {number_text(chosen.f.value)}"
    title = (
        f"{len(axis)} ways to group; chosen: λ = {style.level_text(chosen.level)} with "
        f"{len(cut_of(selection).groups)} groups{f}{error}"
    )
    drawn = style.figure(title, 560)
    steps = list(axis)
    at = [min(float(style.nines(step.high)), end) if step.high < 1 else end for step in steps]
    counts = [len(step.partition.members) for step in steps]
    drawn.add_scatter(
        x=[*at, first],
        y=[*counts, counts[-1]],
        mode="lines",
        line={"shape": "hv", "color": style.PREDICTED, "width": 2},
        hoverinfo="skip",
        xaxis="x",
        yaxis="y",
        showlegend=False,
    )
    drawn.add_scatter(
        x=at,
        y=counts,
        mode="markers",
        marker={"color": style.PREDICTED, "size": 6},
        text=[
            f"λ up to {style.level_text(step.high)}<br>{count} groups"
            for step, count in zip(steps, counts, strict=True)
        ],
        hovertemplate="%{text}<extra></extra>",
        yaxis="y",
        showlegend=False,
    )
    statistics = [
        (x, step.f.value, f"{count} groups<br>F = {step.f.value:.4g}")
        for x, step, count in zip(at, steps, counts, strict=True)
        if step.f is not None and math.isfinite(step.f.value)
    ]
    _panel(drawn, "y2", statistics)
    _panel(
        drawn,
        "y3",
        [
            (
                min(float(style.nines(one.rounds[-1].level)), end) if one.rounds[-1].level < 1 else end,
                one.error,
                f"{len(one.representatives)} representatives<br>held-out error {one.error:.4g}",
            )
            for one in grouping.screenings
            if math.isfinite(one.error)
        ],
    )
    drawn.update_layout(
        xaxis={
            "title": {"text": "λ [–]"},
            "range": [first, end + 0.02 * (end - first)],
            "anchor": "y3",
            **style.level_axis(level_at(first), level_at(end), end=end),
        },
        yaxis={"domain": [0.70, 1.0], "title": {"text": "groups [–]"}, "rangemode": "tozero"},
        yaxis2={"domain": [0.36, 0.64], "title": {"text": "F-statistic [–]"}, "rangemode": "tozero", "anchor": "x"},
        yaxis3={"domain": [0.0, 0.30], "title": {"text": "held-out error<br>/ spread [–]"}, "rangemode": "tozero"},
    )
    add_step_marks(drawn)
    return changed(drawn, step_changes(cut_of(selection), first, end))


def _panel(drawn: go.Figure, yaxis: str, points: list[tuple[float, float, str]]) -> None:
    points = sorted(points)
    drawn.add_scatter(
        x=[x for x, _, _ in points],
        y=[y for _, y, _ in points],
        text=[text for _, _, text in points],
        mode="lines+markers",
        line={"color": "#b9b9b9", "width": 1},
        marker={"color": style.PREDICTED, "size": 7},
        hovertemplate="%{text}<extra></extra>",
        yaxis=yaxis,
        showlegend=False,
    )


def _sensor_label(selection: Selection, name: str, longest: int = style.LONGEST_LABEL) -> str:
    text = style.label(name, longest)
    return f"<b>{text}</b>" if name in selection.chosen else text


def _cell(value: float, n: int) -> str:
    if math.isnan(value):
        return ""
    return f"{value:.4f}" if n <= _FOUR_DECIMALS_UP_TO else f"{value:.3f}"
