"""Dry friction whose amount does not depend on speed."""

from collections.abc import Iterator

import numpy as np

from selector.diagnosis.comparison import Comparison
from selector.diagnosis.effects.drive._forces import force_key, motion_of, of_forces, reverses
from selector.diagnosis.effects.effect import Effect, Fitted, Quantity, Reading, Variant, words_of
from selector.diagnosis.shapes.axis import FORCE_ROLES

_PRESLIDING_UM = (1.0, 4.0, 15.0, 50.0)
_TURNED_BY = (0.02, 0.06, 0.15)  #: Parts of the top speed at which friction has turned over, where the speed tells.


def _variants(comparison: Comparison, response: str) -> Iterator[Variant]:
    moving = motion_of(comparison, response)
    for presliding_um in _PRESLIDING_UM:
        friction = moving.friction_state(1e-6 * presliding_um)
        shape = {"presliding_um": Quantity(presliding_um, "um")}
        yield from of_forces(comparison, response, {"friction by sign of motion": friction}, shape)
    if comparison.channel(response).role not in FORCE_ROLES:
        return
    top = float(np.abs(moving.velocity_m_per_s).max())
    for part in _TURNED_BY:
        # a current that was filtered, or a speed of coarse samples, turns with the speed and not with the way
        friction = np.tanh(moving.velocity_m_per_s / (part * top))
        yield from of_forces(
            comparison, response, {f"friction by sign of motion, beyond {1e3 * part * top:.2g} mm/s": friction}
        )


def _reading(fitted: Fitted, comparison: Comparison) -> Reading:
    shape = {name: fitted.parameter(name) for name in fitted.variant.shape if name == "presliding_um"}
    key, force = force_key(fitted, comparison), fitted.coefficient()
    turned = " against the sense that friction has" if force.value < 0.0 else ""
    text = "At each reversal a force that turns with the sense of motion, whatever the speed, pushes the axis aside"
    if key:
        text = (
            f"Dry friction of {force.words(amount=True)} by sign of motion{turned}, whatever the speed, acts on the "
            "axis and is not in the simulation"
        )
    return Reading(f"{text} ({fitted.size_words}).", ({key: force} if key else fitted.size) | shape)


EFFECT = Effect(**words_of("drive.coulomb"), variants=_variants, testable=reverses, reading=_reading)
