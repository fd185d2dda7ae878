"""The machine with its sensors: where they sit, which of them move together, which are kept."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import plotly.graph_objects as go
from numpy.typing import NDArray

from selector.figures import style
from selector.figures.grouping import first_partition, group_colours
from selector.selection import Selection
from selector.sensors.groups import dendrogram

_VIEWS = (("x", "front view", "X [m]", 0), ("x2", "side view", "Y [m]", 1))
_HEIGHTS = (360, 900)
_PLOT_WIDTH = 870
_ROOM = 0.08
_BESIDE = 0.25
_SIDES = ("middle right", "middle left", "bottom center", "top center")
_LABEL = np.array([0.12, 0.035])
"""Width and height of a label as shares of the picture."""


def sensor_places(
    selection: Selection,
    places_m: Mapping[str, tuple[float, float, float]],
    outline_m: Sequence[NDArray[np.float64]] = (),
) -> go.Figure:
    """Front and side view of the machine with every sensor of known place; the kept ones stand out.

    Parameters
    ----------
    selection : Selection
    places_m : mapping of str to (x, y, z)
        Coordinates [m], Z upwards; sensors that are not named here are not drawn, nor those far off the outline.
    outline_m : sequence of ndarray of shape (n_points, 3), optional
        Lines of the machine's body [m], e.g. `machine_outline` of the thermal field.
    """
    known = [i for i, name in enumerate(selection.sensors) if name in places_m]
    there = [i for i in known if _at_the_machine(places_m[selection.sensors[i]], outline_m)]
    there.sort(key=lambda i: selection.sensors[i] in selection.chosen)  # the kept ones on top
    apart = [selection.sensors[i] for i in known if i not in there]
    chosen = [i for i in there if selection.sensors[i] in selection.chosen]
    n = len(selection.sensors)
    title = (
        f"{len(selection.chosen)} of {n} sensors are kept: "
        + style.listed(selection.chosen)
        + (f"; beside the machine, not drawn: {style.listed(apart)}" if apart else "")
        + (f"; the place of {n - len(known)} is not known" if len(known) < n else "")
    )
    points = np.array([places_m[selection.sensors[i]] for i in there], dtype=np.float64).reshape(-1, 3)
    everything = np.vstack([points, *outline_m]) if len(points) or outline_m else np.zeros((1, 3))
    low, high = everything.min(axis=0), everything.max(axis=0)
    room = _ROOM * max(float((high - low).max()), 0.1)
    low, high = low - room, high + np.array([2 * room, 2 * room, room])
    wide = (high - low)[:2]
    height = int(np.clip(_PLOT_WIDTH * (high - low)[2] / wide.sum(), *_HEIGHTS)) + 150
    drawn = style.figure(title, height)
    tree = dendrogram(selection.grouping.similarity.matrix)
    colours = group_colours(tree, first_partition(selection))
    names = [style.label(selection.sensors[i]) for i in there]
    # one trace for the whole body: lines end at a gap
    gap = np.full((1, 3), np.nan)
    lines = np.vstack([part for line in outline_m for part in (line, gap)] or [gap])[:-1]
    for axis, _, _, across in _VIEWS:
        if lines.size:
            drawn.add_scatter(
                x=lines[:, across],
                y=lines[:, 2],
                xaxis=axis,
                mode="lines",
                line={"color": style.BEFORE, "width": 1},
                hoverinfo="skip",
                showlegend=False,
            )
        drawn.add_scatter(
            x=points[:, across],
            y=points[:, 2],
            xaxis=axis,
            mode="markers",
            marker={"size": 9, "color": [colours.get(i, style.MUTED) for i in there]},
            text=names,
            hovertemplate="%{text}<extra></extra>",
            name="sensor, coloured as its group (grey: alone)",
            showlegend=axis == "x",
        )
        kept = [there.index(i) for i in chosen]
        drawn.add_scatter(
            x=points[kept, across],
            y=points[kept, 2],
            xaxis=axis,
            mode="markers+text",
            marker={"size": 17, "symbol": "circle-open", "color": style.INK, "line": {"width": 2.5}},
            text=[f"<b>{names[k]}</b>" for k in kept],
            textposition=_label_sides(points[kept][:, [across, 2]], float((high - low).max())),
            hoverinfo="skip",
            name="kept",
            showlegend=axis == "x",
        )
    first = float(np.clip(wide[0] / wide.sum(), 0.25, 0.75))
    domains = ([0.0, first - 0.03], [first + 0.05, 1.0])
    for (axis, view, text, across), domain in zip(_VIEWS, domains, strict=True):
        drawn.update_layout(
            {
                axis.replace("x", "xaxis"): {
                    "title": {"text": f"{text}, {view}"},
                    "domain": domain,
                    "range": [float(low[across]), float(high[across])],
                    "scaleanchor": "y",
                    "constrain": "domain",
                }
            }
        )
    drawn.update_yaxes(title_text="Z [m]", range=[float(low[2]), float(high[2])], constrain="domain")
    return drawn


def _at_the_machine(place_m: tuple[float, float, float], outline_m: Sequence[NDArray[np.float64]]) -> bool:
    """Whether a sensor is on the body or close to it; one in the hall would make the machine small."""
    if not outline_m:
        return True
    body = np.vstack(outline_m)
    reach = _BESIDE * float(np.ptp(body, axis=0).max())
    return bool(((place_m >= body.min(axis=0) - reach) & (place_m <= body.max(axis=0) + reach)).all())


def _label_sides(points: NDArray[np.float64], span: float) -> list[str]:
    """A side for every label, another one than its close neighbours have."""
    sides: list[str] = []
    for k, point in enumerate(points):
        near = (np.abs(points[:k] - point) < _LABEL * span).all(axis=1)
        taken = {sides[i] for i in np.flatnonzero(near)}
        sides.append(next((side for side in _SIDES if side not in taken), _SIDES[0]))
    return sides
