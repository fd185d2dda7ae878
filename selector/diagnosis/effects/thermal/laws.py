"""Laws of heat that the simulation has otherwise: cooling, delays, products, speed at once."""

from collections.abc import Iterator
from functools import partial

import numpy as np

from selector.diagnosis.comparison import Comparison
from selector.diagnosis.effects.effect import Fitted, Quantity, Reading, Variant, declared
from selector.diagnosis.effects.thermal._wording import delay_of, late, place_of, told, with_place
from selector.diagnosis.shapes import heating
from selector.diagnosis.shapes.signals import excited, lagged, quick_time_constants, scaled, time_constants
from selector.types import Vector

_GROWTHS = (0.05, 0.5, 2.0)


def _convection(comparison: Comparison, response: str) -> Iterator[Variant]:
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


def _convection_testable(comparison: Comparison, response: str) -> str | None:
    lack = heating.lacking(comparison, response)
    if lack is None and not excited(heating.simulated_rise(comparison, response)):
        return f"the simulated {response} does not move: nothing in it cools"
    own = f"the simulated {response} is a function of recorded temperatures, which has no cooling of its own"
    return lack or (own if heating.follows_sensors(comparison, response) else None)


def _convection_reading(fitted: Fitted, comparison: Comparison) -> Reading:
    name = fitted.variant.sources[0]
    cause = "the warmer it is" if name == fitted.response else f"the faster {name} turns"
    size = (
        f"up to {100 * fitted.variant.shape['growth'].value:.2g} % of its rate"
        if "growth" in fitted.variant.shape
        else delay_of(fitted)
    )
    return told(fitted, f"What moves {fitted.response} cools faster {cause} ({size}) than the simulation has it")


_EXPONENTS = (0.5, 1.0, 1.5, 2.0)


def _instant_speed(comparison: Comparison, response: str) -> Iterator[Variant]:
    name = heating.sources(comparison, response).spindle or ""
    place = place_of(comparison, name) or "spindle"
    for exponent in _EXPONENTS:
        column, shape = heating.speed_power(comparison, name, exponent), {"speed_exponent": Quantity(exponent, "1")}
        yield Variant(column[:, None], (f"({name} / its highest value)^{exponent:g}",), shape, place, (name,))


def _instant_speed_testable(comparison: Comparison, response: str) -> str | None:
    lack = "no spindle speed that changes was recorded"
    return heating.lacking(comparison, response) or (
        lack if heating.sources(comparison, response).spindle is None else None
    )


def _instant_speed_reading(fitted: Fitted, comparison: Comparison) -> Reading:
    name = fitted.variant.sources[0]
    unit, top_rpm = heating.shown_unit(fitted.unit), heating.top_speed_rpm(comparison, name)
    text = f"{fitted.response} shifts at once with {name}^{fitted.variant.shape['speed_exponent'].value:.2g}: "
    text += f"{fitted.coefficients[0]:+.3g} {unit} at {top_rpm:.0f} rpm"
    return told(fitted, text, at_top_speed=fitted.coefficient())


_MOST_SENSORS = 8


def _interaction(comparison: Comparison, response: str) -> Iterator[Variant]:
    known = heating.sources(comparison, response)
    names = known.machine[:_MOST_SENSORS]
    rises = {name: heating.rise_parts(comparison, response, name).calm for name in names}
    for k, first in enumerate(names):
        for second in names[k:]:
            yield _product(comparison, (first, second), rises[first] * rises[second], "K²")
    simulated = heating.simulated_rise(comparison, response)
    if excited(simulated):
        for name in names:
            yield _product(comparison, (response, name), simulated * rises[name], "")
        yield _product(comparison, (response, response), simulated**2, "")


def _product(comparison: Comparison, pair: tuple[str, str], product: Vector, unit: str) -> Variant:
    inputs = {channel.name for channel in comparison.channels} - set(comparison.responses)
    first, second = (name if unit or name in inputs else f"simulated {name}" for name in pair)
    words = f"square of {first}" if first == second else f"{first} × {second}"
    place = place_of(comparison, pair[1])
    return Variant(product[:, None], (words,), {}, place=place, sources=tuple(dict.fromkeys(pair)))


def _interaction_testable(comparison: Comparison, response: str) -> str | None:
    lack = heating.lacking(comparison, response)
    if lack or heating.sources(comparison, response).machine or excited(heating.simulated_rise(comparison, response)):
        return lack
    return "no temperature of the machine that moves was recorded, and the simulated course stands still"


def _interaction_reading(fitted: Fitted, comparison: Comparison) -> Reading:
    pair = fitted.variant.sources
    first, second = pair[0], pair[-1]
    slope = f"its own {'rise' if first != fitted.response else 'size'}" if first == second else "that of "
    other = "" if first == second else with_place(comparison, second)
    subject = f"the simulated {first}" if first == fitted.response else with_place(comparison, first)
    text = f"{fitted.response} goes with {subject} by an amount that depends on {slope}{other}: "
    text += f"{fitted.coefficients[0]:+.2g} {heating.shown_unit(fitted.unit)} a unit of their product"
    return told(fitted, text, product=Quantity(float(fitted.coefficients[0]), f"{fitted.unit}/K^2"))


_MOST_CARRIERS = 3


def _memory(comparison: Comparison, response: str) -> Iterator[Variant]:
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
    return [name for likeness, name in sorted(near, reverse=True) if likeness > 0.5][:_MOST_CARRIERS]


def _memory_testable(comparison: Comparison, response: str) -> str | None:
    lack = f"the simulated {response} does not move: there is no heating that it could remember"
    return heating.lacking(comparison, response) or (
        None if excited(heating.simulated_rise(comparison, response)) else lack
    )


def _memory_reading(fitted: Fitted, comparison: Comparison) -> Reading:
    name = fitted.variant.sources[0]
    heat = "its simulated course" if name == fitted.response else f"the heating {with_place(comparison, name)}"
    return told(fitted, f"{fitted.response} follows {heat} {delay_of(fitted)} that the simulation does not carry")


EFFECTS = (
    declared("thermal.convection", _convection, _convection_testable, _convection_reading),
    declared("thermal.instant_speed", _instant_speed, _instant_speed_testable, _instant_speed_reading),
    declared("thermal.interaction", _interaction, _interaction_testable, _interaction_reading),
    declared("thermal.memory", _memory, _memory_testable, _memory_reading),
)
