"""Pictures of the grouping: who moves with whom, the tree, and what every λ would give."""

from __future__ import annotations

import math

import numpy as np
import plotly.graph_objects as go
from numpy.typing import NDArray

from selector.figures import style
from selector.selection import Selection
from selector.sensors.fuzzy import transitive_closure
from selector.sensors.groups import Dendrogram, LambdaStep, dendrogram

_NUMBERS_UP_TO = 14
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
    groups = first_partition(selection)
    title = (
        f"{n} sensors move in {len(groups)} group{'s' * (len(groups) != 1)} "
        f"at λ = {style.level_text(selection.grouping.chosen.level)}"
    )
    labels = [_sensor_label(selection, name, _LONGEST_CELL_LABEL) for name in names]
    longest = max(len(style.label(name, _LONGEST_CELL_LABEL)) for name in names)
    is_turned = n > 8 or longest > 6
    cell = 20 if n > _NUMBERS_UP_TO else 46
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
        textfont={"size": 11 if n <= 9 else 9},
        customdata=hover,
        hovertemplate="%{customdata}<extra></extra>",
        showscale=n > _NUMBERS_UP_TO,
        colorbar={
            "title": {"text": "r, t [–]", "side": "right"},
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


def sensor_tree(selection: Selection) -> go.Figure:
    """Which groups merge at which closure level, with the chosen λ and the range in which the groups stay the same."""
    tree = dendrogram(selection.grouping.similarity.matrix)
    n = len(selection.sensors)
    step = _chosen_step(selection)
    groups = first_partition(selection)
    title = (
        f"Cut at λ = {style.level_text(selection.grouping.chosen.level)}: {len(groups)} "
        f"group{'s' * (len(groups) != 1)}, the same for every λ above {style.level_text(max(step.low, 0.0))} "
        f"up to {style.level_text(step.high)}"
    )
    drawn = style.figure(title, 170 + max(18 * n, 140))
    drawn.update_layout(margin={"b": 85}, legend={"yref": "container", "y": 0.0, "yanchor": "bottom"})
    first, end = _level_span(tree.levels)
    lines = _branches(tree, selection.grouping.chosen.level, groups, end)
    for colour, (x, y) in sorted(lines.items()):
        drawn.add_scatter(
            x=x, y=y, mode="lines", line={"color": colour, "width": 2}, hoverinfo="skip", showlegend=False
        )
    _mark_step(drawn, selection, step, end)
    representatives = set(selection.grouping.chosen.representatives) - set(selection.chosen)
    for names, symbol, text in (
        (set(selection.chosen), "circle", "chosen"),
        (representatives, "circle-open", "representative of its group"),
    ):
        rows = [k for k, i in enumerate(tree.leaf_order) if selection.sensors[i] in names]
        drawn.add_scatter(
            x=[end] * len(rows),
            y=rows,
            mode="markers",
            name=text,
            marker={"color": style.CHOSEN, "symbol": symbol, "size": 10, "line": {"width": 2, "color": style.CHOSEN}},
            text=[style.label(selection.sensors[tree.leaf_order[k]]) for k in rows],
            hovertemplate="%{text}<extra></extra>",
            showlegend=bool(rows),
            cliponaxis=False,
        )
    drawn.update_xaxes(
        title_text="closure level t = λ at which groups merge [–]",
        range=[first, end + 0.02 * (end - first)],
        **style.level_axis(_level_at(first), _level_at(end), end=end),
    )
    drawn.update_yaxes(
        range=[n - 0.5, -0.5],
        side="right",
        tickvals=list(range(n)),
        ticktext=[_sensor_label(selection, selection.sensors[i]) for i in tree.leaf_order],
        showgrid=False,
        showline=False,
        ticks="",
        tickfont={"size": 12 if n <= 20 else 11},
    )
    return drawn


def lambda_scan(selection: Selection) -> go.Figure:
    """Number of groups, F-statistic and held-out error over λ, for every distinct partition."""
    grouping = selection.grouping
    axis = grouping.axis
    chosen = grouping.chosen
    first, end = _level_span(np.array(axis.levels))
    error = "" if math.isnan(chosen.error) else f", held-out error {style.number(chosen.error)} of the spread"
    f = "" if chosen.f is None or not math.isfinite(chosen.f.value) else f", F = {style.number(chosen.f.value)}"
    title = (
        f"{len(axis)} ways to group; chosen: λ = {style.level_text(chosen.level)} with "
        f"{len(first_partition(selection))} groups{f}{error}"
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
            **style.level_axis(_level_at(first), _level_at(end), end=end),
        },
        yaxis={"domain": [0.70, 1.0], "title": {"text": "groups [–]"}, "rangemode": "tozero"},
        yaxis2={"domain": [0.36, 0.64], "title": {"text": "F-statistic [–]"}, "rangemode": "tozero", "anchor": "x"},
        yaxis3={"domain": [0.0, 0.30], "title": {"text": "held-out error<br>/ spread [–]"}, "rangemode": "tozero"},
    )
    _mark_step(drawn, selection, _chosen_step(selection), end)
    return drawn


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


def group_colours(tree: Dendrogram, groups: list[tuple[int, ...]]) -> dict[int, str]:
    """Colour of every sensor that is not alone in its group, the same in every picture of a selection."""
    place_of = {sensor: k for k, sensor in enumerate(tree.leaf_order)}
    large = sorted((group for group in groups if len(group) > 1), key=lambda group: place_of[group[0]])
    return {sensor: style.GROUPS[k % len(style.GROUPS)] for k, group in enumerate(large) for sensor in group}


def _branches(
    tree: Dendrogram, level: float, groups: list[tuple[int, ...]], end: float
) -> dict[str, tuple[list[float | None], list[float | None]]]:
    """Lines of the tree per colour: one colour a group below the cut, grey above it."""
    n = len(tree.leaf_order)
    colour_of = group_colours(tree, groups)
    place_of = {sensor: k for k, sensor in enumerate(tree.leaf_order)}
    place: list[tuple[float, float]] = [(0.0, 0.0)] * n
    for sensor, k in place_of.items():
        place[sensor] = (end, float(k))
    member = list(range(n))
    lines: dict[str, tuple[list[float | None], list[float | None]]] = {}
    for (a, b, _, _), height in zip(tree.linkage, tree.levels, strict=True):
        (xa, ya), (xb, yb) = place[int(a)], place[int(b)]
        x = min(float(style.nines(height)), end)
        sensor = member[int(a)]
        colour = colour_of[sensor] if height >= level else style.MUTED
        xs, ys = lines.setdefault(colour, ([], []))
        xs += [xa, x, x, xb, None]
        ys += [ya, ya, yb, yb, None]
        place.append((x, (ya + yb) / 2))
        member.append(sensor)
    return lines


def _mark_step(drawn: go.Figure, selection: Selection, step: LambdaStep, end: float) -> None:
    """The range of λ with the chosen groups as a band, and λ itself as a line."""
    first = drawn.layout.xaxis.range[0] if drawn.layout.xaxis.range else float(style.nines(max(step.low, 0.0)))
    start = max(float(style.nines(step.low)), first) if step.low > -1 else first
    stop = min(float(style.nines(step.high)), end) if step.high < 1 else end
    at = min(float(style.nines(selection.grouping.chosen.level)), end)
    over = {"yref": "paper", "y0": 0, "y1": 1, "xref": "x"}
    drawn.add_shape(
        type="rect", x0=start, x1=stop, **over, fillcolor=style.CHOSEN, opacity=0.15, line_width=0, layer="below"
    )
    drawn.add_shape(type="line", x0=at, x1=at, **over, line={"color": style.CHOSEN, "width": 2, "dash": "dash"})
    drawn.add_annotation(
        text=f"λ = {style.level_text(selection.grouping.chosen.level)}",
        x=at,
        y=1.0,
        yref="paper",
        yanchor="bottom",
        showarrow=False,
        font={"color": "#00664b", "size": 13},
    )


def _chosen_step(selection: Selection) -> LambdaStep:
    return selection.grouping.axis.at(selection.grouping.chosen.level)


def first_partition(selection: Selection) -> list[tuple[int, ...]]:
    """Groups of the first round of screening."""
    return list(selection.grouping.chosen.rounds[0].groups)


def _level_span(levels: NDArray[np.float64]) -> tuple[float, float]:
    """Where an axis over these levels begins, and where it puts λ = 1 (all sensors alone)."""
    places = style.nines(levels[levels < 1 - 1e-7]) if len(levels) else np.array([])
    low, high = (float(places.min()), float(places.max())) if len(places) else (0.5, 1.0)
    room = max(0.08 * (high - low), 0.05)
    return low - room, high + 2 * room


def _level_at(place: float) -> float:
    return float(1.0 - 10.0**-place)


def _sensor_label(selection: Selection, name: str, longest: int = style.LONGEST_LABEL) -> str:
    text = style.label(name, longest)
    return f"<b>{text}</b>" if name in selection.chosen else text


def _cell(value: float, n: int) -> str:
    if math.isnan(value):
        return ""
    return f"{value:.4f}" if n <= 9 else f"{value:.3f}"
