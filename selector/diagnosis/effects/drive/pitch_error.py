"""Position error that belongs to the place on the screw or scale."""

from collections.abc import Iterator

import numpy as np

from selector.diagnosis.comparison import Comparison
from selector.diagnosis.effects.drive._forces import centred_place, direct, leads, motion_of, place_only, waved
from selector.diagnosis.effects.effect import Effect, Fitted, Quantity, Reading, Variant, words_of
from selector.diagnosis.shown_units import displayed


def _variants(comparison: Comparison, response: str) -> Iterator[Variant]:
    moving = motion_of(comparison, response)
    place = centred_place(moving)
    powers = {"position": place, "position²": place**2, "position³": place**3}
    for n in (1, 2, 3):
        columns = dict(list(powers.items())[:n])
        yield direct(comparison, response, columns, {"power": Quantity(float(n), "1")})
    starts = [rows.start for _, rows in comparison.rows_of_runs()]
    for lead in leads(comparison, comparison.channel(response).axis, of_force=False):
        turn = 2.0 * np.pi * moving.position_m / lead
        shape = {"lead_mm": Quantity(1e3 * lead, "mm")}
        once = {"sine of the lead": np.sin(turn), "cosine of the lead": np.cos(turn)}
        twice = {"sine of half the lead": np.sin(2.0 * turn), "cosine of half the lead": np.cos(2.0 * turn)}
        growing = once | {"position": place}
        for harmonics, waves, power in ((1.0, once, 0.0), (2.0, once | twice, 0.0), (1.0, growing, 1.0)):
            of_waves = shape | {"harmonics": Quantity(harmonics, "1"), "power": Quantity(power, "1")}
            yield direct(comparison, response, waves, of_waves)
            if len(starts) > 1:
                # a reading that is set to zero where a run begins lacks the error of that place
                from_start = {what: wave - wave[starts][comparison.run_index] for what, wave in waves.items()}
                yield direct(comparison, response, from_start, of_waves | {"from_start": Quantity(1.0, "1")})


def _reading(fitted: Fitted, comparison: Comparison) -> Reading:
    if "lead_mm" not in fitted.variant.shape:
        text = "A position error grows along the way, whatever speed and direction"
        return Reading(f"{text}: {fitted.size_words}.", fitted.size)
    lead, amplitude = fitted.parameter("lead_mm"), waved(fitted)
    factor, unit = displayed(fitted.unit, amplitude.value)
    grows = "grows along the way and " if fitted.parameter("power").value else ""
    text = f"repeats every {lead.value:.4g} mm with an amplitude of {factor * amplitude.value:.3g} {unit}"
    return Reading(
        f"The position error {grows}{text}, whatever the speed: {fitted.size_words}.",
        {"lead_mm": lead, "amplitude": amplitude},
    )


EFFECT = Effect(**words_of("drive.pitch_error"), variants=_variants, testable=place_only, reading=_reading)
