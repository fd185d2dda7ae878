"""A simulated run, or a recorded one: what is done to the machine, how it warms and moves, and how its field looks."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from types import MappingProxyType
from typing import Any

import numpy as np
import plotly.graph_objects as go

from selector.figures import style
from selector.figures.panels import Line, Panel, stacked
from selector.number_text import number_text, round_below, span_text
from selector.physics.thermal.drift_quantities import largest_displacement
from selector.recording import Channel, Recording
from selector.types import Array, Indices, Vector

MOST_IN_A_PANEL = 12
_DASHES = ("solid", "dash", "dot")
_ELSEWHERE = "elsewhere"


def inputs_and_displacements(recording: Recording, run: str, inputs: Sequence[str]) -> go.Figure:
    """Speed, torque, fluids and switches, and below them the displacements; `inputs` names the channels that act."""
    time_s = recording.time_s(run)
    acting = [recording.channel(name) for name in inputs]
    moving = [recording.channel(name) for name in recording.with_role("displacement") if name not in inputs]
    panels = []
    for axis, roles, least in (
        ("speed [r/min]", ("spindle_speed",), 0.0),
        ("air, coolant [°C]", ("ambient", "temperature"), None),
    ):
        if chosen := [channel for channel in acting if channel.role in roles]:
            panels.append(Panel(axis, _lines(recording, run, chosen, steps=True), 110, least=least))
    for channel in acting:
        if channel.role == "state":
            unit = "[N·m]" if "N·m" in (channel.place or "") else "[0, 1]"
            # the name stands beside the line
            panels.append(Panel(unit, _lines(recording, run, [channel], steps=True), 70, least=0.0))
    panels.append(Panel("displacement [µm]", _lines(recording, run, moving), 300, least=0.0))
    most, at_s, um = largest_displacement(recording, run)
    moves = f"{style.label(most)} moves most, by {number_text(um)} µm after {span_text(at_s)}"
    return stacked(f"Simulated: {moves if most else 'no displacement'}", panels, float(time_s[-1]))


def temperatures(recording: Recording, run: str, inputs: Sequence[str]) -> go.Figure:
    """The thermometers in groups by the part they sit on: the first words of their places, up to a comma.

    Those that are alone on their part share a panel.
    """
    names = [name for name in recording.with_role("temperature") if name not in inputs]
    rise = {name: _rise(recording, run, name) for name in names}
    groups: dict[str, list[Channel]] = {}
    for name in names:
        channel = recording.channel(name)
        part = (channel.place or "").split(",")[0].strip() or _ELSEWHERE
        groups.setdefault(part, []).append(channel)
    alone = [channel for channels in groups.values() if len(channels) == 1 for channel in channels]
    if len(alone) > 1:
        groups = {part: channels for part, channels in groups.items() if len(channels) > 1}
        groups |= {_ELSEWHERE: [*groups.get(_ELSEWHERE, []), *alone]}
    warmest = max(names, key=lambda name: abs(rise[name]))
    verb = "warms" if rise[warmest] >= 0 else "cools"
    title = f"Simulated: {style.label(warmest)} {verb} most, by {number_text(abs(rise[warmest]))} K"
    panels = []
    for part, channels in groups.items():
        shown = _spread(channels, rise)
        text = style.label(part, 16)
        panels.append(Panel(f"{text} [°C]", _lines(recording, run, shown), max(110, 19 * len(shown))))
    return stacked(title, panels, float(recording.time_s(run)[-1]))


def _lines(
    recording: Recording, run: str, channels: Sequence[Channel], dashes: Sequence[str] = _DASHES, **look: Any
) -> list[Line]:
    time_s, count = recording.time_s(run), len(style.GROUPS)
    lines = []
    for k, channel in enumerate(channels):
        colour, dash = style.GROUPS[k % count], dashes[k // count % len(dashes)]
        lines.append(Line(channel.name, time_s, recording.values(run, [channel.name])[:, 0], colour, dash=dash, **look))
    return lines


def _rise(recording: Recording, run: str, name: str) -> float:
    course = recording.values(run, [name])[:, 0] - recording.values(run, [name])[0, 0]
    return float(course[int(np.nanargmax(np.abs(course)))])


def _spread(channels: Sequence[Channel], rise: Mapping[str, float]) -> list[Channel]:
    """All channels of a part, or of many some from the one that warms least to the one that warms most."""
    if len(channels) <= MOST_IN_A_PANEL:
        return list(channels)
    ranked = sorted(channels, key=lambda channel: rise[channel.name])
    kept = {ranked[k].name for k in np.linspace(0, len(ranked) - 1, MOST_IN_A_PANEL).round().astype(int).tolist()}
    return [channel for channel in channels if channel.name in kept]


MOST_NAMED = 8  #: More lines in a panel than this are drawn thin, and named by hovering only.

_PANELS: tuple[tuple[str, tuple[str, ...], int], ...] = (
    ("displacement", ("displacement",), 170),
    ("temperature", ("temperature", "ambient"), 200),
    ("speed", ("spindle_speed",), 80),
)
_OTHER_PX, _MOST_OTHERS = 90, 6
_UNITS = {"degC": "°C", "um": "µm", "rpm": "1/min"}


def courses(
    recording: Recording, run: str, faults_s: Mapping[str | None, Sequence[tuple[float, float]]] = MappingProxyType({})
) -> go.Figure:
    """Displacements, temperatures, speed, and up to six further roles of a run; nothing is left out of a panel.

    `faults_s`: channel, or None for all of them → stretches that are shaded, from the start of the run [s].
    """
    time_s = recording.time_s(run)
    end_s = float(time_s[-1])
    panels, drawn_channels = [], []
    taken = {role for _, roles, _ in _PANELS for role in roles}
    others = dict.fromkeys(channel.role for channel in recording.channels if channel.role not in taken)
    further = [(role.replace("_", " "), (role,), _OTHER_PX) for role in list(others)[:_MOST_OTHERS]]
    for text, roles, height in (*_PANELS, *further):
        if chosen := _recorded(recording, run, roles):
            spans: dict[tuple[float, float], str] = {}
            for name in [None, *(channel.name for channel in chosen)]:
                for start, stop in faults_s.get(name, ()):
                    span = max(start, 0.0), min(stop, end_s)
                    spans[span] = ", ".join(filter(None, [spans.get(span), name]))
            lines = _lines(recording, run, chosen, _DASHES[:1])
            if len(lines) > MOST_NAMED:
                lines = [replace(line, name="", width=1.0) for line in lines]
            unit = _UNITS.get(chosen[0].unit, chosen[0].unit)
            panels.append(Panel(f"{text} [{unit}]", lines, height, spans_s=spans))
            drawn_channels += chosen
    drawn = stacked(f"Run {style.label(run)}", panels, end_s)
    for line, channel in zip(drawn.data, drawn_channels, strict=True):
        named = f"<extra>{style.label(channel.name)}</extra>"
        line.update(name=style.label(channel.name), hovertemplate=line.hovertemplate.partition("<extra>")[0] + named)
    return drawn


def _recorded(recording: Recording, run: str, roles: tuple[str, ...]) -> list[Channel]:
    named = [channel for channel in recording.channels if channel.role in roles]
    return [channel for channel in named if np.isfinite(recording.values(run, [channel.name])).any()]


_HEIGHT = 640
_SHOWN_SHARE = 0.08
_MOST_LABELS = 12
_HEAT_SCALE = ((0.0, "#f2f0ea"), (0.3, "#f6c667"), (0.6, "#e2652a"), (1.0, "#6b0f1a"))
_SIZE_SCALE = style.LIKENESS_SCALE
_CAMERA = {"eye": {"x": 1.5, "y": 1.7, "z": 0.9}, "center": {"x": 0, "y": 0, "z": -0.08}}
#: Without the two epsilons, cells of some millimetres have no normal, and are drawn as dark patches.
_LIGHT = {"ambient": 0.75, "diffuse": 0.5, "specular": 0.05, "facenormalsepsilon": 0.0, "vertexnormalsepsilon": 0.0}
_ON_THE_MACHINE_M = 0.15
_TRIED = 200
_ROOM_M = 0.04
_BESIDE_M = 0.05  #: Distance of a sensor's mark from the surface, so that it is not half inside.


def machine_field(
    nodes_m: Array,
    triangles: Indices,
    temperature_degc: Array,
    deformation_um: Array,
    title: str,
    places_m: Mapping[str, tuple[float, float, float]] | None = None,
) -> go.Figure:
    """Temperature of the surface beside its deformation, which is scaled so that it can be seen; the scale is stated.

    The picture can be turned with the mouse.

    `nodes_m` has the shape (n_nodes, 3) [m], Z upwards; `triangles`, (n_triangles, 3), are nodes of the surface.
    `title` says when this is, and under which load; `places_m` are those of sensors [m], drawn on the surface that is
    nearest.
    """
    nodes, corners = np.unique(triangles, return_inverse=True)
    corners = corners.reshape(triangles.shape)
    place, moved = nodes_m[nodes], deformation_um[nodes]
    size = np.linalg.norm(moved, axis=1)
    extent = float(np.ptp(place, axis=0).max())
    scale = round_below(_SHOWN_SHARE * extent / max(float(size.max()) * 1e-6, 1e-12))
    drawn = style.figure(style.label(title, 200), _HEIGHT)
    count = np.uint16 if len(place) < 2**16 else np.int32
    parts = (
        ("scene", place, temperature_degc[nodes], _HEAT_SCALE, "temperature [°C]", 0.44, "%{intensity:.2f} °C"),
        ("scene2", place + moved * 1e-6 * scale, size, _SIZE_SCALE, "displacement [µm]", 1.0, "%{intensity:.1f} µm"),
    )
    for scene, points, values, colours, text, bar_at, hover in parts:
        drawn.add_mesh3d(
            **dict(zip("xyz", points.T.astype(np.float32), strict=True)),
            **dict(zip("ijk", corners.T.astype(count), strict=True)),
            intensity=values.astype(np.float32),
            colorscale=colours,
            colorbar={"title": {"text": text, "side": "right"}, "thickness": 14, "len": 0.7, "x": bar_at},
            flatshading=True,
            lighting=_LIGHT,
            hovertemplate=hover + "<extra></extra>",
            scene=scene,
        )
    everything = np.vstack([place, place + moved * 1e-6 * scale])
    if places_m:
        marks = _on_the_surface(np.array(list(places_m.values()), dtype=np.float64), place, corners)
        names = [style.label(name) for name in places_m]
        drawn.add_scatter3d(
            **dict(zip("xyz", marks.T.astype(np.float32), strict=True)),
            mode="markers+text" if len(names) <= _MOST_LABELS else "markers",
            text=names,
            textposition="top center",
            textfont={"size": 11},
            marker={"size": 4, "color": style.PREDICTED, "line": {"color": "#ffffff", "width": 1}},
            hovertemplate="%{text}<extra></extra>",
            showlegend=False,
            scene="scene",
        )
        everything = np.vstack([everything, marks])
    low, high = everything.min(axis=0) - _ROOM_M, everything.max(axis=0) + _ROOM_M
    axes = {
        f"{name}axis": {"title": {"text": f"{name.upper()} [m]"}, "nticks": 5, "range": [float(low[k]), float(high[k])]}
        for k, name in enumerate("xyz")
    }
    drawn.update_layout(
        scene={"domain": {"x": [0.02, 0.46]}, "aspectmode": "data", "camera": _CAMERA, **axes},
        scene2={"domain": {"x": [0.54, 0.98]}, "aspectmode": "data", "camera": _CAMERA, **axes},
        margin={"l": 0, "r": 0, "b": 10},
    )
    heading = "temperature" + (f", with {len(places_m)} thermometer{'s' * (len(places_m) != 1)}" if places_m else "")
    larger = f"{scale:,.0f}".replace(",", " ")
    for at, text in ((0.22, heading), (0.76, f"deformation, drawn {larger} times larger")):
        above = {"xref": "paper", "yref": "paper", "xanchor": "center", "yanchor": "bottom"}
        drawn.add_annotation(style.words(f"<b>{text}</b>", at, 1.0, **above))
    return drawn


def _on_the_surface(points_m: Vector, nodes_m: Vector, corners: Indices) -> Vector:
    """Beside the nearest triangle that looks outwards; points that are far from the machine stay."""
    ends = nodes_m[corners]
    normals = np.cross(ends[:, 1] - ends[:, 0], ends[:, 2] - ends[:, 0])
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-30)
    marks, middle = points_m.copy(), nodes_m.mean(axis=0)
    for mark in marks:
        touched = _in_triangles(mark, ends)
        distance = np.linalg.norm(touched - mark, axis=1)
        near = np.argsort(distance, kind="stable")[:_TRIED]
        near = near[distance[near] < _ON_THE_MACHINE_M]
        # walls of chambers look towards the middle
        outside = near[(normals[near] * (touched[near] - middle)).sum(axis=1) > 0.0]
        if len(near):
            nearest = int(outside[0] if len(outside) else near[0])
            mark[:] = touched[nearest] + _BESIDE_M * normals[nearest]
    return marks


def _in_triangles(point_m: Vector, ends_m: Vector) -> Vector:
    """A point of every triangle near this one: its foot on the plane, drawn in where that is outside."""
    first, second = ends_m[:, 1] - ends_m[:, 0], ends_m[:, 2] - ends_m[:, 0]
    along = point_m - ends_m[:, 0]
    a, b, c = (first * first).sum(axis=1), (first * second).sum(axis=1), (second * second).sum(axis=1)
    d, e = (along * first).sum(axis=1), (along * second).sum(axis=1)
    size = np.maximum(a * c - b * b, 1e-30)
    v, w = (c * d - b * e) / size, (a * e - b * d) / size
    shares = np.maximum(np.stack([1.0 - v - w, v, w], axis=1), 0.0)
    return np.asarray(np.einsum("tk,tkx->tx", shares / shares.sum(axis=1, keepdims=True), ends_m))
