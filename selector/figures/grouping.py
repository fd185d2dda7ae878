"""Pictures of the grouping: at which λ groups merge, what every λ would give, where sensors sit, and which are kept."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any

import numpy as np
import plotly.graph_objects as go

from selector.figures import style
from selector.figures.style import Changes, changed
from selector.selection import Selection
from selector.sensors.groups import Dendrogram, dendrogram, transitive_closure
from selector.types import Array

_ROOM_PX, _SENSOR_PX, _LEAST_PX = 170, 18, 140
_COLOURS = (style.MUTED, *style.GROUPS)
_STEP_SHAPES = 2  #: Shapes of `add_step_marks`, which come first.
_NOTHING = "M0,0"  #: An outline without lines.
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
    """The first cut of a selection, or the one beside its fuzzy groups."""
    chosen = selection.grouping.chosen
    step = selection.grouping.axis.at(chosen.level)
    position = {name: i for i, name in enumerate(selection.sensors)}
    representatives = frozenset(position[name] for name in chosen.representatives)
    kept = frozenset(position[name] for name in selection.chosen)
    groups = chosen.rounds[0].groups if chosen.fuzzy is None else step.partition.members
    return CutShown(chosen.level, step.low, step.high, tuple(groups), representatives, kept)


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
    for symbol, text in _MARKS:
        look = {"symbol": symbol, "line": {"width": 2, "color": style.CHOSEN}}
        style.points(drawn, None, None, style.CHOSEN, text, "%{text}", size=10, marker=look, cliponaxis=False)
    drawn.update_xaxes(
        title_text="closure level t = λ at which groups merge [–]",
        range=[first, end + 0.02 * (end - first)],
        **style.level_axis(level_at(first), level_at(end), end=end, room=0.07 if height is None else 0.12),
    )
    bare = {"showgrid": False, "showline": False, "ticks": "", "tickfont": {"size": 12 if n <= 20 else 11}}
    drawn.update_yaxes(range=[n - 0.5, -0.5], side="right", tickvals=list(range(n)), **bare)
    add_step_marks(drawn)
    for colour in _COLOURS:
        drawn.add_shape(style.outline(_NOTHING, colour, width=2))
    if height is not None:
        drawn.update_yaxes(showticklabels=False)
        look = {"mode": "text", "textposition": "middle right", "textfont": {"size": 9 if n > 25 else 11}}
        # at the end of the axis: what lies beyond it is not drawn
        place = {"x": [end + 0.02 * (end - first)] * n, "y": list(range(n)), "cliponaxis": False}
        drawn.add_scatter(**place, **look, hoverinfo="skip", showlegend=False)
    return drawn


def tree_changes(tree: Dendrogram, names: tuple[str, ...], cut: CutShown, *, is_live: bool = False) -> Changes:
    """Branches in the colours of their groups, representatives and chosen sensors, and where the tree is cut.

    `is_live`: for a picture with a height of its own, see `tree_picture`.
    """
    first, end = level_span(tree.levels)
    changes: dict[tuple[str | int, ...], object] = dict(step_changes(cut, first, end))
    lines = _branches(tree, cut, end)
    for k, colour in enumerate(_COLOURS, start=_STEP_SHAPES):
        changes["layout", "shapes", k, "path"] = lines.get(colour, _NOTHING)
    shown = style.labels(names)
    for k, marked in enumerate((cut.chosen, cut.representatives - cut.chosen)):
        rows = [row for row, i in enumerate(tree.leaf_order) if i in marked]
        changes["data", k, "x"], changes["data", k, "y"] = [end] * len(rows), rows
        changes["data", k, "text"] = [shown[tree.leaf_order[row]] for row in rows]
        changes["data", k, "showlegend"] = bool(rows)
    labels = [f"<b>{shown[i]}</b>" if i in cut.chosen else shown[i] for i in tree.leaf_order]
    at: tuple[str | int, ...] = ("data", len(_MARKS), "text") if is_live else ("layout", "yaxis", "ticktext")
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
    drawn.add_shape(style.rule(0, style.CHOSEN, width=2, dash="dash", yref="paper"))
    drawn.add_annotation(style.words("", 0, 1.0, "#00664b", 13, yref="paper", yanchor="bottom"))


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


def level_span(levels: Array) -> tuple[float, float]:
    """Where an axis over these levels begins, and where it puts λ = 1 (all sensors alone)."""
    places = style.nines(levels[levels < 1 - 1e-7]) if len(levels) else np.array([])
    low, high = (float(places.min()), float(places.max())) if len(places) else (0.5, 1.0)
    room = max(0.08 * (high - low), 0.05)
    return low - room, high + 2 * room


def level_at(place: float) -> float:
    """The level that stands there on such an axis."""
    return float(1.0 - 10.0**-place)


def _branches(tree: Dendrogram, cut: CutShown, end: float) -> dict[str, str]:
    """Outlines of the tree per colour: one colour a group below the cut, grey above it."""
    n = len(tree.leaf_order)
    colour_of = group_colours(tree, cut.groups)
    heights = np.minimum(style.nines(tree.levels), end).tolist()
    place: list[tuple[float, float]] = [(0.0, 0.0)] * n
    for k, sensor in enumerate(tree.leaf_order):
        place[sensor] = (end, float(k))
    member = list(range(n))
    lines: dict[str, str] = {}
    for (a, b, _, _), level, x in zip(tree.linkage.tolist(), tree.levels.tolist(), heights, strict=True):
        (xa, ya), (xb, yb) = place[int(a)], place[int(b)]
        sensor = member[int(a)]
        colour = colour_of.get(sensor, style.MUTED) if level >= cut.level else style.MUTED
        lines[colour] = f"{lines.get(colour, '')}M{xa},{ya}H{x}V{yb}H{xb}"
        place.append((x, (ya + yb) / 2))
        member.append(sensor)
    return lines


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
    shown = style.labels(names, _LONGEST_CELL_LABEL)
    labels = [f"<b>{text}</b>" if name in selection.chosen else text for name, text in zip(names, shown, strict=True)]
    longest = max(map(len, shown))
    is_turned = n > 8 or longest > 6
    is_told, digits = n <= _NUMBERS_UP_TO, ".4" if n <= _FOUR_DECIMALS_UP_TO else ".3"
    # four decimals must fit into a cell on paper, too
    cell = 20 if n > _NUMBERS_UP_TO else 46 if n > _FOUR_DECIMALS_UP_TO else 58
    drawn = style.figure(title, 120 + cell * n + (7 * longest if is_turned else 20))
    whole = style.labels(names)
    hover = [
        [f"{whole[max(i, j)]} with {whole[min(i, j)]}<br>r = {r[i, j]:.6f}<br>t = {t[i, j]:.6f}" for j in range(n)]
        for i in range(n)
    ]
    bar: dict[str, object] = {"title": {"text": "r, t [–]", "side": "top"}, "thickness": 14, "outlinewidth": 0}
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
        text=[["" if np.isnan(value) else f"{value:{digits}f}" for value in row] for row in both] if is_told else None,
        texttemplate="%{text}" if is_told else None,
        textfont={"size": 11 if n <= _FOUR_DECIMALS_UP_TO else 9},
        customdata=hover,
        hovertemplate="%{customdata}<extra></extra>",
        showscale=not is_told,
        colorbar=bar | style.level_axis(low, high, room=0.08),
    )
    bare = {"showgrid": False, "showline": False, "ticks": "", "tickfont": {"size": 12 if n <= 20 else 10}}
    ticks = {"tickvals": list(range(n)), "ticktext": labels, **bare, "constrain": "domain"}
    drawn.update_xaxes(range=[-0.5, n - 0.5], tickangle=-90 if is_turned else 0, constraintoward="left", **ticks)
    drawn.update_yaxes(range=[n - 0.5, -0.5], scaleanchor="x", **ticks)
    position = {sensor: k for k, sensor in enumerate(order)}
    for group in groups:
        start, stop = min(position[i] for i in group) - 0.5, max(position[i] for i in group) + 0.5
        corners = {"x0": start, "x1": stop, "y0": start, "y1": stop}
        drawn.add_shape(type="rect", **corners, line={"color": style.INK, "width": 2})
    corner = {"x": 0.0, "y": 1.0, "xref": "paper", "yref": "paper", "xanchor": "left", "yanchor": "bottom", "yshift": 6}
    told = "below the diagonal: similarity r; above it: closure t"
    drawn.add_annotation(text=told, **corner, showarrow=False, font={"color": "#555555"})
    return drawn


VIEWS = (("x", "front view", "X [m]", 0), ("x2", "side view", "Y [m]", 1))
_HEIGHTS = (360, 900)
_PLOT_WIDTH = 870
_ROOM = 0.08
_BESIDE = 0.25
_SIDES = ("middle right", "middle left", "bottom center", "top center")
_LABEL = np.array([0.12, 0.035])  #: Width and height of a label as shares of the picture.


def sensor_places(
    selection: Selection, places_m: Mapping[str, tuple[float, float, float]], outline_m: Sequence[Array] = ()
) -> go.Figure:
    """Front and side view of the machine with every sensor of known place; the kept ones stand out.

    Coordinates [m], Z upwards; sensors without a place, or far off the outline, are not drawn. `outline_m`: lines of
    the machine's body, each of shape (n_points, 3), e.g. `machine_outline` of the thermal field.
    """
    known = [i for i, name in enumerate(selection.sensors) if name in places_m]
    there = [i for i in known if _at_the_machine(places_m[selection.sensors[i]], outline_m)]
    there.sort(key=lambda i: selection.sensors[i] in selection.chosen)  # the kept ones on top
    apart = [selection.sensors[i] for i in known if i not in there]
    n = len(selection.sensors)
    title = (
        f"{len(selection.chosen)} of {n} sensors are kept: "
        + style.listed(selection.chosen)
        + (f"; beside the machine, not drawn: {style.listed(apart)}" if apart else "")
        + (f"; the place of {n - len(known)} is not known" if len(known) < n else "")
    )
    tree = dendrogram(selection.grouping.similarity.matrix)
    colours = group_colours(tree, cut_of(selection).groups)
    names = [selection.sensors[i] for i in there]
    points = np.array([places_m[name] for name in names], dtype=np.float64).reshape(-1, 3)
    drawn = machine_picture(names, points, outline_m, title)
    shown = [colours.get(i, style.MUTED) for i in there]
    return changed(drawn, machine_changes(names, points, shown, selection.chosen, style.LONGEST_LABEL))


def machine_picture(
    names: Sequence[str],
    points_m: Array,
    outline_m: Sequence[Array],
    title: str,
    photos: Mapping[str, str] = MappingProxyType({}),
) -> go.Figure:
    """Front and side view of a machine with places of sensors; `machine_changes` colours them.

    `points_m` has the shape (n_sensors, 3), Z upwards; `outline_m` are lines of the machine's body. Without a title
    there is room for the legend only. `photos`: ``"front view"``, ``"side view"`` → address of a picture that fills
    this view.
    """
    everything = np.vstack([points_m, *outline_m]) if len(points_m) or outline_m else np.zeros((1, 3))
    low, high = everything.min(axis=0), everything.max(axis=0)
    room = _ROOM * max(float((high - low).max()), 0.1)
    low, high = low - room, high + np.array([2 * room, 2 * room, room])
    wide = (high - low)[:2]
    height = int(np.clip(_PLOT_WIDTH * (high - low)[2] / wide.sum(), *_HEIGHTS)) + 150
    drawn = style.figure(title, height)
    shown = style.labels(names)
    for axis, view, _, across in VIEWS:
        if len(outline_m) and view not in photos:
            lines = ("L".join(f"{x:.6g},{z:.6g}" for x, z in line[:, [across, 2]].tolist()) for line in outline_m)
            # edges that lie behind each other once
            path = "M" + "M".join(dict.fromkeys(lines))
            drawn.add_shape(style.outline(path, style.BEFORE, xref=axis, yref="y"))
        x, z = points_m[:, across], points_m[:, 2]
        common: dict[str, Any] = {"xaxis": axis, "showlegend": axis == "x"}
        style.points(drawn, x, z, None, "sensor, coloured as its group (grey: alone)", "%{text}", text=shown, **common)
        look = {"symbol": "circle-open", "line": {"width": 2.5}}
        sides = _label_sides(points_m[:, [across, 2]], float((high - low).max()))
        beside: dict[str, Any] = {"mode": "markers+text", "textposition": sides}
        style.points(drawn, None, z, style.INK, "kept", size=17, marker=look, **beside, **common)
        if view in photos:
            drawn.add_layout_image(
                source=photos[view], xref=axis, yref="y", x=float(low[across]), y=float(high[2]),
                sizex=float(high[across] - low[across]), sizey=float(high[2] - low[2]), sizing="contain",
                layer="below",
            )  # fmt: skip
    first = float(np.clip(wide[0] / wide.sum(), 0.25, 0.75))
    domains = ([0.0, first - 0.03], [first + 0.05, 1.0])
    for (axis, view, text, across), domain in zip(VIEWS, domains, strict=True):
        ends = [float(low[across]), float(high[across])]
        own = {"title": {"text": f"{text}, {view}"}, "domain": domain, "range": ends}
        drawn.update_layout({axis.replace("x", "xaxis"): {**own, "scaleanchor": "y", "constrain": "domain"}})
    drawn.update_yaxes(title_text="Z [m]", range=[float(low[2]), float(high[2])], constrain="domain")
    return drawn


def machine_changes(
    names: Sequence[str], points_m: Array, colours: Sequence[str], chosen: Sequence[str], longest: int
) -> Changes:
    """Colours of the sensors, and rings and names of those that are kept, in the frame of `machine_picture`."""
    kept = [name in set(chosen) for name in names]
    labels = style.labels(names, longest)
    beside = [f"<b>{label}</b>" if is_kept else "" for label, is_kept in zip(labels, kept, strict=True)]
    changes: dict[tuple[str | int, ...], object] = {}
    for view, (*_, across) in enumerate(VIEWS):
        pins, rings = 2 * view, 2 * view + 1
        changes["data", pins, "marker", "color"] = list(colours)
        # what is nowhere is not drawn
        changes["data", rings, "x"] = [float(x) if k else None for x, k in zip(points_m[:, across], kept, strict=True)]
        changes["data", rings, "text"] = beside
    return changes


def _at_the_machine(place_m: tuple[float, float, float], outline_m: Sequence[Array]) -> bool:
    """Whether a sensor is on the body or close to it; one in the hall would make the machine small."""
    if not outline_m:
        return True
    body = np.vstack(outline_m)
    reach = _BESIDE * float(np.ptp(body, axis=0).max())
    return bool(((place_m >= body.min(axis=0) - reach) & (place_m <= body.max(axis=0) + reach)).all())


def _label_sides(points: Array, span: float) -> list[str]:
    """A side for every label, another one than its close neighbours have."""
    sides: list[str] = []
    for k, point in enumerate(points):
        near = (np.abs(points[:k] - point) < _LABEL * span).all(axis=1)
        taken = {sides[i] for i in np.flatnonzero(near)}
        sides.append(next((side for side in _SIDES if side not in taken), _SIDES[0]))
    return sides
