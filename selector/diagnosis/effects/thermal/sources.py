"""Heat and cold that the simulation lacks: hall, coolant, spindle, other sources."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from selector.diagnosis.comparison import Comparison
from selector.diagnosis.effects.effect import Fitted, Quantity, Reading, Variant, declared
from selector.diagnosis.effects.thermal._wording import delay_of, late, place_of, told, with_place
from selector.diagnosis.shapes import heating
from selector.diagnosis.shapes.signals import course, excited, in_run, lagged, scaled, time_constants
from selector.types import Vector


def _ambient(comparison: Comparison, response: str) -> Iterator[Variant]:
    taus = time_constants(comparison, 9)
    for name in heating.sources(comparison, response).hall:
        risen = heating.temperature_rise(comparison, name)
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


def _ambient_testable(comparison: Comparison, response: str) -> str | None:
    lack = "no temperature of the hall that moves by more than its resolution was recorded"
    return heating.lacking(comparison, response) or (None if heating.sources(comparison, response).hall else lack)


def _ambient_reading(fitted: Fitted, comparison: Comparison) -> Reading:
    name = fitted.variant.sources[0]
    moved = float(np.ptp(course(comparison, name)))
    text = f"{fitted.response} follows the hall temperature {with_place(comparison, name)}, which moved by "
    text += f"{moved:.2g} K, {delay_of(fitted)}"
    return told(fitted, text, per_kelvin=Quantity(float(np.sum(fitted.coefficients)), f"{fitted.unit}/K"))


_MOST_SENSORS = _MOST_LEVELS = 8
_COLDER = (-np.inf, 0.0)


def _coolant(comparison: Comparison, response: str) -> Iterator[Variant]:
    known = heating.sources(comparison, response)
    taus, apart = time_constants(comparison, 8), heating.warm_starts(comparison, response)
    # what warms a part when it is switched on is coolant only if somebody says so
    cools = not known.is_coolant_said and comparison.channel(response).role == "temperature"
    for name in known.coolant_switches:
        on = heating.switched_on(comparison, name)
        levels = _levels(comparison, name) if not known.coolant_temperatures else []
        simulated = comparison.simulated_course(response)
        starts = [float(simulated[rows][0]) for _, rows in comparison.rows_of_runs()]
        # cold is the start that the course goes farthest from: a run may begin warm
        farthest = max(starts, key=lambda one: float(np.mean((simulated - one) ** 2)))
        warmth = scaled(simulated - farthest)
        drawn = f"{name} × simulated {response}", on * warmth
        for tau_s in taus:
            shapes = [[(name, on)], *([[drawn], [(name, on), drawn]] if excited(warmth) else [])]
            for some in shapes:
                shape = _of_coolant(comparison, name, some, tau_s)
                yield replace(shape, bounds=(_COLDER,) * len(some)) if cools else shape
            if np.any(apart) and not cools:
                late_heats = [(*heat, tau_s) for heat in shapes[-1]]
                left = heating.EARLIER, apart * np.exp(-comparison.time_s / tau_s), 0.0
                yield late(comparison, name, [*late_heats, left], taus_s=(tau_s,), regime=f"{name} on")
        for tau_s in taus[1::2] if levels and excited(warmth) else ():
            yield _of_coolant(comparison, name, [(name, on), drawn, *levels], tau_s)
        for fluid in known.coolant_temperatures:
            for words, colder in _colder(comparison, response, fluid):
                for tau_s in taus[::2]:
                    yield _of_coolant(comparison, name, [(f"{name} × ({words})", on * colder)], tau_s)
    if not known.coolant_switches:
        for fluid in known.coolant_temperatures:
            for tau_s in (0.0, *taus):
                yield _of_coolant(
                    comparison, fluid, [(f"rise of {fluid}", heating.temperature_rise(comparison, fluid))], tau_s
                )


def _levels(comparison: Comparison, name: str) -> list[tuple[str, np.ndarray]]:
    """By how much more the coolant of a run draws than in the fitted runs on average.

    How cold coolant is differs from day to day, and matters as much as that it runs where its temperature is unknown.
    """
    on = heating.switched_on(comparison, name)
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
    yield f"rise of {fluid}", heating.temperature_rise(comparison, fluid)
    for sensor in heating.sources(comparison, response).machine[:_MOST_SENSORS]:
        yield f"{fluid} − {sensor}", temperature - course(comparison, sensor)


def _of_coolant(comparison: Comparison, name: str, heats: list[tuple[str, np.ndarray]], tau_s: float) -> Variant:
    regime = f"{name} on" if comparison.channel(name).role != "temperature" else None
    return late(comparison, name, [(*heat, tau_s) for heat in heats], taus_s=(tau_s,), regime=regime)


def _coolant_testable(comparison: Comparison, response: str) -> str | None:
    lack, known = heating.lacking(comparison, response), heating.sources(comparison, response)
    if lack or known.coolant_switches or known.coolant_temperatures:
        return lack
    return "no state, flow or temperature of the coolant that changes was recorded"


def _coolant_reading(fitted: Fitted, comparison: Comparison) -> Reading:
    what = with_place(comparison, fitted.variant.sources[0])
    is_said = heating.sources(comparison, fitted.response).is_coolant_said
    on = f"moves while {f'the coolant runs ({what})' if is_said else f'{what} is on'}"
    when = on if fitted.variant.regime else f"follows the coolant's temperature ({what})"
    return told(fitted, f"{fitted.response} {when} {delay_of(fitted)}")


_FREE_SHARE = 0.03
_FREE_SHARE_IF_SAID = 0.015
_OWN_SHARE = 0.5
_MOST_CHANNELS = 12


def _second_source(comparison: Comparison, response: str) -> Iterator[Variant]:
    taus = time_constants(comparison, 8)
    for name in heating.sources(comparison, response).other_heat[:_MOST_CHANNELS]:
        for words, heat in heating.heats(comparison, name):
            for tau_s in taus:
                yield late(comparison, name, [(words, heat, tau_s)])
            for pair in ((1, 4), (2, 6), (4, 7)):
                yield late(comparison, name, [(words, heat, taus[k]) for k in pair])
    for name, words, heat in _warm_places(comparison, response):
        for tau_s in (0.0, *taus[1::2]):
            yield late(comparison, name, [(words, heat, tau_s)])
        for slow in taus[2::2]:
            yield late(comparison, name, [(words, heat, 0.0), (words, heat, slow)])


def _warm_places(comparison: Comparison, response: str) -> list[tuple[str, str, Vector]]:
    """Temperatures that the spindle does not account for: whole if hardly, else what it leaves of them."""
    found: list[tuple[float, str, str, Vector]] = []
    for name in heating.sources(comparison, response).machine:
        parts = heating.rise_parts(comparison, response, name)
        free, share = parts.unaccounted, parts.unaccounted_share
        said = heating.says_other_source(comparison.channel(name))
        is_enough = share >= (_FREE_SHARE_IF_SAID if said else _FREE_SHARE)
        if not is_enough or not excited(free, comparison.resolution.get(name, 0.0)):
            continue
        if share > _OWN_SHARE or said:
            found.append((share, name, f"rise of {name}", heating.rise_parts(comparison, response, name).calm))
        if share < 0.95:
            found.append((share, name, f"what spindle and hall leave of {name}", free))
    found.sort(key=lambda one: one[0], reverse=True)
    return [(name, words, heat) for _, name, words, heat in found[:_MOST_CHANNELS]]


def _second_source_testable(comparison: Comparison, response: str) -> str | None:
    lack = "no feed, current, power, state or temperature was recorded that shows a source other than the spindle"
    short = heating.lacking(comparison, response)
    return short or (
        None if heating.sources(comparison, response).other_heat or _warm_places(comparison, response) else lack
    )


def _second_source_reading(fitted: Fitted, comparison: Comparison) -> Reading:
    name = fitted.variant.sources[0]
    text = (
        f"{fitted.response} follows {with_place(comparison, name)}, a source of heat that the simulation does not have,"
    )
    return told(fitted, f"{text} {delay_of(fitted)}")


_APART = 0.2
_ALL = 0.99  #: Squared correlation of a simulated course with its part by the speed, from which it is all of it.


def _speed_heating(comparison: Comparison, response: str) -> Iterator[Variant]:
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


def _speed_heating_testable(comparison: Comparison, response: str) -> str | None:
    lack, name = heating.lacking(comparison, response), heating.sources(comparison, response).spindle
    if lack is not None or name is None:
        return lack or "no spindle speed that changes was recorded"
    part = heating.speed_power(comparison, name, 1.0)
    # speeds apart by a tenth of the highest that took at least 3 % of the time it turned
    counts = np.histogram(part[part > 0.05], bins=np.arange(0.05, 1.16, 0.1))[0]
    is_one = np.sum(counts > 0.03 * max(counts.sum(), 1)) < 2 and heating.spindle_law(comparison, response) is not None
    return "the spindle turned at one speed only, which shows no law of speed" if is_one else None


def _speed_heating_reading(fitted: Fitted, comparison: Comparison) -> Reading:
    variant = fitted.variant
    name = variant.sources[0]
    if "from_speed" in variant.shape:
        law = f"grows faster above {variant.shape['from_speed'].value:.0f} rpm"
    else:
        law = f"goes with {name}^{variant.shape['speed_exponent'].value:.2g}"
    known = heating.spindle_law(comparison, fitted.response)
    has = "has none" if known is None else f"has {name}^{known.exponent:.2g}"
    return told(fitted, f"{fitted.response} shows heating by the spindle that {law}, where the simulation {has}")


EFFECTS = (
    declared("thermal.ambient", _ambient, _ambient_testable, _ambient_reading),
    declared("thermal.coolant", _coolant, _coolant_testable, _coolant_reading),
    declared("thermal.second_source", _second_source, _second_source_testable, _second_source_reading),
    declared("thermal.speed_heating", _speed_heating, _speed_heating_testable, _speed_heating_reading),
)
