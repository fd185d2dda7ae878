"""Where do the stages before the last really end, and which thresholds of the file end one elsewhere than it says."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from typing import TYPE_CHECKING

from selector.findings import Finding
from selector.physics.gauging.finished_sizes import finished_sizes
from selector.physics.gauging.model_findings import mattering_um

if TYPE_CHECKING:
    from selector.physics.gauging.gauging_model import GaugingModel

_PARTS = 200
_SHARE = 0.1
"""Share of the stage that follows, by which an end may be off before it is told."""

_ERRORS = 4.0


def stage_end_um(model: GaugingModel, number: int, seed: int) -> tuple[float, float] | None:
    """Mean allowance when the command of a stage acts, by Monte Carlo, and its standard error [µm].

    `number` counts from 0. None: no part reaches that threshold.
    """
    setup = model.setup
    # what the springs still take off after the feed stands is not yet gone when the next feed begins
    held_um = setup.grinding.lag_s * setup.rates_um_per_s[number]
    alone = replace(
        setup,
        grinding=replace(setup.grinding, stages=setup.grinding.stages[: number + 1]),
        thresholds_v=setup.thresholds_v[: number + 1],
    )
    sizes = finished_sizes(alone, _PARTS, seed=seed)
    return (sizes.mean_um + held_um, sizes.mean_error_um) if sizes.tripped.any() else None


def threshold_findings(model: GaugingModel, seed: int) -> Iterator[Finding]:
    """Thresholds of the file, but for the last one, with which a stage does not end where the file wants it to.

    Those of eq. 23 are not told, nor are those that end a stage where it is wanted although eq. 23 says otherwise. What
    the last one makes of the sizes is in the sizes.
    """
    if model.file.thresholds is None:
        return
    stages, gauges = model.values.grinding.stages, model.stage_gauges
    for number, volts in enumerate(model.file.thresholds.volts[:-1]):
        wanted_um, by_eq_23 = stages[number].until_um, model.advised_thresholds_v[number]
        least_um = max(mattering_um(model), _SHARE * (wanted_um - stages[number + 1].until_um))
        if abs((volts - by_eq_23) / gauges[number].gain_v_per_um) <= least_um:
            continue
        found = stage_end_um(model, number, seed)
        if found is None or abs(found[0] - wanted_um) <= max(least_um, _ERRORS * found[1]):
            continue
        off_um = found[0] - wanted_um
        digits = max(0, 1 - math.floor(math.log10(max(found[1], 1e-3))))
        yield Finding(
            "threshold-ends-elsewhere",
            "warning",
            f"The threshold of stage {number + 1}, {volts:.6g} V, ends it at {found[0]:.{digits}f} µm on average, "
            f"{abs(off_um):.3g} µm {'before' if off_um > 0 else 'after'} the {wanted_um:.4g} µm that are wanted "
            f"(simulated). The calculated threshold (eq. 23) is {by_eq_23:.6g} V.",
            evidence={"stage": number + 1, "volts": volts, "eq_23_v": by_eq_23, "off_um": off_um},
            suggestion=f"set it to about {volts + gauges[number].gain_v_per_um * -off_um:.5g} V, "
            "unless the stage is meant to end there",
        )
