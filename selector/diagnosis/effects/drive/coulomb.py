"""Dry friction whose amount does not depend on speed."""

from collections.abc import Iterator

from selector.diagnosis.comparison import Comparison
from selector.diagnosis.effects.drive._forces import YIELD, force_key, motion_of, of_forces, reverses
from selector.diagnosis.effects.effect import Effect, Fitted, Quantity, Reading, ShapeParameter, Variant, words_of

_PRESLIDING_UM = (1.0, 4.0, 15.0, 50.0)


def _variants(comparison: Comparison, response: str) -> Iterator[Variant]:
    moving = motion_of(comparison, response)
    for presliding_um in _PRESLIDING_UM:
        friction = moving.friction_state(1e-6 * presliding_um)
        shape = {"presliding_um": Quantity(presliding_um, "um")}
        yield from of_forces(comparison, response, {"friction by sign of motion": friction}, shape)


def _reading(fitted: Fitted, comparison: Comparison) -> Reading:
    presliding = fitted.parameter("presliding_um")
    key = force_key(fitted, comparison)
    if key:
        force = fitted.coefficient()
        turned = " against the sense that friction has" if force.value < 0.0 else ""
        return Reading(
            f"Dry friction of {force.words(amount=True)} by sign of motion{turned}, whatever the speed, acts on the "
            f"axis and is not in the simulation ({fitted.size_words}).",
            {key: force, "presliding_um": presliding},
        )
    return Reading(
        f"At each reversal a force that turns with the sense of motion, whatever the speed, pushes the axis aside: "
        f"{fitted.size_words}.",
        fitted.size | {"presliding_um": presliding},
    )


EFFECT = Effect(
    **words_of("drive.coulomb"),
    parameters=(
        ShapeParameter(
            "force_n", "N (A or V where a current or voltage is compared)", 0.0, 1e5, "amount of the friction"
        ),
        ShapeParameter("presliding_um", "um", 1.0, 50.0, "way within which the friction turns over after a reversal"),
        YIELD,
    ),
    variants=_variants,
    testable=reverses,
    reading=_reading,
)
