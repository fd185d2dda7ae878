"""Which allowance did a run have of which the feed was recorded, but not the allowance itself."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from selector.findings import Finding, Where
from selector.physics.gauging.gauging_channels import UM_PER_S
from selector.physics.gauging.gauging_model import GaugingModel
from selector.physics.gauging.model_length import finest_s
from selector.physics.gauging.process import Noise, Surface
from selector.physics.gauging.threshold import wear_share
from selector.physics.gauging.voltage_course import SeenSurface, voltage_course

Vector = NDArray[np.float64]

_REACH = 0.02
"""Share of what the gauge can show that its ends are taken for: beyond its reach it says nothing of the allowance."""

_FINER = 4


def fallen_um(model: GaugingModel, time_s: Vector, feed_mm_per_min: Vector) -> Vector:
    """What is ground off under a recorded feed, held from sample to sample, as wheel and springs of the file follow it.

    Shape of `time_s` [µm].
    """
    grinding = model.values.grinding
    feed = np.maximum(feed_mm_per_min, 0.0) * UM_PER_S
    rate = feed / (1.0 + wear_share(grinding))
    steps, lag_s = np.diff(time_s), grinding.lag_s
    if lag_s == 0:
        return np.concatenate([[0.0], np.cumsum(rate[:-1] * steps)])
    removal, fallen = 0.0, np.zeros(len(time_s))
    for k, (step_s, wanted) in enumerate(zip(steps.tolist(), rate[:-1].tolist(), strict=True)):
        left = np.exp(-step_s / lag_s)
        fallen[k + 1] = fallen[k] + wanted * step_s + (removal - wanted) * lag_s * (1.0 - left)
        removal = wanted + (removal - wanted) * left
    return fallen


def start_um(model: GaugingModel, time_s: Vector, fallen: Vector, shown_um: Vector | None) -> float | None:
    """The allowance at the start that a recorded gauge says, `shown_um` being what it measured [µm].

    While it first is within its reach, for a time T_Φ or a turn: what it measured, and what was ground off until then
    as its filter has it. None: nothing was recorded of it, or never within its reach.
    """
    if shown_um is None:
        return None
    known, curve = np.isfinite(shown_um), model.characteristic
    if curve is not None:
        least, most = curve.monotone_um
        room = _REACH * (most - least)
        known &= (shown_um > least + room) & (shown_um < most - room)
    if not known.any():
        return None
    made = model.values
    # grooves that are deeper than the gauge reaches have no mean in µm
    surface = made.surface if curve is None else Surface()
    seen = SeenSurface(surface, Noise())
    behind = voltage_course(lambda um: um, made.filter_s, time_s, -fallen, seen, finest_s(made) / _FINER)
    turn_s = 60.0 / surface.workpiece_rpm if surface.workpiece_rpm > 0 else 0.0
    first_s = float(time_s[np.argmax(known)])
    early = known & (time_s <= first_s + max(made.filter_s, turn_s))
    return float(np.mean(shown_um[early] - behind[early]))


def start_finding(run: str, begins_um: float, channel: str | None, of_file_um: float) -> Finding:
    """Where the allowance of a run begins of which only the feed was recorded; `channel` says it, or the file."""
    if channel is not None:
        return Finding(
            "start-from-gauge",
            "info",
            f"Of {run} the feed was recorded and no allowance: it begins at {begins_um:.4g} µm, as {channel} says at "
            f"first (the mean of the model file is {of_file_um:.4g} µm).",
            Where(channel=channel, run=run),
            {"begins_um": begins_um, "of_file_um": of_file_um},
            "differences of the gauge count from there: an offset of the whole gauge does not show",
        )
    return Finding(
        "start-from-file",
        "warning",
        f"Of {run} the feed was recorded, and neither the allowance nor what the gauge showed within its reach: the "
        f"allowance begins at {begins_um:.4g} µm, the mean of the model file.",
        Where(run=run),
        {"begins_um": begins_um},
        "a part that had another allowance is off by the difference all the way: set grinding.allowance_um to its own",
    )
