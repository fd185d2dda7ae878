"""How does a world with a concealed effect become a case of wanted strength: noise, size, tables, truth."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from selector.proof import concealment
from selector.proof.case import Case, Concealment, Kind, Scenario, TrueEffect, Truth
from selector.proof.concealment import Noise, fitted_starts, held_out_errors, recalibration, scale_for, split, stacked
from selector.recording import Channel, Recording
from selector.types import Vector

Courses = Mapping[str, Vector]
Runs = Mapping[str, Sequence[Vector]]

HIDDEN_FACTOR = 4.0
"""What no catalogue knows is made stronger than what it knows, since nothing can be matched to it."""


_DRAWS = 4


class Shown(NamedTuple):
    """Courses of a case without their noise, all runs one after the other, which begin at `starts`."""

    effect: Courses
    recorded: Courses
    simulated: Courses
    noise: Mapping[str, Noise]
    starts: Sequence[int]


Measure = Callable[[Shown], Concealment]


@dataclass(frozen=True, eq=False)
class World:
    """A machine with an effect of any size, what is recorded of it, and what a simulation says of it."""

    channels: tuple[Channel, ...]  #: Of the recording, responses included
    responses: tuple[str, ...]
    time_s: Mapping[str, Vector]  #: Run → stamps of the recorded rows [s]
    simulation_time_s: Mapping[str, Vector]  #: Run → stamps of the simulation [s]
    #: (size) -> mapping of str to sequence of ndarray: Channel → course in every run [its unit], responses without
    #: their noise. Size 0 = the effect is off.
    recorded: Callable[[float], Runs]
    #: (size) -> mapping of str to sequence of ndarray: The same of the simulation, with parameters fitted to a machine
    #: with the effect if that is how it is hidden
    simulated: Callable[[float], Runs]
    noise: Mapping[str, Noise]  #: Of the responses
    effects: Callable[[float], tuple[TrueEffect, ...]]  #: (size) -> tuple of TrueEffect
    first: float = 1.0  #: A size to begin the search with
    #: (recorded, size) -> mapping, or None: What becomes of readings with their noise (a sensor that freezes reads no
    #: noise)
    distorted: Callable[[Runs, float], Runs] | None = None
    #: The same machine with another effect in the place of this one, which this record does not tell from it
    rival: World | None = None
    #: Of several effects at once: the same world without the first one, without the second one, and so on
    lacking: tuple[World, ...] = ()


@dataclass(frozen=True)
class Plan:
    """What a scenario says of its cases: name, family, kind, right verdicts, how it is hidden.

    `hidden` names the numbers that are to hold: ``"small"``, ``"absorbed"``, ``"rare"``, ``"ruled out in E"``,
    ``"like E"`` (the effect in that response against the simulation and the recorded channels). `factor` multiplies
    the wanted d′; `size` is that of an effect whose strength is not chosen, since recalibration takes in all of it.
    `lost` is the share of rows that were never written. `measures` are further ways to be hidden.
    """

    name: str
    family: str
    kind: Kind
    verdicts: tuple[str, ...] = ("missing-physics",)
    hidden: tuple[str, ...] = ()
    tolerated: tuple[str, ...] = ()
    factor: float = 1.0
    size: float = 0.0
    lost: float = 0.0
    note: str = ""
    measures: tuple[Measure, ...] = ()


def scenario(plan: Plan, world: Callable[[np.random.Generator], World], *, has_strength: bool = True) -> Scenario:
    """A scenario of worlds that are made from a seed; every name draws other worlds from the same seed.

    A world in which the effect is not hidden as the plan says, or cannot be of the wanted strength, is drawn anew, a
    few times.
    """

    def build(seed: int, wanted: float | None) -> Case:
        case: Case | None = None
        for draw in range(_DRAWS):
            generator = _generator(plan, seed, draw)
            try:
                case = case_of(world(generator), plan, generator, wanted)
            except ValueError:
                if case is None and draw == _DRAWS - 1:
                    raise
                continue
            if all(hidden.holds for hidden in case.truth.concealed):
                break
        assert case is not None
        return case

    return Scenario(plan.name, plan.family, plan.kind, build, plan.note, has_strength=has_strength)


def _generator(plan: Plan, seed: int, draw: int) -> np.random.Generator:
    return np.random.default_rng([seed, draw, *plan.name.encode()])


def twin(plan: Plan, world: Callable[[np.random.Generator], World]) -> Scenario:
    """The clean twin of a scenario: the same machines, programmes and noise, the effect off."""

    def build(seed: int, wanted: float | None) -> Case:
        generator = _generator(plan, seed, 0)
        case = case_of(world(generator), plan, generator, 0.0)
        return replace(case, name=name, kind="clean")

    name = f"clean.{plan.family}/off {plan.name.partition('.')[2]}"
    note = f"Twin of {plan.name} with the effect off."
    return Scenario(name, plan.family, "clean", build, note, has_strength=False)


def scenarios_of(
    cases: Sequence[tuple[Plan, Callable[[np.random.Generator], World]]], *twins: str
) -> tuple[Scenario, ...]:
    """The scenarios of plans with their worlds, and the clean twins of those with these names."""
    return (
        *(scenario(plan, made, has_strength=plan.kind != "clean" and not plan.size) for plan, made in cases),
        *(twin(*case) for case in cases if case[0].name in twins),
    )


class _Seen:
    """A world at one size; its courses at the recorded rows, all runs one after the other."""

    def __init__(self, world: World, size: float) -> None:
        self.runs, self.simulation = world.recorded(size), world.simulated(size)
        self.recorded = {name: np.concatenate(list(parts)) for name, parts in self.runs.items()}
        clocks = list(zip(world.time_s.values(), world.simulation_time_s.values(), strict=True))
        self.simulated = {
            name: np.concatenate([np.interp(time, own, part) for (time, own), part in zip(clocks, parts, strict=True)])
            for name, parts in self.simulation.items()
        }
        self.missing = {name: self.recorded[name] - self.simulated[name] for name in world.responses}


class _Strength:
    """Effects of a world by size: their courses, and how well an oracle could detect them."""

    def __init__(self, world: World) -> None:
        self.world = world
        self.time_s, self.starts = stacked(list(world.time_s.values()))
        self.off = _Seen(world, 0.0)
        self._seen = {0.0: self.off}
        self._rows = fitted_starts(self.starts)
        self._absorbed = {name: self._basis(name) for name in world.responses}
        self._lacking = tuple(_Strength(one) for one in world.lacking)

    def seen(self, size: float) -> _Seen:
        if size not in self._seen:
            self._seen[size] = _Seen(self.world, size)
        return self._seen[size]

    def effect(self, size: float) -> dict[str, Vector]:
        missing = self.seen(size).missing
        return {name: missing[name] - self.off.missing[name] for name in self.world.responses}

    def detected(self, courses: Courses) -> float:
        """`selector.proof.concealment.d_prime`, with what recalibration absorbs worked out once."""
        total = 0.0
        for name, course in courses.items():
            total += float(np.sum(self.unabsorbed(name, course) ** 2))
        return float(np.sqrt(total))

    def weakest(self, size: float) -> float:
        """The d′ of the effect, of several at once that of the one which is least clear beside the others."""
        if not self._lacking:
            return self.detected(self.effect(size))
        missing = self.seen(size).missing
        courses = np.column_stack(
            [
                np.concatenate(
                    [self.unabsorbed(name, missing[name] - one.seen(size).missing[name]) for name in missing]
                )
                for one in self._lacking
            ]
        )
        found = []
        for k in range(courses.shape[1]):
            others = np.delete(courses, k, axis=1)
            course = courses[:, k]
            found.append(float(np.linalg.norm(course - others @ np.linalg.lstsq(others, course, rcond=None)[0])))
        return min(found)

    def unabsorbed(self, name: str, course: Vector) -> Vector:
        white = self.world.noise[name].whitened(course[: self._rows[-1], None], self._rows)[:, 0]
        basis = self._absorbed[name]
        return np.asarray(white - basis @ (basis.T @ white))

    def _basis(self, name: str) -> Vector:
        noise = self.world.noise[name]
        stop = self._rows[-1]
        free = recalibration(self.off.simulated[name], self.time_s, self.starts)[:stop]
        repeated = noise.repeated(self._rows)
        if repeated.size and not noise.phi:
            # white: means over every phase of the cycle, which are orthogonal as they are
            even = repeated / np.sqrt(np.maximum(repeated.sum(axis=0), 1.0))
            free = free - even @ (even.T @ free)
        else:
            even, free = np.empty((stop, 0)), np.column_stack([free, repeated])
        lengths = np.linalg.norm(free, axis=0)
        free = noise.whitened(free / np.where(lengths > 0.0, lengths, 1.0), self._rows)
        basis, values, _ = np.linalg.svd(free, full_matrices=False)
        return np.column_stack([even, basis[:, values > 1e-10 * values.max(initial=0.0)]])


def case_of(world: World, plan: Plan, generator: np.random.Generator, wanted: float | None) -> Case:
    """A case whose effect an oracle could detect with d′ `wanted` (times the plan's factor).

    Of several effects at once each has at least this d′ beside the others. With 0 the effect is off; without one it has
    the `size` of the plan.

    Raises ValueError if no size of the effect has this strength.
    """
    strength = _Strength(world)
    starts = strength.starts
    noise = {name: world.noise[name].drawn(generator, starts) for name in world.responses}
    lost = generator.random(starts[-1]) < plan.lost
    size = plan.size if wanted is None else 0.0
    if wanted:
        size = _size_for(wanted * plan.factor, strength, world.first)
    now = strength.seen(size)
    readings: dict[str, list[Vector]] = {name: list(parts) for name, parts in now.runs.items()}
    for name, errors in noise.items():
        readings[name] = split(now.recorded[name] + errors, starts)
    if world.distorted is not None:
        readings = {name: list(parts) for name, parts in world.distorted(readings, size).items()}
    for name in world.responses:
        readings[name] = [world.noise[name].rounded(part) for part in readings[name]]
    courses = strength.effect(size)
    held_out = {
        name: held_out_errors(
            np.concatenate(readings[name]),
            now.simulated[name],
            courses[name],
            np.concatenate(readings[name]) - now.recorded[name],
            world.noise[name],
            strength.time_s,
            starts,
        )
        for name in world.responses
    }
    whole = replace(plan, kind="clean", verdicts=("nothing-missing",), tolerated=()) if wanted == 0.0 else plan
    concealed: tuple[Concealment, ...] = (concealment.faithful(strength.detected(strength.off.missing)),)
    truth = Truth(whole.verdicts, (), whole.tolerated, None, concealed, held_out)
    if size:
        alone = {name: strength.detected({name: course}) for name, course in courses.items()}
        concealed += tuple(_hidden(kind, strength, now, courses, alone) for kind in plan.hidden)
        seen = Shown(courses, now.recorded, now.simulated, world.noise, starts)
        if world.rival is not None:
            concealed += (_like_rival(strength, courses, world.rival, strength.detected(courses)),)
        concealed += tuple(measure(seen) for measure in plan.measures)
        truth = replace(truth, effects=world.effects(size), d_prime=strength.weakest(size), concealed=concealed)
    return Case(
        whole.name,
        whole.family,
        whole.kind,
        _recording(world, readings, [~part for part in split(lost, starts)]),
        _simulation(world, now.simulation),
        world.responses,
        truth,
    )


def _like_rival(strength: _Strength, courses: Courses, rival: World, wanted: float) -> Concealment:
    other = _Strength(rival)
    theirs = other.effect(_size_for(wanted, other, rival.first))
    one, two = (
        np.concatenate([strength.unabsorbed(name, side[name]) for name in strength.world.responses])
        for side in (courses, theirs)
    )
    return concealment.like_rival(float(one @ two / np.linalg.norm(one) / np.linalg.norm(two)))


def _size_for(target: float, strength: _Strength, first: float) -> float:
    """The size with this d′: by secants, and where the effect sets in all at once (a limit, a play) by halving."""
    found = strength.weakest
    try:
        return scale_for(target, found, first=first)
    except ValueError:
        low, high, nearest = 0.0, first, (0.0, 0.0)
        for _ in range(12):
            if found(high) > target:
                break
            low, high = high, 2.0 * high
        for _ in range(30):
            middle = 0.5 * (low + high)
            value = found(middle)
            if abs(value / target - 1.0) < abs(nearest[0] / target - 1.0):
                nearest = value, middle
            if abs(value / target - 1.0) < 0.02:
                break
            low, high = (middle, high) if value < target else (low, middle)
        if abs(nearest[0] / target - 1.0) < 0.045:
            return nearest[1]
        raise


def size_with(world: World, wanted: float) -> float:
    """The size of the effect at which an oracle could detect it with d′ `wanted`."""
    return _size_for(wanted, _Strength(world), world.first)


def _hidden(kind: str, strength: _Strength, now: _Seen, courses: Courses, alone: Mapping[str, float]) -> Concealment:
    world = strength.world
    word, _, response = kind.rpartition(" ")
    if kind == "small":
        return concealment.below_noise(courses, world.noise, strength.starts)
    if kind == "absorbed":
        return concealment.absorbed(courses, strength.off.simulated, world.noise, strength.time_s, strength.starts)
    if kind == "rare":
        return concealment.rare(courses, strength.starts)
    if word == "ruled out in":
        return concealment.ruled_out(alone, response)
    if word == "like":
        known = {f"simulated {name}": course for name, course in strength.off.simulated.items()}
        known |= {name: course for name, course in now.recorded.items() if name not in world.responses}
        return concealment.like_known(courses, known, response, strength.starts)
    raise ValueError(f"concealment {kind!r}")


def _recording(world: World, readings: Runs, kept: Sequence[NDArray[np.bool_]]) -> Recording:
    frames = {}
    for k, (run, time) in enumerate(world.time_s.items()):
        table = {channel.name: readings[channel.name][k][kept[k]] for channel in world.channels}
        frames[run] = pd.DataFrame(table, index=pd.Index(time[kept[k]], name="time_s"))
    return Recording.from_runs(frames, world.channels)


def _simulation(world: World, courses: Runs) -> Recording:
    channels = [channel for channel in world.channels if channel.name in courses]
    frames = {}
    for k, (run, time) in enumerate(world.simulation_time_s.items()):
        table = {channel.name: courses[channel.name][k] for channel in channels}
        frames[run] = pd.DataFrame(table, index=pd.Index(time, name="time_s"))
    return Recording.from_runs(frames, channels)
