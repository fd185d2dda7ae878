"""How does a world with a concealed effect become a case of wanted strength: noise, size, tables, truth."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any, ClassVar, Self

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from proving_ground import concealment
from proving_ground.case import Case, Concealment, Kind, Scenario, TrueEffect, Truth
from proving_ground.concealment import (
    Measure,
    Noise,
    Shown,
    fitted_starts,
    held_out_errors,
    recalibration,
    scale_for,
    split,
    stacked,
    whitened_basis,
)
from selector.recording import Channel, Recording
from selector.types import Vector

Courses = Mapping[str, Vector]
Runs = Mapping[str, Sequence[Vector]]

HIDDEN_FACTOR = 4.0
"""What no catalogue knows is made stronger than what it knows, since nothing can be matched to it."""


_DRAWS = 4
_VERDICTS: Mapping[Kind, str] = {
    "clean": "nothing-missing",
    "miscalibrated": "miscalibrated",
    "data": "data-fault",
    "out-of-catalogue": "unexplained",
}


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
    #: (channel → course, its period [s], generator) -> World: The same world with a run more, in front of the last one,
    #: in which these channels are as told; ValueError if one cannot be set
    with_run: Callable[[Courses, float, np.random.Generator], World] | None = None


@dataclass(frozen=True)
class Plan:
    """What a scenario says of its cases: name, family, kind, right verdicts, how it is hidden.

    `hidden` says which numbers are to hold: ``"small"``, ``"absorbed"``, ``"rare"``, or what measures one, such as
    `proving_ground.concealment.ruled_out` in a response. `size` is that of an effect whose strength is not chosen,
    since recalibration takes in all of it.
    `lost` is the share of rows that were never written.
    """

    name: str
    family: str
    kind: Kind
    verdicts: tuple[str, ...] = ()  #: Empty = that of the kind
    hidden: tuple[str | Measure, ...] = ()
    tolerated: tuple[str, ...] = ()
    size: float = 0.0
    lost: float = 0.0
    is_true: bool = True  #: The simulation lacks nothing but the effect and what recalibration takes in
    note: str = ""

    def __post_init__(self) -> None:
        if not self.verdicts:
            object.__setattr__(self, "verdicts", (_VERDICTS.get(self.kind, "missing-physics"),))

    @property
    def factor(self) -> float:
        """By what the wanted d′ is multiplied."""
        return HIDDEN_FACTOR if self.kind == "out-of-catalogue" else 1.0


Made = Callable[[np.random.Generator], World]
"""A world with what the generator draws."""


def scenario(plan: Plan, made: Made) -> Scenario:
    """A scenario of worlds that are made from a seed; every name draws other worlds from the same seed.

    A world in which the effect is not hidden as the plan says, or cannot be of the wanted strength, is drawn anew, a
    few times.
    """

    def build(seed: int, wanted: float | None) -> Case:
        case: Case | None = None
        for draw in range(_DRAWS):
            generator = _generator(plan, seed, draw)
            try:
                case = case_of(made(generator), plan, generator, wanted)
            except ValueError:
                if case is None and draw == _DRAWS - 1:
                    raise
                continue
            if all(hidden.holds for hidden in case.truth.concealed):
                break
        assert case is not None
        return case

    has_strength = plan.kind not in ("clean", "miscalibrated") and not plan.size
    return Scenario(plan.name, plan.family, plan.kind, build, plan.note, has_strength=has_strength)


def _generator(plan: Plan, seed: int, draw: int) -> np.random.Generator:
    return np.random.default_rng([seed, draw, *plan.name.encode()])


def twin(plan: Plan, made: Made) -> Scenario:
    """The clean twin of a scenario: the same machines, programmes and noise, the effect off."""

    def build(seed: int, wanted: float | None) -> Case:
        generator = _generator(plan, seed, 0)
        return replace(case_of(made(generator), plan, generator, 0.0), name=name, kind="clean")

    name = f"clean.{plan.family}/off {plan.name.partition('.')[2]}"
    note = f"Twin of {plan.name} with the effect off."
    return Scenario(name, plan.family, "clean", build, note, has_strength=False)


def scenarios_of(cases: Iterable[tuple[Plan, Made]], *twins: str) -> tuple[Scenario, ...]:
    """The scenarios of plans with their worlds, and the clean twins of those with these names."""
    known = list(cases)
    return (*(scenario(*case) for case in known), *(twin(*case) for case in known if case[0].name in twins))


Change = Callable[[Any, float], Any]
"""(machine, size) → the machine with the effect; called with size > 0 only."""
Prepared = Callable[[Any, np.random.Generator], Mapping[str, Any]]
"""(bench, generator) → arguments of the world that depend on the machine."""


@dataclass(frozen=True)
class Missing:
    """One machine on its bench, and what it does that its simulation does not; families derive from it."""

    plan: Plan
    id: str  #: Of the effect; empty = none
    change: Change | None = None
    bench: Mapping[str, Any] = field(default_factory=dict)  #: How the bench is drawn
    start: Mapping[str, float] = field(default_factory=dict)  #: Parameters that are set whatever was drawn
    world: Mapping[str, Any] = field(default_factory=dict)  #: Arguments of the world
    #: accept, channels and place: Of the true effect; the id alone is right unless told
    accept: tuple[str, ...] = ()
    channels: tuple[str, ...] = ()
    place: str | None = None
    #: Further arguments of the world; ``"true"`` among them replaces `change`, ``"windows"`` says when the effect acts.
    #: Of several effects ``"lacking"`` has the arguments that are otherwise where the first one is lacking, the second
    #: one, ….
    prepared: Prepared | None = None
    rival: Prepared | None = None  #: The arguments of another effect that this record does not tell from it

    family: ClassVar[str]

    @classmethod
    def of(
        cls,
        name: str,
        change: Change | None = None,
        bench: Mapping[str, Any] | None = None,
        start: Mapping[str, float] | None = None,
        *,
        hidden: Sequence[str | Measure] | None = None,
        first: float = 1.0,
        world: Mapping[str, Any] | None = None,
        **rest: Any,
    ) -> Self:
        """The effect before the slash of the name is missing, unless told otherwise; `rest` is of `Plan` or this.

        A single effect is hidden by being small, unless `hidden` says how.
        """
        told = {"kind": "single"} | {key: rest.pop(key) for key in list(rest) if key in Plan.__dataclass_fields__}
        ways = hidden if hidden is not None else ("small",) if told["kind"] == "single" else ()
        plan = Plan(name, cls.family, hidden=tuple(ways), **told)
        arguments = {"first": first, **(world or {})}
        return cls(plan, rest.pop("id", name.partition("/")[0]), change, bench or {}, start or {}, arguments, **rest)

    @property
    def case(self) -> tuple[Plan, Made]:
        """For `scenarios_of`."""
        return self.plan, self.made

    def drawn(self, generator: np.random.Generator) -> Any:
        """The bench with its `machine`, without the effect."""
        raise NotImplementedError

    def world_of(self, bench: Any, **more: Any) -> World:
        """What is recorded and simulated on this bench."""
        raise NotImplementedError

    def with_run(
        self, bench: Any, arguments: Mapping[str, Any]
    ) -> Callable[[Courses, float, np.random.Generator], World] | None:
        """See `World.with_run`; `arguments` are those of `world_of`."""
        return None

    def made(self, generator: np.random.Generator) -> World:
        """The world of this scenario with what the generator draws."""
        drawn, change = self.drawn(generator), self.change
        start = drawn.machine
        arguments: dict[str, Any] = {
            "true": lambda size: change(start, size) if change is not None and size else start,
            **self.world,
            **(self.prepared(drawn, generator) if self.prepared is not None else {}),
        }
        windows, lacking = arguments.pop("windows", ()), arguments.pop("lacking", ())
        effect = TrueEffect(self.id, self.accept or (self.id,), self.channels, self.place, windows)
        arguments.setdefault("effects", lambda size: (effect,) if self.id else ())
        with_run = self.with_run(drawn, arguments)
        if self.rival is not None:
            other = {**arguments, **self.rival(drawn, generator)}
            arguments["rival"] = self.world_of(drawn, **{key: other[key] for key in other if key != "windows"})
        without = tuple(self.world_of(drawn, **{**arguments, **other}) for other in lacking)
        return replace(self.world_of(drawn, **arguments), lacking=without, with_run=with_run)


def plus(name: str, unit: float = 1.0) -> Change:
    """The change that adds size × `unit` to a parameter of the machine."""
    return lambda machine, size: machine._replace(**{name: getattr(machine, name) + size * unit})


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
        """`proving_ground.concealment.d_prime`, with what recalibration absorbs worked out once."""
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
        return np.column_stack([even, whitened_basis(free, noise, self._rows)])


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
    whole = replace(plan, kind="clean", verdicts=(), tolerated=()) if wanted == 0.0 else plan
    concealed: tuple[Concealment, ...] = ()
    if plan.is_true:
        concealed += (concealment.faithful(strength.detected(strength.off.missing)),)
    truth = Truth(whole.verdicts, (), whole.tolerated, None, concealed, held_out)
    if size:
        alone = {name: strength.detected({name: course}) for name, course in courses.items()}
        without, time_s = strength.off.simulated, strength.time_s
        seen = Shown(courses, now.recorded, now.simulated, without, world.noise, alone, time_s, starts)
        concealed += tuple(concealment.concealed(how, seen) for how in plan.hidden)
        if world.rival is not None:
            concealed += (_like_rival(strength, courses, world.rival, strength.detected(courses)),)
        truth = replace(truth, effects=world.effects(size), d_prime=strength.weakest(size), concealed=concealed)
    said = [channel for channel in world.channels if channel.name in now.simulation]
    case = Case(
        whole.name,
        whole.family,
        whole.kind,
        _recording(world.channels, world.time_s, readings, [~part for part in split(lost, starts)]),
        _recording(said, world.simulation_time_s, now.simulation),
        world.responses,
        truth,
    )
    if world.with_run is None or world.distorted is not None:
        return case
    return replace(case, with_run=partial(_with_run, case, world, size))


def _with_run(case: Case, world: World, size: float, told: Courses, period_s: float, seed: int) -> Case:
    generator = np.random.default_rng([seed, *case.name.encode()])
    assert world.with_run is not None
    longer = world.with_run(told, period_s, generator)
    new, now = next(run for run in longer.time_s if run not in world.time_s), _Seen(longer, size)
    place = list(longer.time_s).index(new)

    def joined(known: Recording, times: Mapping[str, Vector], courses: Runs) -> Recording:
        parts = {one.name: [courses[one.name][place]] for one in known.channels}
        frames = {run: known.frame.loc[run] for run in known.runs}
        frames[new] = _recording(known.channels, {new: times[new]}, parts).frame.loc[new]
        return Recording.from_runs({run: pd.DataFrame(frames[run]) for run in longer.time_s}, known.channels)

    readings = {name: list(parts) for name, parts in now.runs.items()}
    for name in world.responses:
        noise, course = world.noise[name], readings[name][place]
        readings[name][place] = noise.rounded(course + noise.drawn(generator, (0, len(course))))
    return replace(
        case,
        recording=joined(case.recording, longer.time_s, readings),
        simulation=joined(case.simulation, longer.simulation_time_s, now.simulation),
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


def _recording(
    channels: Sequence[Channel], times: Mapping[str, Vector], courses: Runs, kept: Sequence[NDArray[np.bool_]] = ()
) -> Recording:
    """Courses of these channels as a recording; `kept` are the rows of every run, empty = all."""
    frames = {}
    for k, (run, time) in enumerate(times.items()):
        rows = kept[k] if kept else slice(None)
        table = {channel.name: courses[channel.name][k][rows] for channel in channels}
        frames[run] = pd.DataFrame(table, index=pd.Index(time[rows], name="time_s"))
    return Recording.from_runs(frames, channels)
