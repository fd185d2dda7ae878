"""Dead time in command, measurement or actuator."""

from __future__ import annotations

from collections.abc import Iterator

from selector.diagnosis.comparison import Comparison
from selector.diagnosis.effects.drive._forces import (
    any_response,
    coefficient,
    direct,
    is_force,
    motion_of,
    of_forces,
    shape_quantity,
    size_of,
    with_interval,
)
from selector.diagnosis.effects.effect import Effect, Fitted, Quantity, Reading, ShapeParameter, Variant
from selector.diagnosis.shapes.axis import simulated_drive_force
from selector.diagnosis.shapes.signals import filled, rate


def _variants(comparison: Comparison, response: str) -> Iterator[Variant]:
    if any_response(comparison, response) is not None:
        return
    moving = motion_of(comparison, response)
    role = comparison.channel(response).role
    simulated = filled(comparison, comparison.simulated[response])
    in_signal = {"in": Quantity(0.0, "1")}
    if role == "displacement":
        # an error that is measured late is off by the way of the delay
        yield direct(comparison, response, {"speed": moving.velocity_m_per_s * 1e3}, in_signal)
    else:
        yield direct(
            comparison, response, {"rate of the simulated course": -1e-3 * rate(comparison, simulated)}, in_signal
        )
    drive = simulated_drive_force(comparison, comparison.channel(response).axis)
    if drive is not None:
        # a force that comes late acts as a push of the delay times its rate
        name, force = drive
        pushed = {f"rate of {name}": 1e-3 * rate(comparison, force)}
        yield from of_forces(comparison, response, pushed, {"in": Quantity(1.0, "1")}, of_motor=True)
    else:
        jerk = {"jerk": 1e-3 * rate(comparison, moving.acceleration_m_per_s2, over_samples=5)}
        yield from of_forces(comparison, response, jerk, {"in": Quantity(1.0, "1")}, of_motor=True)


def _reading(fitted: Fitted, comparison: Comparison) -> Reading:
    where = shape_quantity(fitted, "in").value
    if where == 0.0:
        delay = coefficient(fitted, 0, "ms")
        late = "late" if delay.value > 0.0 or is_force(fitted, comparison) else "early"
        return Reading(
            f"Command or measurement is {with_interval(delay, amount=True)} {late}: {size_of(fitted)}.",
            {"delay_ms": delay},
        )
    return Reading(
        f"The force comes late, which the loop makes good after each change: {size_of(fitted)}.",
        {"largest": Quantity(fitted.largest, fitted.unit)},
    )


EFFECT = Effect(
    id="drive.delay",
    title="Dead time",
    physics="Sampling, bus and filters make command, measurement or current late by a fraction of a cycle or a few. "
    "The position "
    "is off by speed times delay, or the force by its rate times delay, which the loop then has to make good.",
    reference="K. J. Åström, B. Wittenmark (1997), Computer-controlled systems, 3rd edition (sampling as dead time)",
    enters="measurement",
    acts_at="command, encoder, bus, amplifier or recorder of an axis",
    parameters=(
        ShapeParameter("delay_ms", "ms", -20.0, 20.0, "dead time"),
        ShapeParameter("in", "1", 0.0, 1.0, "0 in command or measurement, 1 in the actuator"),
    ),
    needs="position error, current or force of an axis at more than one speed",
    # at one acceleration a delay is a mass, at one speed it is a lag, and one clock of the recording can be late too
    confounders=("data.clock", "drive.mass", "drive.elasticity", "drive.viscous"),
    refuted_by="Ramps and strokes at several speeds whose error does not grow with speed, or force whose rate does "
    "not matter.",
    experiment="Strokes of 50 mm at 10, 50 and 100 % of the rapid speed and a sine sweep from 1 to 100 Hz: phase "
    "grows in "
    "proportion to frequency, and the error in proportion to speed.",
    variants=_variants,
    testable=any_response,
    reading=_reading,
)
