"""What is odd about the sizes that come out, and what would make them better."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING

from selector.findings import Finding
from selector.physics.gauging.early_findings import differing_findings, early_findings
from selector.physics.gauging.gauging_advice import (
    BEST_CENTRED,
    BEST_FILTER,
    CENTRED,
    PRESENT,
    limit_text,
    off_text,
    volts_text,
)
from selector.physics.gauging.model_findings import mattering_um

if TYPE_CHECKING:
    from selector.physics.gauging.capability import Capability
    from selector.physics.gauging.finished_sizes import FinishedSizes
    from selector.physics.gauging.gauging_advice import Setting
    from selector.physics.gauging.gauging_model import GaugingModel
    from selector.physics.gauging.size_distribution import SizeDistribution

CAPABLE = 1.33
"""Cpk from which on a process is called capable: four standard deviations to the nearer limit."""

_ERRORS = 4.0
"""Standard errors by which sizes must be off to be told."""

_BETTER, _LEAST_UM = 0.9, 1e-3
"""A filter is better that leaves at most this share of the error, and so much less of it [µm]."""


def size_findings(
    model: GaugingModel,
    formula: SizeDistribution,
    sizes: FinishedSizes,
    capability: Capability | None,
    settings: tuple[Setting, ...],
) -> tuple[Finding, ...]:
    """Noise and surfaces that trip the relay early, low capability, sizes off what is wanted, a better filter.

    Parameters
    ----------
    model : GaugingModel
    formula, sizes : SizeDistribution, FinishedSizes
        By first passage; by Monte Carlo.
    capability : Capability or None
        Of these sizes.
    settings : tuple of Setting
        What other thresholds and filters give, as parts were ground with them.
    """
    by_name = {one.name: one for one in settings}
    return (
        *early_findings(model, formula),
        *_off(model, sizes, by_name.get(CENTRED)),
        *_capability(model, formula, capability, by_name.get(BEST_CENTRED)),
        *_filter(by_name),
        *differing_findings(model, formula, sizes),
    )


def _off(model: GaugingModel, sizes: FinishedSizes, centred: Setting | None) -> Iterator[Finding]:
    off_um = sizes.mean_um - model.setup.wanted_um
    if abs(off_um) <= max(mattering_um(model), _ERRORS * sizes.mean_error_um):
        return
    yield Finding(
        "sizes-off-what-is-wanted",
        "warning",
        f"Parts come out {abs(off_um):.3g} µm {'larger' if off_um > 0 else 'smaller'} than wanted, on average.",
        evidence={
            "off_um": off_um,
            "standard_error_um": sizes.mean_error_um,
            "centred_v": None if centred is None else centred.threshold_v,
            "left_um": None if centred is None else centred.bias_um,
        },
        suggestion="no last threshold centres them: look at the stages, the reach of the gauge and the filter"
        if centred is None
        else f"set {volts_text(centred)}: parts that are ground with it are off by {off_text(centred)} µm on average",
    )


def _capability(
    model: GaugingModel, formula: SizeDistribution, known: Capability | None, steady: Setting | None
) -> Iterator[Finding]:
    tolerance = model.values.tolerance
    if known is None or tolerance is None or known.cpk >= CAPABLE:
        return
    half_um = 0.5 * (tolerance.upper_um - tolerance.lower_um)
    best = half_um / (3.0 * steady.sd_um) if steady is not None and steady.sd_um > 0 else None
    if known.cp >= CAPABLE:
        advice = f"centre the sizes in the tolerance: Cp is {known.cp:.3g}, and Cpk then too"
    elif steady is not None and best is not None and best >= CAPABLE:
        advice = f"take T_Φ = {steady.time_constant_s:g} s with {volts_text(steady)}: Cp {best:.3g}"
    elif formula.between_um > formula.within_um and model.is_wearing:
        advice = "dress more often and set the gauge again for its worn tip: most of the spread is between parts"
    else:
        advice = "no filter makes it capable: feed slower in the last stage, steady the feed, lower the noise"
    yield Finding(
        "low-capability",
        "warning",
        f"Cpk is {known.cpk:.3g} ({known.cpk_low:.3g} to {known.cpk_high:.3g}), below {CAPABLE:g}: "
        f"{100 * known.share_outside:.3g} % of {known.count} parts are out of tolerance.",
        evidence={"cp": known.cp, "cpk": known.cpk, "share_outside": known.share_outside, "best_cp": best},
        suggestion=advice,
    )


def _filter(by_name: Mapping[str, Setting]) -> Iterator[Finding]:
    """Filters with which the error is less: the one for calculated thresholds, and the one for centred ones."""
    now = by_name[PRESENT]
    least = min(now.rms_um, by_name[CENTRED].rms_um if CENTRED in by_name else now.rms_um)
    better = [
        one
        for one, with_um in ((by_name.get(BEST_FILTER), now.rms_um), (by_name.get(BEST_CENTRED), least))
        if one is not None and one.rms_um <= min(_BETTER * with_um, with_um - _LEAST_UM)
    ]
    if not better:
        return
    told = "; ".join(
        f"{one.time_constant_s:g} s{limit_text(one)} leaves {one.rms_um:.3g} µm with "
        + ("calculated thresholds (eq. 23)" if one.name == BEST_FILTER else "thresholds that centre them")
        for one in better
    )
    yield Finding(
        "better-filter",
        "info",
        f"With T_Φ = {now.time_constant_s:.3g} s sizes are off by {now.rms_um:.3g} µm (rms); {told}.",
        evidence={
            "present_s": now.time_constant_s,
            "present_rms_um": now.rms_um,
            "settings": [
                {"time_constant_s": one.time_constant_s, "volts": list(one.thresholds_v), "rms_um": one.rms_um}
                for one in better
            ],
        },
        suggestion="; ".join(f"with {one.time_constant_s:g} s set {volts_text(one)}" for one in better),
    )
