"""Cases with two or three effects at once, with wrong parameters beside them, with decoys, or with no way to tell."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from proving_ground.thermal.duty import Duty, changed, gated
from proving_ground.thermal.memory import QUIET_HALL, member_by
from proving_ground.thermal.scene import decoy, of, thermal_case, warmed
from proving_ground.thermal.sources import (
    DRIFT,
    chilled,
    feed_watts,
    growth,
    hall,
    heating,
    jets,
    source,
    while_turning,
    with_hydraulics,
)
from proving_ground.world import scenarios_of
from selector.types import Vector


def _rise(one: Duty) -> Vector:
    return warmed(one["hydraulics"], 1500.0)


_exhaust = changed(
    hydraulics=lambda draw, one: gated(draw, len(one.time_s), (250.0, 800.0), (250.0, 800.0)),
    oil_degc=lambda _, one: one["hall"][0] + 14.0 * _rise(one),
    hall=lambda _, one: one["hall"][0] + 4.0 * _rise(one),
)
"""The hydraulic unit blows its heat into the hall: the hall follows its tank and nothing else."""


def _one_speed_by_turns(generator: np.random.Generator, duties: Sequence[Duty]) -> Sequence[Duty]:
    """The spindle turns at one speed or not at all, by turns."""
    speed = 0.7 * max(float(one["speed"].max()) for one in duties)
    turning = changed(speed=lambda draw, one: speed * gated(draw, len(one.time_s), (80.0, 700.0), (200.0, 900.0)))
    return turning(generator, duties)


def _one_speed_wet(generator: np.random.Generator, duties: Sequence[Duty]) -> Sequence[Duty]:
    wet = changed(coolant=while_turning, coolant_degc=chilled)
    return wet(generator, _one_speed_by_turns(generator, duties))


_N, _F, _M8 = of("n"), of("f"), of("M8")
_CASES = (
    thermal_case(
        "several.thermal/memory and feed",
        "A late member and the heat of a feed drive.",
        (member_by("T1"), source("nut", feed_watts)),
        ("warm-up", "steps", "intermittent"),
        (_N, _F),
        hall=QUIET_HALL,
        kind="several",
    ),
    thermal_case(
        "several.thermal/hall and growth",
        "The hall acts slowly, the spindle grows at once.",
        (hall(), growth(2.0, {"Z": 1.0})),
        ("steps", "intermittent", "steps"),
        knows=("constant hall",),
        hall=DRIFT,
        kind="several",
    ),
    thermal_case(
        "several.thermal/coolant against law of speed",
        "Coolant takes away heat of which the spindle makes more than the simulation knows.",
        (jets(), heating({"front bearing": 40.0, "rear bearing": 20.0}, 2.9)),
        ("steps", "intermittent", "staircase"),
        (_N, _M8),
        law=(0.9, 1.1),
        duties=changed(coolant_degc=chilled),
        kind="several",
    ),
    thermal_case(
        "several.thermal/hall, hydraulics, growth",
        "Three at once: hall, hydraulic unit, growth of the spindle.",
        (hall(), source("hydraulics", lambda one: 90.0 * one["hydraulics"]), growth(2.0, {"Z": 1.0, "Y": 0.3})),
        ("steps", "intermittent", "steps"),
        (_N, of("M20"), of("T9")),
        knows=("constant hall",),
        hall=DRIFT,
        duties=with_hydraulics,
        kind="several",
    ),
    thermal_case(
        "thermal.coolant/wrong gain",
        "The simulation has 20 % too much heat as well; only the coolant is physics.",
        (jets(),),
        ("steps", "intermittent", "steps"),
        (_N, _M8, of("T8")),
        gain=1.2,
        offset_um=-2.0,
    ),
    thermal_case(
        "thermal.second_source/wrong gain",
        "The simulation has 20 % too little heat as well; only the feed drive is physics.",
        (source("nut", feed_watts),),
        ("steps", "warm-up", "intermittent"),
        (_N, _F),
        gain=0.8,
    ),
    thermal_case(
        "thermal.memory/decoy",
        "Two cabinets warmed up like the late member in the first run, and went their own way afterwards.",
        (member_by("T1"),),
        ("warm-up", "intermittent", "steps"),
        (_N, decoy("T10", "control cabinet", 4500.0), decoy("T11", "drive cabinet", 9000.0)),
        hall=QUIET_HALL,
        kind="decoy",
    ),
    thermal_case(
        "thermal.instant_speed/decoy",
        "A feed channel and a cabinet went with the spindle in the first run only.",
        (growth(2.0, {"Z": 1.0, "Y": -0.4}),),
        ("intermittent", "steps", "cooling"),
        (_N, _F, decoy("T10", "control cabinet", 60.0)),
        kind="decoy",
    ),
    thermal_case(
        "undecidable.thermal/one speed",
        "One speed only: a rear bearing that heats more by speed, or a slower answer to the same heat.",
        (heating({"rear bearing": 40.0}, 2.0, accept=("thermal.speed_heating", "thermal.memory")),),
        ("steps", "steps", "steps"),
        hall=QUIET_HALL,
        duties=_one_speed_by_turns,
        kind="undecidable",
    ),
    thermal_case(
        "undecidable.thermal/wet at one speed",
        "Coolant runs whenever the spindle does, at one speed: it, cooling by speed, or less heat by speed.",
        (jets(accept=("thermal.coolant", "thermal.convection", "thermal.speed_heating", "thermal.memory")),),
        ("steps", "steps", "steps"),
        (_N, _M8),
        hall=QUIET_HALL,
        duties=_one_speed_wet,
        kind="undecidable",
    ),
    thermal_case(
        "undecidable.thermal/exhaust",
        "The hydraulic unit warms the hall, which follows it alone: its heat at the foot, or the hall's.",
        (hall(accept=("thermal.ambient", "thermal.second_source")),),
        ("steps", "intermittent", "steps"),
        (_N, of("T9"), of("M20")),
        knows=("constant hall",),
        duties=_exhaust,
        kind="undecidable",
    ),
)
SCENARIOS = scenarios_of(_CASES)
