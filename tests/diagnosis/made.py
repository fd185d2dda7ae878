"""Comparisons with noise of known colour, and structures that no effect of the catalogue makes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

from selector.diagnosis.comparison import Comparison
from selector.diagnosis.evidence.noise import noise_model, stretches, whitened
from selector.recording import Channel

Vector = NDArray[np.float64]
RUNS = ("r1", "r2", "r3")
STEP_S = 30.0


def comparison(noise: dict[str, Vector], *, resolution: float = 0.0) -> Comparison:
    """Three runs of a spindle in steps that heats; the responses are what a simulation says and this noise."""
    total = len(next(iter(noise.values())))
    n = total // len(RUNS)
    rng = np.random.default_rng(7)
    speed = np.concatenate([np.repeat(rng.choice([0.0, 1000.0, 2000.0, 3000.0], n // 40 + 1), 40)[:n] for _ in RUNS])
    heat = np.concatenate([lfilter([0.01], [1.0, -0.99], part) / 400.0 for part in speed.reshape(len(RUNS), n)])
    simulated = {name: (2.0 - 0.7 * k) * heat for k, name in enumerate(noise)}
    recorded = {"n": speed, "T1": 20.0 + np.round(heat, 1)}
    for name, part in noise.items():
        reading = simulated[name] + part
        recorded[name] = np.round(reading / resolution) * resolution if resolution else reading
    channels = (Channel("n", "spindle_speed", "rpm"), Channel("T1", "temperature", "degC"))
    channels += tuple(Channel(name, "displacement", "um") for name in noise)
    held_out = np.arange(total) >= 2 * n
    time = np.tile(np.arange(n) * STEP_S, len(RUNS))
    steps = dict.fromkeys(noise, resolution)
    return Comparison(RUNS, (0, n, 2 * n, total), time, channels, recorded, simulated, tuple(noise), held_out, steps)


def residuals(of: Comparison) -> tuple[dict[str, Vector], dict[str, Vector]]:
    """What recalibration on the fitted rows leaves, and the same after the noise filter."""
    left, white = {}, {}
    for name in of.responses:
        residual = of.difference(name)
        fitted = ~of.held_out & np.isfinite(residual)
        table = np.column_stack([np.ones(len(residual)), of.simulated[name]])
        residual = residual - table @ np.linalg.lstsq(table[fitted], residual[fitted], rcond=None)[0]
        parts = stretches(of, np.isfinite(residual))
        left[name] = residual
        white[name] = whitened(noise_model(residual, parts, lost=2), residual[:, None], parts)[:, 0]
    return left, white


def coloured(kind: str, n: int, rng: np.random.Generator) -> Vector:
    """Noise of variance 1: white, AR(1) with 0.85, or heavy-tailed (Student's t with 3 degrees of freedom)."""
    if kind == "ar":
        return np.asarray(lfilter([np.sqrt(1 - 0.85**2)], [1.0, -0.85], rng.standard_normal(n + 200)))[200:]
    if kind == "t3":
        return np.asarray(rng.standard_t(3, n) / np.sqrt(3.0))
    return np.asarray(rng.standard_normal(n))


def door(n: int, windows: tuple[tuple[int, int], ...], memory: float = 0.9) -> Vector:
    """1 while it acts, built up and forgotten with this memory a sample."""
    on = np.zeros(n)
    for first, last in windows:
        on[first:last] = 1.0
    return np.asarray(lfilter([1.0 - memory], [1.0, -memory], on))


def late_run(run: int, by: int, noise: float) -> Comparison:
    """Z as simulated but for noise, and recorded too late by so many samples in one of the runs (0 to 2)."""
    n = 600
    made = comparison({"Z": noise * np.random.default_rng(0).standard_normal(len(RUNS) * n)})
    course = made.simulated["Z"] / np.std(made.simulated["Z"]) * 3.0
    late = course.reshape(len(RUNS), n).copy()
    late[run] = np.interp(np.arange(n) - by, np.arange(n), late[run])
    recorded = late.ravel() + made.difference("Z")
    return replace(made, simulated={"Z": course}, recorded={**made.recorded, "Z": recorded})
