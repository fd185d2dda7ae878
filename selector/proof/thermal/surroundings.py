"""Cases whose simulation lacks what surrounds the machine: hall (`thermal.ambient`), coolant (`thermal.coolant`)."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from selector.proof.thermal import hiding
from selector.proof.thermal.duty import Duty, Omission, changed, gated, load, once, with_bath
from selector.proof.thermal.machine import Heat, Machine
from selector.proof.thermal.scene import WHITE, of, scenarios_of, thermal_case, warmed
from selector.types import Vector


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


def _heated_hall(_generator: np.random.Generator, one: Duty) -> Vector:
    return one["hall"][0] + 3.0 * warmed(load(one), 1500.0) if one.run == "r1" else one["hall"]


def _gate(generator: np.random.Generator, one: Duty) -> Vector:
    cold = once(generator, one, 0.3, 0.7, (13.0, 17.0))
    return warmed(one["hall"] - (cold * generator.uniform(5.0, 7.0) if one.run != "r1" else cold), 90.0)


def _seldom_on(generator: np.random.Generator, one: Duty) -> Vector:
    return once(generator, one, 0.25, 0.65, (18.0, 26.0))


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
_N = (of("n"),)
_CASES = (
    thermal_case(
        "thermal.ambient/absorbed",
        "The hall drifts by a few kelvins; offset and gain of the simulation were fitted to that.",
        (hall(),),
        ("warm-up", "steps", "intermittent"),
        _N,
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
        hidden=("small",),
        measures=(hiding.one_axis("Y"),),
        knows=("constant hall", "coolant", "feed"),
        hall=DRIFT,
        noise="white",
        periods_s=(15.0, 20.0),
    ),
    thermal_case(
        "thermal.ambient/warmed by the machine",
        "In the first run the hall warms up with the machine; in the others it goes its own way.",
        (hall(),),
        ("warm-up", "steps", "intermittent"),
        _N,
        measures=(hiding.like_in_first_run,),
        knows=("constant hall",),
        hall=(21.0, 0.3, 0.8),
        duties=changed(hall=_heated_hall),
    ),
    thermal_case(
        "thermal.ambient/gate",
        "A gate lets cold air in for a quarter of an hour; the hall is steady otherwise.",
        (hall(brief=True),),
        ("warm-up", "steps", "steps"),
        _N,
        measures=(hiding.cold_spells,),
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
        noise="white",
        periods_s=(15.0, 20.0),
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
        measures=(hiding.seldom("M8"),),
        duties=changed(coolant=_seldom_on, coolant_degc=chilled),
    ),
    thermal_case(
        "thermal.coolant/with the spindle",
        "In the first run coolant is on whenever the spindle turns; in the others it has its own programme.",
        (jets(),),
        ("intermittent", "steps", "steps"),
        (of("n"), of("M8")),
        measures=(hiding.like_in_first_run,),
        duties=changed(coolant=_with_spindle, coolant_degc=chilled),
    ),
)
SCENARIOS = scenarios_of(_CASES, 0, 4)
