"""A simulated run: what is done to the machine, how it warms and moves, and where its heat goes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import plotly.graph_objects as go

from selector.figures import style
from selector.figures.panels import Line, Panel, stacked
from selector.recording import Channel, Recording

MOST_IN_A_PANEL = 12
MOST_BARS = 12
_DASHES = ("solid", "dash", "dot")
_IN, _OUT, _KEPT = style.RESIDUAL, style.PREDICTED, style.CHOSEN
_ELSEWHERE = "elsewhere"


def inputs_and_displacements(recording: Recording, run: str, inputs: Sequence[str]) -> go.Figure:
    """Speed, torque, fluids and switches, and below them the displacements; `inputs` names the channels that act."""
    time_s = recording.time_s(run)
    acting = [recording.channel(name) for name in inputs]
    moving = [recording.channel(name) for name in recording.with_role("displacement") if name not in inputs]
    panels = []
    for axis, chosen, height in (
        ("speed [r/min]", [c for c in acting if c.role == "spindle_speed"], 110),
        ("air, coolant [°C]", [c for c in acting if c.role in ("ambient", "temperature")], 110),
    ):
        if chosen:
            panels.append(Panel(axis, _lines(recording, run, chosen, steps=True), height, least=_zero_of(axis)))
    for channel in acting:
        if channel.role == "state":
            unit = "[N·m]" if "N·m" in (channel.place or "") else "[0, 1]"
            panels.append(
                Panel(
                    unit,  # the name stands beside the line
                    _lines(recording, run, [channel], steps=True),
                    70,
                    least=0.0,
                )
            )
    panels.append(Panel("displacement [µm]", _lines(recording, run, moving), 300, least=0.0))
    most, at_s, um = largest_displacement(recording, run)
    unit, seconds = style.time_unit(float(time_s[-1]))
    title = (
        f"Simulated: {style.label(most)} moves most, by {style.number(um)} µm after {at_s / seconds:.3g} {unit}"
        if most
        else "Simulated: no displacement"
    )
    return stacked(title, panels, float(time_s[-1]))


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
    title = f"Simulated: {style.label(warmest)} {verb} most, by {style.number(abs(rise[warmest]))} K"
    panels = []
    for part, channels in groups.items():
        shown = _spread(channels, rise)
        text = style.label(part, 16)
        panels.append(Panel(f"{text} [°C]", _lines(recording, run, shown), max(110, 19 * len(shown))))
    return stacked(title, panels, float(recording.time_s(run)[-1]))


def heat_balance(balance: Mapping[str, Any]) -> go.Figure:
    """Heat that every source brought, every surface gave to its fluid, and that stayed, over the whole run."""
    sources = {name: float(j) for name, j in balance["sources_j"].items()}
    films = {name: float(j) for name, j in balance["films_j"].items()}
    kept = float(balance["stored_j"])
    came = sum(max(j, 0.0) for j in sources.values()) + sum(max(-j, 0.0) for j in films.values()) + max(-kept, 0.0)
    unit, joules = next((u, j) for u, j in (("GJ", 1e9), ("MJ", 1e6), ("kJ", 1e3), ("J", 1.0)) if came >= j or u == "J")
    went = sum(max(j, 0.0) for j in films.values())
    title = (
        "Simulated: no heat"
        if came == 0
        else (
            f"Simulated: of {style.number(came / joules)} {unit} of heat, {100 * went / came:.0f} % went into air and "
            f"coolant and {100 * max(kept, 0.0) / came:.0f} % stayed in the machine"
        )
    )
    rows = [(name, j, _IN) for name, j in _largest(sources, "source")]
    rows += [(name, -j, _OUT) for name, j in _largest(films, "surface")]
    rows.append(("stayed in the machine" if kept >= 0 else "given off by the machine itself", -kept, _KEPT))
    drawn = style.figure(title, 130 + 24 * len(rows))
    drawn.add_bar(
        x=[j / joules for _, j, _ in rows],
        y=list(range(len(rows))),
        orientation="h",
        marker={"color": [colour for _, _, colour in rows]},
        text=[style.number(j / joules) for _, j, _ in rows],
        textposition="outside",
        cliponaxis=False,
        hovertemplate=f"%{{x:.4g}} {unit}<extra></extra>",
        showlegend=False,
    )
    drawn.update_xaxes(title_text=f"heat into the machine, out of it to the left [{unit}]", zeroline=True)
    drawn.update_layout(xaxis={"zerolinecolor": style.INK}, bargap=0.3)
    drawn.update_yaxes(
        range=[len(rows) - 0.5, -0.5],
        tickvals=list(range(len(rows))),
        ticktext=[style.label(name, 40) for name, _, _ in rows],
        showgrid=False,
        ticks="",
    )
    return drawn


def _largest(amounts: Mapping[str, float], what: str) -> list[tuple[str, float]]:
    """The largest amounts by name, and the sum of the others."""
    ranked = sorted(amounts.items(), key=lambda item: -abs(item[1]))
    told = [(f"{name}, {what}", amount) for name, amount in ranked[:MOST_BARS]]
    rest = ranked[MOST_BARS:]
    return told + ([(f"{len(rest)} more {what}s", sum(amount for _, amount in rest))] if rest else [])


def largest_displacement(recording: Recording, run: str) -> tuple[str, float, float]:
    """(channel, time [s], displacement [µm]) of the largest displacement from the start of a run; no name if none."""
    best = ("", 0.0, 0.0)
    for name in recording.with_role("displacement"):
        course = recording.values(run, [name])[:, 0]
        course = course - course[0]
        if not np.isfinite(course).any():
            continue
        k = int(np.nanargmax(np.abs(course)))
        if abs(course[k]) > abs(best[2]):
            best = (name, float(recording.time_s(run)[k]), float(course[k]))
    return best


def _lines(recording: Recording, run: str, channels: Sequence[Channel], *, steps: bool = False) -> list[Line]:
    time_s = recording.time_s(run)
    count = len(style.GROUPS)
    return [
        Line(
            channel.name,
            time_s,
            recording.values(run, [channel.name])[:, 0],
            style.GROUPS[k % count],
            steps=steps,
            dash=_DASHES[k // count % len(_DASHES)],
        )
        for k, channel in enumerate(channels)
    ]


def _zero_of(axis: str) -> float | None:
    return 0.0 if axis.startswith("speed") else None


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
