"""Offset, gain and delay that are the same in all runs: is the recording at fault, or the simulation."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from selector.diagnosis.comparison import Comparison
from selector.diagnosis.effects.data.gain import known_factor
from selector.diagnosis.effects.effect import Quantity
from selector.diagnosis.evidence.recalibration import Recalibrated

_FORCES = ("force", "current", "voltage")
_HEATED = ("displacement", "size", "temperature", "ambient")


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
    scales = {name: value for name, value in off["gain"].items() if known_factor(value) or _alone(off["gain"], again)}
    if scales:
        found["data.gain"] = dict.fromkeys(scales, "gain")
    forces = {name: value for name, value in off["offset"].items() if comparison.channel(name).role in _FORCES}
    if forces:
        found["drive.offset_force"] = dict.fromkeys(forces, "offset")
    elif _alone(off["offset"], again):
        found["data.zero"] = dict.fromkeys(off["offset"], "offset")
    if _alone(off["delay"], again):
        found["data.clock"] = dict.fromkeys(off["delay"], "delay")
    return found


def _alone(off: Mapping[str, Quantity], again: Mapping[str, Recalibrated]) -> bool:
    """Whether one of several responses is off, and the others are known not to be as much."""
    return len(off) == 1 < len(again)


def _is_off(one: Recalibrated, word: str) -> bool:
    value = one.quantities.get(word)
    if value is None or not one.matters or value.low is None or value.high is None:
        return False
    neutral = 1.0 if word == "gain" else 0.0
    error = (value.high - value.low) / 3.92
    return abs(value.value - neutral) > 6.0 * max(error, 1e-300) and np.isfinite(value.value)
