"""`vibration.hysteresis`: restoring force with memory."""

from collections.abc import Iterator
from dataclasses import replace
from functools import partial

import numpy as np

from selector.diagnosis.comparison import Comparison
from selector.diagnosis.effects.effect import Effect, Fitted, Quantity, Reading, Variant, words_of
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
from selector.diagnosis.shapes.signals import rate, swept_hz
from selector.types import Vector

Linear = tuple[float, float]

_WIDTHS = (0.03, 0.1, 0.25, 0.5, 1.0)  #: Displacement until the element slips, over the root mean square of the motion.
_LAWS: tuple[Law, ...] = ("stop", "dahl")
#: Largest force of the element over the elastic force at the root mean square of the motion.
_STRENGTHS = np.geomspace(0.03, 3.0, 5)
_MODERATE = 0.1
_REFINED = 2
_FREE = ((0.0, np.inf),)


def _variants(comparison: Comparison, response: str) -> Iterator[Variant]:
    remainder = Remainder(comparison, response)
    for member, path, onward in joints(comparison, response):
        yield from _at_joint(comparison, remainder, member, path, onward)


def _at_joint(
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
                    yield _variant(member, path, found, law, share * swing, linear)
    for _, law, width, linear in sorted(tried, key=lambda t: -t[0])[:_REFINED] if feeds_back else ():
        best = remainder.best(partial(column, law, width, linear), _STRENGTHS, rounds=2)
        if best is None:
            continue

        def slipping(width: float, law: Law = law, linear: Linear = linear, best: float = best) -> Vector | None:
            return column(law, width, linear, best)

        width = remainder.best(slipping, width * np.array([0.7, 1.0, 1.4]), rounds=1) or width
        found = slipping(width)
        if found is not None:
            looked_at = float(len(_WIDTHS) * len(_STRENGTHS))
            yield _variant(member, path, found, law, width, linear, looked_at)


def _variant(
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


def _testable(comparison: Comparison, response: str) -> str | None:
    if swept_hz(comparison, response) is not None:
        return "a response curve taken step by step does not show what happens within a cycle"
    return no_joint(comparison, response)


def _reading(fitted: Fitted, comparison: Comparison) -> Reading:
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


EFFECT = Effect(**words_of("vibration.hysteresis"), variants=_variants, testable=_testable, reading=_reading)
