"""A constant force on the axis."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from selector.diagnosis.comparison import Comparison
from selector.diagnosis.effects.drive._forces import YIELD, direct, force_key, of_forces
from selector.diagnosis.effects.effect import Effect, Fitted, Reading, ShapeParameter, Variant
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


EFFECT = Effect(
    id="drive.offset_force",
    title="a constant force",
    physics="Weight of a vertical axis, its counterbalance, a hose or a cable chain pull with the same force all the "
    "time. Current or force is shifted by a constant at rest, in motion and in both directions.",
    reference="A. Janot, M. Gautier, M. Brunot (2019), Data set and reference models of EMPS, Workshop on Nonlinear "
    "System Identification Benchmarks (offset of the force)",
    enters="force",
    acts_at="table of an axis",
    parameters=(
        ShapeParameter("force_n", "N (A or V where these are compared)", -1e5, 1e5, "force in positive direction"),
        YIELD,
    ),
    needs="current, force, voltage or position error of an axis; a constant of all runs may as well be the channel's "
    "zero",
    # a constant in one channel says nothing of its cause
    confounders=("data.zero", "drive.asymmetric_friction", "drive.coulomb"),
    refuted_by="A current that is zero while the axis is held by its brake or stands without the drive, and shifted "
    "alike then.",
    experiment="Hold the axis in position with the drive on for 5 s, then with the brake on and the drive off for 5 s, "
    "at both ends and in the middle: what the current loses is the constant force.",
    variants=_variants,
    testable=responds,
    reading=_reading,
)
