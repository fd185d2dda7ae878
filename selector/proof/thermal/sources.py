"""Cases with a source of heat that the simulation does not have: feed drives, hydraulics, a cabinet."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np

from selector.proof.thermal import hiding
from selector.proof.thermal.duty import BOTH, STEP_S, Duty, Maker, Omission, gated, held, wandering, with_power
from selector.proof.thermal.machine import Heat
from selector.proof.thermal.scene import Gauge, Scene, of, scenarios_of, thermal_case, warmed
from selector.recording import Channel
from selector.types import Vector


def source(
    inlet: str,
    watts: Callable[[Duty], Vector],
    axes: Mapping[str, float] = BOTH,
    *,
    id: str = "thermal.second_source",  # noqa: A002 - the word of the contract
    accept: tuple[str, ...] = (),
    brief: bool = False,
) -> Maker:
    """Heat at an inlet that the simulation does not have."""

    def heated(heat: Heat, one: Duty, size: float) -> Heat:
        return with_power(heat, inlet, size * watts(one))

    omission = Omission(id, accept, place=inlet, heated=heated, axes=axes, brief=brief)
    return lambda _generator, _tool, _duties: omission


def feed_watts(one: Duty) -> Vector:
    """Heat of a ball-screw nut at 50 W for 9 m/min."""
    return 50.0 * one["feed"] / 9000.0


def _with_hydraulics(
    gate: Callable[[np.random.Generator, Duty], Vector],
) -> Callable[[np.random.Generator, Sequence[Duty]], list[Duty]]:
    def change(generator: np.random.Generator, duties: Sequence[Duty]) -> list[Duty]:
        result = []
        for one in duties:
            on = gate(generator, one)
            oil = one["hall"][0] + 2.0 + warmed(14.0 * on, 1500.0) + 0.2 * wandering(generator, len(on), 3000.0)
            result.append(one.having(hydraulics=on, oil_degc=oil))
        return result

    return change


def _by_turns(generator: np.random.Generator, one: Duty) -> Vector:
    """A pump that runs for a quarter to a whole hour and rests as long."""
    return gated(generator, len(one.time_s), (180.0, 700.0), (180.0, 700.0))


with_hydraulics = _with_hydraulics(_by_turns)
"""Duties with a hydraulic pump that runs by turns, and the temperature of its tank."""


def _once(generator: np.random.Generator, one: Duty) -> Vector:
    course = np.zeros(len(one.time_s))
    if one.run != "r1":
        at = int(len(course) * generator.uniform(0.2, 0.6))
        course[at : at + int(60.0 * generator.uniform(18.0, 26.0) / STEP_S)] = 1.0
    return course


def _follows_spindle(generator: np.random.Generator, duties: Sequence[Duty]) -> list[Duty]:
    result = []
    for one in duties:
        if one.run == "r1":
            feed = 9000.0 * one["speed"] / max(1.0, float(one["speed"].max()))
        else:
            feed = held(generator, len(one.time_s), 10.0, 50.0, np.array([0.0, 3000.0, 6000.0, 9000.0]))
        result.append(one.having(feed=feed))
    return result


def _with_cabinet(generator: np.random.Generator, duties: Sequence[Duty]) -> list[Duty]:
    result = []
    for one in duties:
        load = held(generator, len(one.time_s), 20.0, 70.0, np.array([0.0, 0.5, 1.0]))
        result.append(one.having(cabinet_degc=26.0 + 11.0 * warmed(load, 1200.0)))
    return result


def _from_cabinet(one: Duty) -> Vector:
    return 8.0 * (one["cabinet_degc"] - one["cabinet_degc"][0])


_CABINET = Gauge(
    Channel("T10", "temperature", "degC", "control cabinet"), lambda one, _: one["cabinet_degc"], lag_s=60.0
)
_CASES = (
    thermal_case(
        "thermal.second_source/feed",
        "The nut of the Z axis heats the column; offset and gain of the simulation were fitted to that.",
        Scene(
            (source("nut", feed_watts),),
            ("warm-up", "steps", "intermittent"),
            (of("n"), of("f")),
            refitted=True,
            noise="white",
            periods_s=(20.0,),
        ),
        hidden=("absorbed",),
    ),
    thermal_case(
        "thermal.second_source/cabinet",
        "A cabinet at the rear wall bends the column; its temperature is recorded.",
        Scene(
            (source("rear wall", _from_cabinet, {"Z": 1.0, "Y": -1.0}),),
            ("steps", "intermittent", "warm-up"),
            (of("n"), _CABINET, of("T11")),
            duties=_with_cabinet,
        ),
        measures=(hiding.opposed,),
    ),
    thermal_case(
        "thermal.second_source/seldom",
        "A hydraulic unit at the column's foot runs for some twenty minutes once in a run.",
        Scene(
            (source("hydraulics", lambda one: 120.0 * one["hydraulics"], brief=True),),
            ("warm-up", "steps", "intermittent"),
            (of("n"), of("M20"), of("T9")),
            duties=_with_hydraulics(_once),
        ),
        measures=(hiding.seldom("M20"),),
    ),
    thermal_case(
        "thermal.second_source/with the spindle",
        "In the first run feed goes with spindle speed; in the others it has its own programme.",
        Scene(
            (source("motor", feed_watts),),
            ("intermittent", "steps", "cooling"),
            (of("n"), of("f")),
            duties=_follows_spindle,
        ),
        measures=(hiding.like_in_first_run(),),
    ),
    thermal_case(
        "thermal.second_source/hydraulics",
        "Hydraulics by turns, Y alone; only the temperature of the tank tells; coolant is known.",
        Scene(
            (source("hydraulics", lambda one: 90.0 * one["hydraulics"], {"Y": 1.0}),),
            ("steps", "intermittent", "steps"),
            (of("n"), of("M8"), of("T8"), of("T9")),
            knows=("coolant",),
            duties=with_hydraulics,
            noise="white",
            periods_s=(20.0,),
        ),
        hidden=("absorbed",),
        measures=(hiding.one_axis("Y"),),
    ),
)
SCENARIOS = scenarios_of(_CASES, 0, 4)
