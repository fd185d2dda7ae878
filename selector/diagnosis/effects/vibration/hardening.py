"""`vibration.hardening`: stiffness that grows with amplitude, or falls."""

from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np

from selector.diagnosis.comparison import Comparison
from selector.diagnosis.effects.effect import Effect, Fitted, Quantity, Reading, Variant, words_of
from selector.diagnosis.shapes.linear_response import (
    LinearResponse,
    displacement_of,
    fed_back,
    joints,
    linear_part,
    no_joint,
    restoring,
)
from selector.diagnosis.shapes.residual import Remainder
from selector.diagnosis.shapes.signals import rate, slope, swept_hz
from selector.types import Vector

#: Stiffness that the cube adds at the swing of the simulation, over the linear one.
_STRENGTHS = np.geomspace(0.01, 30.0, 8)
_ALIKE = 0.1  #: Of the movement: by how much a recorded and a simulated motion may differ and be alike.


def _variants(comparison: Comparison, response: str) -> Iterator[Variant]:
    swept = swept_hz(comparison, response)
    if swept is not None:
        simulated = comparison.simulated_course(response)
        shift = -slope(comparison, response, swept) * (simulated / float(np.abs(simulated).max())) ** 2
        yield Variant(shift[:, None], ("resonances raised by the square of the amplitude",))
        return
    remainder = Remainder(comparison, response)
    for member, path, onward in joints(comparison, response):
        yield from _at_joint(comparison, remainder, member, path, onward)


def _at_joint(
    comparison: Comparison, remainder: Remainder, member: str, path: LinearResponse, onward: LinearResponse | None
) -> Iterator[Variant]:
    """The cube of a member's motion, as it reaches the response; k₃ weak, and as strong as explains most."""
    simulated = comparison.simulated_course(member)
    y = displacement_of(comparison, member, simulated)
    fitted = ~comparison.held_out
    swing = float(np.mean(y[fitted] ** 4) / max(float(np.mean(y[fitted] ** 2)), 1e-300))
    if swing <= 0.0:
        return
    cube = restoring(comparison, y, "cubic")

    def seen_by_response(course: Vector) -> Vector:
        return course if onward is None else onward.passed(comparison, course)

    square = seen_by_response(path.passed(comparison, -(y**2)))
    yield from _at_recorded_swing(comparison, member, path, seen_by_response)
    for linear in ((0.0, 0.0), linear_part(comparison, path, y, cube)):
        part = cube - linear[0] * y - linear[1] * rate(comparison, y)
        weak = seen_by_response(-path.passed(comparison, part))
        yield _variant(member, path, weak, None, 0.0, fitted_there=linear[0] != 0.0)
        if y is not simulated or path.static_gain <= 0.0 or path.source is None:
            yield _variant(member, path, weak, square, 0.0, fitted_there=linear[0] != 0.0)
            continue

        for side in (1.0, -1.0):

            def strong(strength: float, side: float = side, linear: tuple[float, float] = linear) -> Vector | None:
                k = strength / (swing * path.static_gain)
                moved = fed_back(comparison, path, y, "cubic", side * k, linear=linear)
                return None if moved is None else seen_by_response(moved) / k

            best = remainder.best(strong, _STRENGTHS)
            for strength in () if best is None else (0.7 * best, best, 1.4 * best):
                column = strong(strength)
                if column is not None:
                    is_there = linear[0] != 0.0
                    yield _variant(member, path, side * column, None, strength, fitted_there=is_there)
                    if strength == best:
                        yield _variant(member, path, side * column, square, strength, fitted_there=is_there)


def _at_recorded_swing(
    comparison: Comparison, member: str, path: LinearResponse, seen_by_response: Callable[[Vector], Vector]
) -> Iterator[Variant]:
    """The cube of the recorded motion of what swings freely, where that is far from the simulated motion.

    What is left between a linear simulation and the record obeys the simulation's own equation, pushed by the force
    that it lacks where the member was in truth, however strong that force is.
    """
    if path.source is not None or path.misfit >= 1.0 or member not in comparison.recorded:
        return
    recorded, simulated = comparison.filled(comparison.recorded[member]), comparison.simulated_course(member)
    fitted = ~comparison.held_out
    if float(np.std((recorded - simulated)[fitted])) < _ALIKE * float(np.std(simulated[fitted])):
        return
    y = displacement_of(comparison, member, recorded - float(np.median(recorded)))
    cube = restoring(comparison, y, "cubic")
    for linear in ((0.0, 0.0), linear_part(comparison, path, y, cube)):
        part = cube - linear[0] * y - linear[1] * rate(comparison, y)
        column = seen_by_response(-path.passed(comparison, part))
        yield _variant(member, path, column, None, 0.0, fitted_there=linear[0] != 0.0)


def _variant(
    member: str, path: LinearResponse, column: Vector, square: Vector | None, strength: float, *, fitted_there: bool
) -> Variant:
    """The coefficient of the first column is k₃ [force per cube of the member's motion]; 0 strength: that of weak ones.

    A strength was chosen from what is left, and pays for it.
    """
    columns = column[:, None] if square is None else np.column_stack([column, square])
    words = ", stiffness fitted at this swing" if fitted_there else ""
    names = (f"cubic restoring force on {member}{words}", f"quadratic restoring force on {member}")[: columns.shape[1]]
    shape = {"static_gain": Quantity(path.static_gain, "1"), "strength": Quantity(strength, "1")}
    sources = (member,) if path.source is None else (member, path.source)
    looked_at = 2.0 * len(_STRENGTHS) if strength > 0.0 else 1.0
    return Variant(columns, names, shape, sources=sources, looked_at=looked_at)


def _testable(comparison: Comparison, response: str) -> str | None:
    return no_joint(comparison, response) if swept_hz(comparison, response) is None else None


#: Of the stiffness at rest: what changes by more is no stiffness, but a swing that accelerations do not tell.
_MOST_PERCENT = 1000.0


def _reading(fitted: Fitted, comparison: Comparison) -> Reading:
    gain, sources = fitted.variant.shape.get("static_gain"), fitted.variant.sources
    moves = f"moves {fitted.response} by up to {fitted.up_to}"
    grows = "grows" if fitted.coefficients[0] > 0.0 else "falls"
    alone = Reading(f"stiffness {grows} with amplitude, which {moves}", fitted.size)
    if gain is None or not sources or sources[0] not in comparison.recorded:
        return alone
    member = sources[0]
    recorded = comparison.filled(comparison.recorded[member])
    top = float(np.abs(displacement_of(comparison, member, recorded - np.median(recorded))).max())
    rise = 300.0 * top**2 * gain.value
    cubic = fitted.coefficient()
    low, high = (rise * end for end in (cubic.low or 0.0, cubic.high or 0.0))
    stiffening = Quantity(rise * cubic.value, "percent", low, high)
    if abs(stiffening.value) > _MOST_PERCENT:
        return alone
    parameters = fitted.size | {"stiffening": stiffening}
    if len(sources) > 1 and sources[1] in comparison.recorded:
        unit = f"{comparison.channel(sources[1]).unit}/{comparison.channel(member).unit}^3"
        parameters["cubic_stiffness"] = replace(cubic, unit=unit)
    grows, above = ("grows", "above") if stiffening.value > 0.0 else ("falls", "below")
    text = (
        f"stiffness at {member} {grows} with amplitude, at the largest swing {abs(stiffening.value):.3g} % {above} "
        "that at rest; this "
    )
    return Reading(text + moves, parameters)


EFFECT = Effect(**words_of("vibration.hardening"), variants=_variants, testable=_testable, reading=_reading)
