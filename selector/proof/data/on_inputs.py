"""Temperatures of a heated machine that are read wrongly, where the simulation was computed from these readings."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from selector.proof.case import TrueEffect, Window
from selector.proof.data import faults
from selector.proof.data.faults import CHANNELS, LENGTH_S, RUNS, SENSORS, Fault, Heated, heated, regressed
from selector.proof.data.on_heat import plan
from selector.proof.world import Plan, World, scenario, twin
from selector.types import Vector

Runs = Mapping[str, Sequence[Vector]]
RESPONSES = ("Z", "Y")


def misread(machine: Heated, fault: Fault, sensors: Sequence[str], run: int, first: float = 1.0) -> World:
    """A world in which sensors are read with a fault in one run, and the simulation is computed from what they read."""
    time = machine.time_s

    def read(size: float) -> Runs:
        courses = {name: list(parts) for name, parts in machine.courses.items()}
        for name in sensors if size else ():
            courses[name][run] = fault.reading(time, courses[name][run], size)
        return courses

    def effects(size: float) -> tuple[TrueEffect, ...]:
        window = Window(RUNS[run], fault.from_s, fault.to_s(size))
        place = next(channel.place for channel in CHANNELS if channel.name == sensors[0])
        return (TrueEffect(fault.id, (fault.id,), (*RESPONSES, *sensors), place, (window,)),)

    return _world(machine, read, effects, first)


def _world(
    machine: Heated, read: Callable[[float], Runs], effects: Callable[[float], tuple[TrueEffect, ...]], first: float
) -> World:
    return World(
        CHANNELS,
        RESPONSES,
        dict.fromkeys(RUNS, machine.time_s),
        dict.fromkeys(RUNS, machine.time_s),
        read,
        lambda size: {name: regressed(machine, read(size), name) for name in RESPONSES},
        {name: machine.noise[name] for name in RESPONSES},
        effects,
        first,
    )


def _case(
    fault: Callable[[np.random.Generator], Fault],
    sensors: tuple[str, ...],
    first: float = 1.0,
    colour: str = "white",
) -> Callable[[np.random.Generator], World]:
    def made(generator: np.random.Generator) -> World:
        machine = heated(generator, colour=colour)
        return misread(machine, fault(generator), sensors, int(generator.integers(0, 2)), first)

    return made


def _exchanged(generator: np.random.Generator) -> World:
    """Two sensors are exchanged in the second run; size is how differently the machine grows with their places."""
    drawn = heated(generator)
    even = {name: np.where(np.arange(4) == 2, gains[0], gains) for name, gains in drawn.gains.items()}

    def grown(size: float) -> Heated:
        gains = {name: even[name] + size * (drawn.gains[name] - even[name]) for name in RESPONSES}
        return replace(drawn, gains=gains)

    def read(size: float) -> Runs:
        machine = grown(size)
        courses = {name: list(parts) for name, parts in machine.courses.items()}
        for name in RESPONSES:
            courses[name] = machine.grown([machine.true[sensor] for sensor in SENSORS], name)
        if size:
            courses["T1"][1], courses["T3"][1] = courses["T3"][1], courses["T1"][1]
        return courses

    effect = TrueEffect(
        "data.swapped", ("data.swapped",), (*RESPONSES, "T1", "T3"), None, (Window(RUNS[1], 0.0, LENGTH_S),)
    )
    return World(
        CHANNELS,
        RESPONSES,
        dict.fromkeys(RUNS, drawn.time_s),
        dict.fromkeys(RUNS, drawn.time_s),
        read,
        lambda size: {name: regressed(grown(size), read(size), name) for name in RESPONSES},
        {name: drawn.noise[name] for name in RESPONSES},
        lambda size: (effect,),
        0.05,
    )


def _moment(generator: np.random.Generator) -> float:
    return float(generator.uniform(0.2, 0.6) * LENGTH_S)


_PLANS: tuple[tuple[Plan, Callable[[np.random.Generator], World]], ...] = (
    (plan("data.stuck/input", ()), _case(lambda g: faults.frozen(LENGTH_S, 600.0, _moment(g)), ("T3",))),
    (plan("data.step/input"), _case(lambda g: faults.jumped(LENGTH_S, 0.1, _moment(g)), ("T1",))),
    (plan("data.drift/input"), _case(lambda g: faults.running_away(LENGTH_S, 0.3, _moment(g)), ("T4",))),
    (
        plan("data.clock/inputs", note="The logger of all temperatures is late in one run."),
        _case(lambda g: faults.late(LENGTH_S, 60.0), SENSORS),
    ),
    (
        plan("data.drift/input-ar", ()),
        _case(lambda g: faults.running_away(LENGTH_S, 0.3, _moment(g), 0.7), ("T1",), colour="ar"),
    ),
    (plan("data.swapped/inputs", ()), _exchanged),
)
SCENARIOS = (
    *(scenario(*entry) for entry in _PLANS),
    *(twin(*entry) for entry in _PLANS if entry[0].name == "data.stuck/input"),
)
