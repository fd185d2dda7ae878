"""What trips the relay before the mean reading does, and where the formula of sizes is off what is simulated."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np

from selector.findings import Finding
from selector.physics.gauging.first_passage import relay_law
from selector.physics.gauging.mean_course import on_line
from selector.physics.gauging.model_findings import mattering_um
from selector.physics.gauging.size_distribution import size_distribution
from selector.physics.gauging.surface_ripple import mean_surface_um, smoothed_surface

if TYPE_CHECKING:
    from selector.physics.gauging.finished_sizes import FinishedSizes
    from selector.physics.gauging.gauging_model import GaugingModel
    from selector.physics.gauging.size_distribution import SizeDistribution

_TURNS = 2048
_EARLY_SHARE = 0.1
"""Share of the standard deviation from which on an early command is told."""

_MOSTLY = 0.7
"""Share of an early command from which on one cause is named alone."""

_ERRORS, _SHARE, _LEAST_UM = 4.0, 0.15, 1e-3
"""Standard errors, share of the standard deviation and length by which formula and Monte Carlo differ to be told."""


def early_findings(model: GaugingModel, formula: SizeDistribution) -> Iterator[Finding]:
    """Surfaces, noise that the gauge sees, and noise of the relay that trip it early; `formula` is by first passage."""
    setup, parts = model.setup, model.file.run.parts
    linear = size_distribution(setup, method="linear", parts=parts)
    early_um = formula.mean_um - linear.mean_um
    if formula.ripple_rate >= 1.0:
        yield _of_surface(model, formula, early_um)
    elif early_um > _EARLY_SHARE * formula.sd_um and early_um > _LEAST_UM:
        relay_um = float(relay_law(setup, np.array([0.5])).mean_um)
        share = relay_um / early_um
        seen = (
            f"noise that the gauge sees moves the smoothed voltage {formula.restlessness:.2g} times as fast as the "
            "feed does and so reaches the threshold early"
        )
        hold_ms = 1e3 * setup.relay.noise_hold_s
        own = (
            f"noise of the relay, {1e3 * setup.relay.noise_v:.3g} mV and new every {hold_ms:.3g} ms, makes one of many "
            "comparisons early"
        )
        causes, helps = [], []
        if share < _MOSTLY:
            causes.append(seen)
            helps.append("give the filter more time")
        if share > 1.0 - _MOSTLY:
            causes.append(own)
            helps.append("quiet the relay or let it average")
        said = "; ".join(causes)
        yield Finding(
            "noise-trips-early",
            "info" if early_um < mattering_um(model) else "warning",
            f"{said[0].upper()}{said[1:]}. Parts are {early_um:.2g} µm larger than the calculated threshold (eq. 23) "
            f"has it. The linear spread (eq. 25) is {linear.sd_um:.3g} µm; with early commands it is "
            f"{formula.sd_um:.3g} µm.",
            evidence={
                "restlessness": formula.restlessness,
                "early_um": early_um,
                "of_relay_um": relay_um,
                "sd_by_eq_25_um": linear.sd_um,
            },
            suggestion=f"{', '.join(helps)}, feed faster in the last stage, or move the last threshold",
        )


def _of_surface(model: GaugingModel, formula: SizeDistribution, early_um: float) -> Finding:
    setup = model.setup
    surface = on_line(setup).surface
    mean_um = -mean_surface_um(surface)
    behind, _ = smoothed_surface(surface, setup.gauge.time_constant_s, np.arange(_TURNS) / _TURNS)
    swing_um = float(np.abs(behind + mean_um).max())
    return Finding(
        "surface-trips-early",
        "warning",
        f"Behind the filter grooves and run-out still move the reading by up to {swing_um:.3g} µm from its mean, "
        f"{formula.ripple_rate:.3g} times as fast as the feed does: the relay trips on the peaks"
        + (f", {early_um:.2g} µm early" if early_um > 0 else "")
        + (f", and the mean of the grooves adds {mean_um:.2g} µm." if mean_um else "."),
        evidence={
            "ripple_um": swing_um,
            "ripple_rate": formula.ripple_rate,
            "early_um": early_um,
            "mean_um": mean_um,
        },
        suggestion="set the last threshold for this surface, and give the filter more time",
    )


def differing_findings(model: GaugingModel, formula: SizeDistribution, sizes: FinishedSizes) -> Iterator[Finding]:
    """Where the formula, by first passage, is not to be trusted: by what it misses of the simulated `sizes`."""
    by_formula = formula.mean_um + formula.curvature_um
    mean_um, sd_um = sizes.mean_um - by_formula, sizes.sd_um - formula.sd_um
    least = max(min(_SHARE * sizes.sd_um, 0.5 * mattering_um(model)), _LEAST_UM)
    beyond = [
        abs(one) > max(_ERRORS * error, least)
        for one, error in ((mean_um, sizes.mean_error_um), (sd_um, sizes.sd_error_um))
    ]
    if not any(beyond):
        return
    why = "" if formula.passage_holds else " Noise or allowances still decide how the last stage begins."
    yield Finding(
        "formula-differs",
        "info",
        f"The formula says {by_formula:.3g} ± {formula.sd_um:.3g} µm (mean and standard deviation), Monte Carlo "
        f"{sizes.mean_um:.3g} ± {sizes.sd_um:.3g} µm; the latter counts, with standard errors of "
        f"{sizes.mean_error_um:.1g} and {sizes.sd_error_um:.1g} µm.{why}",
        evidence={
            "formula_um": by_formula,
            "formula_sd_um": formula.sd_um,
            "mean_um": sizes.mean_um,
            "sd_um": sizes.sd_um,
            "passage_holds": formula.passage_holds,
        },
        suggestion="see docs/explanation/finished-sizes.md for what the formula leaves out",
    )
