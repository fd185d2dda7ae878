"""Dead time in command, measurement or actuator."""

from collections.abc import Iterator

from selector.diagnosis.comparison import Comparison
from selector.diagnosis.effects.drive._forces import direct, is_force, motion_of, of_forces
from selector.diagnosis.effects.effect import Effect, Fitted, Quantity, Reading, Variant, words_of
from selector.diagnosis.shapes.axis import simulated_drive_force
from selector.diagnosis.shapes.force_response import responds
from selector.diagnosis.shapes.signals import rate


def _variants(comparison: Comparison, response: str) -> Iterator[Variant]:
    moving = motion_of(comparison, response)
    if comparison.channel(response).role == "displacement":
        # an error that is measured late is off by the way of the delay
        late = {"speed": moving.velocity_m_per_s * 1e3}
    else:
        simulated = comparison.simulated_course(response)
        late = {"rate of the simulated course": -1e-3 * rate(comparison, simulated)}
    yield direct(comparison, response, late, {"in": Quantity(0.0, "1")})
    drive = simulated_drive_force(comparison, comparison.channel(response).axis)
    if drive is not None:
        # a force that comes late acts as a push of the delay times its rate
        pushed = {f"rate of {drive[0]}": 1e-3 * rate(comparison, drive[1])}
    else:
        pushed = {"jerk": 1e-3 * rate(comparison, moving.acceleration_m_per_s2, over_samples=5)}
    yield from of_forces(comparison, response, pushed, {"in": Quantity(1.0, "1")}, of_motor=True)


def _reading(fitted: Fitted, comparison: Comparison) -> Reading:
    if fitted.variant.shape["in"].value == 0.0:
        delay = fitted.coefficient("ms")
        late = "late" if delay.value > 0.0 or is_force(fitted, comparison) else "early"
        return Reading(
            f"Command or measurement is {delay.words(amount=True)} {late}: {fitted.size_words}.", {"delay_ms": delay}
        )
    return Reading(
        f"The force comes late, which the loop makes good after each change: {fitted.size_words}.", fitted.size
    )


EFFECT = Effect(**words_of("drive.delay"), variants=_variants, testable=responds, reading=_reading)
