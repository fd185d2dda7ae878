"""What is a structure excited by, and what does its simulation lack: a source, a mode, an answer, a spring's law."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from proving_ground.case import TrueEffect, Window
from proving_ground.concealment import Noise, coloured
from proving_ground.vibration.structure import STEP_S, Structure, given_swing, true_swing
from proving_ground.world import Missing, Runs, World, plus, scenarios_of
from selector.recording import Channel
from selector.types import Vector

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

    machine: Structure  #: Without the effect
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
    start: Mapping[str, float] = MappingProxyType({}),
) -> Bench:
    """A structure with modes between 50 and 130 Hz, shaken by other noise in every run, its spindle turning.

    `speeds` of a run: steps, run-up, or one (the same in all runs). `level` multiplies the shaker's force; `start` are
    parameters that are set whatever was drawn.
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
    spread = {"y": sd, "z": 1.3 * sd, "a": draw(0.02, 0.05)}
    noise = {name: coloured(colour, one, one / 20.0) for name, one in spread.items()}
    structure = structure._replace(**start)
    return Bench(structure, times, tuple(forces), tuple(turning), tuple(angles), eccentric, draw(0.0, 2 * np.pi), noise)


def swinging(
    bench: Bench,
    *,
    effects: Callable[[float], tuple[TrueEffect, ...]],
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


@dataclass(frozen=True)
class Swing(Missing):
    """A scenario of vibration; `bench` has arguments of this file's `bench`, `world` of `swinging`."""

    channels: tuple[str, ...] = ("y",)
    place: str | None = "spindle nose"
    family = "vibration"

    def drawn(self, generator: np.random.Generator) -> Bench:
        """A structure with its excitation."""
        return bench(generator, start=self.start, **self.bench)

    def world_of(self, bench: Bench, **more: Any) -> World:
        """See `swinging`."""
        return swinging(bench, **more)


Drawing = Callable[[Bench, np.random.Generator], dict[str, Any]]
"""A force unknown to all, for `Missing.prepared`, and the windows in which it acts, if that is not always."""


def line(low_hz: float, high_hz: float) -> Drawing:
    """A pump or a fan at a fixed frequency, in every run from another phase on."""

    def drawing(bench: Bench, generator: np.random.Generator) -> dict[str, Any]:
        tone, phases = generator.uniform(low_hz, high_hz), generator.uniform(0.0, 2 * np.pi, len(RUNS))
        return {"force": lambda run, time_s, size: size * np.sin(2 * np.pi * tone * time_s + phases[run])}

    return drawing


def imbalance(bench: Bench, generator: np.random.Generator) -> dict[str, Any]:
    """A mass on the spindle that nobody balanced."""

    def force(run: int, time_s: Vector, size: float) -> Vector:
        turning = bench.speeds[run] * 2 * np.pi / 60.0
        return np.asarray(size * 1e-5 * turning**2 * np.cos(bench.angles[run] + bench.angle))

    return {"force": force}


def at_the_speed(bench: Bench, generator: np.random.Generator) -> dict[str, Any]:
    """A line that happens to lie at the one speed of all runs."""
    tone = bench.speeds[0][0] / 60.0
    return {"force": lambda run, time_s, size: size * np.cos(2 * np.pi * tone * time_s + bench.angle)}


def with_mode(structure: Structure, size: float) -> Structure:
    """A mode that the force excites too; its share grows with size."""
    return structure._replace(mode_kg=structure.mass_kg * 100.0 / size)


def rubbing(structure: Structure, size: float) -> Structure:
    """Joints that slip: springs in parallel with the first, size per cent of its stiffness."""
    return structure._replace(sliders_n_per_m=0.01 * size * structure.stiffness_n_per_m)


def _impacts(bench: Bench, generator: np.random.Generator) -> dict[str, Any]:
    """A loose part knocks at random."""
    moments = [np.sort(generator.uniform(0.1, LENGTH_S - 0.15, int(generator.integers(5, 10)))) for _ in RUNS]
    sizes = [generator.uniform(0.4, 1.6, len(part)) * generator.choice([-1.0, 1.0], len(part)) for part in moments]

    def force(run: int, time_s: Vector, size: float) -> Vector:
        total = np.zeros_like(time_s)
        for moment, height in zip(moments[run], sizes[run], strict=True):
            total += height * np.exp(-0.5 * ((time_s - moment) / 8e-4) ** 2)
        return size * total

    windows = (Window(run, float(m), float(m) + 0.12) for run, part in zip(RUNS, moments, strict=True) for m in part)
    return {"force": force, "windows": tuple(windows)}


def _whine(bench: Bench, generator: np.random.Generator) -> dict[str, Any]:
    """A source whose pitch wanders by itself over a third of an octave and more."""
    pitches = [generator.uniform(60.0, 130.0, 8) for _ in RUNS]

    def force(run: int, time_s: Vector, size: float) -> Vector:
        pitch = np.interp(time_s, np.linspace(0.0, LENGTH_S, 8), pitches[run])
        return np.asarray(size * np.sin(2 * np.pi * np.cumsum(pitch) * (time_s[1] - time_s[0])))

    return {"force": force}


def _chatter(bench: Bench, generator: np.random.Generator) -> dict[str, Any]:
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

    windows = (
        Window(RUNS[run], float(a), float(a + b) + 0.05)
        for run in range(len(RUNS))
        for a, b in zip(starts[run], lengths[run], strict=True)
    )
    return {"force": force, "windows": tuple(windows)}


def _outside(name: str, drawing: Drawing, first: float, note: str) -> Swing:
    told: dict[str, Any] = {"kind": "out-of-catalogue", "note": note, "id": f"hidden.{name}", "prepared": drawing}
    return Swing.of(f"hidden.vibration/{name}", first=first, **told)


def _clean(name: str, world: Mapping[str, Any] | None = None, **bench: Any) -> Swing:
    return Swing.of(f"clean.vibration/{name}", None, bench, world=world, kind="clean", id="")


_TWO: Mapping[str, Any] = {"names": ("F", "n", "y", "z"), "responses": ("y", "z")}
_ACCELERATION: Mapping[str, Any] = {"names": ("F", "n", "a"), "responses": ("a",)}
_BALANCED = {"imbalance": False}
_back_reaction = partial(
    Swing.of,
    change=plus("back", 0.01),
    hidden=("absorbed",),
    tolerated=("vibration.mode",),
    channels=("y", "z"),
    place="between spindle nose and workpiece",
)
SWINGS: Sequence[Swing] = (
    Swing.of("vibration.line/pump", prepared=line(85.0, 110.0)),
    Swing.of(
        "vibration.line/off-resonance",
        prepared=line(20.0, 40.0),
        bench={"colour": "ar", "speeds": ("run-up", "steps", "run-up")},
        first=2.0,
    ),
    Swing.of(
        "vibration.line/acceleration",
        prepared=line(120.0, 190.0),
        bench={"colour": "heavy-tailed"},
        world=_ACCELERATION,
        channels=("a",),
    ),
    Swing.of("vibration.imbalance/steps", prepared=imbalance, bench=_BALANCED),
    Swing.of(
        "vibration.imbalance/run-up",
        prepared=imbalance,
        bench={**_BALANCED, "speeds": ("run-up", "run-up", "steps")},
        hidden=("absorbed",),
        note="Only while the speed passes the resonance it is seen.",
    ),
    Swing.of(
        "vibration.imbalance/quiet",
        prepared=imbalance,
        bench={**_BALANCED, "level": 0.2, "colour": "ar"},
        note="The shaker hardly shakes.",
    ),
    Swing.of("vibration.mode/above", with_mode, bench=_BALANCED, start={"mode_hz": 142.0}),
    Swing.of("vibration.mode/between", with_mode, bench={"colour": "ar", **_BALANCED}, start={"mode_hz": 100.0}),
    Swing.of(
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
    Swing.of("vibration.hardening/small", plus("hardening_per_m2", 1e8), first=3.0),
    Swing.of(
        "vibration.hardening/absorbed",
        plus("hardening_per_m2", 1e8),
        bench={"level": 1.5, "colour": "ar"},
        first=3.0,
        world={"refitted": True},
        hidden=("small", "absorbed"),
        note="Stiffness and damping were fitted to it.",
    ),
    Swing.of(
        "vibration.hysteresis/absorbed",
        rubbing,
        bench={"level": 1.5},
        world={"refitted": True},
        hidden=("small", "absorbed"),
        note="Stiffness and damping were fitted to it.",
        start={"slip_m": 2e-6},
    ),
    Swing.of(
        "vibration.hysteresis/refitted",
        rubbing,
        bench={"colour": "heavy-tailed", **_BALANCED},
        world={"refitted": True},
        start={"slip_m": 1e-6},
    ),
    Swing.of(
        "undecidable.vibration/one-speed",
        None,
        {"speeds": ("one", "one", "one"), **_BALANCED},
        kind="undecidable",
        note="All runs at one speed: line or imbalance.",
        id="vibration.imbalance",
        accept=("vibration.imbalance", "vibration.line"),
        prepared=imbalance,
        rival=at_the_speed,
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
SCENARIOS = scenarios_of((swing.case for swing in SWINGS), "vibration.hardening/small", "vibration.imbalance/run-up")
