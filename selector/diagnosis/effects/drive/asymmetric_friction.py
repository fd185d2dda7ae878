"""Friction that is not the same in both directions."""

from collections.abc import Iterator

import numpy as np

from selector.diagnosis.comparison import Comparison
from selector.diagnosis.effects.drive._forces import force_key, motion_of, of_forces, presliding_m, reverses
from selector.diagnosis.effects.effect import Effect, Fitted, Quantity, Reading, Variant, words_of

_ALL = "friction that both directions differ by"
_GROWING = "the same, growing with speed"


def _variants(comparison: Comparison, response: str) -> Iterator[Variant]:
    moving = motion_of(comparison, response)
    # a constant in both directions and at rest is no friction: only what starts and stops with the motion counts
    moved = np.abs(moving.friction_state(presliding_m(comparison, response)))
    share = moving.velocity_m_per_s / float(np.abs(moving.velocity_m_per_s).max())
    fast = np.abs(share)
    for growth, forces in ((0.0, {_ALL: moved}), (1.0, {_GROWING: fast}), (0.5, {_ALL: moved, _GROWING: fast})):
        yield from of_forces(comparison, response, forces, {"growth": Quantity(growth, "1")})
    for sense, words in ((1.0, "forwards"), (-1.0, "backwards")):
        one_way = np.maximum(sense * share, 0.0) * sense
        shape = {"growth": Quantity(1.0, "1"), "direction": Quantity(sense, "1")}
        yield from of_forces(comparison, response, {f"friction growing with speed, {words} only": one_way}, shape)


def _reading(fitted: Fitted, comparison: Comparison) -> Reading:
    growing = fitted.variant.shape["growth"].value > 0.0
    one_way = fitted.variant.shape.get("direction")
    how = "" if one_way is None else (" forwards" if one_way.value > 0.0 else " backwards") + " only"
    law = " and grows with speed" if growing else ""
    key = force_key(fitted, comparison)
    if key:
        force = fitted.coefficient()
        at = " at the largest speed" if growing and len(fitted.coefficients) == 1 else ""
        text = f"has another law{how}, by {force.words(amount=True)} at the largest speed"
        if one_way is None:
            differ = Quantity(2.0 * abs(force.value), force.unit)
            text = f"differs by {differ.words()} between the two directions{at or law}"
        return Reading(f"Friction {text}: {fitted.size_words}.", {key: force})
    return Reading(f"Friction differs between the two directions{how}{law}: {fitted.size_words}.", fitted.size)


EFFECT = Effect(**words_of("drive.asymmetric_friction"), variants=_variants, testable=reverses, reading=_reading)
