"""Displacements of a heated machine that are read wrongly, beside a simulation that is right."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from selector.proof.case import TrueEffect, Window
from selector.proof.data import faults
from selector.proof.data.faults import CHANNELS, LENGTH_S, RUNS, Fault, Heated, heated, regressed
from selector.proof.world import Plan, World, scenario, twin
from selector.types import Vector

Runs = Mapping[str, Sequence[Vector]]
Drawing = Callable[[np.random.Generator], Fault]

_UNDECIDED = ("data-fault", "miscalibrated")
"""In every run the same: the recording is wrong, or the simulation."""


def plan(name: str, hidden: tuple[str, ...] = ("absorbed",), **rest: Any) -> Plan:
    """A plan of the data family."""
    settings: dict[str, Any] = {"family": "data", "kind": "data", "verdicts": ("data-fault",), "hidden": hidden}
    return Plan(name, **(settings | rest))


def faulty(
    machine: Heated,
    fault: Fault,
    channel: str,
    runs: Sequence[int],
    *,
    accept: tuple[str, ...] = (),
    responses: tuple[str, ...] = ("Z", "Y"),
    first: float = 1.0,
) -> World:
    """A world in which one response is read with a fault in some runs; the simulation is right."""
    time = machine.time_s
    # noise of a response comes with the world
    courses = {**machine.courses, **{name: machine.true[name] for name in responses if name in machine.true}}

    def read(courses: Runs, size: float) -> Runs:
        if not size:
            return courses
        result = {name: list(parts) for name, parts in courses.items()}
        for run in runs:
            result[channel][run] = fault.reading(time, result[channel][run], size)
        return result

    def effects(size: float) -> tuple[TrueEffect, ...]:
        whole = fault.from_s == 0.0 and len(runs) == len(RUNS)
        windows = () if whole else tuple(Window(RUNS[run], fault.from_s, fault.to_s(size)) for run in runs)
        return (TrueEffect(fault.id, accept or (fault.id,), (channel,), None, windows),)

    return World(
        CHANNELS,
        responses,
        dict.fromkeys(RUNS, time),
        dict.fromkeys(RUNS, time),
        lambda size: read(courses, size),
        lambda size: {name: regressed(machine, machine.courses, name) for name in responses},
        {name: machine.noise[name] for name in responses},
        effects,
        first,
        read if fault.id == "data.stuck" else None,
    )


def _case(
    fault: Drawing,
    channel: str = "Z",
    runs: tuple[int, ...] = (),
    colour: str = "white",
    **settings: Any,
) -> Callable[[np.random.Generator], World]:
    def made(generator: np.random.Generator) -> World:
        machine = heated(generator, colour=colour)
        chosen = runs or (int(generator.integers(0, 2)),)
        return faulty(machine, fault(generator), channel, chosen, **settings)

    return made


def _moment(generator: np.random.Generator, low: float = 0.2, high: float = 0.6) -> float:
    return float(generator.uniform(low, high) * LENGTH_S)


def _exchanged(from_run: int, until: int) -> Callable[[np.random.Generator], World]:
    """Z and Y are exchanged in runs; size is how much they differ."""

    def made(generator: np.random.Generator) -> World:
        machine = heated(generator)
        said = {name: regressed(machine, machine.courses, name) for name in ("Z", "Y")}

        def apart(courses: Runs, size: float) -> dict[str, Sequence[Vector]]:
            both = zip(courses["Z"], courses["Y"], strict=True)
            return {**courses, "Y": [a + size * (b - a) for a, b in both]}

        def recorded(size: float) -> Runs:
            courses = {name: list(parts) for name, parts in apart(machine.courses, size).items()}
            for run in range(from_run, until):
                courses["Z"][run], courses["Y"][run] = courses["Y"][run], courses["Z"][run]
            return courses

        windows = tuple(Window(RUNS[run], 0.0, LENGTH_S) for run in range(from_run, until))
        effect = TrueEffect("data.swapped", ("data.swapped",), ("Z", "Y"), None, windows)
        return World(
            CHANNELS,
            ("Z", "Y"),
            dict.fromkeys(RUNS, machine.time_s),
            dict.fromkeys(RUNS, machine.time_s),
            recorded,
            lambda size: apart(said, size),
            {name: machine.noise[name] for name in ("Z", "Y")},
            lambda size: (effect,),
            0.1,
        )

    return made


_PLANS: tuple[tuple[Plan, Callable[[np.random.Generator], World]], ...] = (
    (plan("data.clock/late-run"), _case(lambda g: faults.late(LENGTH_S, 60.0))),
    (plan("data.clock/jump", ()), _case(lambda g: faults.late(LENGTH_S, 120.0, _moment(g)), colour="ar")),
    (plan("data.clock/rate"), _case(lambda g: faults.slow(LENGTH_S, 120.0), "Y", first=3.0)),
    (plan("data.gain/one-run"), _case(lambda g: faults.stretched(LENGTH_S, 0.02))),
    (
        plan(
            "data.gain/unit",
            ("absorbed",),
            verdicts=_UNDECIDED,
            kind="undecidable",
            size=1.54,
            note="Inch against centimetre in every run: the recording's scale or the simulation's.",
        ),
        _case(lambda g: faults.stretched(LENGTH_S, 1.0), runs=(0, 1, 2)),
    ),
    (plan("data.zero/one-run"), _case(lambda g: faults.moved(LENGTH_S, 0.1))),
    (
        plan("data.zero/all-runs", ("absorbed",), verdicts=_UNDECIDED, kind="undecidable", size=4.0),
        _case(lambda g: faults.moved(LENGTH_S, 1.0), runs=(0, 1, 2)),
    ),
    (plan("data.drift/late"), _case(lambda g: faults.running_away(LENGTH_S, 1.0, _moment(g)))),
    (
        plan("data.drift/bent", ()),
        _case(lambda g: faults.running_away(LENGTH_S, 1.0, _moment(g), 0.6), "Y", colour="ar"),
    ),
    (plan("data.step/one-run"), _case(lambda g: faults.jumped(LENGTH_S, 0.3, _moment(g)))),
    (
        plan("data.step/heavy-tailed"),
        _case(lambda g: faults.jumped(LENGTH_S, 0.3, _moment(g, 0.5, 0.9)), "Y", colour="heavy-tailed"),
    ),
    (plan("data.stuck/response", ()), _case(lambda g: faults.frozen(LENGTH_S, 600.0, _moment(g, 0.1, 0.4)))),
    (plan("data.swapped/one-run"), _exchanged(1, 2)),
    (plan("data.swapped/from-then-on"), _exchanged(1, 3)),
    (
        plan("data.drift/temperature", note="The simulation has the temperature too; only its reading runs away."),
        _case(lambda g: faults.running_away(LENGTH_S, 0.1, _moment(g)), "T3", responses=("Z", "T3")),
    ),
)


def _clean(name: str, colour: str) -> tuple[Plan, Callable[[np.random.Generator], World]]:
    made = _case(lambda g: faults.moved(LENGTH_S, 1.0), colour=colour)
    return plan(f"clean.data/{name}", (), kind="clean", verdicts=("nothing-missing",)), made


SCENARIOS = (
    *(scenario(plan, made, has_strength=not plan.size) for plan, made in _PLANS),
    *(scenario(*_clean(colour, colour), has_strength=False) for colour in ("white", "ar", "heavy-tailed")),
    *(twin(*entry) for entry in _PLANS if entry[0].name in ("data.clock/rate", "data.stuck/response")),
)
