"""Friction per speed that is not the same everywhere."""

from collections.abc import Iterator

import numpy as np

from selector.diagnosis.comparison import Comparison
from selector.diagnosis.effects.drive._forces import centred_place, is_force, motion_of, of_forces, stays
from selector.diagnosis.effects.effect import Effect, Fitted, Quantity, Reading, Variant, words_of
from selector.diagnosis.shapes.force_response import responds

_WITH = ("position", "position to the second power", "acceleration")


def _variants(comparison: Comparison, response: str) -> Iterator[Variant]:
    moving = motion_of(comparison, response)
    speed, place = moving.velocity_m_per_s, centred_place(moving)
    pull = np.abs(moving.acceleration_m_per_s2)
    pull = pull / max(float(pull.max()), 1e-12)
    linear = {"viscous friction times position": speed * place}
    square = {"viscous friction times position²": speed * place**2}
    laws = (linear, linear | square, {"viscous friction times acceleration": speed * pull})
    for number, forces in enumerate(laws):
        yield from of_forces(comparison, response, forces, {"law": Quantity(float(number), "1")})


def _reading(fitted: Fitted, comparison: Comparison) -> Reading:
    what = _WITH[int(fitted.variant.shape["law"].value)]
    parameters, text = fitted.size, f"A friction per speed that changes with {what} shifts the axis"
    if is_force(fitted, comparison):
        parameters = {"change": fitted.coefficient(f"{fitted.unit}*s/m")}
        where = "from the middle of the way to its end" if "position" in what else "up to the largest acceleration"
        text = f"Friction per speed changes with {what}, by {parameters['change'].words()} {where}"
    return Reading(f"{text} ({fitted.size_words}).", parameters)


EFFECT = Effect(
    **words_of("drive.varying_damping"),
    variants=_variants,
    testable=lambda comparison, response: responds(comparison, response) or stays(comparison, response),
    reading=_reading,
)
