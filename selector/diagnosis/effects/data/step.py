"""A sensor that jumps and stays there."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from selector.diagnosis.comparison import Comparison
from selector.diagnosis.effects.data.places import estimate, later_parts
from selector.diagnosis.effects.data.words import amount, step_unit
from selector.diagnosis.effects.effect import Effect, Fitted, Quantity, Reading, ShapeParameter, Variant
from selector.diagnosis.shapes.input_faults import fault_reading, fault_variants


def _variants(comparison: Comparison, response: str) -> Iterator[Variant]:
    for part in later_parts(comparison):
        yield Variant(
            part.rows.astype(float)[:, None], ("jump",), part.shape, "sensor", (), part.run, None, part.regime
        )
    yield from fault_variants(comparison, response, "data.step")


def _testable(comparison: Comparison, response: str) -> str | None:
    if not any(True for _ in later_parts(comparison)):
        return "no fitted run is long enough to have a before and an after"
    return None


def _reading(fitted: Fitted, comparison: Comparison) -> Reading:
    of_input = fault_reading(fitted, comparison)
    if of_input is not None:
        return of_input
    step = estimate(fitted, step_unit(fitted.unit))
    from_s = fitted.variant.shape["from_s"].value
    low, high = fitted.shape_intervals.get("from_s", (from_s, from_s))
    half_s = 0.5 * _grid_s(comparison, fitted.variant.run)
    return Reading(
        f"{fitted.response} jumps {'up' if step.value > 0 else 'down'} by {amount(step.value, fitted.unit)} and stays "
        f"there: {fitted.variant.regime}.",
        {
            "step": step,
            "from_s": Quantity(from_s, "s", max(0.0, min(low, from_s - half_s)), max(high, from_s + half_s)),
        },
    )


def _grid_s(comparison: Comparison, run: str | None) -> float:
    """Distance of the moments that were tried in a run [s]."""
    tried = [part.from_s or 0.0 for part in later_parts(comparison) if part.run == run]
    return float(np.median(np.diff(tried))) if len(tried) > 1 else comparison.longest_s


EFFECT = Effect(
    id="data.step",
    title="Jump of a sensor",
    physics="A sensor jumps to another level and stays there: it was knocked, slipped in its holder, or its amplifier "
    "was switched. The difference is constant before and constant after.",
    reference="Change in mean at an unknown moment: Hinkley, Biometrika 57 (1970) 1",
    enters="measurement",
    acts_at="a recorded channel, from a moment on to the end of the run",
    parameters=(
        ShapeParameter("step", "unit of the channel", -np.inf, np.inf, "by how much it jumps"),
        ShapeParameter("from_s", "s", 0.0, np.inf, "when, from the start of the run"),
    ),
    needs="a run with some samples before and after",
    confounders=("data.zero", "drive.backlash", "thermal.instant_speed"),
    refuted_by="Other channels at the same place jump at the same moment, or a command changes then.",
    experiment="Read a reference before and after the moment, or run the same programme with the sensor fastened anew.",
    variants=_variants,
    testable=_testable,
    reading=_reading,
)
