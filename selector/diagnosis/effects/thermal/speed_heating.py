"""Heating by the spindle that the simulation lacks, or has with another law of speed."""

from collections.abc import Iterator

import numpy as np

from selector.diagnosis.comparison import Comparison
from selector.diagnosis.effects.effect import Effect, Fitted, Quantity, Reading, Variant, words_of
from selector.diagnosis.effects.thermal._wording import late, place_of, told
from selector.diagnosis.shapes import heating
from selector.diagnosis.shapes.signals import time_constants
from selector.types import Vector

_APART = 0.2
_ALL = 0.99  #: Squared correlation of a simulated course with its part by the speed, from which it is all of it.


def _variants(comparison: Comparison, response: str) -> Iterator[Variant]:
    name, law = heating.sources(comparison, response).spindle or "", heating.spindle_law(comparison, response)
    yield from _lacking_heat(comparison, name) if law is None else _other_law(comparison, response, name, law)


def _lacking_heat(comparison: Comparison, name: str) -> Iterator[Variant]:
    taus = time_constants(comparison, 8)
    place = place_of(comparison, name) or "spindle bearings"
    for exponent in (0.5, 1.0, 1.5, 2.0, 3.0):
        heat, shape = heating.speed_power(comparison, name, exponent), {"speed_exponent": Quantity(exponent, "1")}
        for some in (*((k,) for k in range(len(taus))), (1, 4), (2, 6), (4, 7)):
            parts = [(f"{name}^{exponent:g}", heat, taus[k]) for k in some]
            yield late(comparison, name, parts, shape, place=place)


def _other_law(comparison: Comparison, response: str, name: str, law: heating.SpindleLaw) -> Iterator[Variant]:
    """The simulation's own lags, fed with another power of the speed, or only above a speed."""
    place, warmth = place_of(comparison, name) or "spindle bearings", heating.warm_starts(comparison, response)
    lags = time_constants(comparison, 5)[2:] if np.any(warmth) else ()
    earlier = [((), ()), *(((warmth * np.exp(-comparison.time_s / tau_s),), (heating.EARLIER,)) for tau_s in lags)]
    own = law.course(comparison, heating.speed_power(comparison, name, law.exponent))
    if np.corrcoef(own, heating.simulated_rise(comparison, response))[0, 1] ** 2 < _ALL:
        # the gain would take what the simulation has of this heat off the rest of it, too
        earlier += [((own, *left), (f"{name}^{law.exponent:g} of the simulation", *said)) for left, said in earlier]

    def of_heat(words: str, heat: Vector, shape: dict[str, Quantity], regime: str | None = None) -> Iterator[Variant]:
        column = law.course(comparison, heat)
        for beside, said in earlier:
            names = (f"{words} with the simulation's own delays", *said)
            yield Variant(np.column_stack([column, *beside]), names, shape, place=place, sources=(name,), regime=regime)

    for exponent in heating.EXPONENTS:
        if abs(exponent - law.exponent) >= _APART:
            shape = {"speed_exponent": Quantity(exponent, "1")}
            yield from of_heat(f"{name}^{exponent:g}", heating.speed_power(comparison, name, exponent), shape)
    top, part = heating.top_speed_rpm(comparison, name), heating.speed_power(comparison, name, 1.0)
    for level in _thresholds(part):
        shape, above = {"from_speed": Quantity(level * top, "rpm")}, f"{level * top:.0f} rpm"
        yield from of_heat(f"{name} above {above},", np.maximum(part - level, 0.0), shape, f"{name} > {above}")


def _thresholds(part: np.ndarray) -> list[float]:
    """Parts of the highest speed below which, and above which, the spindle turned for a tenth of the time."""
    turning = part[part > 0.05]
    levels = (0.25, 0.4, 0.55, 0.7) if len(turning) else ()
    return [level for level in levels if np.mean(turning < level) > 0.1 and np.mean(turning > level) > 0.1]


def _testable(comparison: Comparison, response: str) -> str | None:
    lack, name = heating.lacking(comparison, response), heating.sources(comparison, response).spindle
    if lack is not None or name is None:
        return lack or "no spindle speed that changes was recorded"
    part = heating.speed_power(comparison, name, 1.0)
    # speeds apart by a tenth of the highest that took at least 3 % of the time it turned
    counts = np.histogram(part[part > 0.05], bins=np.arange(0.05, 1.16, 0.1))[0]
    is_one = np.sum(counts > 0.03 * max(counts.sum(), 1)) < 2 and heating.spindle_law(comparison, response) is not None
    return "the spindle turned at one speed only, which shows no law of speed" if is_one else None


def _reading(fitted: Fitted, comparison: Comparison) -> Reading:
    variant = fitted.variant
    name = variant.sources[0]
    if "from_speed" in variant.shape:
        law = f"grows faster above {variant.shape['from_speed'].value:.0f} rpm"
    else:
        law = f"goes with {name}^{variant.shape['speed_exponent'].value:.2g}"
    known = heating.spindle_law(comparison, fitted.response)
    has = "has none" if known is None else f"has {name}^{known.exponent:.2g}"
    return told(fitted, f"{fitted.response} shows heating by the spindle that {law}, where the simulation {has}")


EFFECT = Effect(**words_of("thermal.speed_heating"), variants=_variants, testable=_testable, reading=_reading)
