"""Wind-up that is not the same everywhere."""

from collections.abc import Iterator

import numpy as np

from selector.diagnosis.comparison import Comparison
from selector.diagnosis.effects.drive._forces import centred_place, direct, motion_of, place_only, presliding_m, stays
from selector.diagnosis.effects.effect import Effect, Fitted, Quantity, Reading, Variant, words_of
from selector.diagnosis.shapes.axis import simulated_drive_force

_INERTIA, _FRICTION = "inertia", "friction"


def _variants(comparison: Comparison, response: str) -> Iterator[Variant]:
    moving = motion_of(comparison, response)
    place = centred_place(moving)
    speed = np.abs(moving.velocity_m_per_s) / float(np.abs(moving.velocity_m_per_s).max())
    friction = moving.friction_state(presliding_m(comparison, response))
    loads = [(_INERTIA, moving.acceleration_m_per_s2), (_FRICTION, friction)]
    drive = simulated_drive_force(comparison, comparison.channel(response).axis)
    for number, (name, load) in enumerate([drive, *loads] if drive is not None else loads):
        # contacts stiffen with their load: the stiffness of Hertz goes with its cube root
        most = max(float(np.abs(load).max()), 1e-300)
        linear, square = {f"{name} × position": load * place}, {f"{name} × position²": load * place**2}
        laws = [linear, linear | square, {f"{name} × its amount": load * np.abs(load) / most}]
        if name == _FRICTION:
            # friction times its amount is friction, and times speed a lag: nothing that varies
            laws = laws[:2]
        elif name == _INERTIA:
            laws.append({f"{name} × speed": load * speed})
        for law, columns in enumerate(laws):
            shape = {"load": Quantity(float(number), "1"), "law": Quantity(float(law), "1")}
            yield direct(comparison, response, columns, shape)


_WITH = ("position", "position and its square", "load", "speed")


def _reading(fitted: Fitted, comparison: Comparison) -> Reading:
    what = _WITH[int(fitted.variant.shape["law"].value)]
    return Reading(f"The wind-up of the axis per load changes with {what}: {fitted.size_words}.", fitted.size)


EFFECT = Effect(
    **words_of("drive.varying_stiffness"),
    variants=_variants,
    testable=lambda comparison, response: place_only(comparison, response) or stays(comparison, response),
    reading=_reading,
)
