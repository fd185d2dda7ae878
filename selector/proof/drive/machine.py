"""Which axis, programme, sensors and noise has a case, and what is the axis told to do."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from selector.proof.concealment import Noise
from selector.proof.drive.true_axis import COMMAND_S, TrueAxis
from selector.types import Vector

Style = Literal["strokes", "one way", "one speed", "creeping", "sines", "other", "gentle", "cycles"]
Move = tuple[float, float]
"""Speed [m/s] and time at that speed [s]."""

LENGTH_S = 7.0
CYCLE_S = 0.9
"""Time after which a programme of cycles repeats."""
_REST_S = 0.25


def command(
    moves: Sequence[Move], generator: np.random.Generator, acceleration: float, rounded_s: float = 0.045
) -> Vector:
    """Positions [m] every `COMMAND_S` over `LENGTH_S` of moves with ramps of `acceleration` [m/s²].

    Jerk is rounded over about `rounded_s`. The axis stays within 0.05 to 0.55 m: a move that would leave this is
    driven the other way.
    """
    n = round(LENGTH_S / COMMAND_S)
    speed = np.zeros(n)
    position, now, k = 0.05 + 0.05 * generator.random(), 0.0, int(_REST_S / COMMAND_S)
    begin = position
    stop = n - int(0.25 / COMMAND_S)
    for wanted, time_s in moves:
        if k >= stop:
            break
        end = position + wanted * time_s
        target = -wanted if not 0.05 <= end <= 0.55 else wanted
        ramp = max(int(abs(target - now) / acceleration / COMMAND_S), 1)
        hold = int(time_s / COMMAND_S)
        part = np.concatenate([np.linspace(now, target, ramp, endpoint=False), np.full(hold, target)])[: stop - k]
        speed[k : k + len(part)] = part
        position += float(part.sum()) * COMMAND_S
        k, now = k + len(part), float(part[-1])
    ramp = min(max(int(abs(now) / acceleration / COMMAND_S), 1), n - k)
    speed[k : k + ramp] = np.linspace(now, 0.0, ramp)
    window = np.hanning(2 * int(0.5 * rounded_s * generator.uniform(0.67, 1.33) / COMMAND_S) + 3)
    smooth = np.convolve(speed, window / window.sum(), mode="same")
    return np.asarray(begin + np.cumsum(smooth) * COMMAND_S)


def sine(amplitude_m: float, rises_s: float, turns_per_s: float, generator: np.random.Generator) -> Vector:
    """A circle's sine: positions [m] that swing to `amplitude_m` within `rises_s` and stand still at both ends."""
    time = np.arange(round(LENGTH_S / COMMAND_S)) * COMMAND_S
    inside = np.clip((time - _REST_S) / rises_s, 0.0, 1.0) * np.clip((LENGTH_S - _REST_S - time) / rises_s, 0.0, 1.0)
    envelope = inside**2 * (3.0 - 2.0 * inside)
    middle = 0.2 + 0.1 * generator.random()
    return np.asarray(middle + amplitude_m * envelope * np.sin(2.0 * np.pi * turns_per_s * (time - _REST_S)))


def cycles(fastest: float, generator: np.random.Generator) -> Vector:
    """A smooth course that repeats every `CYCLE_S`, of another shape and size in every run [m]."""
    time = np.arange(round(LENGTH_S / COMMAND_S)) * COMMAND_S
    speed = np.zeros_like(time)
    for k, height in enumerate((1.0, 0.5 * generator.random(), 0.3 * generator.random()), start=1):
        speed += height * np.cos(2.0 * np.pi * k * time / CYCLE_S + generator.uniform(0.0, 2.0 * np.pi))
    rise = np.clip(time / CYCLE_S, 0.0, 1.0)
    course = generator.uniform(0.5, 1.0) * fastest * speed / np.abs(speed).max() * rise**2 * (3.0 - 2.0 * rise)
    return np.asarray(0.25 + np.cumsum(course) * COMMAND_S)


def programme(
    style: Style, generator: np.random.Generator, fastest: float, acceleration: float, rounded_s: float = 0.045
) -> Vector:
    """The command of one run in a style, with speeds up to `fastest` [m/s], different for every draw."""
    speeds = fastest * np.array([1.0, 0.55, 0.3, 0.15, 0.06])
    moves: list[Move] = []
    if style == "sines":
        turns = generator.uniform(0.4, 0.9)
        return sine(fastest / (2.0 * np.pi * turns), generator.uniform(0.6, 1.2), turns, generator)
    if style == "cycles":
        return cycles(fastest, generator)
    if style == "strokes":
        for speed in generator.permutation(np.tile(speeds[:4], 2)):
            time_s = generator.uniform(0.25, 0.45)
            moves += [(speed, time_s), (0.0, generator.uniform(0.02, 0.15)), (-speed, time_s)]
    elif style == "one speed":
        for _ in range(9):
            moves += [(speeds[0], generator.uniform(0.4, 0.7)), (-speeds[0], generator.uniform(0.4, 0.7))]
    elif style == "one way":
        for speed in generator.permutation(np.tile(speeds[1:4], 4)):
            moves += [(0.6 * speed, generator.uniform(0.3, 0.6)), (0.0, generator.uniform(0.05, 0.2))]
        moves = [move if k < 18 else (-move[0], move[1]) for k, move in enumerate(moves)]
    elif style == "creeping":
        slow = fastest * np.array([0.01, 0.02, 0.04, 0.25, 0.6])
        for speed in generator.permutation(np.tile(slow, 2)):
            time_s = generator.uniform(0.2, 0.35)
            moves += [(speed, time_s), (-speed, time_s)]
    elif style == "gentle":
        for speed in generator.permutation(np.tile(speeds[2:], 3)):
            moves += [(speed, generator.uniform(0.3, 0.8)), (-speed, generator.uniform(0.3, 0.8))]
    else:
        for speed in generator.permutation(np.tile(fastest * np.array([0.8, 0.4, 0.2, 0.1, 0.03]), 2)):
            back = speed * generator.uniform(0.5, 1.5)
            moves += [(speed, generator.uniform(0.2, 0.6)), (-min(back, fastest), generator.uniform(0.2, 0.5))]
    return command(moves, generator, acceleration, rounded_s)


RUNS = ("r1", "r2", "r3")
PERIOD_S = 2e-3


@dataclass(frozen=True, eq=False)
class Bench:
    """An axis with what it is told and how it is recorded."""

    axis: TrueAxis  #: Without the effect
    commands: tuple[Vector, ...]  #: Of every run, every millisecond [m]
    stamps: tuple[Vector, ...]  #: Times of the recorded rows [s]
    jitter: tuple[Vector, ...]  #: How much later than its stamp every row was read [s]
    noise: dict[str, Noise]  #: Of every quantity that may be a response
    speed_noise: float  #: Of the recorded speed [m/s]


def bench(
    generator: np.random.Generator,
    *,
    styles: Sequence[Style] = ("strokes", "sines", "other"),
    friction: bool = True,
    on_scale: bool = True,
    colour: str = "white",
    jitter_s: float = 2e-6,
    fastest: float | None = None,
    coarse_scale: bool = False,
    slips: bool = False,
    rounded_s: float = 0.045,
) -> Bench:
    """An axis of a machining centre with its loop, three runs, and noise of a colour.

    `friction` False makes the guide hydrostatic: viscous only. With `slips` bristles give way to springs that slip one
    after the other; `coarse_scale` has thrice the noise in the displacement. `colour`: white, ar, heavy-tailed,
    quantised, coarse (readings repeat), cycle-locked.
    """
    draw = generator.uniform
    table, motor = draw(80.0, 300.0), draw(40.0, 100.0)
    axis = TrueAxis(
        motor_kg=motor,
        table_kg=table,
        stiffness_n_per_m=draw(0.8e8, 2.2e8),
        screw_damping_ns_per_m=draw(1.5e4, 4e4),
        slips=1.0 if slips else 0.0,
        coulomb_n=draw(40.0, 160.0) if friction else 0.0,
        presliding_m=draw(2e-6, 6e-6),
        viscous_ns_per_m=draw(150.0, 600.0),
        position_gain_per_s=draw(30.0, 70.0),
        feed_forward=draw(0.9, 1.0),
        speed_gain_ns_per_m=(motor + table) * draw(180.0, 320.0),
        integral_time_s=draw(0.012, 0.03),
        current_lag_s=draw(4e-4, 9e-4),
        force_per_a=draw(50.0, 120.0),
        on_scale=1.0 if on_scale else 0.0,
    )
    top = draw(0.08, 0.2) if fastest is None else fastest
    pull = draw(1.0, 2.5)
    commands = tuple(programme(style, generator, top, pull, rounded_s) for style in styles)
    n = int(LENGTH_S / PERIOD_S) - 25
    middle = float(np.mean(np.concatenate(commands)))
    return Bench(
        axis._replace(middle_m=middle),
        commands,
        tuple(PERIOD_S * np.arange(n, dtype=np.float64) for _ in styles),
        tuple(jitter_s * np.clip(generator.standard_normal(n), -3.0, 3.0) for _ in styles),
        {
            "E": noise_of(colour, draw(0.2, 0.5) * (3.0 if coarse_scale else 1.0), generator),
            "I": noise_of(colour, draw(0.03, 0.08), generator),
            "F": noise_of(colour, axis.force_per_a * draw(0.03, 0.08), generator),
            "a": noise_of(colour, draw(0.03, 0.08), generator),
            "x": noise_of(colour, draw(0.2e-6, 0.5e-6), generator),
        },
        draw(5e-6, 3e-5),
    )


def noise_of(colour: str, sd: float, generator: np.random.Generator) -> Noise:
    """Noise of a colour with about this standard deviation."""
    if colour == "ar":
        return Noise(sd, phi=float(generator.uniform(0.3, 0.6)), step=sd / 20.0)
    if colour == "heavy-tailed":
        return Noise(sd, tails=3.0, step=sd / 20.0)
    if colour == "quantised":
        return Noise(0.5 * sd, step=1.5 * sd)
    if colour == "coarse":
        return Noise(0.3 * sd, step=2.0 * sd)
    if colour == "cycle-locked":
        return Noise(sd, cycle_samples=round(CYCLE_S / PERIOD_S), cycle_sd=sd, step=sd / 20.0)
    return Noise(sd, step=sd / 20.0)


def command_times(commands: Vector) -> Vector:
    """Times of the samples of a command [s]."""
    return np.asarray(np.arange(len(commands)) * COMMAND_S)
