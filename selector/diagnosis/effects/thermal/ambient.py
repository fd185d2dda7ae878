"""The hall's temperature acts on the structure."""

from collections.abc import Iterator

import numpy as np

from selector.diagnosis.comparison import Comparison
from selector.diagnosis.effects.effect import Effect, Fitted, Quantity, Reading, Variant, words_of
from selector.diagnosis.effects.thermal._wording import delay_of, late, told, with_place
from selector.diagnosis.shapes.heating import lacking, sources, temperature_rise
from selector.diagnosis.shapes.signals import course, lagged, time_constants


def _variants(comparison: Comparison, response: str) -> Iterator[Variant]:
    taus = time_constants(comparison, 9)
    for name in sources(comparison, response).hall:
        risen = temperature_rise(comparison, name)
        level = course(comparison, name)
        level = level - np.median(level[:5])
        for tau_s in (0.0, *taus):
            yield late(comparison, name, [(f"rise of {name}", risen, tau_s)], place="structure")
        if len(comparison.runs) > 1:
            for tau_s in (0.0, *taus[2::2]):
                settled = f"level of {name}, late", lagged(comparison, level, float(tau_s), settled=True), 0.0
                yield late(comparison, name, [settled], taus_s=(tau_s,), place="structure")
        for quick in (0.0, float(taus[2])):
            for slow in taus[4::2]:
                pair = [(f"rise of {name}", risen, tau_s) for tau_s in (quick, slow)]
                yield late(comparison, name, pair, place="structure")


def _testable(comparison: Comparison, response: str) -> str | None:
    lack = "no temperature of the hall that moves by more than its resolution was recorded"
    return lacking(comparison, response) or (None if sources(comparison, response).hall else lack)


def _reading(fitted: Fitted, comparison: Comparison) -> Reading:
    name = fitted.variant.sources[0]
    moved = float(np.ptp(course(comparison, name)))
    text = f"{fitted.response} follows the hall temperature {with_place(comparison, name)}, which moved by "
    text += f"{moved:.2g} K, {delay_of(fitted)}"
    return told(fitted, text, per_kelvin=Quantity(float(np.sum(fitted.coefficients)), f"{fitted.unit}/K"))


EFFECT = Effect(**words_of("thermal.ambient"), variants=_variants, testable=_testable, reading=_reading)
