"""What is a structure excited by, and what does its simulation lack: a source, a mode, an answer, a spring's law."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from selector.proof.case import TrueEffect, Window
from selector.proof.concealment import Noise
from selector.proof.vibration.structure import STEP_S, Structure, given_swing, true_swing
from selector.proof.world import HIDDEN_FACTOR, Plan, World, scenario, twin
from selector.recording import Channel
from selector.types import Vector

Runs = Mapping[str, Sequence[Vector]]
Force = Callable[[int, Vector, float], Vector]
"""(number of the run, times [s], size) → force [N] that nobody recorded."""

RUNS = ("r1", "r2", "r3")
LENGTH_S = 1.5
PERIOD_S = 5e-4
CHANNELS = {
    "F": Channel("F", "force", "N", place="shaker at the spindle nose"),
    "n": Channel("n", "spindle_speed", "rpm", place="spindle"),
    "y": Channel("y", "displacement", "um", place="spindle nose", axis="Y"),
    "z": Channel("z", "displacement", "um", place="workpiece", axis="Y"),
    "a": Channel("a", "acceleration", "m/s^2", place="spindle nose", axis="Y"),
}


@dataclass(frozen=True, eq=False)
class Bench:
    """A structure with its excitation."""

    structure: Structure  #: Without the effect
    times: Vector  #: Every half step [s]
    #: forces and speeds: Of the shaker [N] and of the spindle [r/min] at these times, run by run
    forces: tuple[Vector, ...]
    speeds: tuple[Vector, ...]
    angles: tuple[Vector, ...]  #: Of the spindle at these times [rad]
    imbalance_kg_m: float  #: Known imbalance, which the simulation has too
    angle: float  #: At which an imbalance sits that nobody knows [rad]
    noise: Mapping[str, Noise]


def bench(
    generator: np.random.Generator,
    *,
    speeds: Sequence[str] = ("steps", "run-up", "steps"),
    shaken: bool = True,
    imbalance: bool = True,
    colour: str = "white",
    level: float = 1.0,
) -> Bench:
    """A structure with modes between 50 and 130 Hz, shaken by other noise in every run, its spindle turning.

    `speeds` of a run: steps, run-up, or one (the same in all runs). `level` multiplies the shaker's force.
    """
    draw = generator.uniform
    mass, second = draw(25.0, 60.0), draw(4.0, 10.0)
    first_hz, second_hz = draw(55.0, 80.0), draw(95.0, 130.0)
    stiffness = mass * (2 * np.pi * first_hz) ** 2
    second_stiffness = second * (2 * np.pi * second_hz) ** 2
    structure = Structure(
        mass_kg=mass,
        stiffness_n_per_m=stiffness,
        damping_ns_per_m=2.0 * draw(0.02, 0.05) * np.sqrt(stiffness * mass),
        second_kg=second,
        second_n_per_m=second_stiffness,
        second_ns_per_m=2.0 * draw(0.02, 0.05) * np.sqrt(second_stiffness * second),
        mode_hz=draw(150.0, 220.0),
        mode_damping=draw(0.015, 0.04),
    )
    times = 0.5 * STEP_S * np.arange(2 * round(LENGTH_S / STEP_S) + 1, dtype=np.float64)
    common = draw(2400.0, 3300.0)
    forces, turning, angles = [], [], []
    for style in speeds:
        forces.append(level * _shaken(generator, times) if shaken else np.zeros_like(times))
        speed = _speed(generator, style, times, common)
        turning.append(speed)
        turned = np.cumsum(speed) * (0.5 * STEP_S) * 2 * np.pi / 60.0
        angles.append(turned - 0.5 * (speed - speed[0]) * (0.5 * STEP_S) * 2 * np.pi / 60.0)
    eccentric = draw(2e-5, 6e-5) if imbalance else 0.0
    sd = draw(0.05, 0.1)
    noise = {"y": _noise(colour, sd), "z": _noise(colour, 1.3 * sd), "a": _noise(colour, draw(0.02, 0.05))}
    return Bench(structure, times, tuple(forces), tuple(turning), tuple(angles), eccentric, draw(0.0, 2 * np.pi), noise)


def swinging(
    bench: Bench,
    effects: Callable[[float], tuple[TrueEffect, ...]],
    *,
    true: Callable[[float], Structure],
    given: Callable[[float], Structure] | None = None,
    force: Force | None = None,
    names: Sequence[str] = ("F", "n", "y"),
    responses: Sequence[str] = ("y",),
    refitted: bool = False,
    first: float = 1.0,
    rival: World | None = None,
) -> World:
    """The world of a structure: `true` (size) swings, `given` is simulated; `force` is what nobody recorded.

    With `refitted` stiffness and damping of the simulation were fitted to a structure with the effect.
    """
    when = np.arange(0.0, LENGTH_S - PERIOD_S, PERIOD_S)
    steps = bench.times[:-1:2]
    own = steps[::5]
    start = given(0.0) if given is not None else true(0.0)

    def known(run: int) -> Vector:
        turning = bench.speeds[run] * 2 * np.pi / 60.0
        return np.asarray(bench.forces[run] + bench.imbalance_kg_m * turning**2 * np.cos(bench.angles[run]))

    def courses(swing: NDArray[np.float64]) -> dict[str, Vector]:
        return {"y": 1e6 * swing[:, 0], "z": 1e6 * swing[:, 1], "a": swing[:, 2]}

    def recorded(size: float) -> Runs:
        result: dict[str, list[Vector]] = {name: [] for name in (*names, *responses)}
        for run in range(len(bench.forces)):
            extra = force(run, bench.times, size) if force is not None else 0.0
            swung = courses(true_swing(true(size), known(run) + extra))
            for name in result:
                if name in swung:
                    result[name].append(swung[name][:: round(PERIOD_S / STEP_S)][: len(when)])
            if "F" in result:
                result["F"].append(np.round(np.interp(when, bench.times, bench.forces[run]), 3))
            if "n" in result:
                result["n"].append(np.round(np.interp(when, bench.times, bench.speeds[run]), 1))
        return result

    def said(structure: Structure) -> dict[str, list[Vector]]:
        result: dict[str, list[Vector]] = {name: [] for name in responses}
        for run in range(len(bench.forces)):
            swung = courses(given_swing(structure, known(run)))
            for name in responses:
                result[name].append(swung[name][::5])
        return result

    def simulated(size: float) -> Runs:
        structure = given(size) if given is not None else start
        if not refitted or not size:
            return said(structure)
        plain = said(structure)
        keys = ("stiffness_n_per_m", "damping_ns_per_m")
        trials = [said(structure._replace(**{key: 1.01 * getattr(structure, key)})) for key in keys]
        seen = recorded(size)
        rest, columns = [], []
        for run in range(len(bench.forces) - 1):
            for name in responses:
                rest.append(seen[name][run] - plain[name][run][: len(when)])
                columns.append(
                    np.column_stack([(one[name][run] - plain[name][run])[: len(when)] / 0.01 for one in trials])
                )
        share = np.linalg.lstsq(np.concatenate(columns), np.concatenate(rest), rcond=None)[0]
        change = {key: getattr(structure, key) * (1.0 + part) for key, part in zip(keys, share, strict=True)}
        return said(structure._replace(**change))

    return World(
        tuple(CHANNELS[name] for name in names),
        tuple(responses),
        dict.fromkeys(RUNS[: len(bench.forces)], when),
        dict.fromkeys(RUNS[: len(bench.forces)], own),
        recorded,
        simulated,
        {name: bench.noise[name] for name in responses},
        effects,
        first,
        rival=rival,
    )


def _shaken(generator: np.random.Generator, times: Vector) -> Vector:
    """Noise of a shaker between 20 and 160 Hz, another level in every run [N]."""
    tones = generator.uniform(20.0, 160.0, 60)
    phases = generator.uniform(0.0, 2 * np.pi, 60)
    total = np.zeros_like(times)
    for tone, phase in zip(tones, phases, strict=True):
        total += np.sin(2 * np.pi * tone * times + phase)
    swell = np.clip(times / 0.05, 0.0, 1.0)
    return np.asarray(generator.uniform(2.0, 6.0) * swell * total / np.sqrt(30.0))


def _speed(generator: np.random.Generator, style: str, times: Vector, common: float) -> Vector:
    if style == "one":
        return np.full_like(times, common)
    if style == "run-up":
        low, high = generator.uniform(600.0, 1500.0), generator.uniform(5200.0, 6500.0)
        return np.asarray(low + (high - low) * np.clip((times - 0.1) / (LENGTH_S - 0.2), 0.0, 1.0))
    knots = np.array([0.0, 0.4, 0.5, 0.9, 1.0, LENGTH_S])
    levels = np.repeat(generator.permutation([1800.0, 3000.0, 4800.0]) * generator.uniform(0.9, 1.1, 3), 2)
    return np.interp(times, knots, levels)


def _noise(colour: str, sd: float) -> Noise:
    if colour == "ar":
        return Noise(sd, phi=0.5, step=sd / 20.0)
    if colour == "heavy-tailed":
        return Noise(sd, tails=3.0, step=sd / 20.0)
    if colour == "quantised":
        return Noise(0.5 * sd, step=1.5 * sd)
    return Noise(sd, step=sd / 20.0)


Change = Callable[[Structure, float], Structure]
Drawing = Callable[[Bench, np.random.Generator], tuple[Force, tuple[Window, ...]]]


@dataclass(frozen=True)
class Swing:
    """A scenario of vibration: what is right, and a change of the structure by size or a force unknown to all."""

    plan: Plan
    id: str
    change: Change | None = None  #: (structure, size) -> structure, or None
    drawing: Drawing | None = None  #: (bench, generator) -> (force, windows), or None
    #: bench and world: Arguments of `selector.proof.vibration.members.bench` and of `swinging`
    bench: Mapping[str, Any] = field(default_factory=dict)
    world: Mapping[str, Any] = field(default_factory=dict)
    #: accept, channels and place: Of the true effect
    accept: tuple[str, ...] = ()
    channels: tuple[str, ...] = ("y",)
    place: str | None = "spindle nose"
    #: Parameters of the structure that are set whatever was drawn
    start: Mapping[str, float] = field(default_factory=dict)
    rival: tuple[Drawing, float] | None = None  #: Which this record does not tell from the true one

    def made(self, generator: np.random.Generator) -> World:
        """The world of this scenario with what the generator draws."""
        drawn = bench(generator, **self.bench)
        plain = drawn.structure._replace(**self.start)
        change = self.change
        windows: tuple[Window, ...] = ()
        arguments: dict[str, Any] = {"true": lambda size: change(plain, size) if change is not None and size else plain}
        if self.drawing is not None:
            arguments["force"], windows = self.drawing(drawn, generator)
        effect = TrueEffect(self.id, self.accept or (self.id,), self.channels, self.place, windows)
        effects = (effect,) if self.id else ()
        arguments |= self.world
        if self.rival is not None:
            other = arguments | {"force": self.rival[0](drawn, generator)[0], "first": self.rival[1]}
            arguments["rival"] = swinging(drawn, lambda size: (), **other)
        return swinging(drawn, lambda size: effects, **arguments)

    @property
    def scenario(self) -> Any:
        """Cases of any strength."""
        return scenario(self.plan, self.made, has_strength=bool(self.id) and not self.plan.size)


def plan(name: str, hidden: tuple[str, ...] = ("small",), **rest: Any) -> Plan:
    """A plan of the vibration family."""
    return Plan(name, **{"family": "vibration", "kind": "single", "hidden": hidden} | rest)


def line(low_hz: float, high_hz: float) -> Drawing:
    """A pump or a fan at a fixed frequency, in every run from another phase on."""

    def drawing(bench: Bench, generator: np.random.Generator) -> tuple[Force, tuple[Window, ...]]:
        tone, phases = generator.uniform(low_hz, high_hz), generator.uniform(0.0, 2 * np.pi, len(RUNS))
        return lambda run, time_s, size: size * np.sin(2 * np.pi * tone * time_s + phases[run]), ()

    return drawing


def imbalance(bench: Bench, generator: np.random.Generator) -> tuple[Force, tuple[Window, ...]]:
    """A mass on the spindle that nobody balanced."""

    def force(run: int, time_s: Vector, size: float) -> Vector:
        turning = bench.speeds[run] * 2 * np.pi / 60.0
        return np.asarray(size * 1e-5 * turning**2 * np.cos(bench.angles[run] + bench.angle))

    return force, ()


def at_the_speed(bench: Bench, generator: np.random.Generator) -> tuple[Force, tuple[Window, ...]]:
    """A line that happens to lie at the one speed of all runs."""
    tone = bench.speeds[0][0] / 60.0
    return lambda run, time_s, size: size * np.cos(2 * np.pi * tone * time_s + bench.angle), ()


def tuned(key: str, unit: float) -> Change:
    """The change that adds size × `unit` to a parameter."""
    return lambda structure, size: structure._replace(**{key: getattr(structure, key) + size * unit})


def with_mode(structure: Structure, size: float) -> Structure:
    """A mode that the force excites too; its share grows with size."""
    return structure._replace(mode_kg=structure.mass_kg * 100.0 / size)


def rubbing(structure: Structure, size: float) -> Structure:
    """Joints that slip: springs in parallel with the first, size per cent of its stiffness."""
    return structure._replace(sliders_n_per_m=0.01 * size * structure.stiffness_n_per_m)


def _impacts(bench: Bench, generator: np.random.Generator) -> tuple[Force, tuple[Window, ...]]:
    """A loose part knocks at random."""
    moments = [np.sort(generator.uniform(0.1, LENGTH_S - 0.15, int(generator.integers(5, 10)))) for _ in RUNS]
    sizes = [generator.uniform(0.4, 1.6, len(part)) * generator.choice([-1.0, 1.0], len(part)) for part in moments]

    def force(run: int, time_s: Vector, size: float) -> Vector:
        total = np.zeros_like(time_s)
        for moment, height in zip(moments[run], sizes[run], strict=True):
            total += height * np.exp(-0.5 * ((time_s - moment) / 8e-4) ** 2)
        return size * total

    return force, tuple(
        Window(run, float(m), float(m) + 0.12) for run, part in zip(RUNS, moments, strict=True) for m in part
    )


def _whine(bench: Bench, generator: np.random.Generator) -> tuple[Force, tuple[Window, ...]]:
    """A source whose pitch wanders by itself over a third of an octave and more."""
    pitches = [generator.uniform(60.0, 130.0, 8) for _ in RUNS]

    def force(run: int, time_s: Vector, size: float) -> Vector:
        pitch = np.interp(time_s, np.linspace(0.0, LENGTH_S, 8), pitches[run])
        return np.asarray(size * np.sin(2 * np.pi * np.cumsum(pitch) * (time_s[1] - time_s[0])))

    return force, ()


def _chatter(bench: Bench, generator: np.random.Generator) -> tuple[Force, tuple[Window, ...]]:
    """A cut that begins to sing for a while, each time at another pitch."""
    starts = [np.sort(generator.uniform(0.1, LENGTH_S - 0.3, 4)) for _ in RUNS]
    lengths = [generator.uniform(0.06, 0.16, 4) for _ in RUNS]
    tones = [generator.uniform(55.0, 140.0, 4) for _ in RUNS]

    def force(run: int, time_s: Vector, size: float) -> Vector:
        total = np.zeros_like(time_s)
        for start, length, tone in zip(starts[run], lengths[run], tones[run], strict=True):
            inside = np.clip((time_s - start) / length, 0.0, 1.0)
            total += inside * np.sin(np.pi * inside) * np.sin(2 * np.pi * tone * time_s)
        return size * total

    return force, tuple(
        Window(RUNS[run], float(a), float(a + b) + 0.05)
        for run in range(len(RUNS))
        for a, b in zip(starts[run], lengths[run], strict=True)
    )


def _outside(name: str, drawing: Drawing, first: float, note: str) -> Swing:
    made = plan(
        f"hidden.vibration/{name}",
        (),
        kind="out-of-catalogue",
        verdicts=("unexplained",),
        factor=HIDDEN_FACTOR,
        note=note,
    )
    return Swing(made, f"hidden.{name}", None, drawing, world={"first": first})


def _clean(name: str, note: str = "", world: Mapping[str, Any] | None = None, **bench: Any) -> Swing:
    made = plan(f"clean.vibration/{name}", (), kind="clean", verdicts=("nothing-missing",), note=note)
    return Swing(made, "", bench=bench, world=world or {})


def _lacking(name: str, change: Change | None = None, *, hidden: tuple[str, ...] = ("small",), **rest: Any) -> Swing:
    """The effect before the slash of the name is missing; `rest` are further fields of `Plan` and `Swing`."""
    planned = plan(name, hidden, **{key: rest.pop(key) for key in list(rest) if key in Plan.__dataclass_fields__})
    return Swing(planned, name.partition("/")[0], change, **rest)


_TWO: Mapping[str, Any] = {"names": ("F", "n", "y", "z"), "responses": ("y", "z")}
_ACCELERATION: Mapping[str, Any] = {"names": ("F", "n", "a"), "responses": ("a",)}
_BALANCED = {"imbalance": False}
_back_reaction = partial(
    _lacking,
    change=tuned("back", 0.01),
    hidden=("absorbed",),
    tolerated=("vibration.mode",),
    channels=("y", "z"),
    place="between spindle nose and workpiece",
)
SWINGS: Sequence[Swing] = (
    _lacking("vibration.line/pump", drawing=line(85.0, 110.0)),
    _lacking(
        "vibration.line/off-resonance",
        drawing=line(20.0, 40.0),
        bench={"colour": "ar", "speeds": ("run-up", "steps", "run-up")},
        world={"first": 2.0},
    ),
    _lacking(
        "vibration.line/acceleration",
        drawing=line(120.0, 190.0),
        bench={"colour": "heavy-tailed"},
        world=_ACCELERATION,
        channels=("a",),
    ),
    _lacking("vibration.imbalance/steps", drawing=imbalance, bench=_BALANCED),
    _lacking(
        "vibration.imbalance/run-up",
        drawing=imbalance,
        bench={**_BALANCED, "speeds": ("run-up", "run-up", "steps")},
        hidden=("absorbed",),
        note="Only while the speed passes the resonance it is seen.",
    ),
    _lacking(
        "vibration.imbalance/quiet",
        drawing=imbalance,
        bench={**_BALANCED, "level": 0.2, "colour": "ar"},
        note="The shaker hardly shakes.",
    ),
    _lacking("vibration.mode/above", with_mode, bench=_BALANCED, start={"mode_hz": 142.0}),
    _lacking("vibration.mode/between", with_mode, bench={"colour": "ar", **_BALANCED}, start={"mode_hz": 100.0}),
    _lacking(
        "vibration.mode/acceleration",
        with_mode,
        bench={"colour": "quantised", **_BALANCED},
        world=_ACCELERATION,
        channels=("a",),
        start={"mode_hz": 130.0},
    ),
    _back_reaction("vibration.back_reaction/two", world=_TWO),
    _back_reaction(
        "vibration.back_reaction/refitted", bench={"colour": "heavy-tailed"}, world={**_TWO, "refitted": True}
    ),
    _lacking("vibration.hardening/small", tuned("hardening_per_m2", 1e8), world={"first": 3.0}),
    _lacking(
        "vibration.hardening/absorbed",
        tuned("hardening_per_m2", 1e8),
        bench={"level": 1.5, "colour": "ar"},
        world={"first": 3.0, "refitted": True},
        hidden=("small", "absorbed"),
        note="Stiffness and damping were fitted to it.",
    ),
    _lacking(
        "vibration.hysteresis/absorbed",
        rubbing,
        bench={"level": 1.5},
        world={"refitted": True},
        hidden=("small", "absorbed"),
        note="Stiffness and damping were fitted to it.",
        start={"slip_m": 2e-6},
    ),
    _lacking(
        "vibration.hysteresis/refitted",
        rubbing,
        bench={"colour": "heavy-tailed", **_BALANCED},
        world={"refitted": True},
        start={"slip_m": 1e-6},
    ),
    Swing(
        plan(
            "undecidable.vibration/one-speed", (), kind="undecidable", note="All runs at one speed: line or imbalance."
        ),
        "vibration.imbalance",
        None,
        imbalance,
        {"speeds": ("one", "one", "one"), **_BALANCED},
        accept=("vibration.imbalance", "vibration.line"),
        rival=(at_the_speed, 1.0),
    ),
    _outside("impacts", _impacts, 20.0, "A loose part knocks at random."),
    _outside("whine", _whine, 3.0, "A source whose pitch wanders; no speed is recorded that it follows."),
    _outside("singing", _chatter, 4.0, "A cut begins to sing for a while, each time at another pitch."),
    _clean("white"),
    _clean("ar", colour="ar"),
    _clean("heavy-tailed", colour="heavy-tailed"),
    _clean("quantised", colour="quantised"),
    _clean("two-members", world=_TWO),
    _clean("unshaken", shaken=False),
)
_TWINS = ("vibration.hardening/small", "vibration.imbalance/run-up")
SCENARIOS = (
    *(swing.scenario for swing in SWINGS),
    *(twin(swing.plan, swing.made) for swing in SWINGS if swing.plan.name in _TWINS),
)
