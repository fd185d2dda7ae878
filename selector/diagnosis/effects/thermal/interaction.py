"""The response to one temperature depends on another: products of rises, not delayed."""

from collections.abc import Iterator

from selector.diagnosis.comparison import Comparison
from selector.diagnosis.effects.effect import Effect, Fitted, Quantity, Reading, Variant, words_of
from selector.diagnosis.effects.thermal._wording import place_of, told, with_place
from selector.diagnosis.shapes.heating import lacking, rise_parts, shown_unit, simulated_rise, sources
from selector.diagnosis.shapes.signals import excited
from selector.types import Vector

_MOST_SENSORS = 8


def _variants(comparison: Comparison, response: str) -> Iterator[Variant]:
    known = sources(comparison, response)
    names = known.machine[:_MOST_SENSORS]
    rises = {name: rise_parts(comparison, response, name).calm for name in names}
    for k, first in enumerate(names):
        for second in names[k:]:
            yield _variant(comparison, (first, second), rises[first] * rises[second], "K²")
    simulated = simulated_rise(comparison, response)
    if excited(simulated):
        for name in names:
            yield _variant(comparison, (response, name), simulated * rises[name], "")
        yield _variant(comparison, (response, response), simulated**2, "")


def _variant(comparison: Comparison, pair: tuple[str, str], product: Vector, unit: str) -> Variant:
    inputs = {channel.name for channel in comparison.channels} - set(comparison.responses)
    first, second = (name if unit or name in inputs else f"simulated {name}" for name in pair)
    words = f"square of {first}" if first == second else f"{first} × {second}"
    place = place_of(comparison, pair[1])
    return Variant(product[:, None], (words,), {}, place=place, sources=tuple(dict.fromkeys(pair)))


def _testable(comparison: Comparison, response: str) -> str | None:
    lack = lacking(comparison, response)
    if lack or sources(comparison, response).machine or excited(simulated_rise(comparison, response)):
        return lack
    return "no temperature of the machine that moves was recorded, and the simulated course stands still"


def _reading(fitted: Fitted, comparison: Comparison) -> Reading:
    pair = fitted.variant.sources
    first, second = pair[0], pair[-1]
    slope = f"its own {'rise' if first != fitted.response else 'size'}" if first == second else "that of "
    other = "" if first == second else with_place(comparison, second)
    subject = f"the simulated {first}" if first == fitted.response else with_place(comparison, first)
    text = f"{fitted.response} goes with {subject} by an amount that depends on {slope}{other}: "
    text += f"{fitted.coefficients[0]:+.2g} {shown_unit(fitted.unit)} a unit of their product"
    return told(fitted, text, product=Quantity(float(fitted.coefficients[0]), f"{fitted.unit}/K^2"))


EFFECT = Effect(**words_of("thermal.interaction"), variants=_variants, testable=_testable, reading=_reading)
