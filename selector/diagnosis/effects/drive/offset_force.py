"""A constant force on the axis."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from selector.diagnosis.comparison import Comparison
from selector.diagnosis.effects.drive._forces import direct, force_key, of_forces
from selector.diagnosis.effects.effect import Effect, Fitted, Reading, Variant, words_of
from selector.diagnosis.shapes.force_response import responds
from selector.diagnosis.shapes.signals import course, in_run
from selector.types import Vector

_CONSTANT = "constant force"


def _variants(comparison: Comparison, response: str) -> Iterator[Variant]:
    ones = np.ones(len(comparison.time_s))
    yield from _shown(comparison, response, ones)
    for run in comparison.runs if len(comparison.runs) > 1 else ():
        yield from _shown(comparison, response, in_run(comparison, run, ones), run=run)
    for name in comparison.with_role("state"):
        state = course(comparison, name)
        values = np.unique(state)
        # a brake, a clamp or the drive itself, on and off
        if len(values) == 2:
            on = (state > values.mean()).astype(np.float64)
            yield from _shown(comparison, response, on, regime=f"{name} = {values[1]:g}")


def _shown(
    comparison: Comparison, response: str, force: Vector, *, run: str | None = None, regime: str | None = None
) -> Iterator[Variant]:
    """Long at rest before the recording begins, so that it has settled; or put on with the first sample."""
    settled = direct(comparison, response, {_CONSTANT: force})
    for variant in (settled, *of_forces(comparison, response, {_CONSTANT: force}, most=2)):
        yield replace(variant, run=run, regime=regime)


def _reading(fitted: Fitted, comparison: Comparison) -> Reading:
    run, regime = fitted.variant.run, fitted.variant.regime
    shift = fitted.coefficient()
    when = ("" if run is None else f" in run {run}") + ("" if regime is None else f" while {regime}")
    key = force_key(fitted, comparison)
    if key:
        text = f"A constant force of {shift.words()} acts on the axis{when}, at rest and in motion alike"
        return Reading(f"{text} ({fitted.size_words}).", {key: shift})
    text = f"A constant force holds the axis {shift.words()} aside{when}, at rest and in motion alike."
    return Reading(text, {"shift": shift})


EFFECT = Effect(**words_of("drive.offset_force"), variants=_variants, testable=responds, reading=_reading)
