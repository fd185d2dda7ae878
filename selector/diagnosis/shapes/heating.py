"""Which recorded channels heat, cool or surround the machine, in the roles and words of the machine file."""

from __future__ import annotations

import re
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from selector.diagnosis.comparison import Comparison
from selector.diagnosis.shapes.signals import course, excited, filled, rate, rise
from selector.quality.wording import duration
from selector.recording import Channel

Vector = NDArray[np.float64]

SHORTEST_S = 600.0
"""Runs shorter than this show no heat: the fastest parts of machines take minutes."""
_WARMED = ("displacement", "temperature")
_HALL = r"\bhall\b|\broom\b|ambient|\bair\b|environment|raum|umgebung|luft|цех|воздух|окруж|环境|室温|车间"
_COOLANT = r"cool|chill|emulsion|\bkss\b|flood|\bjets?\b|kühl|охлажд|сож|冷却|切削液"
_SOURCE = (
    r"hydr|\btank|feed|axis|servo|motor|gear|drive|\bfan\b|compress|lamp|light|chip|convey|clamp|door|cabinet|electr|"
    r"supply|getriebe|antrieb|гидро|двигат|привод|бак|液压|电机|油箱"
)
_SQUARED = ("current", "force", "voltage", "acceleration")
_MOVING = ("feed_rate", "velocity")
_SWITCHED = ("state", "flow")


@dataclass(frozen=True)
class Sources:
    """Names of the channels that move, by what they do to the machine's heat.

    Attributes
    ----------
    spindle : str or None
        The spindle speed.
    hall : tuple of str
        Temperatures of the surroundings.
    machine : tuple of str
        Temperatures of the machine, without the response itself.
    coolant_switches, coolant_temperatures : tuples of str
        State or flow of the coolant; its temperature.
    other_heat : tuple of str
        Channels of other heat: feeds, currents, states of other devices.
    """

    spindle: str | None
    hall: tuple[str, ...]
    machine: tuple[str, ...]
    coolant_switches: tuple[str, ...]
    coolant_temperatures: tuple[str, ...]
    other_heat: tuple[str, ...]


@lru_cache(maxsize=16)
def sources(comparison: Comparison, response: str) -> Sources:
    """What heats, cools or surrounds the machine of this comparison, as far as it was recorded and moves."""
    moving = [
        channel
        for channel in comparison.channels
        if channel.name != response and excited(course(comparison, channel.name), _grain(comparison, channel))
    ]
    warm = [channel for channel in moving if channel.role == "temperature"]
    switched = [channel for channel in moving if channel.role in _SWITCHED and channel.name not in comparison.responses]
    coolant = [channel for channel in switched if _says(channel, _COOLANT)]
    if not coolant:
        coolant = [channel for channel in switched if not _says(channel, _SOURCE)][:1]
    hall = [c for c in moving if c.role == "ambient"] + [c for c in warm if _says(c, _HALL)]
    fluid = [channel for channel in warm if _says(channel, _COOLANT) and channel not in hall]
    others = [
        channel
        for channel in moving
        if channel.name not in comparison.responses
        and (channel.role in (*_MOVING, *_SQUARED, "position") or (channel in switched and channel not in coolant))
    ]
    commands = [c for c in moving if c.role == "position_command" and c.axis not in {o.axis for o in others}]
    return Sources(
        spindle=next((channel.name for channel in moving if channel.role == "spindle_speed"), None),
        hall=_named(hall),
        machine=_named([channel for channel in warm if channel not in hall and channel not in fluid]),
        coolant_switches=_named(coolant),
        coolant_temperatures=_named(fluid),
        other_heat=_named(others + commands),
    )


def says_other_source(channel: Channel) -> bool:
    """Whether the name or place speaks of a device that heats and is no spindle."""
    return _says(channel, _SOURCE)


def lacking(comparison: Comparison, response: str) -> str | None:
    """Why no thermal effect can be tested in this response; None if it can."""
    role = comparison.channel(response).role
    if role not in _WARMED:
        return f"heat shows in displacements and temperatures, and {response} is a channel of role {role}"
    if comparison.longest_s < SHORTEST_S:
        return f"the longest run takes {duration(comparison.longest_s)}, heat needs {duration(SHORTEST_S)} or more"
    if len(comparison.time_s) < 20 * len(comparison.runs):
        return "fewer than 20 samples a run"
    return None


def speed_power(comparison: Comparison, name: str, exponent: float) -> Vector:
    """(n / n_max)^p of a channel of speed, shape (n_rows,)."""
    speed = np.abs(course(comparison, name))
    return np.asarray((speed / max(float(speed.max()), 1e-300)) ** exponent)


def top_speed_rpm(comparison: Comparison, name: str) -> float:
    """Highest recorded spindle speed [rpm]: the one that `speed_power` counts from."""
    return float(np.abs(course(comparison, name)).max())


def switched_on(comparison: Comparison, name: str) -> Vector:
    """State or flow as a part of its largest value, 0 to 1."""
    values = np.abs(course(comparison, name))
    return np.asarray(values / max(float(values.max()), 1e-300))


def heats(comparison: Comparison, name: str) -> tuple[tuple[str, Vector], ...]:
    """Heat flows that a channel may stand for, each with words and as a part of its largest value."""
    role = comparison.channel(name).role
    values = course(comparison, name)
    if role in ("position", "position_command"):
        values = rate(comparison, values)
    values = np.abs(values)
    part = values / max(float(values.max()), 1e-300)
    if role in _SWITCHED:
        return ((name, part),)
    word = f"|d {name}/dt|" if role.startswith("position") else f"|{name}|"
    return ((word, part), (f"{name}²" if role in _SQUARED else f"{word}²", part**2))


def temperature_rise(comparison: Comparison, name: str) -> Vector:
    """What a recorded temperature has risen since the start of its run [K]."""
    return rise(comparison, course(comparison, name))


def simulated_rise(comparison: Comparison, response: str) -> Vector:
    """What the simulated course has risen since the start of its run [unit of the response], without holes."""
    return rise(comparison, filled(comparison, comparison.simulated[response]), over_samples=1)


def shown_unit(unit: str) -> str:
    """The unit of a response as people write it; differences of temperatures are in K."""
    return {"um": "µm", "degC": "K"}.get(unit, unit)


def _grain(comparison: Comparison, channel: Channel) -> float:
    """Resolution of a sensor; the steps of what is switched or set are no resolution."""
    return comparison.resolution.get(channel.name, 0.0) if channel.role in ("temperature", "ambient") else 0.0


def _says(channel: Channel, words: str) -> bool:
    text = f"{channel.name} {channel.place or ''}".lower().replace("_", " ")
    return re.search(words, text) is not None


def _named(channels: list[Channel]) -> tuple[str, ...]:
    return tuple(dict.fromkeys(channel.name for channel in channels))
