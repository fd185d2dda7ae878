"""How times, places and quantities are said in a finding."""

from __future__ import annotations

from selector.recording import Channel

_UNITS = {"degC": "°C", "um": "µm", "1": ""}


def duration(seconds: float) -> str:
    """A duration as people say it, e.g. ``"45 s"``, ``"12 min"``, ``"3.5 h"``."""
    if seconds < 120:
        return f"{seconds:.3g} s"
    if seconds < 7200:
        return f"{seconds / 60:.3g} min"
    return f"{seconds / 3600:.3g} h"


def moment(seconds: float) -> str:
    """A time from the start of the run: seconds, and a larger unit where it helps."""
    plain = f"{seconds:.7g} s"
    return plain if seconds < 120 else f"{plain} ({duration(seconds)})"


def stretch(from_s: float, to_s: float) -> str:
    """A stretch of time from the start of the run."""
    if from_s == to_s:
        return f"at {moment(from_s)}"
    return f"from {moment(from_s)} to {moment(to_s)}"


def reading(value: float, channel: Channel) -> str:
    """A value with its unit; a temperature to 0.01 °C, as no thermometer on a machine tells more."""
    shown = f"{value if channel.unit != 'degC' else round(value, 2) + 0.0:.6g}"
    return _true_minus(f"{shown} {_UNITS.get(channel.unit, channel.unit)}".rstrip())


def difference(value: float, channel: Channel) -> str:
    """A difference of two values with its unit: of temperatures in K."""
    unit = "K" if channel.unit == "degC" else _UNITS.get(channel.unit, channel.unit)
    return _true_minus(f"{value:.3g} {unit}".rstrip())


def _true_minus(text: str) -> str:
    return f"−{text[1:]}" if text.startswith("-") else text
