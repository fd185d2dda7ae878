"""What has to be done to the simulation, in numbers and courses, so that it has the error that the answer promises."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from selector.diagnosis.answer import Diagnosis, NamedEffect
from selector.diagnosis.shapes.signals import filled

Vector = NDArray[np.float64]


@dataclass(frozen=True)
class Correction:
    """What is to be added to one response of the simulation as it was given; all rows, finite.

    Attributes
    ----------
    add : ndarray of shape (n_rows,)
        All of it: recorded − `of_recording` − simulated − `add` has the error that `Fit` promises.
    of_effects : ndarray of shape (n_rows,)
        The part of the effects of physics; the rest is recalibration.
    of_recording : ndarray of shape (n_rows,)
        What named faults of the data added to the recording, as far as the fit holds it.
    """

    add: Vector
    of_effects: Vector
    of_recording: Vector


def corrections(found: Diagnosis) -> dict[str, Correction]:
    """Response → correction, of every response in which the improved model differs from the simulation."""
    result = {}
    for name, fit in found.fit.items():
        physics, faults = (_course(found, name, of_data=one) for one in (False, True))
        added = fit.after - fit.before - faults
        if np.nanmax(np.abs(added), initial=0.0) > 0.0:
            result[name] = Correction(filled(found.comparison, added), physics, faults)
    return result


def physics_of(found: Diagnosis) -> tuple[NamedEffect, ...]:
    """The named effects that are no fault of the recording."""
    return tuple(effect for effect in found.effects if not effect.id.startswith("data."))


def _course(found: Diagnosis, name: str, *, of_data: bool) -> Vector:
    """The sum of the courses that the fit of a response holds: of physics, or of faults of the data."""
    total = np.zeros(len(found.comparison.time_s))
    for effect in found.effects:
        if name in effect.courses and effect.id.startswith("data.") == of_data and (effect.is_fitted or not of_data):
            total = total + effect.courses[name]
    return total
