"""What is a structure excited by, and how is it recorded: noise of a shaker, spindle at speeds, runs, world."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from selector.proof.case import TrueEffect
from selector.proof.concealment import Noise
from selector.proof.vibration.structure import STEP_S, Structure, given_swing, true_swing
from selector.proof.world import World
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
