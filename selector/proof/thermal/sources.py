"""Cases with a source of heat that the simulation does not have: feed drives, hydraulics, a cabinet."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np

from selector.proof.thermal import hiding
from selector.proof.thermal.duty import (
    BOTH,
    Duty,
    Omission,
    changed,
    gated,
    held,
    once,
    wandering,
    with_power,
)
from selector.proof.thermal.machine import Heat, Machine
from selector.proof.thermal.scene import WHITE, Gauge, of, scenarios_of, thermal_case, warmed
from selector.recording import Channel
from selector.types import Vector


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


def _by_turns(generator: np.random.Generator, one: Duty) -> Vector:
    """A pump that runs for a quarter to a whole hour and rests as long."""
    return gated(generator, len(one.time_s), (180.0, 700.0), (180.0, 700.0))


with_hydraulics = changed(hydraulics=_by_turns, oil_degc=_oil)
"""Duties with a hydraulic pump that runs by turns, and the temperature of its tank."""


def _once(generator: np.random.Generator, one: Duty) -> Vector:
    return once(generator, one, 0.2, 0.6, (18.0, 26.0))


def _follows_spindle(generator: np.random.Generator, one: Duty) -> Vector:
    if one.run == "r1":
        return 9000.0 * one["speed"] / max(1.0, float(one["speed"].max()))
    return held(generator, len(one.time_s), 10.0, 50.0, np.array([0.0, 3000.0, 6000.0, 9000.0]))


def _cabinet(generator: np.random.Generator, one: Duty) -> Vector:
    on = held(generator, len(one.time_s), 20.0, 70.0, np.array([0.0, 0.5, 1.0]))
    return 26.0 + 11.0 * warmed(on, 1200.0)


def _from_cabinet(one: Duty) -> Vector:
    return 8.0 * (one["cabinet_degc"] - one["cabinet_degc"][0])


_CABINET = Gauge(
    Channel("T10", "temperature", "degC", "control cabinet"), lambda one, _: one["cabinet_degc"], lag_s=60.0
)
_CASES = (
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
        (source("rear wall", _from_cabinet, {"Z": 1.0, "Y": -1.0}),),
        ("steps", "intermittent", "warm-up"),
        (of("n"), _CABINET, of("T11")),
        measures=(hiding.opposed,),
        duties=changed(cabinet_degc=_cabinet),
    ),
    thermal_case(
        "thermal.second_source/seldom",
        "A hydraulic unit at the column's foot runs for some twenty minutes once in a run.",
        (source("hydraulics", lambda one: 120.0 * one["hydraulics"], brief=True),),
        ("warm-up", "steps", "intermittent"),
        (of("n"), of("M20"), of("T9")),
        measures=(hiding.seldom("M20"),),
        duties=changed(hydraulics=_once, oil_degc=_oil),
    ),
    thermal_case(
        "thermal.second_source/with the spindle",
        "In the first run feed goes with spindle speed; in the others it has its own programme.",
        (source("motor", feed_watts),),
        ("intermittent", "steps", "cooling"),
        (of("n"), of("f")),
        measures=(hiding.like_in_first_run,),
        duties=changed(feed=_follows_spindle),
    ),
    thermal_case(
        "thermal.second_source/hydraulics",
        "Hydraulics by turns, Y alone; only the temperature of the tank tells; coolant is known.",
        (source("hydraulics", lambda one: 90.0 * one["hydraulics"], {"Y": 1.0}),),
        ("steps", "intermittent", "steps"),
        (of("n"), of("M8"), of("T8"), of("T9")),
        hidden=("absorbed",),
        measures=(hiding.one_axis("Y"),),
        knows=("coolant",),
        duties=with_hydraulics,
        **WHITE,
    ),
)
SCENARIOS = scenarios_of(_CASES, 0, 4)
