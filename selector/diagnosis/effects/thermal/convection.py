"""Cooling that changes with the spindle speed, or with how warm the machine is."""

from collections.abc import Iterator

import numpy as np

from selector.diagnosis.comparison import Comparison
from selector.diagnosis.effects.effect import Effect, Fitted, Quantity, Reading, Variant, words_of
from selector.diagnosis.effects.thermal._wording import delay_of, late, place_of, told
from selector.diagnosis.shapes import heating
from selector.diagnosis.shapes.signals import excited, scaled, time_constants
from selector.types import Vector

_GROWTHS = (0.05, 0.5, 2.0)


def _variants(comparison: Comparison, response: str) -> Iterator[Variant]:
    name = heating.sources(comparison, response).spindle
    law = heating.spindle_law(comparison, response)
    simulated = heating.simulated_rise(comparison, response)
    warmth = np.abs(simulated) / max(float(np.abs(simulated).max()), 1e-300)
    gates = [("its own warmth", warmth, response)]
    if name is not None:
        gates = [(f"{name}^{p:g}", heating.speed_power(comparison, name, p), name) for p in (0.5, 1.0)] + gates
    for words, gate, source in gates:
        if law is None:
            drawn = f"simulated {response} × {words}", gate * scaled(simulated)
            yield from (late(comparison, source, [(*drawn, tau_s)]) for tau_s in time_constants(comparison, 8))
        else:
            yield from _cooled(comparison, law, words, gate, source)


def _cooled(
    comparison: Comparison, law: heating.SpindleLaw, words: str, gate: Vector, source: str
) -> Iterator[Variant]:
    """What the simulation loses when its modes cool faster: all alike (a film), or each in its own proportion."""
    heat, place = heating.speed_power(comparison, law.channel, law.exponent), place_of(comparison, source)
    plain = law.cooled_course(comparison, heat, gate, 0.0, 0.0)
    for growth in _GROWTHS:
        for alike in (True, False):
            extra = growth / law.typical_s if alike else None
            column = law.cooled_course(comparison, heat, gate, extra, growth) - plain
            names = (f"simulated course, cooled faster with {words} ({'all modes' if alike else 'in proportion'})",)
            shape = {"growth": Quantity(growth, "1")}
            yield Variant(column[:, None] / growth, names, shape, place=place, sources=(source,))


def _testable(comparison: Comparison, response: str) -> str | None:
    lack = heating.lacking(comparison, response)
    if lack is None and not excited(heating.simulated_rise(comparison, response)):
        return f"the simulated {response} does not move: nothing in it cools"
    own = f"the simulated {response} is a function of recorded temperatures, which has no cooling of its own"
    return lack or (own if heating.follows_sensors(comparison, response) else None)


def _reading(fitted: Fitted, comparison: Comparison) -> Reading:
    name = fitted.variant.sources[0]
    cause = "the warmer it is" if name == fitted.response else f"the faster {name} turns"
    size = (
        f"up to {100 * fitted.variant.shape['growth'].value:.2g} % of its rate"
        if "growth" in fitted.variant.shape
        else delay_of(fitted)
    )
    return told(fitted, f"What moves {fitted.response} cools faster {cause} ({size}) than the simulation has it")


EFFECT = Effect(**words_of("thermal.convection"), variants=_variants, testable=_testable, reading=_reading)
