"""Which axis, programme, sensors and noise has a case: drawn from its generator."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from selector.proof.drive.programme import CYCLE_S, LENGTH_S, Style, programme
from selector.proof.drive.true_axis import COMMAND_S, TrueAxis
from selector.proof.noise import Noise

Vector = NDArray[np.float64]

RUNS = ("r1", "r2", "r3")
PERIOD_S = 2e-3


@dataclass(frozen=True, eq=False)
class Bench:
    """An axis with what it is told and how it is recorded.

    Attributes
    ----------
    axis : TrueAxis
        Without the effect.
    commands : tuple of ndarray
        Of every run, every millisecond [m].
    stamps : tuple of ndarray
        Times of the recorded rows [s].
    jitter : tuple of ndarray
        How much later than its stamp every row was read [s].
    noise : mapping of str to Noise
        Of every quantity that may be a response.
    speed_noise : float
        Of the recorded speed [m/s].
    """

    axis: TrueAxis
    commands: tuple[Vector, ...]
    stamps: tuple[Vector, ...]
    jitter: tuple[Vector, ...]
    noise: dict[str, Noise]
    speed_noise: float


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
