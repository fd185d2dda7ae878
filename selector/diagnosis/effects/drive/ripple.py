"""Force or torque that is periodic in the motor's angle."""

from collections.abc import Iterator

import numpy as np

from selector.diagnosis.comparison import Comparison
from selector.diagnosis.effects.drive._forces import force_key, leads, motion_of, of_forces, waved
from selector.diagnosis.effects.effect import Effect, Fitted, Quantity, Reading, Variant, words_of
from selector.diagnosis.shapes.force_response import responds


def _variants(comparison: Comparison, response: str) -> Iterator[Variant]:
    moving = motion_of(comparison, response)
    for lead in leads(comparison, comparison.channel(response).axis, of_force=True):
        turn = 2.0 * np.pi * moving.position_m / lead
        once = {"sine of the angle": np.sin(turn), "cosine of the angle": np.cos(turn)}
        twice = {"sine of twice the angle": np.sin(2.0 * turn), "cosine of twice the angle": np.cos(2.0 * turn)}
        for harmonics, waves in ((1.0, once), (2.0, once | twice)):
            shape = {"lead_mm": Quantity(1e3 * lead, "mm"), "harmonics": Quantity(harmonics, "1")}
            yield from of_forces(comparison, response, waves, shape, of_motor=True)


def _testable(comparison: Comparison, response: str) -> str | None:
    lacking = responds(comparison, response)
    if lacking is None and not leads(comparison, comparison.channel(response).axis, of_force=True):
        return "the way is too short, or too quick for the sampling, to show what repeats along it"
    return lacking


def _reading(fitted: Fitted, comparison: Comparison) -> Reading:
    lead = fitted.parameter("lead_mm")
    key, amplitude = force_key(fitted, comparison), waved(fitted)
    text = f"A force that repeats every {lead.value:.4g} mm shakes the axis, less the slower it goes"
    if key:
        has = f"has an amplitude of {amplitude.value:.3g} {fitted.unit}"
        text = f"A force that repeats every {lead.value:.4g} mm, as cogging or commutation does, {has}"
    return Reading(f"{text} ({fitted.size_words}).", {"lead_mm": lead} | ({key: amplitude} if key else fitted.size))


EFFECT = Effect(**words_of("drive.ripple"), variants=_variants, testable=_testable, reading=_reading)
