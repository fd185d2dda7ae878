"""Joints that are not linear: stiffness that changes with amplitude, force with memory."""

from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial

import numpy as np

from selector.diagnosis.comparison import Comparison
from selector.diagnosis.effects.effect import Fitted, Quantity, Reading, Variant, declared
from selector.diagnosis.shapes.linear_response import (
    Law,
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


def _hardening(comparison: Comparison, response: str) -> Iterator[Variant]:
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

    What is left obeys the simulation's own equation, pushed by the force that it lacks where the member was in truth.
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


def _hardening_testable(comparison: Comparison, response: str) -> str | None:
    return no_joint(comparison, response) if swept_hz(comparison, response) is None else None


#: Of the stiffness at rest: what changes by more is no stiffness, but a swing that accelerations do not tell.
_MOST_PERCENT = 1000.0


def _hardening_reading(fitted: Fitted, comparison: Comparison) -> Reading:
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


Linear = tuple[float, float]

_WIDTHS = (0.03, 0.1, 0.25, 0.5, 1.0)  #: Displacement until the element slips, over the root mean square of the motion.
_LAWS: tuple[Law, ...] = ("stop", "dahl")
#: Largest force of the element over the elastic force at the root mean square of the motion.
_OF_SLIP = np.geomspace(0.03, 3.0, 5)
_MODERATE = 0.1
_REFINED = 2
_FREE = ((0.0, np.inf),)


def _hysteresis(comparison: Comparison, response: str) -> Iterator[Variant]:
    remainder = Remainder(comparison, response)
    for member, path, onward in joints(comparison, response):
        yield from _slipping(comparison, remainder, member, path, onward)


def _slipping(
    comparison: Comparison, remainder: Remainder, member: str, path: LinearResponse, onward: LinearResponse | None
) -> Iterator[Variant]:
    """Elements at a member, as they reach the response; the likeliest also as strong as explains most."""
    simulated = comparison.simulated_course(member)
    y = displacement_of(comparison, member, simulated)
    fitted = ~comparison.held_out
    swing = float(np.std(y[fitted]))
    if swing <= 0.0:
        return
    feeds_back = y is simulated and path.static_gain > 0.0 and path.source is not None

    def column(law: Law, width: float, linear: Linear, strength: float) -> Vector | None:
        if feeds_back:
            k = strength * swing / path.static_gain
            moved = fed_back(comparison, path, y, law, k, width=width, linear=linear)
            moved = None if moved is None else moved / k
        else:
            force = restoring(comparison, y, law, width)
            moved = -path.passed(comparison, force - linear[0] * y - linear[1] * rate(comparison, y))
        return moved if moved is None or onward is None else onward.passed(comparison, moved)

    tried: list[tuple[float, Law, float, Linear]] = []
    for law in _LAWS:
        for share in _WIDTHS if path.source is not None else _WIDTHS[1:4]:
            force = restoring(comparison, y, law, share * swing)
            for linear in ((0.0, 0.0), linear_part(comparison, path, y, force)):
                found = column(law, share * swing, linear, _MODERATE)
                if found is not None:
                    tried.append((remainder.share(found), law, share * swing, linear))
                    yield _slip_variant(member, path, found, law, share * swing, linear)
    for _, law, width, linear in sorted(tried, key=lambda t: -t[0])[:_REFINED] if feeds_back else ():
        best = remainder.best(partial(column, law, width, linear), _OF_SLIP, rounds=2)
        if best is None:
            continue

        def slipping(width: float, law: Law = law, linear: Linear = linear, best: float = best) -> Vector | None:
            return column(law, width, linear, best)

        width = remainder.best(slipping, width * np.array([0.7, 1.0, 1.4]), rounds=1) or width
        found = slipping(width)
        if found is not None:
            looked_at = float(len(_WIDTHS) * len(_OF_SLIP))
            yield _slip_variant(member, path, found, law, width, linear, looked_at)


def _slip_variant(
    member: str, path: LinearResponse, column: Vector, law: Law, width: float, linear: Linear, looked_at: float = 1.0
) -> Variant:
    """The coefficient is the largest force of the element."""
    name = "elastic element that slips" if law == "stop" else "Bouc–Wen element"
    words = ", stiffness fitted at this swing" if linear[0] != 0.0 else ""
    return Variant(
        column[:, None],
        (f"{name} at {member}{words}",),
        {"slip": Quantity(width, "unit of the motion"), "static_gain": Quantity(path.static_gain, "1")},
        sources=(member,) if path.source is None else (member, path.source),
        bounds=_FREE,
        looked_at=looked_at,
    )


def _hysteresis_testable(comparison: Comparison, response: str) -> str | None:
    if swept_hz(comparison, response) is not None:
        return "a response curve taken step by step does not show what happens within a cycle"
    return no_joint(comparison, response)


def _hysteresis_reading(fitted: Fitted, comparison: Comparison) -> Reading:
    member, *force = fitted.variant.sources
    channel = comparison.channel(member)
    slip = replace(
        fitted.parameter("slip"), unit={"acceleration": "m", "velocity": "m"}.get(channel.role, channel.unit)
    )
    parameters = {"slip": slip} | fitted.size
    text = f"a restoring force with memory acts on {member}: it slips {slip.value:.3g} {slip.unit} after each reversal"
    text += f" and moves {fitted.response} by up to {fitted.up_to}"
    if force and force[0] in comparison.recorded:
        largest = parameters["force"] = fitted.coefficient(comparison.channel(force[0]).unit)
        text += f"; its force is at most {largest.value:.3g} {largest.unit}"
    return Reading(text, parameters)


EFFECTS = (
    declared("vibration.hardening", _hardening, _hardening_testable, _hardening_reading),
    declared("vibration.hysteresis", _hysteresis, _hysteresis_testable, _hysteresis_reading),
)
