"""A simulated run, or a recorded one: what is done to the machine, how it warms and moves."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from types import MappingProxyType
from typing import Any

import numpy as np
import plotly.graph_objects as go

from selector.figures import style
from selector.figures.panels import Line, Panel, stacked
from selector.number_text import number_text, span_text
from selector.physics.thermal.drift_quantities import largest_displacement
from selector.recording import Channel, Recording

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
