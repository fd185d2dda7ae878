"""What do recording and simulation of an axis say, and how is a drive scenario put together."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from proving_ground.case import TrueEffect
from proving_ground.drive.true_axis import STEP_S, Bench, TrueAxis, bench, command_times, given_motion, true_motion
from proving_ground.world import Missing, Runs, World
from selector.recording import Channel
from selector.types import Vector

Disturbance = Callable[[int, Vector, float], Vector]
"""(number of the run, times [s], size) → course."""

CHANNELS = {
    "r": Channel("r", "position_command", "m", axis="X"),
    "x": Channel("x", "position", "m", place="table, linear scale", axis="X"),
    "v": Channel("v", "velocity", "m/s", place="motor", axis="X"),
    "E": Channel("E", "displacement", "um", place="table, linear scale minus command", axis="X"),
    "I": Channel("I", "current", "A", place="motor"),
    "F": Channel("F", "force", "N", place="motor, from the current"),
    "a": Channel("a", "acceleration", "m/s^2", place="table", axis="X"),
    "brake": Channel("brake", "state", "1", place="holding brake, 1 = open"),
}
FORCE: Mapping[str, Any] = {"names": ("x", "F"), "responses": ("x", "F")}
"""Arguments of `axis_world`: position and force, and nothing else."""


def axis_world(
    bench: Bench,
    *,
    effects: Callable[[float], tuple[TrueEffect, ...]] = lambda size: (),
    true: Callable[[float], TrueAxis],
    given: Callable[[float], TrueAxis] | None = None,
    delay_s: Callable[[float], float] | None = None,
    force: Disturbance | None = None,
    shift: Disturbance | None = None,
    names: Sequence[str] = ("r", "v", "E", "I"),
    responses: Sequence[str] = ("E", "I"),
    refitted: Sequence[str] = (),
    first: float = 1.0,
    rival: World | None = None,
    recorded_as: Callable[[Runs, float], Runs] | None = None,
    simulated_as: Callable[[Runs, Sequence[Vector]], Runs] | None = None,
    distorted: Callable[[Runs, float], Runs] | None = None,
    simulation_period_s: float = 2e-3,
    author: Bench | None = None,
) -> World:
    """The world of an axis: `true` (size) moves, `given` is simulated.

    `force` [N] acts on the table besides; `shift` [µm] is added to the displacement of the table against its scale.
    `refitted` are parameters of the simulation that are fitted to the current of the fitted runs, so that they take
    in what they can of the effect: ``"viscous_ns_per_m"``, ``"coulomb_n"``, ``"table_kg"``. `recorded_as` changes
    courses after the motion (a fault of the data), `simulated_as` those of the simulation at its own times,
    `distorted` readings with their noise. `author` is what the simulation is fitted on, if not this bench; what acts
    besides in a run that it lacks is that of its last run.
    """
    known = author or bench
    speed_errors = [
        bench.speed_noise * np.random.default_rng([7, k, len(bench.stamps[k])]).standard_normal(len(bench.stamps[k]))
        for k in range(len(bench.commands))
    ]

    def moved(size: float, bench: Bench = bench) -> dict[str, list[Vector]]:
        axis = true(size)
        late = delay_s(size) if delay_s is not None else 0.0
        courses: dict[str, list[Vector]] = {name: [] for name in (*names, *responses)}
        for k, command in enumerate(bench.commands):
            n = len(command) * round(command_times(command)[1] / STEP_S)
            fine = STEP_S * np.arange(n, dtype=np.float64)
            number = min(k, len(known.commands) - 1)
            load = force(number, fine, size) if force is not None else np.zeros(n)
            _, v_motor, x_table, amps = true_motion(axis, command, load, late)
            when = bench.stamps[k] + bench.jitter[k]
            target = np.interp(fine, command_times(command), command)
            error = 1e6 * (x_table - target)
            if shift is not None:
                error = error + shift(number, fine, size)
            whole = {
                "r": target,
                "x": x_table,
                "v": v_motor,
                "E": error,
                "I": amps,
                "F": amps * axis.force_per_a,
                "a": np.gradient(np.gradient(x_table, STEP_S), STEP_S) if "a" in courses else x_table,
            }
            for name in courses:
                if name in whole:
                    at = bench.stamps[k] if name == "r" else when
                    courses[name].append(np.interp(at, fine, whole[name]))
            if "v" in courses:
                courses["v"][-1] = courses["v"][-1] + speed_errors[k]
            if "r" in courses:
                courses["r"][-1] = np.round(courses["r"][-1], 6)
            if "brake" in courses:
                courses["brake"].append(np.ones(len(when)))
        return courses

    def said(axis: TrueAxis, bench: Bench = bench) -> dict[str, list[Vector]]:
        courses: dict[str, list[Vector]] = {name: [] for name in responses}
        for command in bench.commands:
            _, x_table, amps = given_motion(axis, command)
            own = command_times(command)
            whole = {"x": x_table, "E": 1e6 * (x_table - command), "I": amps, "F": amps * axis.force_per_a}
            if "a" in courses:
                whole["a"] = np.gradient(np.gradient(x_table, own), own)
            every = round(simulation_period_s / own[1])
            for name in responses:
                courses[name].append(whole[name][::every])
        return courses

    plain = true(0.0)
    every_ms = round(simulation_period_s / 1e-3)
    own_times = [command_times(command)[::every_ms] for command in bench.commands]

    def simulated(size: float) -> Runs:
        axis = given(size) if given is not None else plain
        if refitted and size:
            axis = _refitted(axis, refitted, known, moved(size, known), said(axis, known), simulation_period_s)
        courses = said(axis)
        return simulated_as(courses, own_times) if simulated_as is not None else courses

    def recorded(size: float) -> Runs:
        courses = moved(size)
        return recorded_as(courses, size) if recorded_as is not None else courses

    return World(
        tuple(CHANNELS[name] for name in names),
        tuple(responses),
        dict(zip(bench.runs, bench.stamps, strict=False)),
        dict(zip(bench.runs, own_times, strict=False)),
        recorded,
        simulated,
        {name: bench.noise[name] for name in responses},
        effects,
        first,
        distorted,
        rival,
    )


def _refitted(axis: TrueAxis, names: Sequence[str], bench: Bench, true: Runs, given: Runs, period_s: float) -> TrueAxis:
    """The simulation with parameters fitted to the motor's force in all runs but the last (linear, one step)."""
    force = "F" if "F" in given else "I"
    columns: list[Vector] = []
    rest: list[Vector] = []
    for k in range(len(bench.commands) - 1):
        own = command_times(bench.commands[k])
        speed = np.gradient(bench.commands[k], own)
        parts = {"viscous_ns_per_m": speed, "coulomb_n": np.tanh(speed / 1e-3), "table_kg": np.gradient(speed, own)}
        columns.append(np.column_stack([np.interp(bench.stamps[k], own, parts[name]) for name in names]))
        simulated = np.interp(bench.stamps[k], np.arange(len(given[force][k])) * period_s, given[force][k])
        rest.append((true[force][k] - simulated) * (axis.force_per_a if force == "I" else 1.0))
    change = np.linalg.lstsq(np.concatenate(columns), np.concatenate(rest), rcond=None)[0]
    return axis._replace(**{name: getattr(axis, name) + float(d) for name, d in zip(names, change, strict=True)})


@dataclass(frozen=True)
class Drive(Missing):
    """A drive scenario; `bench` has arguments of `proving_ground.drive.true_axis.bench`, `world` of `axis_world`."""

    channels: tuple[str, ...] = ("E", "I")
    family = "drive"

    def drawn(self, generator: np.random.Generator) -> Bench:
        """An axis with its loop, and what it is told."""
        return bench(generator, start=self.start, **self.bench)

    def world_of(self, bench: Bench, **more: Any) -> World:
        """See `axis_world`."""
        return axis_world(bench, **more)

    def with_run(
        self, bench: Bench, arguments: Mapping[str, Any]
    ) -> Callable[[Mapping[str, Vector], float, np.random.Generator], World] | None:
        """Another command; none where something besides befalls the courses of a run."""
        if any(arguments.get(name) for name in ("recorded_as", "simulated_as", "distorted")):
            return None

        def longer(told: Mapping[str, Vector], period_s: float, generator: np.random.Generator) -> World:
            others = told.keys() - {"r"}
            if others or "r" not in arguments.get("names", ("r",)):
                raise ValueError(f"nobody can set {', '.join(others) or 'the command'}")
            return self.world_of(bench.with_command(told["r"], period_s, generator), **arguments, author=bench)

        return longer
