"""Cases whose simulation lacks heat or cold: a second source, a law of speed, growth at once, the hall, coolant."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from proving_ground.concealment import cold_spells, like_in_first_run, one_axis, opposed, seldom
from proving_ground.thermal.duty import (
    BOTH,
    STEP_S,
    Duty,
    Omission,
    changed,
    gated,
    held,
    load,
    once,
    wandering,
    with_bath,
    with_power,
)
from proving_ground.thermal.machine import Heat, Machine
from proving_ground.thermal.scene import FINE, STRIDE, WHITE, Gauge, of, thermal_case, warmed
from proving_ground.world import scenarios_of
from selector.recording import Channel
from selector.types import Matrix, Vector


def source(
    inlet: str, watts: Callable[[Duty], Vector], axes: Mapping[str, float] = BOTH, *, brief: bool = False
) -> Omission:
    """Heat at an inlet that the simulation does not have."""

    def heated(_tool: Machine, heat: Heat, one: Duty, size: float) -> Heat:
        return with_power(heat, inlet, size * watts(one))

    return Omission("thermal.second_source", place=inlet, heated=heated, axes=axes, brief=brief)


def feed_watts(one: Duty) -> Vector:
    """Heat of a ball-screw nut at 50 W for 9 m/min."""
    return 50.0 * one["feed"] / 9000.0


def _oil(generator: np.random.Generator, one: Duty) -> Vector:
    warm = warmed(14.0 * one["hydraulics"], 1500.0)
    return one["hall"][0] + 2.0 + warm + 0.2 * wandering(generator, len(warm), 3000.0)


with_hydraulics = changed(
    hydraulics=lambda draw, one: gated(draw, len(one.time_s), (180.0, 700.0), (180.0, 700.0)), oil_degc=_oil
)
"""Duties with a hydraulic pump that runs by turns, up to a whole hour, and the temperature of its tank."""


def _follows_spindle(generator: np.random.Generator, one: Duty) -> Vector:
    if one.run == "r1":
        return 9000.0 * one["speed"] / max(1.0, float(one["speed"].max()))
    return held(generator, len(one.time_s), 10.0, 50.0, np.array([0.0, 3000.0, 6000.0, 9000.0]))


def _cabinet(generator: np.random.Generator, one: Duty) -> Vector:
    on = held(generator, len(one.time_s), 20.0, 70.0, np.array([0.0, 0.5, 1.0]))
    return 26.0 + 11.0 * warmed(on, 1200.0)


_CABINET = Gauge(
    Channel("T10", "temperature", "degC", "control cabinet"), lambda one, _: one["cabinet_degc"], lag_s=60.0
)
_SOURCES = (
    thermal_case(
        "thermal.second_source/feed",
        "The nut of the Z axis heats the column; offset and gain of the simulation were fitted to that.",
        (source("nut", feed_watts),),
        ("warm-up", "steps", "intermittent"),
        (of("n"), of("f")),
        hidden=("absorbed",),
        refitted=True,
        **WHITE,
    ),
    thermal_case(
        "thermal.second_source/cabinet",
        "A cabinet at the rear wall bends the column; its temperature is recorded.",
        (source("rear wall", lambda one: 8.0 * (one["cabinet_degc"] - one["cabinet_degc"][0]), {"Z": 1.0, "Y": -1.0}),),
        ("steps", "intermittent", "warm-up"),
        (of("n"), _CABINET, of("T11")),
        hidden=(opposed,),
        duties=changed(cabinet_degc=_cabinet),
    ),
    thermal_case(
        "thermal.second_source/seldom",
        "A hydraulic unit at the column's foot runs for some twenty minutes once in a run.",
        (source("hydraulics", lambda one: 120.0 * one["hydraulics"], brief=True),),
        ("warm-up", "steps", "intermittent"),
        (of("n"), of("M20"), of("T9")),
        hidden=(seldom("M20"),),
        duties=changed(hydraulics=lambda draw, one: once(draw, one, 0.2, 0.6, (18.0, 26.0)), oil_degc=_oil),
    ),
    thermal_case(
        "thermal.second_source/with the spindle",
        "In the first run feed goes with spindle speed; in the others it has its own programme.",
        (source("motor", feed_watts),),
        ("intermittent", "steps", "cooling"),
        (of("n"), of("f")),
        hidden=(like_in_first_run,),
        duties=changed(feed=_follows_spindle),
    ),
    thermal_case(
        "thermal.second_source/hydraulics",
        "Hydraulics by turns, Y alone; only the temperature of the tank tells; coolant is known.",
        (source("hydraulics", lambda one: 90.0 * one["hydraulics"], {"Y": 1.0}),),
        ("steps", "intermittent", "steps"),
        (of("n"), of("M8"), of("T8"), of("T9")),
        hidden=("absorbed", one_axis("Y")),
        knows=("coolant",),
        duties=with_hydraulics,
        **WHITE,
    ),
)


def heating(watts: Mapping[str, float], exponent: float, *, onset: float = 0.0, **omission: Any) -> Omission:
    """Heat that the simulation lacks: watts at highest speed times (share of it above `onset`)^exponent."""

    def heated(tool: Machine, heat: Heat, one: Duty, size: float) -> Heat:
        share = np.maximum(one["speed"] / tool.highest_rpm - onset, 0.0) / (1.0 - onset)
        for inlet, most in watts.items():
            heat = with_power(heat, inlet, size * most * share**exponent)
        return heat

    return Omission("thermal.speed_heating", place="spindle bearings", heated=heated, **omission)


def growth(exponent: float, axes: Mapping[str, float], *, brief: bool = False) -> Omission:
    """Shift by speed at once: micrometres at highest speed times (share of it)^exponent."""

    def shifted(tool: Machine, rises: Matrix, one: Duty) -> dict[str, Vector]:
        share = one["speed"][::STRIDE] / tool.highest_rpm
        return dict.fromkeys(BOTH, (share**exponent)[: len(rises)])

    return Omission("thermal.instant_speed", place="spindle", shifted=shifted, axes=axes, brief=brief)


def sprints(generator: np.random.Generator, duties: Sequence[Duty]) -> list[Duty]:
    """Programmes that stay below 55 % of the highest speed but for two sprints of some minutes in every run but r1."""
    result = []
    highest = max(float(one["speed"].max()) for one in duties)
    for one in duties:
        speed = 0.55 * highest * one["speed"] / max(1.0, float(one["speed"].max()))
        if one.run != duties[0].run:
            for start in (0.25, 0.6):
                at = int(len(speed) * (start + generator.uniform(0.0, 0.2)))
                speed[at : at + int(60.0 * generator.uniform(6.0, 9.0) / STEP_S)] = highest
        result.append(one.having(speed=speed))
    return result


_SPEED = (
    thermal_case(
        "thermal.speed_heating/law",
        "Heat grows with a higher power of speed than the simulation has; its gain was fitted to the machine.",
        (heating({"front bearing": 40.0, "rear bearing": 20.0}, 2.9),),
        ("warm-up", "steps", "staircase"),
        hidden=("absorbed",),
        law=(0.9, 1.1),
        refitted=True,
        **WHITE,
    ),
    thermal_case(
        "thermal.speed_heating/onset",
        "Churning above 60 % of the highest speed, which is reached in a few sprints only.",
        (heating({"front bearing": 60.0}, 1.0, onset=0.6, brief=True),),
        ("steps", "steps", "intermittent"),
        hidden=(seldom("n", 0.6),),
        duties=sprints,
    ),
    thermal_case(
        "thermal.speed_heating/one axis",
        "The rear bearing heats more with speed than the simulation knows; that bends Y alone.",
        (heating({"rear bearing": 40.0}, 2.6, axes={"Y": 1.0}),),
        ("steps", "intermittent", "staircase"),
        hidden=("absorbed", one_axis("Y")),
        law=(0.9, 1.2),
        **FINE,
    ),
    thermal_case(
        "thermal.instant_speed/absorbed",
        "The spindle grows with the square of speed; offset and gain of the simulation were fitted to it.",
        (growth(2.0, {"Z": 1.0}),),
        ("warm-up", "cooling", "steps"),
        hidden=("absorbed",),
        refitted=True,
        **WHITE,
    ),
    thermal_case(
        "thermal.instant_speed/opposed",
        "Preload moves the shaft in proportion to speed, out in Z and back in Y.",
        (growth(1.0, {"Z": 1.0, "Y": -0.8}),),
        ("steps", "intermittent", "cooling"),
        hidden=("absorbed", opposed),
        **FINE,
    ),
    thermal_case(
        "thermal.instant_speed/sprints",
        "Growth by the third power of speed, which matters in a few sprints only.",
        (growth(3.0, {"Z": 1.0}, brief=True),),
        ("steps", "steps", "intermittent"),
        hidden=(seldom("n", 0.6), one_axis("Z")),
        duties=sprints,
    ),
)


def hall(**omission: Any) -> Omission:
    """The hall acts on the machine; the simulation has it constant."""

    def heated(_tool: Machine, heat: Heat, one: Duty, size: float) -> Heat:
        start = one["hall"][0]
        return with_bath(heat, "hall", start + size * (one["hall"] - start), np.ones(len(one.time_s)))

    return Omission("thermal.ambient", place="structure", heated=heated, **omission)


def jets(by: Callable[[Duty], Vector] = lambda one: one["coolant"], **omission: Any) -> Omission:
    """Coolant on nose, headstock and column foot while it runs."""

    def heated(_tool: Machine, heat: Heat, one: Duty, size: float) -> Heat:
        return with_bath(heat, "coolant", one["coolant_degc"], size * by(one))

    return Omission("thermal.coolant", place="headstock nose", heated=heated, **omission)


def _gate(generator: np.random.Generator, one: Duty) -> Vector:
    cold = once(generator, one, 0.3, 0.7, (13.0, 17.0))
    return warmed(one["hall"] - (cold * generator.uniform(5.0, 7.0) if one.run != "r1" else cold), 90.0)


def while_turning(_generator: np.random.Generator, one: Duty) -> Vector:
    """1 while the spindle turns, else 0."""
    return (one["speed"] > 0.0).astype(np.float64)


def _with_spindle(generator: np.random.Generator, one: Duty) -> Vector:
    if one.run == "r1":
        return while_turning(generator, one)
    return gated(generator, len(one.time_s), (200.0, 500.0), (150.0, 500.0))


def chilled(generator: np.random.Generator, one: Duty) -> Vector:
    """Coolant that a chiller keeps some kelvins below the hall."""
    return np.full(len(one.time_s), one["hall"][0] - float(generator.uniform(3.0, 6.0)))


DRIFT = (21.0, 0.8, 1.3)
"""A hall that drifts by some kelvins."""
_SURROUNDINGS = (
    thermal_case(
        "thermal.ambient/absorbed",
        "The hall drifts by a few kelvins; offset and gain of the simulation were fitted to that.",
        (hall(),),
        ("warm-up", "steps", "intermittent"),
        hidden=("absorbed",),
        knows=("constant hall",),
        hall=DRIFT,
        refitted=True,
        **WHITE,
    ),
    thermal_case(
        "thermal.ambient/one axis",
        "The hall bends Y alone; coolant and feed are there and known.",
        (hall(axes={"Y": 1.0}),),
        ("steps", "intermittent", "cooling"),
        (of("n"), of("M8"), of("T8"), of("f")),
        hidden=("small", one_axis("Y")),
        knows=("constant hall", "coolant", "feed"),
        hall=DRIFT,
        **FINE,
    ),
    thermal_case(
        "thermal.ambient/warmed by the machine",
        "In the first run the hall warms up with the machine; in the others it goes its own way.",
        (hall(),),
        ("warm-up", "steps", "intermittent"),
        hidden=(like_in_first_run,),
        knows=("constant hall",),
        hall=(21.0, 0.3, 0.8),
        duties=changed(
            hall=lambda _, one: one["hall"][0] + 3.0 * warmed(load(one), 1500.0) if one.run == "r1" else one["hall"]
        ),
    ),
    thermal_case(
        "thermal.ambient/gate",
        "A gate lets cold air in for a quarter of an hour; the hall is steady otherwise.",
        (hall(brief=True),),
        ("warm-up", "steps", "steps"),
        hidden=(cold_spells,),
        knows=("constant hall",),
        hall=(21.0, 0.15, 0.02),
        duties=changed(hall=_gate),
    ),
    thermal_case(
        "thermal.coolant/small",
        "Chilled coolant; only the state of its pump is recorded.",
        (jets(),),
        ("steps", "intermittent", "steps"),
        (of("n"), of("M8")),
        hidden=("small",),
        **FINE,
        duties=changed(coolant_degc=chilled),
    ),
    thermal_case(
        "thermal.coolant/flow",
        "Flow and tank temperature are recorded; the film goes with flow to the power of 0.6.",
        (jets(lambda one: (one["flow"] / 20.0) ** 0.6),),
        ("steps", "warm-up", "intermittent"),
        (of("n"), of("Q"), of("T8")),
        hidden=("absorbed",),
        refitted=True,
        **WHITE,
    ),
    thermal_case(
        "thermal.coolant/seldom",
        "Coolant for some twenty minutes once in a run, not at all in the first.",
        (jets(brief=True),),
        ("steps", "intermittent", "steps"),
        (of("n"), of("M8"), of("T8")),
        hidden=(seldom("M8"),),
        duties=changed(coolant=lambda draw, one: once(draw, one, 0.25, 0.65, (18.0, 26.0)), coolant_degc=chilled),
    ),
    thermal_case(
        "thermal.coolant/with the spindle",
        "In the first run coolant is on whenever the spindle turns; in the others it has its own programme.",
        (jets(),),
        ("intermittent", "steps", "steps"),
        (of("n"), of("M8")),
        hidden=(like_in_first_run,),
        duties=changed(coolant=_with_spindle, coolant_degc=chilled),
    ),
)
SCENARIOS = (
    *scenarios_of(_SOURCES, "thermal.second_source/feed", "thermal.second_source/hydraulics"),
    *scenarios_of(_SPEED, "thermal.speed_heating/law", "thermal.instant_speed/absorbed"),
    *scenarios_of(_SURROUNDINGS, "thermal.ambient/absorbed", "thermal.coolant/small"),
)
