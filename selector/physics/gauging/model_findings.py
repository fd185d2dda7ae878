"""What is odd about gauging before a part is ground: numbers, reach of the gauge, slow parts, samples, ripple."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np

from selector.findings import Finding
from selector.physics.gauging.model_length import finest_s
from selector.physics.gauging.model_slips import slow_times
from selector.physics.gauging.parameter_bounds import unit_of_key
from selector.physics.gauging.plausibility import USUAL
from selector.physics.model_plausibility import unlikely_numbers
from selector.physics.model_text import plain_values

if TYPE_CHECKING:
    from selector.physics.gauging.characteristic import Characteristic
    from selector.physics.gauging.gauging_model import GaugingModel

_SHIFT_SHARE = 0.1
"""Share of the tolerance by which a size may be off before it is told."""

_SHIFT_UM = 1.0
"""The same without a tolerance [µm]."""

_SHORT = 0.5
"""Share of the last stage that a filter takes at most that somebody could have meant."""


def model_findings(model: GaugingModel) -> tuple[Finding, ...]:
    """What is odd before a part is ground; none of it stops a simulation."""
    return tuple(_found(model))


def mattering_um(model: GaugingModel) -> float:
    """Error of size that is worth a word: a tenth of the tolerance, 1 µm without one [µm]."""
    tolerance = model.values.tolerance
    return _SHIFT_UM if tolerance is None else _SHIFT_SHARE * (tolerance.upper_um - tolerance.lower_um)


def _found(model: GaugingModel) -> Iterator[Finding]:
    yield from unlikely_numbers(plain_values(model.file), USUAL, unit_of_key)
    curve = model.characteristic
    if curve is not None:
        yield from _swings(curve)
        yield from _reach(model, curve)
        yield from _ripple(model)
    yield from _slow(model)
    yield from _samples(model)


def _swings(curve: Characteristic) -> Iterator[Finding]:
    """What was told of the characteristic, where the gauge is of use."""
    _, most = curve.monotone_um
    for finding in curve.findings:
        places = np.asarray(finding.evidence.get("allowance_um", [0.0]), dtype=np.float64)
        if (places <= most).any():
            yield finding


def _reach(model: GaugingModel, curve: Characteristic) -> Iterator[Finding]:
    grinding, (least, most) = model.values.grinding, curve.monotone_um
    if grinding.allowance_um > most:
        yield Finding(
            "allowance-beyond-reach",
            "info",
            f"Parts begin with {grinding.allowance_um:.4g} µm; the gauge shows nothing of it until the allowance has "
            f"fallen to {most:.4g} µm.",
            evidence={"allowance_um": grinding.allowance_um, "reach_um": most},
            suggestion="nothing, if the first stage ends within reach; else swing wider or set the gauge farther",
        )
    wanted = grinding.stages[-1].until_um
    if wanted - least < mattering_um(model):
        yield Finding(
            "wanted-size-at-the-end-of-reach",
            "warning",
            f"The tip meets the workpiece down to {least:.4g} µm of allowance, and {wanted:.4g} µm are wanted: what "
            "is below is not seen, so a threshold may never be reached.",
            evidence={"wanted_um": wanted, "least_um": least},
            suggestion="set the gauge nearer: a smaller transducer.rest_gap_m",
        )


def _ripple(model: GaugingModel) -> Iterator[Finding]:
    """Of the smoothed voltage at the frequency of the rectified swing, whose peaks the relay compares."""
    setup = model.setup
    if model.crest is None:
        return
    gain = setup.gauge.gain_v_per_um
    crest_v = float(model.crest.crest_at(setup.wanted_um, setup.gauge.time_constant_s))
    early_um, clear_v = crest_v / abs(gain), model.advised_thresholds_v[-1] + crest_v
    is_set = abs(setup.thresholds_v[-1] - clear_v) < 0.5 * crest_v
    if early_um > mattering_um(model) and not is_set:
        yield Finding(
            "ripple-behind-filter",
            "info",
            "Behind the filter the voltage still swings at twice the frequency of the probe, up to "
            f"{1e3 * crest_v:.2g} mV above its mean: the relay trips on these peaks, {early_um:.2g} µm early. The "
            "calculated threshold (eq. 23) does not know of it.",
            evidence={"crest_v": crest_v, "early_um": early_um, "clear_v": clear_v},
            suggestion=f"set the last threshold to about {clear_v:.5g} V, which takes it out, or give "
            "smoothing.time_constant_s more",
        )


def _slow(model: GaugingModel) -> Iterator[Finding]:
    """Filter, delay and lag that are long against the feed that they act in."""
    rates, made = model.setup.rates_um_per_s, model.values
    ends = (made.grinding.allowance_um, *(stage.until_um for stage in made.grinding.stages))
    lasts_s = (ends[-2] - ends[-1]) / rates[-1]
    for key, time_s in slow_times(made).items():
        if time_s <= lasts_s:
            continue
        meant = f"; {time_s:g} ms would be {1e-3 * time_s:g} s" if 1e-3 * time_s < _SHORT * lasts_s else ""
        yield Finding(
            "slow-for-the-stage",
            "warning",
            f"{key} is {time_s:.4g} s, and the last stage takes {lasts_s:.3g} s: the gauge commands before the stage "
            f"has settled, or before it begins{meant}.",
            evidence={"key": key, "time_s": time_s, "stage_s": lasts_s},
            suggestion="give the last stage more allowance or less feed, or correct the time if it is a slip",
        )


def _samples(model: GaugingModel) -> Iterator[Finding]:
    said, finest = model.file.run.period_s, finest_s(model.values)
    if said is None or said <= finest * (1.0 + 1e-9):
        return
    surface = model.values.surface
    what = f"T_Φ of {model.values.filter_s:.3g} s"
    if surface.workpiece_rpm > 0:
        what += f" and turns of {60.0 / surface.workpiece_rpm:.3g} s" + (
            f" with {surface.grooves} grooves" if surface.grooves else ""
        )
    yield Finding(
        "coarse-period",
        "warning",
        f"Samples are {said:.3g} s apart, which does not show {what}; the recording looks different from what "
        "happened. The sizes are calculated in finer steps.",
        evidence={"period_s": said, "advised_s": finest},
        suggestion=f"take run.period_s = {finest:.2g} or less, or leave it out",
    )
