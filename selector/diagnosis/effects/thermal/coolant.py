"""Coolant that changes the boundary while it runs: it takes heat away, the more the warmer the machine is."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from selector.diagnosis.comparison import Comparison
from selector.diagnosis.effects.effect import Effect, Fitted, Reading, Variant, words_of
from selector.diagnosis.effects.thermal._wording import delay_of, late, told, with_place
from selector.diagnosis.shapes.heating import EARLIER, lacking, sources, switched_on, temperature_rise, warm_starts
from selector.diagnosis.shapes.signals import course, excited, in_run, scaled, time_constants

_MOST_SENSORS = _MOST_LEVELS = 8
_COLDER = (-np.inf, 0.0)


def _variants(comparison: Comparison, response: str) -> Iterator[Variant]:
    known = sources(comparison, response)
    taus, apart = time_constants(comparison, 8), warm_starts(comparison, response)
    # what warms a part when it is switched on is coolant only if somebody says so
    cools = not known.is_coolant_said and comparison.channel(response).role == "temperature"
    for name in known.coolant_switches:
        on = switched_on(comparison, name)
        levels = _levels(comparison, name) if not known.coolant_temperatures else []
        simulated = comparison.simulated_course(response)
        starts = [float(simulated[rows][0]) for _, rows in comparison.rows_of_runs()]
        # cold is the start that the course goes farthest from: a run may begin warm
        farthest = max(starts, key=lambda one: float(np.mean((simulated - one) ** 2)))
        warmth = scaled(simulated - farthest)
        drawn = f"{name} × simulated {response}", on * warmth
        for tau_s in taus:
            shapes = [[(name, on)], *([[drawn], [(name, on), drawn]] if excited(warmth) else [])]
            for heats in shapes:
                shape = _variant(comparison, name, heats, tau_s)
                yield replace(shape, bounds=(_COLDER,) * len(heats)) if cools else shape
            if np.any(apart) and not cools:
                late_heats = [(*heat, tau_s) for heat in shapes[-1]]
                left = EARLIER, apart * np.exp(-comparison.time_s / tau_s), 0.0
                yield late(comparison, name, [*late_heats, left], taus_s=(tau_s,), regime=f"{name} on")
        for tau_s in taus[1::2] if levels and excited(warmth) else ():
            yield _variant(comparison, name, [(name, on), drawn, *levels], tau_s)
        for fluid in known.coolant_temperatures:
            for words, colder in _colder(comparison, response, fluid):
                for tau_s in taus[::2]:
                    yield _variant(comparison, name, [(f"{name} × ({words})", on * colder)], tau_s)
    if not known.coolant_switches:
        for fluid in known.coolant_temperatures:
            for tau_s in (0.0, *taus):
                yield _variant(comparison, fluid, [(f"rise of {fluid}", temperature_rise(comparison, fluid))], tau_s)


def _levels(comparison: Comparison, name: str) -> list[tuple[str, np.ndarray]]:
    """By how much more the coolant of a run draws than in the fitted runs on average.

    How cold coolant is differs from day to day, and matters as much as that it runs where its temperature is unknown.
    """
    on = switched_on(comparison, name)
    wet = [run for run, rows in comparison.rows_of_runs() if (on * ~comparison.held_out)[rows].any()]
    if len(wet) > _MOST_LEVELS:
        return []
    return [
        (f"{name} in {run} more than in {wet[-1]}", in_run(comparison, run, on) - in_run(comparison, wet[-1], on))
        for run in wet[:-1]
    ]


def _colder(comparison: Comparison, response: str, fluid: str) -> Iterator[tuple[str, np.ndarray]]:
    """How much colder the coolant is than what it may flow over [K]."""
    temperature = course(comparison, fluid)
    yield f"rise of {fluid}", temperature_rise(comparison, fluid)
    for sensor in sources(comparison, response).machine[:_MOST_SENSORS]:
        yield f"{fluid} − {sensor}", temperature - course(comparison, sensor)


def _variant(comparison: Comparison, name: str, heats: list[tuple[str, np.ndarray]], tau_s: float) -> Variant:
    regime = f"{name} on" if comparison.channel(name).role != "temperature" else None
    return late(comparison, name, [(*heat, tau_s) for heat in heats], taus_s=(tau_s,), regime=regime)


def _testable(comparison: Comparison, response: str) -> str | None:
    lack, known = lacking(comparison, response), sources(comparison, response)
    if lack or known.coolant_switches or known.coolant_temperatures:
        return lack
    return "no state, flow or temperature of the coolant that changes was recorded"


def _reading(fitted: Fitted, comparison: Comparison) -> Reading:
    what = with_place(comparison, fitted.variant.sources[0])
    is_said = sources(comparison, fitted.response).is_coolant_said
    on = f"moves while {f'the coolant runs ({what})' if is_said else f'{what} is on'}"
    when = on if fitted.variant.regime else f"follows the coolant's temperature ({what})"
    return told(fitted, f"{fitted.response} {when} {delay_of(fitted)}")


EFFECT = Effect(**words_of("thermal.coolant"), variants=_variants, testable=_testable, reading=_reading)
