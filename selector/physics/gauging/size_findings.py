"""What is odd about the sizes that come out, and what would make them better."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

from selector.findings import Finding
from selector.physics.gauging.early_findings import differing_findings, early_findings
from selector.physics.gauging.model_findings import mattering_um

if TYPE_CHECKING:
    from selector.physics.gauging.capability import Capability
    from selector.physics.gauging.finished_sizes import FinishedSizes
    from selector.physics.gauging.gauging_model import GaugingModel
    from selector.physics.gauging.size_distribution import SizeDistribution
    from selector.physics.gauging.trade_off import TradeOff

CAPABLE = 1.33
"""Cpk from which on a process is called capable: four standard deviations to the nearer limit."""

_ERRORS = 4.0
"""Standard errors by which sizes must be off to be told."""

_BETTER = 0.9
"""A filter is better that leaves at most this share of the error."""


def size_findings(
    model: GaugingModel,
    formula: SizeDistribution,
    sizes: FinishedSizes,
    capability: Capability | None,
    filters: TradeOff,
) -> tuple[Finding, ...]:
    """Noise and surfaces that trip the relay early, low capability, sizes off what is wanted, a better filter.

    Parameters
    ----------
    model : GaugingModel
    formula, sizes : SizeDistribution, FinishedSizes
        By first passage; by Monte Carlo.
    capability : Capability or None
        Of these sizes.
    filters : TradeOff
        Of this model.
    """
    return (
        *early_findings(model, formula),
        *_off(model, sizes),
        *_capability(model, formula, capability, filters),
        *_filter(filters),
        *differing_findings(model, formula, sizes),
    )


def _off(model: GaugingModel, sizes: FinishedSizes) -> Iterator[Finding]:
    off_um = sizes.mean_um - model.setup.wanted_um
    if abs(off_um) <= max(mattering_um(model), _ERRORS * sizes.mean_error_um):
        return
    setup = model.setup
    centred_v = setup.thresholds_v[-1] - setup.gauge.gain_v_per_um * off_um
    yield Finding(
        "sizes-off-what-is-wanted",
        "warning",
        f"Parts come out {abs(off_um):.3g} µm {'larger' if off_um > 0 else 'smaller'} than wanted, on average.",
        evidence={"off_um": off_um, "standard_error_um": sizes.mean_error_um, "centred_v": centred_v},
        suggestion=f"set the last threshold to about {centred_v:.4g} V in place of {setup.thresholds_v[-1]:.4g} V",
    )


def _capability(
    model: GaugingModel, formula: SizeDistribution, known: Capability | None, filters: TradeOff
) -> Iterator[Finding]:
    tolerance = model.values.tolerance
    if known is None or tolerance is None or known.cpk >= CAPABLE:
        return
    half_um = 0.5 * (tolerance.upper_um - tolerance.lower_um)
    best = half_um / (3.0 * filters.centred_rms_um) if filters.centred_rms_um > 0 else None
    if known.cp >= CAPABLE:
        advice = f"centre the sizes in the tolerance: Cp is {known.cp:.3g}, and Cpk then too"
    elif best is not None and best >= CAPABLE:
        threshold = f"the last threshold at {filters.centred_best_v:.5g} V"
        advice = f"take T_Φ = {filters.centred_s:.2g} s with {threshold}: Cpk {best:.3g}"
    elif formula.between_um > formula.within_um and model.is_wearing:
        advice = "dress more often and set the gauge again for its worn tip: most of the spread is between parts"
    else:
        advice = "no filter makes it capable: feed slower in the last stage, steady the feed, lower the noise"
    yield Finding(
        "low-capability",
        "warning",
        f"Cpk is {known.cpk:.3g} ({known.cpk_low:.3g} to {known.cpk_high:.3g}), below {CAPABLE:g}: "
        f"{100 * known.share_outside:.2g} % of {known.count} parts are out of tolerance.",
        evidence={"cp": known.cp, "cpk": known.cpk, "share_outside": known.share_outside, "best_cp": best},
        suggestion=advice,
    )


def _filter(filters: TradeOff) -> Iterator[Finding]:
    if filters.best_rms_um > _BETTER * filters.present_rms_um:
        return
    yield Finding(
        "better-filter",
        "info",
        f"With T_Φ = {filters.present_s:.3g} s sizes are off by {filters.present_rms_um:.3g} µm (rms); "
        f"{filters.best_s:.2g} s would leave {filters.best_rms_um:.3g} µm with the threshold of eq. 23, and "
        f"{filters.centred_s:.2g} s {filters.centred_rms_um:.3g} µm with one that centres them.",
        evidence={
            "present_s": filters.present_s,
            "present_rms_um": filters.present_rms_um,
            "best_s": filters.best_s,
            "best_rms_um": filters.best_rms_um,
            "centred_s": filters.centred_s,
            "centred_rms_um": filters.centred_rms_um,
        },
        suggestion=f"set the last threshold to {filters.best_threshold_v:.5g} V with the one, "
        f"{filters.centred_best_v:.5g} V with the other",
    )
