"""From machine, duties and omissions to a world: what is recorded at any size, with which channels beside it."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from copy import copy
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np

from proving_ground.case import TrueEffect, Window
from proving_ground.concealment import Noise, d_prime, recalibration, scale_for
from proving_ground.thermal.duty import (
    BOTH,
    STEP_S,
    Change,
    Duty,
    Maker,
    Omission,
    duty,
    held,
    lagged,
    load,
    wandering,
    with_bath,
    with_power,
)
from proving_ground.thermal.machine import Body, Heat, guessed, machine, slightly_off, temperatures
from proving_ground.world import Courses, Made, Plan, World
from selector.recording import Channel
from selector.types import Matrix, Vector

_ALONE = 8.0
"""The d′ at which several effects are made equally strong, each by itself."""
STRIDE = 2
GRID_S = STRIDE * STEP_S
"""Grid on which temperatures and displacements are kept before they are sampled [s]."""
WHITE: Mapping[str, Any] = {"noise": "white", "periods_s": (20.0,)}
FINE: Mapping[str, Any] = {"noise": "white", "periods_s": (15.0, 20.0)}
"""What a `Scene` says of a recording in which small effects, or quick ones, are to be seen."""


@dataclass(frozen=True)
class Gauge:
    """A recorded channel that does not depend on the effect.

    `course` (duty, generator) gives it on the steps of the duty; it is lagged, rounded to `resolution`, and held from
    step to step where `held`.
    """

    channel: Channel
    course: Callable[[Duty, np.random.Generator], Vector]
    resolution: float = 0.1
    lag_s: float = 0.0
    held: bool = False
    noise: float = 0.0


def warmed(course: Vector, tau_s: float) -> Vector:
    """A course behind a first-order lag, from its first value."""
    return lagged(course, tau_s, STEP_S)


def _cabinet(name: str, place: str, tau_s: float, swing_k: float, load_k: float) -> Gauge:
    def course(one: Duty, generator: np.random.Generator) -> Vector:
        n = len(one.time_s)
        own = held(generator, n, 10.0, 50.0, np.array([0.0, 0.4, 1.0]))
        warm = warmed(swing_k * own + load_k * load(one), tau_s * generator.uniform(0.7, 1.4))
        return np.asarray(27.0 + warm + 0.6 * wandering(generator, n, 2500.0))

    return Gauge(Channel(name, "temperature", "degC", place), course, noise=0.03)


def decoy(name: str, place: str, tau_s: float) -> Gauge:
    """A cabinet that in the first run happens to warm up as if the spindle did it, and goes its own way afterwards."""
    own = _cabinet(name, place, 1500.0, 5.0, 0.0)

    def course(one: Duty, generator: np.random.Generator) -> Vector:
        if one.run != "r1":
            return own.course(one, generator)
        return np.asarray(27.0 + 5.0 * warmed(load(one), tau_s) + 0.15 * wandering(generator, len(one.time_s), 1500.0))

    return replace(own, course=course)


_GAUGES = {
    gauge.channel.name: gauge
    for gauge in (
        Gauge(Channel("n", "spindle_speed", "rpm"), lambda one, _: one["speed"], 1.0, held=True),
        Gauge(Channel("f", "feed_rate", "mm/min"), lambda one, _: one["feed"], 1.0, held=True),
        Gauge(Channel("M8", "state", "1", "coolant pump"), lambda one, _: one["coolant"], 1.0, held=True),
        Gauge(Channel("Q", "flow", "m^3/s", "coolant"), lambda one, _: one["flow"] / 60000.0, 1e-6, held=True),
        Gauge(Channel("T8", "temperature", "degC", "coolant tank"), lambda one, _: one["coolant_degc"], lag_s=60.0),
        Gauge(Channel("T9", "temperature", "degC", "hydraulic tank"), lambda one, _: one["oil_degc"], lag_s=60.0),
        Gauge(Channel("M20", "state", "1", "hydraulic pump"), lambda one, _: one["hydraulics"], 1.0, held=True),
        _cabinet("T10", "control cabinet", 1800.0, 6.0, 2.5),
        _cabinet("T11", "drive cabinet", 3600.0, 4.0, 3.5),
        _cabinet("T12", "transformer", 900.0, 3.0, 1.0),
        _cabinet("T13", "chip conveyor", 5400.0, 5.0, 1.5),
    )
}
#: Channel that can be set → course of a duty, and what a unit of the channel is there.
_SET = {
    "n": ("speed", 1.0),
    "f": ("feed", 1.0),
    "M8": ("coolant", 1.0),
    "Q": ("flow", 60000.0),
    "M20": ("hydraulics", 1.0),
    "Tamb": ("hall", 1.0),
}
_STILL = {"speed", "feed", "coolant", "flow"}
CABINETS = tuple(_GAUGES[name] for name in ("T10", "T11", "T12", "T13"))


def of(name: str) -> Gauge:
    """A gauge by the name of its channel: n, f, M8, Q, T8, T9, M20, T10…T13."""
    return _GAUGES[name]


@dataclass(frozen=True)
class Scene:
    """What a scenario says of machine, runs and recording; the rest is drawn."""

    omissions: tuple[Omission | Maker, ...] = ()
    styles: tuple[str, ...] = ("warm-up", "steps", "intermittent")  #: Programme of every run, the held-out one last
    gauges: tuple[Gauge, ...] = ()  #: Channels beside temperatures, ambient and responses
    must: tuple[str, ...] = ()  #: Temperatures that are recorded in any case
    #: What both machine and simulation have besides the spindle's heat: ``"coolant"``, ``"feed"``; with ``"constant
    #: hall"`` the simulation's hall does not change
    knows: tuple[str, ...] = ()
    law: tuple[float, float] = (1.2, 1.7)  #: Between which exponents of speed the heat of the bearings lies
    noise: str = "any"  #: Kind of the noise: any, white, ar, walk, heavy, quantised, cycle
    sampling: str = "even"  #: {"even", "jitter", "uneven"}
    own_clock: bool = False  #: The simulation has a time grid of its own
    refitted: bool = False  #: Offset and gain of the simulation are fitted to the machine with the effect
    #: gain, offset_um and delay_s: What is wrong with the simulation's parameters
    gain: float = 1.0
    offset_um: float = 0.0
    delay_s: float = 0.0
    off: float = 0.0  #: Standard deviation of the shares by which heat and parts of the simulation are wrong
    hours: tuple[float, float] = (5.0, 6.5)
    periods_s: tuple[float, ...] = (20.0, 30.0, 60.0)  #: Sampling periods to choose from
    hall: tuple[float, float, float] = (21.0, 0.5, 0.4)
    duties: Change = lambda _generator, duties: duties  #: What a scenario changes in the programmes


def noise_of(generator: np.random.Generator, kind: str) -> Noise:
    """Noise of a displacement probe, of a kind and a drawn size."""
    sd = float(generator.uniform(0.4, 0.8))
    if kind == "any":
        kind = str(generator.choice(["white", "weak", "ar"]))
    if kind == "cycle":
        return Noise(0.6 * sd, 0.3, cycle_samples=int(generator.integers(9, 24)), cycle_sd=0.7 * sd)
    return {
        "white": Noise(sd, step=0.01),
        "weak": Noise(sd, 0.5, step=0.01),
        "ar": Noise(sd, 0.85, step=0.01),
        "walk": Noise(1.3 * sd, 0.992, step=0.01),
        "heavy": Noise(sd, float(generator.uniform(0.0, 0.6)), tails=3.0, step=0.01),
        "quantised": Noise(0.5 * sd, step=0.5),
    }[kind]


def thermal_case(
    name: str,
    note: str,
    omissions: tuple[Omission | Maker, ...],
    styles: tuple[str, ...],
    gauges: tuple[Gauge, ...] = (of("n"),),
    **rest: Any,
) -> tuple[Plan, Made]:
    """What is said of a case, and its worlds; `rest` is of `Plan`, of a single effect unless told, or of `Scene`."""
    planned = {key: rest.pop(key) for key in list(rest) if key in Plan.__dataclass_fields__}
    scene = Scene(omissions, styles, gauges, **rest)
    plan = Plan(name, **{"family": "thermal", "kind": "single", "note": note} | planned)
    return plan, lambda generator: Stage(scene, generator).world()


class Stage:
    """A machine in its runs, drawn for a scene; solves its heat as simulated, and with every omission at its size."""

    def __init__(self, scene: Scene, generator: np.random.Generator) -> None:
        self.scene, self.tool = scene, machine(generator)
        hours = float(generator.uniform(*scene.hours))
        level, swing, drift = scene.hall
        duties: list[Duty] = []
        for k, style in enumerate(scene.styles):
            hall = (level + float(generator.uniform(-1.2, 1.2)), swing, drift)
            duties.append(duty(generator, f"r{k + 1}", style, hours, self.tool.highest_rpm, hall))
        self.duties = scene.duties(generator, duties)
        self.omissions = [one if isinstance(one, Omission) else one(generator, self.duties) for one in scene.omissions]
        self.exponent = float(generator.uniform(*scene.law))
        self.watts = {
            "front bearing": float(generator.uniform(55.0, 85.0)),
            "rear bearing": float(generator.uniform(25.0, 45.0)),
            "motor": float(generator.uniform(15.0, 35.0)),
            "nut": float(generator.uniform(30.0, 60.0)),
        }
        self.expansion = self.tool.displacement()
        self.base = [self._heat(one) for one in self.duties]
        self.fields = [self._solved(heat, one) for heat, one in zip(self.base, self.duties, strict=True)]
        self._truths: dict[tuple[int, float], dict[str, Vector]] = {}
        self._author: Stage | None = None
        several = range(len(self.omissions))
        self.weights = [1.0 for _ in several]
        self._sample(generator)
        self.guess = self.tool.body, self.watts
        self._says: dict[int, Matrix] = {}
        if scene.off:
            self.guess = guessed(self.tool.body, scene.off, generator), slightly_off(self.watts, scene.off, generator)
        if len(several) > 1:
            self.weights = [scale_for(_ALONE, partial(self._strength_alone, k)) / _ALONE for k in several]

    def _heat(self, one: Duty, watts: Mapping[str, float] | None = None) -> Heat:
        watts = watts or self.watts
        share = one["speed"] / self.tool.highest_rpm
        law = share**self.exponent
        power = {name: watts[name] * law for name in ("front bearing", "rear bearing")}
        power["motor"] = watts["motor"] * share
        still = np.ones_like(share)
        start = np.full_like(share, one["hall"][0])
        heat = Heat(power, {"hall": one["hall"], "floor": start}, {"hall": still, "floor": still})
        if "feed" in self.scene.knows:
            heat = with_power(heat, "nut", watts["nut"] * one["feed"] / 9000.0)
        if "coolant" in self.scene.knows:
            heat = with_bath(heat, "coolant", one["coolant_degc"], one["coolant"])
        if "constant hall" in self.scene.knows:
            heat = with_bath(heat, "hall", start, still)
        return heat

    def _solved(self, heat: Heat, one: Duty, body: Body | None = None) -> Matrix:
        return temperatures(body or self.tool.body, heat, float(one["hall"][0]), STEP_S, STRIDE)

    def _simulated(self, run: int) -> Matrix:
        """Rises of the volumes [K] of what the author of the simulation takes the machine for."""
        if not self.scene.off:
            return self.rises(run)
        if run not in self._says:
            body, watts = self.guess
            field = self._solved(self._heat(self.duties[run], watts), self.duties[run], body)
            self._says[run] = field - field[0]
        return self._says[run]

    def _with(self, k: int, run: int, size: float) -> Matrix:
        changed = self.omissions[k].heated(self.tool, self.base[run], self.duties[run], size)
        return self.fields[run] if changed is self.base[run] else self._solved(changed, self.duties[run])

    def rises(self, run: int) -> Matrix:
        """Rises of the simulated volumes since the start of a run [K], shape (n_times, n_volumes)."""
        return np.asarray(self.fields[run] - self.fields[run][0])

    def effect(self, number: int, run: int, size: float) -> dict[str, Vector]:
        """Axis → what an omission of this size does [µm] on the grid of the fields."""
        omission, now = self.omissions[number], self._with(number, run, size)
        result = {axis: (now - self.fields[run]) @ self.expansion[axis] for axis in BOTH}
        if omission.shifted is not None:
            for axis, course in omission.shifted(self.tool, now - now[0], self.duties[run]).items():
                result[axis] = result[axis] + size * course
        return {axis: omission.axes.get(axis, 0.0) * course for axis, course in result.items()}

    def given(self, size: float) -> list[dict[str, Vector]]:
        """Per run: axis → what the simulation says [µm] on the grid of the fields, before its parameters are wrong."""
        runs = range(len(self.duties))
        result = [{axis: self._simulated(run) @ self.expansion[axis] for axis in BOTH} for run in runs]
        for omission, weight in zip(self.omissions, self.weights, strict=True):
            if omission.stand_in is not None and size:
                instead = omission.stand_in(self.tool, [self.rises(run) for run in runs])
                for run, axes in enumerate(instead):
                    for axis, course in axes.items():
                        result[run][axis] = result[run][axis] + size * weight * omission.axes.get(axis, 0.0) * course
        return result

    def _sample(self, generator: np.random.Generator) -> None:
        self.period_s = period = float(generator.choice(self.scene.periods_s))
        self.time_s: dict[str, Vector] = {}
        self.own_time_s: dict[str, Vector] = {}
        for one in self.duties:
            end = one.time_s[-1] - GRID_S
            n = int(end / period)
            stamps = period * np.arange(n + 1)
            if self.scene.sampling == "jitter":
                stamps[1:] += np.clip(0.08 * period * generator.standard_normal(n), -0.4 * period, 0.4 * period)
            elif self.scene.sampling == "uneven":
                stamps[1:] = np.cumsum(period * generator.uniform(0.4, 1.6, n))
            self.time_s[one.run] = np.round(stamps[stamps <= end], 2)
            own = period * float(generator.uniform(0.55, 1.7))
            grid = np.append(np.arange(0.0, end, own), end)
            self.own_time_s[one.run] = np.round(grid, 2) if self.scene.own_clock else self.time_s[one.run]
        self.noise = {axis: noise_of(generator, self.scene.noise) for axis in BOTH}
        others = [name for name in ("T3", "T4", "T5") if (generator.random() < 0.6) | (name in self.scene.must)]
        self.felt = ["T1", "T2", *others, "T6"]
        self.errors = {
            run: 0.03 * generator.standard_normal((len(stamps), len(self.felt) + 1))
            for run, stamps in self.time_s.items()
        }
        self.gauged = {
            gauge.channel.name: [self._gauged(gauge, one, generator) for one in self.duties]
            for gauge in self.scene.gauges
        }

    def _gauged(self, gauge: Gauge, one: Duty, generator: np.random.Generator) -> Vector:
        course = lagged(gauge.course(one, generator), gauge.lag_s, STEP_S)
        stamps = self.time_s[one.run]
        if gauge.held:
            seen = course[np.minimum((stamps / STEP_S).astype(int), len(course) - 1)]
        else:
            seen = np.interp(stamps, one.time_s, course)
        seen = seen + gauge.noise * generator.standard_normal(len(stamps))
        return np.round(np.round(seen / gauge.resolution) * gauge.resolution, 9)

    def _strength_alone(self, k: int, size: float) -> float:
        lengths = [len(stamps) for stamps in self.time_s.values()]
        starts = (0, *np.cumsum(lengths).tolist())
        time = np.concatenate(list(self.time_s.values()))
        effect, free = {}, {}
        for axis in BOTH:
            effect[axis] = np.concatenate(
                [self._at(run, self.effect(k, run, size)[axis]) for run in range(len(lengths))]
            )
            simulated = [self._at(run, self.rises(run) @ self.expansion[axis]) for run in range(len(lengths))]
            free[axis] = recalibration(np.concatenate(simulated), time, starts)
        return d_prime(effect, self.noise, free, starts)

    def _at(self, run: int, course: Vector, *, delay_s: float = 0.0, own: bool = False) -> Vector:
        name = self.duties[run].run
        stamps = (self.own_time_s if own else self.time_s)[name]
        return np.interp(stamps - delay_s, GRID_S * np.arange(len(course)), course)

    def _temperatures(self, run: int, size: float) -> dict[str, Vector]:
        changed = self.base[run]
        for omission, weight in zip(self.omissions, self.weights, strict=True):
            changed = omission.heated(self.tool, changed, self.duties[run], size * weight)
        now = self.fields[run] if changed is self.base[run] or not size else self._solved(changed, self.duties[run])
        errors = self.errors[self.duties[run].run]
        result = {}
        for k, name in enumerate(self.felt):
            _, weights, lag_s = self.tool.sensors[name]
            result[name] = np.round(self._at(run, lagged(now @ weights, lag_s, GRID_S)) + errors[:, k], 1)
        hall = lagged(self.duties[run]["hall"], 40.0, STEP_S)[::STRIDE]
        result["Tamb"] = np.round(20.0 * (self._at(run, hall) + errors[:, -1])) / 20.0
        return result

    def _true(self, run: int, size: float) -> dict[str, Vector]:
        if (run, size) not in self._truths:
            course = {axis: self.rises(run) @ self.expansion[axis] for axis in BOTH}
            if size:
                for k, weight in enumerate(self.weights):
                    effect = self.effect(k, run, size * weight)
                    course = {axis: course[axis] + effect[axis] for axis in BOTH}
            self._truths[run, size] = course
        return self._truths[run, size]

    def recorded(self, size: float) -> dict[str, list[Vector]]:
        """Channel → course of every run, responses without their noise."""
        result: dict[str, list[Vector]] = {channel.name: [] for channel in self.channels()}
        for run in range(len(self.duties)):
            for axis, course in self._true(run, size).items():
                result[axis].append(self._at(run, course))
            for name, values in self._temperatures(run, size).items():
                result[name].append(values)
            for name, runs in self.gauged.items():
                result[name].append(runs[run])
        return result

    def simulated(self, size: float) -> dict[str, list[Vector]]:
        """Axis → what the simulation says in every run, with parameters that its author fitted or got wrong."""
        scene, given = self.scene, self.given(size)
        result = {}
        for axis in BOTH:
            gain, offset = (self._author or self)._fitted(axis, size)
            result[axis] = [
                np.round(gain * self._at(run, course[axis], delay_s=scene.delay_s, own=True) + offset, 3)
                for run, course in enumerate(given)
            ]
        return result

    def _fitted(self, axis: str, size: float) -> tuple[float, float]:
        """Gain and offset [µm] that the author of the simulation has."""
        gain, offset = self.scene.gain, self.scene.offset_um
        if self.scene.refitted and size:
            given = self.given(size)
            fitted = range(max(1, len(given) - 1))
            truth = np.concatenate([self._at(run, self._true(run, size)[axis]) for run in fitted])
            says = np.concatenate([self._at(run, given[run][axis]) for run in fitted])
            slope, level = np.polyfit(says, truth, 1)
            gain, offset = gain * float(slope), offset + float(level)
        return gain, offset

    def with_run(self, told: Courses, period_s: float, generator: np.random.Generator) -> Stage:
        """The same machine and simulation with one more run in front of the last one, which is held out.

        `told` are recorded channels as they are to be, from `period_s` to `period_s`; whatever else could be set is as
        at the start of the first run.

        Raises ValueError if a channel cannot be set.
        """
        new = self._duty(told, period_s)
        other, before = copy(self), len(self.duties) - 1

        def inserted(known: Sequence[Any], one: Any) -> list[Any]:
            return [*known[:before], one, *known[before:]]

        other.duties = inserted(self.duties, new)
        other.base = inserted(self.base, self._heat(new))
        other.fields = inserted(self.fields, self._solved(other.base[before], new))
        other._truths, other._says, other._author = {}, {}, self._author or self
        stamps = np.round(np.arange(0.0, new.time_s[-1] - GRID_S, self.period_s), 2)
        other.time_s = dict(inserted([*self.time_s.items()], (new.run, stamps)))
        other.own_time_s = dict(inserted([*self.own_time_s.items()], (new.run, stamps)))
        other.errors = {**self.errors, new.run: 0.03 * generator.standard_normal((len(stamps), len(self.felt) + 1))}
        other.gauged = {
            gauge.channel.name: inserted(self.gauged[gauge.channel.name], other._gauged(gauge, new, generator))
            for gauge in self.scene.gauges
        }
        return other

    def _duty(self, told: Courses, period_s: float) -> Duty:
        first, n = self.duties[0], int(len(next(iter(told.values()))) * period_s / STEP_S)
        steps = STEP_S * np.arange(n)
        courses = {name: np.full(n, course[0]) for name, course in first.courses.items()}
        for name in _STILL & courses.keys():
            courses[name] = np.zeros(n)
        for channel, values in told.items():
            name, unit = _SET.get(channel, ("", 1.0))
            if name not in courses:
                raise ValueError(f"nobody can set {channel}")
            held = values[np.minimum((steps / period_s).astype(int), len(values) - 1)]
            smooth = np.interp(steps, period_s * np.arange(len(values)), values)
            courses[name] = unit * (smooth if name == "hall" else held)
        return Duty(f"r{len(self.duties) + 1}", "planned", np.asarray(steps, dtype=np.float64), courses)

    def channels(self) -> tuple[Channel, ...]:
        """The recorded channels."""
        felt = [Channel(name, "temperature", "degC", self.tool.sensors[name][0]) for name in self.felt]
        ambient = Channel("Tamb", "ambient", "degC", "hall, 2 m off the machine")
        others = [gauge.channel for gauge in self.scene.gauges]
        return (
            *felt,
            *others,
            ambient,
            Channel("Z", "displacement", "um", axis="Z"),
            Channel("Y", "displacement", "um", axis="Y"),
        )

    def effects(self, size: float) -> tuple[TrueEffect, ...]:
        """What was left out, in which responses it shows, and when."""
        found = []
        for k, (omission, weight) in enumerate(zip(self.omissions, self.weights, strict=True)):
            courses = [self.effect(k, run, size * weight) for run in range(len(self.duties))]
            power = {
                axis: sum(float(np.sum((course[axis] / self.noise[axis].sd) ** 2)) for course in courses)
                for axis in BOTH
            }
            shown = tuple(axis for axis in BOTH if power[axis] >= 0.05 * max(power.values()))
            windows = _windows(self.duties, [course[shown[0]] for course in courses]) if omission.brief else ()
            found.append(TrueEffect(omission.id, omission.accept or (omission.id,), shown, omission.place, windows))
        return tuple(found)

    def _without(self, k: int) -> Stage:
        """The same stage with one omission less."""
        other = copy(self)
        other.omissions = [one for number, one in enumerate(self.omissions) if number != k]
        other.weights = [one for number, one in enumerate(self.weights) if number != k]
        other._truths = {}
        return other

    def world(self) -> World:
        """The world of this stage."""
        several = range(len(self.omissions)) if len(self.omissions) > 1 else ()
        lacking = tuple(self._without(k)._world() for k in several)
        return replace(self._world(), lacking=lacking, with_run=lambda *told: self.with_run(*told)._world())

    def _world(self) -> World:
        return World(
            self.channels(),
            tuple(BOTH),
            self.time_s,
            self.own_time_s,
            self.recorded,
            self.simulated,
            self.noise,
            self.effects,
        )


def _windows(duties: Sequence[Duty], courses: Sequence[Vector]) -> tuple[Window, ...]:
    """When a course is above 30 % of its largest value."""
    limit = 0.3 * max(float(np.abs(course).max()) for course in courses)
    found = []
    for one, course in zip(duties, courses, strict=True):
        edges = np.flatnonzero(np.diff(np.r_[0, (np.abs(course) > limit).astype(int), 0]))
        last = float(one.time_s[-1])
        found += [
            Window(one.run, GRID_S * float(a), min(GRID_S * float(b), last))
            for a, b in zip(edges[::2], edges[1::2], strict=True)
        ]
    return tuple(found)
