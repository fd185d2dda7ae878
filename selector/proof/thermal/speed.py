"""Cases in which the spindle heats, or grows, by a law of speed that the simulation lacks."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from selector.proof.thermal import hiding
from selector.proof.thermal.duty import BOTH, STEP_S, Duty, Omission, with_power
from selector.proof.thermal.machine import Heat, Machine
from selector.proof.thermal.scene import STRIDE, WHITE, of, scenarios_of, thermal_case
from selector.types import Matrix, Vector


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


_N = (of("n"),)
_CASES = (
    thermal_case(
        "thermal.speed_heating/law",
        "Heat grows with a higher power of speed than the simulation has; its gain was fitted to the machine.",
        (heating({"front bearing": 40.0, "rear bearing": 20.0}, 2.9),),
        ("warm-up", "steps", "staircase"),
        _N,
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
        _N,
        measures=(hiding.seldom("n", 0.6),),
        duties=sprints,
    ),
    thermal_case(
        "thermal.speed_heating/one axis",
        "The rear bearing heats more with speed than the simulation knows; that bends Y alone.",
        (heating({"rear bearing": 40.0}, 2.6, axes={"Y": 1.0}),),
        ("steps", "intermittent", "staircase"),
        _N,
        hidden=("absorbed",),
        measures=(hiding.one_axis("Y"),),
        law=(0.9, 1.2),
        noise="white",
        periods_s=(15.0, 20.0),
    ),
    thermal_case(
        "thermal.instant_speed/absorbed",
        "The spindle grows with the square of speed; offset and gain of the simulation were fitted to it.",
        (growth(2.0, {"Z": 1.0}),),
        ("warm-up", "cooling", "steps"),
        _N,
        hidden=("absorbed",),
        refitted=True,
        **WHITE,
    ),
    thermal_case(
        "thermal.instant_speed/opposed",
        "Preload moves the shaft in proportion to speed, out in Z and back in Y.",
        (growth(1.0, {"Z": 1.0, "Y": -0.8}),),
        ("steps", "intermittent", "cooling"),
        _N,
        hidden=("absorbed",),
        measures=(hiding.opposed,),
        noise="white",
        periods_s=(15.0, 20.0),
    ),
    thermal_case(
        "thermal.instant_speed/sprints",
        "Growth by the third power of speed, which matters in a few sprints only.",
        (growth(3.0, {"Z": 1.0}, brief=True),),
        ("steps", "steps", "intermittent"),
        _N,
        measures=(hiding.seldom("n", 0.6), hiding.one_axis("Z")),
        duties=sprints,
    ),
)
SCENARIOS = scenarios_of(_CASES, 0, 3)
