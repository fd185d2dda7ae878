"""The displacement follows past heating: a lag or slow mode of heat that the simulation knows, but not its delay."""

from collections.abc import Iterator
from functools import partial

import numpy as np

from selector.diagnosis.comparison import Comparison
from selector.diagnosis.effects.effect import Effect, Fitted, Reading, Variant, words_of
from selector.diagnosis.effects.thermal._wording import delay_of, late, told, with_place
from selector.diagnosis.shapes import heating
from selector.diagnosis.shapes.signals import excited, lagged, quick_time_constants, time_constants
from selector.types import Vector

_MOST_SENSORS = 3


def _variants(comparison: Comparison, response: str) -> Iterator[Variant]:
    taus, warmth = time_constants(comparison, 10), heating.warm_starts(comparison, response)
    off = heating.off_starts(comparison, response)
    for name, words, heat in _heats(comparison, response):
        # runs may begin at different levels of the simulated course, and settled there
        of_course = partial(late, comparison, name, settled=name == response)
        # how long a record is says nothing of how quick a lag in it may be
        for tau_s in (*quick_time_constants(comparison, float(taus[0])), *taus):
            yield of_course([(words, heat, tau_s)])
        for some in ((1, 5), (1, 8), (3, 6), (3, 9), (5, 8), (1, 4, 8), (3, 6, 9)):
            yield of_course([(words, heat, taus[k]) for k in some])
        if comparison.channel(name).role == "temperature" and name != response:
            for tau_s in taus[3::2]:
                yield late(comparison, name, [(words, heat, 0.0), (words, heat, tau_s)], taus_s=(tau_s,))
        if np.any(warmth):
            for tau_s in taus[4::2]:
                earlier = heating.EARLIER, warmth * np.exp(-comparison.time_s / tau_s), 0.0
                yield of_course([(words, heat, tau_s), earlier], taus_s=(tau_s,))
        if np.any(off) and name == response:
            # a lag goes on from where the response was
            for tau_s in taus.tolist():
                gone_on = lagged(comparison, heat, tau_s, settled=True) + off * np.exp(-comparison.time_s / tau_s)
                from_there = f"{words} delayed by {tau_s / 60:.3g} min, from where {response} was", gone_on, 0.0
                yield of_course([from_there], taus_s=(tau_s,))


def _heats(comparison: Comparison, response: str) -> list[tuple[str, str, Vector]]:
    """Heat that the simulation carries: its course, its law of speed; with no speed, sensors that move with it."""
    simulated = heating.simulated_rise(comparison, response)
    found = []
    if excited(simulated):
        found.append((response, f"simulated {response}", comparison.simulated_course(response)))
    speed = heating.sources(comparison, response).spindle
    law = heating.spindle_law(comparison, response)
    if speed is not None and law is not None:
        found.append((speed, f"{speed}^{law.exponent:.2g}", heating.speed_power(comparison, speed, law.exponent)))
    elif speed is None and found:
        for name in _carried(comparison, response, simulated):
            found.append((name, name, heating.rise_parts(comparison, response, name).of_spindle))
    return found


def _carried(comparison: Comparison, response: str, simulated: Vector) -> list[str]:
    """Sensors that mostly move as the simulated course does, the nearest to it first."""
    near = []
    for name in heating.sources(comparison, response).machine:
        values = heating.temperature_rise(comparison, name)
        if excited(values) and heating.rise_parts(comparison, response, name).unaccounted_share < 0.1:
            near.append((abs(float(np.corrcoef(values, simulated)[0, 1])), name))
    return [name for likeness, name in sorted(near, reverse=True) if likeness > 0.5][:_MOST_SENSORS]


def _testable(comparison: Comparison, response: str) -> str | None:
    lack = f"the simulated {response} does not move: there is no heating that it could remember"
    return heating.lacking(comparison, response) or (
        None if excited(heating.simulated_rise(comparison, response)) else lack
    )


def _reading(fitted: Fitted, comparison: Comparison) -> Reading:
    name = fitted.variant.sources[0]
    heat = "its simulated course" if name == fitted.response else f"the heating {with_place(comparison, name)}"
    return told(fitted, f"{fitted.response} follows {heat} {delay_of(fitted)} that the simulation does not carry")


EFFECT = Effect(**words_of("thermal.memory"), variants=_variants, testable=_testable, reading=_reading)
