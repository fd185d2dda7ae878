"""The machine with its sensors: where they sit, which of them move together, which are kept."""

from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import Any

import numpy as np
import plotly.graph_objects as go

from selector.figures import style
from selector.figures.grouping import cut_of, group_colours
from selector.figures.style import Changes, changed
from selector.selection import Selection
from selector.sensors.groups import dendrogram
from selector.types import Array

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
