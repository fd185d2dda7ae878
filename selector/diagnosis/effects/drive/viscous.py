"""Friction that grows with speed."""

from collections.abc import Iterator

import numpy as np

from selector.diagnosis.comparison import Comparison
from selector.diagnosis.effects.drive._forces import is_force, motion_of, of_forces
from selector.diagnosis.effects.effect import Effect, Fitted, Quantity, Reading, Variant, words_of
from selector.diagnosis.shapes.force_response import responds

_EXPONENTS = (1.0, 0.67, 1.5, 2.0)


def _variants(comparison: Comparison, response: str) -> Iterator[Variant]:
    speed = motion_of(comparison, response).velocity_m_per_s
    top = float(np.abs(speed).max())
    for exponent in _EXPONENTS:
        force = np.sign(speed) * top * (np.abs(speed) / top) ** exponent
        shape = {"exponent": Quantity(exponent, "1")}
        yield from of_forces(comparison, response, {"friction that grows with speed": force}, shape)


def _reading(fitted: Fitted, comparison: Comparison) -> Reading:
    exponent = fitted.variant.shape["exponent"]
    law = "in proportion to speed" if exponent.value == 1.0 else f"with speed to the power {exponent.value:g}"
    parameters, text = fitted.size, f"A friction that grows {law} and is not in the simulation shifts the axis"
    if is_force(fitted, comparison):
        slope = fitted.coefficient(f"{fitted.unit}*s/m")
        less = f"{slope.words(amount=True)} {'more' if slope.value > 0.0 else 'less'}"
        parameters, text = {"coefficient": slope}, f"Friction that grows {law} is {less} than in the simulation"
    return Reading(f"{text} ({fitted.size_words}).", parameters | {"exponent": exponent})


EFFECT = Effect(**words_of("drive.viscous"), variants=_variants, testable=responds, reading=_reading, absorbs=True)
