"""What was recorded in a run: its channels over time, those of one kind in one panel."""

from __future__ import annotations

import numpy as np
import plotly.graph_objects as go

from selector.figures import style
from selector.figures.panels import Line, Panel, stacked
from selector.recording import Channel, Recording

MOST_NAMED = 8
"""More lines in a panel than this are drawn thin, and named by hovering only."""

_PANELS: tuple[tuple[str, tuple[str, ...], int], ...] = (
    ("displacement", ("displacement",), 170),
    ("temperature", ("temperature", "ambient"), 200),
    ("speed", ("spindle_speed",), 80),
)
_OTHER_PX, _MOST_OTHERS = 90, 6


def courses(recording: Recording, run: str) -> go.Figure:
    """Displacements, temperatures, speed, and up to six further roles of a run; nothing is left out of a panel."""
    time_s = recording.time_s(run)
    panels, drawn_channels = [], []
    taken: set[str] = set()
    for text, roles, height in _PANELS:
        taken |= set(roles)
        if chosen := _recorded(recording, run, roles):
            panels.append(Panel(f"{text} [{_unit(chosen[0])}]", _lines(recording, run, chosen), height))
            drawn_channels += chosen
    others = dict.fromkeys(channel.role for channel in recording.channels if channel.role not in taken)
    for role in list(others)[:_MOST_OTHERS]:
        if chosen := _recorded(recording, run, (role,)):
            text = f"{role.replace('_', ' ')} [{_unit(chosen[0])}]"
            panels.append(Panel(text, _lines(recording, run, chosen), _OTHER_PX))
            drawn_channels += chosen
    drawn = stacked(f"Run {style.label(run)}", panels, float(time_s[-1]))
    for line, channel in zip(drawn.data, drawn_channels, strict=True):
        named = f"<extra>{style.label(channel.name)}</extra>"
        line.update(name=style.label(channel.name), hovertemplate=line.hovertemplate.partition("<extra>")[0] + named)
    return drawn


def _recorded(recording: Recording, run: str, roles: tuple[str, ...]) -> list[Channel]:
    """Channels of these roles with a value in this run."""
    named = [channel for channel in recording.channels if channel.role in roles]
    return [channel for channel in named if np.isfinite(recording.values(run, [channel.name])).any()]


def _lines(recording: Recording, run: str, channels: list[Channel]) -> list[Line]:
    time_s = recording.time_s(run)
    are_many = len(channels) > MOST_NAMED
    return [
        Line(
            "" if are_many else channel.name,
            time_s,
            recording.values(run, [channel.name])[:, 0],
            style.GROUPS[number % len(style.GROUPS)],
            width=1.0 if are_many else 1.8,
        )
        for number, channel in enumerate(channels)
    ]


def _unit(channel: Channel) -> str:
    return {"degC": "°C", "um": "µm", "rpm": "1/min"}.get(channel.unit, channel.unit)
