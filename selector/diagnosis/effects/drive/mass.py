"""Moving mass or inertia that is not what the simulation has."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from selector.diagnosis.comparison import Comparison
from selector.diagnosis.effects.drive._forces import is_force, motion_of, of_forces
from selector.diagnosis.effects.effect import Effect, Fitted, Reading, Variant, words_of
from selector.diagnosis.shapes.force_response import responds

_MOST_STARTS = 8  #: Runs from which on the inertia may be another one; of more runs every second, third, …


def _variants(comparison: Comparison, response: str) -> Iterator[Variant]:
    inertia = motion_of(comparison, response).acceleration_m_per_s2
    yield from of_forces(comparison, response, {"force of inertia": inertia})
    for k in range(1, len(comparison.runs), -(-len(comparison.runs) // _MOST_STARTS)):
        # a workpiece that was put on the table
        later = np.where(comparison.run_index >= k, inertia, 0.0)
        if later[~comparison.held_out].any():
            for variant in of_forces(comparison, response, {"force of inertia": later}):
                yield replace(variant, regime=f"from run {comparison.runs[k]} on", looked_at=float(_MOST_STARTS))


def _reading(fitted: Fitted, comparison: Comparison) -> Reading:
    when = f" {fitted.variant.regime}" if fitted.variant.regime else ""
    if is_force(fitted, comparison):
        of_mass = fitted.unit == "N"
        found = fitted.coefficient("kg" if of_mass else f"{fitted.unit}*s^2/m")
        what, key = ("The axis moves", "mass_kg") if of_mass else ("The inertia of the axis asks for", "inertia")
        more = f"{found.words(amount=True)} {'more' if found.value > 0.0 else 'less'}"
        return Reading(f"{what} {more} than in the simulation{when} ({fitted.size_words}).", {key: found})
    text = "While it speeds up and slows down the axis is off by what another moving mass makes"
    return Reading(f"{text}{when}: {fitted.size_words}.", fitted.size)


EFFECT = Effect(**words_of("drive.mass"), variants=_variants, testable=responds, reading=_reading)
