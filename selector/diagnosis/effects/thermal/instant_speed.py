"""Growth or shift with the spindle speed that comes and goes with it, without any delay."""

from collections.abc import Iterator

from selector.diagnosis.comparison import Comparison
from selector.diagnosis.effects.effect import Effect, Fitted, Quantity, Reading, Variant, words_of
from selector.diagnosis.effects.thermal._wording import place_of, told
from selector.diagnosis.shapes.heating import lacking, shown_unit, sources, speed_power, top_speed_rpm

_EXPONENTS = (0.5, 1.0, 1.5, 2.0)


def _variants(comparison: Comparison, response: str) -> Iterator[Variant]:
    name = sources(comparison, response).spindle or ""
    place = place_of(comparison, name) or "spindle"
    for exponent in _EXPONENTS:
        column, shape = speed_power(comparison, name, exponent), {"speed_exponent": Quantity(exponent, "1")}
        yield Variant(column[:, None], (f"({name} / its highest value)^{exponent:g}",), shape, place, (name,))


def _testable(comparison: Comparison, response: str) -> str | None:
    lack = "no spindle speed that changes was recorded"
    return lacking(comparison, response) or (lack if sources(comparison, response).spindle is None else None)


def _reading(fitted: Fitted, comparison: Comparison) -> Reading:
    name = fitted.variant.sources[0]
    text = f"{fitted.response} shifts at once with {name}^{fitted.variant.shape['speed_exponent'].value:.2g}: "
    text += f"{fitted.coefficients[0]:+.3g} {shown_unit(fitted.unit)} at {top_speed_rpm(comparison, name):.0f} rpm"
    return told(fitted, text, at_top_speed=fitted.coefficient())


EFFECT = Effect(**words_of("thermal.instant_speed"), variants=_variants, testable=_testable, reading=_reading)
