"""The hall's temperature acts on the structure."""

from collections.abc import Iterator

import numpy as np

from selector.diagnosis.comparison import Comparison
from selector.diagnosis.effects.effect import Effect, Fitted, Quantity, Reading, ShapeParameter, Variant
from selector.diagnosis.effects.thermal._wording import delay_of, late, quantities, with_place, worth
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
    lack = lacking(comparison, response)
    if lack is None and not sources(comparison, response).hall:
        return "no temperature of the hall that moves by more than its resolution was recorded"
    return lack


def _reading(fitted: Fitted, comparison: Comparison) -> Reading:
    name = fitted.variant.sources[0]
    moved = float(np.ptp(course(comparison, name)))
    return Reading(
        f"{fitted.response} follows the hall temperature {with_place(comparison, name)}, which moved by "
        f"{moved:.2g} K, {delay_of(fitted)}; {worth(fitted)}.",
        quantities(fitted) | {"per_kelvin": Quantity(float(np.sum(fitted.coefficients)), f"{fitted.unit}/K")},
    )


EFFECT = Effect(
    id="thermal.ambient",
    title="the hall temperature",
    physics="Air and floor of the hall warm the structure through its film of air; thin parts follow within minutes, "
    "column and bed within hours. The displacement follows the hall's rise with these delays, whether the "
    "spindle turns or not.",
    reference="Environmental temperature variation error: ISO 230-3 and ISO/TR 16015; a body in a film of air follows "
    "as a lag of first order with τ = ρ·c·V/(h·A): Incropera, DeWitt, Fundamentals of Heat and Mass Transfer, lumped "
    "capacitance method",
    enters="heat flow",
    acts_at="structure",
    parameters=(
        ShapeParameter("tau_s", "s", 0.0, 86400.0, "delay of the structure behind the hall"),
        ShapeParameter("slow_tau_s", "s", 0.0, 86400.0, "delay of its slow part, if two are needed"),
        ShapeParameter("per_kelvin", "um/K", -200.0, 200.0, "displacement a kelvin of the hall once all has followed"),
    ),
    needs="a recorded temperature of the hall that moves by some tenths of a kelvin",
    confounders=("thermal.second_source", "thermal.memory", "data.drift"),
    refuted_by="drift that stays when the hall is held constant, or none while the idle machine's hall moves",
    experiment="Leave the machine idle with drives on for 24 h in the changing hall (open the gate for 2 h, close it "
    "for 4 h) and record displacement and hall temperature: what moves then is the hall.",
    variants=_variants,
    testable=_testable,
    reading=_reading,
)
