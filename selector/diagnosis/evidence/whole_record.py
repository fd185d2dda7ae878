"""Offset, gain and delay that are the same in all runs: is the recording at fault, or the simulation."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from selector.diagnosis.comparison import Comparison
from selector.diagnosis.effects.data.gain import known_factor
from selector.diagnosis.effects.effect import Quantity
from selector.diagnosis.evidence.recalibration import Recalibrated

_FORCES = ("force", "current", "voltage")
_NEUTRAL = {"gain": 1.0, "offset": 0.0, "delay": 0.0}
_OFF, _RIGHT, _APART = 6.0, 3.0, 4.0
"""Standard errors from which a quantity is off, up to which it is right, and from which two of them differ."""


def whole_record_names(comparison: Comparison, again: Mapping[str, Recalibrated]) -> dict[str, dict[str, str]]:
    """Effect → response → the quantity of the recalibration that shows it, where it is no mere miscalibration.

    A wrong parameter of the simulation rarely moves one response of several and leaves the others exactly right; a
    wrong scale, zero or clock of one channel does just that. A factor that separates two units is the unit. A constant
    force where the axis stands as well is a force (a cable, a weight), if not the zero of its amplifier.
    """
    off = {
        word: {name: one.quantities[word] for name, one in again.items() if _is_off(one, word)}
        for word in ("gain", "offset", "delay")
    }
    found: dict[str, dict[str, str]] = {}
    alone = {word: _alone(word, values, again) for word, values in off.items()}
    scales = {name: value for name, value in off["gain"].items() if known_factor(value) or alone["gain"]}
    if scales:
        found["data.gain"] = dict.fromkeys(scales, "gain")
    forces = {name: value for name, value in off["offset"].items() if comparison.channel(name).role in _FORCES}
    if forces:
        found["drive.offset_force"] = dict.fromkeys(forces, "offset")
    elif alone["offset"]:
        found["data.zero"] = dict.fromkeys(off["offset"], "offset")
    if alone["delay"]:
        found["data.clock"] = dict.fromkeys(off["delay"], "delay")
    return found


def _alone(word: str, off: Mapping[str, Quantity], again: Mapping[str, Recalibrated]) -> bool:
    """Whether one of several responses is off, and the others are known to be right, and not as far off as it.

    Others that are off as well, by less than is sure, or not known well enough to say, speak of the simulation.
    """
    if len(off) != 1 or len(again) == 1:
        return False
    ((name, value),) = off.items()
    others = [one.quantities.get(word) for key, one in again.items() if key != name]
    return all(
        other is not None
        and abs(other.value - _NEUTRAL[word]) <= _RIGHT * _error(other)
        and abs(other.value - value.value) >= _APART * np.hypot(_error(other), _error(value))
        for other in others
    )


def _is_off(one: Recalibrated, word: str) -> bool:
    value = one.quantities.get(word)
    if value is None or not one.matters:
        return False
    return abs(value.value - _NEUTRAL[word]) > _OFF * _error(value) and bool(np.isfinite(value.value))


def _error(value: Quantity) -> float:
    """Standard error by the interval; infinite without one."""
    if value.low is None or value.high is None:
        return np.inf
    return max((value.high - value.low) / 3.92, 1e-300)
