"""The tree of the sensors: at which λ groups merge, where it is cut, and which sensors are kept."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import plotly.graph_objects as go
from numpy.typing import NDArray

from selector.figures import style
from selector.figures.style import Changes, changed
from selector.selection import Selection
from selector.sensors.groups import Dendrogram, dendrogram

_ROOM_PX, _SENSOR_PX, _LEAST_PX = 170, 18, 140
_COLOURS = (style.MUTED, *style.GROUPS)
_MARKS = (("circle", "chosen"), ("circle-open", "representative of its group"))


@dataclass(frozen=True)
class CutShown:
    """What a picture shows of a cut."""

    level: float  #: λ
    #: low and high: Every λ above `low` up to `high` gives the same groups
    low: float
    high: float
    groups: tuple[tuple[int, ...], ...]  #: Sensors of each group, by position
    representatives: frozenset[int]
    chosen: frozenset[int]


def cut_of(selection: Selection) -> CutShown:
    """The first cut of a selection."""
    chosen = selection.grouping.chosen
    step = selection.grouping.axis.at(chosen.level)
    position = {name: i for i, name in enumerate(selection.sensors)}
    return CutShown(
        chosen.level,
        step.low,
        step.high,
        tuple(chosen.rounds[0].groups),
        frozenset(position[name] for name in chosen.representatives),
        frozenset(position[name] for name in selection.chosen),
    )


def sensor_tree(selection: Selection) -> go.Figure:
    """Which groups merge at which closure level, with the chosen λ and the range in which the groups stay the same."""
    tree = dendrogram(selection.grouping.similarity.matrix)
    cut = cut_of(selection)
    return changed(tree_picture(tree, tree_title(cut)), tree_changes(tree, selection.sensors, cut))


def tree_title(cut: CutShown) -> str:
    """How many groups there are, and for which λ."""
    n = len(cut.groups)
    return (
        f"Cut at λ = {style.level_text(cut.level)}: {n} group{'s' * (n != 1)}, the same for every λ above "
        f"{style.level_text(max(cut.low, 0.0))} up to {style.level_text(cut.high)}"
    )


def tree_picture(tree: Dendrogram, title: str, height: int | None = None) -> go.Figure:
    """The frame of a tree; `tree_changes` fills it.

    By default every sensor has a line of its own. With a height [px] the names are points of a line of text, which is
    drawn again in half the time that labels of an axis take.
    """
    n = len(tree.leaf_order)
    drawn = style.figure(title, _ROOM_PX + max(_SENSOR_PX * n, _LEAST_PX) if height is None else height)
    drawn.update_layout(margin={"b": 85}, legend={"yref": "container", "y": 0.0, "yanchor": "bottom"})
    first, end = level_span(tree.levels)
    for colour in _COLOURS:
        drawn.add_scatter(mode="lines", line={"color": colour, "width": 2}, hoverinfo="skip", showlegend=False)
    for symbol, text in _MARKS:
        drawn.add_scatter(
            mode="markers",
            name=text,
            marker={"color": style.CHOSEN, "symbol": symbol, "size": 10, "line": {"width": 2, "color": style.CHOSEN}},
            hovertemplate="%{text}<extra></extra>",
            cliponaxis=False,
        )
    drawn.update_xaxes(
        title_text="closure level t = λ at which groups merge [–]",
        range=[first, end + 0.02 * (end - first)],
        **style.level_axis(level_at(first), level_at(end), end=end, room=0.07 if height is None else 0.12),
    )
    drawn.update_yaxes(
        range=[n - 0.5, -0.5],
        side="right",
        tickvals=list(range(n)),
        showgrid=False,
        showline=False,
        ticks="",
        tickfont={"size": 12 if n <= 20 else 11},
    )
    add_step_marks(drawn)
    if height is not None:
        drawn.update_yaxes(showticklabels=False)
        drawn.add_scatter(
            # at the end of the axis: what lies beyond it is not drawn
            x=[end + 0.02 * (end - first)] * n,
            y=list(range(n)),
            mode="text",
            textposition="middle right",
            textfont={"size": 9 if n > 25 else 11},
            cliponaxis=False,
            hoverinfo="skip",
            showlegend=False,
        )
    return drawn


def tree_changes(tree: Dendrogram, names: tuple[str, ...], cut: CutShown, *, is_live: bool = False) -> Changes:
    """Branches in the colours of their groups, representatives and chosen sensors, and where the tree is cut.

    `is_live`: for a picture with a height of its own, see `tree_picture`.
    """
    first, end = level_span(tree.levels)
    changes: dict[tuple[str | int, ...], object] = dict(step_changes(cut, first, end))
    lines = _branches(tree, cut, end)
    for k, colour in enumerate(_COLOURS):
        changes["data", k, "x"], changes["data", k, "y"] = lines.get(colour, ([], []))
    for k, marked in enumerate((cut.chosen, cut.representatives - cut.chosen), start=len(_COLOURS)):
        rows = [row for row, i in enumerate(tree.leaf_order) if i in marked]
        changes["data", k, "x"], changes["data", k, "y"] = [end] * len(rows), rows
        changes["data", k, "text"] = [style.label(names[tree.leaf_order[row]]) for row in rows]
        changes["data", k, "showlegend"] = bool(rows)
    labels = [f"<b>{style.label(names[i])}</b>" if i in cut.chosen else style.label(names[i]) for i in tree.leaf_order]
    at: tuple[str | int, ...] = (
        ("data", len(_COLOURS) + len(_MARKS), "text") if is_live else ("layout", "yaxis", "ticktext")
    )
    changes[at] = labels
    return changes


def group_colours(tree: Dendrogram, groups: tuple[tuple[int, ...], ...]) -> dict[int, str]:
    """Colour of every sensor that is not alone in its group, the same in every picture of a selection."""
    place_of = {sensor: k for k, sensor in enumerate(tree.leaf_order)}
    large = sorted((group for group in groups if len(group) > 1), key=lambda group: place_of[group[0]])
    return {sensor: style.GROUPS[k % len(style.GROUPS)] for k, group in enumerate(large) for sensor in group}


def add_step_marks(drawn: go.Figure) -> None:
    """A band, a line and a text, which `step_changes` puts in their places."""
    over = {"yref": "paper", "y0": 0, "y1": 1, "xref": "x", "x0": 0, "x1": 0}
    drawn.add_shape(type="rect", **over, fillcolor=style.CHOSEN, opacity=0.15, line_width=0, layer="below")
    drawn.add_shape(type="line", **over, line={"color": style.CHOSEN, "width": 2, "dash": "dash"})
    drawn.add_annotation(
        text="", x=0, y=1.0, yref="paper", yanchor="bottom", showarrow=False, font={"color": "#00664b", "size": 13}
    )


def step_changes(cut: CutShown, first: float, end: float) -> Changes:
    """The range of λ with these groups as a band, and λ itself as a line; the ends are those of `level_span`."""
    start = max(float(style.nines(cut.low)), first) if cut.low > -1 else first
    stop = min(float(style.nines(cut.high)), end) if cut.high < 1 else end
    at = min(float(style.nines(cut.level)), end)
    return {
        ("layout", "shapes", 0, "x0"): start,
        ("layout", "shapes", 0, "x1"): stop,
        ("layout", "shapes", 1, "x0"): at,
        ("layout", "shapes", 1, "x1"): at,
        ("layout", "annotations", 0, "x"): at,
        ("layout", "annotations", 0, "text"): f"λ = {style.level_text(cut.level)}",
    }


def level_span(levels: NDArray[np.float64]) -> tuple[float, float]:
    """Where an axis over these levels begins, and where it puts λ = 1 (all sensors alone)."""
    places = style.nines(levels[levels < 1 - 1e-7]) if len(levels) else np.array([])
    low, high = (float(places.min()), float(places.max())) if len(places) else (0.5, 1.0)
    room = max(0.08 * (high - low), 0.05)
    return low - room, high + 2 * room


def level_at(place: float) -> float:
    """The level that stands there on such an axis."""
    return float(1.0 - 10.0**-place)


def _branches(tree: Dendrogram, cut: CutShown, end: float) -> dict[str, tuple[list[float | None], list[float | None]]]:
    """Lines of the tree per colour: one colour a group below the cut, grey above it."""
    n = len(tree.leaf_order)
    colour_of = group_colours(tree, cut.groups)
    place_of = {sensor: k for k, sensor in enumerate(tree.leaf_order)}
    heights = np.minimum(style.nines(tree.levels), end).tolist()
    place: list[tuple[float, float]] = [(0.0, 0.0)] * n
    for sensor, k in place_of.items():
        place[sensor] = (end, float(k))
    member = list(range(n))
    lines: dict[str, tuple[list[float | None], list[float | None]]] = {}
    for (a, b, _, _), level, x in zip(tree.linkage.tolist(), tree.levels.tolist(), heights, strict=True):
        (xa, ya), (xb, yb) = place[int(a)], place[int(b)]
        sensor = member[int(a)]
        colour = colour_of.get(sensor, style.MUTED) if level >= cut.level else style.MUTED
        xs, ys = lines.setdefault(colour, ([], []))
        xs += [xa, x, x, xb, None]
        ys += [ya, ya, yb, yb, None]
        place.append((x, (ya + yb) / 2))
        member.append(sensor)
    return lines
