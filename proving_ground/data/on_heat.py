"""Displacements and temperatures of a heated machine that are read wrongly.

Displacements beside a simulation that is right; temperatures where the simulation was computed from these readings.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from proving_ground.case import TrueEffect, Window
from proving_ground.data import faults
from proving_ground.data.faults import CHANNELS, LENGTH_S, RUNS, SENSORS, Fault, Heated, heated, regressed
from proving_ground.world import Made, Plan, Runs, World, scenarios_of
from selector.types import Vector

Drawing = Callable[[np.random.Generator], Fault]

RESPONSES = ("Z", "Y")
_UNDECIDED = ("data-fault", "miscalibrated")
"""In every run the same: the recording is wrong, or the simulation."""

fault_plan = partial(Plan, family="data", kind="data")
"""A plan of the data family."""
_absorbed = partial(fault_plan, hidden=("absorbed",))


def _world(
    machine: Heated,
    recorded: Callable[[float], Runs],
    simulated: Callable[[float], Runs],
    effects: Callable[[float], tuple[TrueEffect, ...]],
    first: float,
    responses: tuple[str, ...] = RESPONSES,
    distorted: Callable[[Runs, float], Runs] | None = None,
) -> World:
    return World(
        CHANNELS,
        responses,
        dict.fromkeys(RUNS, machine.time_s),
        dict.fromkeys(RUNS, machine.time_s),
        recorded,
        simulated,
        {name: machine.noise[name] for name in responses},
        effects,
        first,
        distorted,
    )


def _case(
    drawn: Drawing,
    channel: str = "Z",
    runs: tuple[int, ...] = (),
    colour: str = "white",
    accept: tuple[str, ...] = (),
    responses: tuple[str, ...] = RESPONSES,
    first: float = 1.0,
) -> Made:
    """Worlds in which one response is read with a fault in some runs; the simulation is right."""

    def made(generator: np.random.Generator) -> World:
        machine = heated(generator, colour=colour)
        chosen = runs or (int(generator.integers(0, 2)),)
        fault = drawn(generator)
        # noise of a response comes with the world
        courses = {**machine.courses, **{name: machine.true[name] for name in responses if name in machine.true}}
        read = fault.read([machine.time_s] * len(RUNS), (channel,), chosen)

        def effects(size: float) -> tuple[TrueEffect, ...]:
            whole = fault.from_s == 0.0 and len(chosen) == len(RUNS)
            windows = () if whole else fault.windows(chosen, size)
            return (TrueEffect(fault.id, accept or (fault.id,), (channel,), None, windows),)

        return _world(
            machine,
            lambda size: read(courses, size),
            lambda size: {name: regressed(machine, machine.courses, name) for name in responses},
            effects,
            first,
            responses,
            read if fault.id == "data.stuck" else None,
        )

    return made


def _input(drawn: Drawing, sensors: tuple[str, ...], colour: str = "white") -> Made:
    """Worlds in which sensors are read with a fault in one run, and the simulation is computed from what they read."""

    def made(generator: np.random.Generator) -> World:
        machine = heated(generator, colour=colour)
        fault, run = drawn(generator), int(generator.integers(0, 2))
        read = fault.read([machine.time_s] * len(RUNS), sensors, (run,))
        place = next(channel.place for channel in CHANNELS if channel.name == sensors[0])

        def simulated(size: float) -> Runs:
            readings = read(machine.courses, size)
            return {name: regressed(machine, readings, name) for name in RESPONSES}

        def effects(size: float) -> tuple[TrueEffect, ...]:
            return (TrueEffect(fault.id, (fault.id,), (*RESPONSES, *sensors), place, fault.windows((run,), size)),)

        return _world(machine, lambda size: read(machine.courses, size), simulated, effects, 1.0)

    return made


def _moment(generator: np.random.Generator, low: float = 0.2, high: float = 0.6) -> float:
    return float(generator.uniform(low, high) * LENGTH_S)


def _exchanged(from_run: int, until: int) -> Made:
    """Z and Y are exchanged in runs; size is how much they differ."""

    def made(generator: np.random.Generator) -> World:
        machine = heated(generator)
        said = {name: regressed(machine, machine.courses, name) for name in RESPONSES}

        def apart(courses: Runs, size: float) -> dict[str, Sequence[Vector]]:
            both = zip(courses["Z"], courses["Y"], strict=True)
            return {**courses, "Y": [a + size * (b - a) for a, b in both]}

        def recorded(size: float) -> Runs:
            courses = {name: list(parts) for name, parts in apart(machine.courses, size).items()}
            for run in range(from_run, until):
                courses["Z"][run], courses["Y"][run] = courses["Y"][run], courses["Z"][run]
            return courses

        windows = tuple(Window(RUNS[run], 0.0, LENGTH_S) for run in range(from_run, until))
        effect = TrueEffect("data.swapped", ("data.swapped",), RESPONSES, None, windows)
        return _world(machine, recorded, lambda size: apart(said, size), lambda size: (effect,), 0.1)

    return made


def _exchanged_inputs(generator: np.random.Generator) -> World:
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

    def simulated(size: float) -> Runs:
        return {name: regressed(grown(size), read(size), name) for name in RESPONSES}

    window = Window(RUNS[1], 0.0, LENGTH_S)
    effect = TrueEffect("data.swapped", ("data.swapped",), (*RESPONSES, "T1", "T3"), None, (window,))
    return _world(drawn, read, simulated, lambda size: (effect,), 0.05)


def _clean(colour: str) -> tuple[Plan, Made]:
    made = _case(lambda g: faults.moved(LENGTH_S, 1.0), colour=colour)
    return fault_plan(f"clean.data/{colour}", kind="clean"), made


_RESPONSES: tuple[tuple[Plan, Made], ...] = (
    (_absorbed("data.clock/late-run"), _case(lambda g: faults.late(LENGTH_S, 60.0))),
    (fault_plan("data.clock/jump"), _case(lambda g: faults.late(LENGTH_S, 120.0, _moment(g)), colour="ar")),
    (_absorbed("data.clock/rate"), _case(lambda g: faults.slow(LENGTH_S, 120.0), "Y", first=3.0)),
    (_absorbed("data.gain/one-run"), _case(lambda g: faults.stretched(LENGTH_S, 0.02))),
    (
        _absorbed(
            "data.gain/unit",
            verdicts=_UNDECIDED,
            kind="undecidable",
            size=1.54,
            note="Inch against centimetre in every run: the recording's scale or the simulation's.",
        ),
        _case(lambda g: faults.stretched(LENGTH_S, 1.0), runs=(0, 1, 2)),
    ),
    (_absorbed("data.zero/one-run"), _case(lambda g: faults.moved(LENGTH_S, 0.1))),
    (
        _absorbed("data.zero/all-runs", verdicts=_UNDECIDED, kind="undecidable", size=4.0),
        _case(lambda g: faults.moved(LENGTH_S, 1.0), runs=(0, 1, 2)),
    ),
    (_absorbed("data.drift/late"), _case(lambda g: faults.running_away(LENGTH_S, 1.0, _moment(g)))),
    (
        fault_plan("data.drift/bent"),
        _case(lambda g: faults.running_away(LENGTH_S, 1.0, _moment(g), 0.6), "Y", colour="ar"),
    ),
    (_absorbed("data.step/one-run"), _case(lambda g: faults.jumped(LENGTH_S, 0.3, _moment(g)))),
    (
        _absorbed("data.step/heavy-tailed"),
        _case(lambda g: faults.jumped(LENGTH_S, 0.3, _moment(g, 0.5, 0.9)), "Y", colour="heavy-tailed"),
    ),
    (fault_plan("data.stuck/response"), _case(lambda g: faults.frozen(LENGTH_S, 600.0, _moment(g, 0.1, 0.4)))),
    (_absorbed("data.swapped/one-run"), _exchanged(1, 2)),
    (_absorbed("data.swapped/from-then-on"), _exchanged(1, 3)),
    (
        _absorbed("data.drift/temperature", note="The simulation has the temperature too; only its reading runs away."),
        _case(lambda g: faults.running_away(LENGTH_S, 0.1, _moment(g)), "T3", responses=("Z", "T3")),
    ),
    *(_clean(colour) for colour in ("white", "ar", "heavy-tailed")),
)
_INPUTS: tuple[tuple[Plan, Made], ...] = (
    (fault_plan("data.stuck/input"), _input(lambda g: faults.frozen(LENGTH_S, 600.0, _moment(g)), ("T3",))),
    (_absorbed("data.step/input"), _input(lambda g: faults.jumped(LENGTH_S, 0.1, _moment(g)), ("T1",))),
    (_absorbed("data.drift/input"), _input(lambda g: faults.running_away(LENGTH_S, 0.3, _moment(g)), ("T4",))),
    (
        _absorbed("data.clock/inputs", note="The logger of all temperatures is late in one run."),
        _input(lambda g: faults.late(LENGTH_S, 60.0), SENSORS),
    ),
    (
        fault_plan("data.drift/input-ar"),
        _input(lambda g: faults.running_away(LENGTH_S, 0.3, _moment(g), 0.7), ("T1",), "ar"),
    ),
    (fault_plan("data.swapped/inputs"), _exchanged_inputs),
)
SCENARIOS = (
    *scenarios_of(_RESPONSES, "data.clock/rate", "data.stuck/response"),
    *scenarios_of(_INPUTS, "data.stuck/input"),
)
