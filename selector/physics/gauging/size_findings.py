"""What is odd about the sizes that come out, and what would make them better."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np

from selector.findings import Finding
from selector.physics.gauging.mean_course import on_line
from selector.physics.gauging.model_findings import mattering_um
from selector.physics.gauging.size_distribution import size_distribution
from selector.physics.gauging.surface_ripple import mean_surface_um, smoothed_surface

if TYPE_CHECKING:
    from selector.physics.gauging.capability import Capability
    from selector.physics.gauging.finished_sizes import FinishedSizes
    from selector.physics.gauging.gauging_model import GaugingModel
    from selector.physics.gauging.size_distribution import SizeDistribution
    from selector.physics.gauging.trade_off import TradeOff

CAPABLE = 1.33
"""Cpk from which on a process is called capable: four standard deviations to the nearer limit."""

_TURNS = 2048
_RESTLESS = 0.1
_EARLY_SHARE = 0.1
"""Share of the standard deviation from which on an early command is told."""

_ERRORS = 4.0
"""Standard errors by which formula and Monte Carlo must differ to be told."""

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
        *_early(model, formula),
        *_off(model, sizes),
        *_capability(model, formula, capability, filters),
        *_filter(filters),
        *_differing(model, formula, sizes),
    )


def _early(model: GaugingModel, formula: SizeDistribution) -> Iterator[Finding]:
    setup, parts = model.setup, model.file.run.parts
    linear = size_distribution(setup, method="linear", parts=parts)
    early_um = formula.mean_um - linear.mean_um
    if formula.ripple_rate >= 1.0:
        surface = on_line(setup).surface
        mean_um = -mean_surface_um(surface)
        behind, _ = smoothed_surface(surface, setup.gauge.time_constant_s, np.arange(_TURNS) / _TURNS)
        swing_um = float(np.abs(behind + mean_um).max())
        yield Finding(
            "surface-trips-early",
            "warning",
            f"Behind the filter grooves and run-out still move the reading by up to {swing_um:.3g} µm from its mean, "
            f"{formula.ripple_rate:.3g} times as fast as the feed does: the relay trips on the peaks, "
            f"{early_um:.2g} µm early" + (f", and the mean of the grooves adds {mean_um:.2g} µm." if mean_um else "."),
            evidence={
                "ripple_um": swing_um,
                "ripple_rate": formula.ripple_rate,
                "early_um": early_um,
                "mean_um": mean_um,
            },
            suggestion="set the last threshold for this surface, and give the filter more time",
        )
    elif formula.restlessness > _RESTLESS and early_um > _EARLY_SHARE * formula.sd_um:
        yield Finding(
            "noise-trips-early",
            "info" if early_um < mattering_um(model) else "warning",
            f"Noise moves the smoothed voltage {formula.restlessness:.2g} times as fast as the feed does: it reaches "
            f"the threshold early, and parts are {early_um:.2g} µm larger than eq. 23 has it. The spread by eq. 25 is "
            f"{linear.sd_um:.3g} µm; with early commands it is {formula.sd_um:.3g} µm.",
            evidence={"restlessness": formula.restlessness, "early_um": early_um, "sd_by_eq_25_um": linear.sd_um},
            suggestion="give the filter more time, feed faster in the last stage, or move the last threshold",
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


def _differing(model: GaugingModel, formula: SizeDistribution, sizes: FinishedSizes) -> Iterator[Finding]:
    """Where the formula is not to be trusted, by what it misses."""
    by_formula = formula.mean_um + formula.curvature_um
    mean_um, sd_um = sizes.mean_um - by_formula, sizes.sd_um - formula.sd_um
    least = 0.5 * mattering_um(model)
    beyond = [
        abs(one) > max(_ERRORS * error, least)
        for one, error in ((mean_um, sizes.mean_error_um), (sd_um, sizes.sd_error_um))
    ]
    if any(beyond):
        yield Finding(
            "formula-differs",
            "info",
            f"The formula says {by_formula:.3g} ± {formula.sd_um:.3g} µm (mean and standard deviation), Monte Carlo "
            f"{sizes.mean_um:.3g} ± {sizes.sd_um:.3g} µm; the latter counts, with standard errors of "
            f"{sizes.mean_error_um:.1g} and {sizes.sd_error_um:.1g} µm.",
            evidence={"formula_um": by_formula, "formula_sd_um": formula.sd_um, "mean_um": sizes.mean_um},
            suggestion="see docs/explanation/finished-sizes.md for what the formula leaves out",
        )
