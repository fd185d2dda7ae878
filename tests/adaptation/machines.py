"""Courses of machines whose error walks as it is said."""

from __future__ import annotations

import numpy as np

from selector.adaptation.drift import Course

NOTHING = np.zeros(0, dtype=np.intp)


def walking(
    k: int, rng: np.random.Generator, *, walk=1e-3, start=4.0, noise=0.25, gain_walk=0.0, gain_start=0.0, hours=8.0
) -> Course:
    """A run of a sample a minute; variances in µm²/s, µm², µm², 1/s and 1."""
    time_s = np.arange(0.0, 3600.0 * hours + 1.0, 60.0)
    n = len(time_s)
    modelled = 30.0 * (1.0 - np.exp(-time_s / 5400.0)) * rng.uniform(0.6, 1.4) + 5.0 * np.sin(time_s / 4000.0)
    offset = rng.normal(0.0, start**0.5) + np.r_[0.0, np.cumsum(rng.normal(0.0, (60.0 * walk) ** 0.5, n - 1))]
    gain = rng.normal(0.0, gain_start**0.5) + np.r_[0.0, np.cumsum(rng.normal(0.0, (60.0 * gain_walk) ** 0.5, n - 1))]
    recorded = modelled + offset + gain * modelled + rng.normal(0.0, noise**0.5, n)
    return Course(f"r{k}", time_s, modelled, recorded, NOTHING, np.zeros(0))


def machines(n: int, seed: int, **planted: float) -> list[Course]:
    """Runs of one machine."""
    rng = np.random.default_rng(seed)
    return [walking(k, rng, **planted) for k in range(n)]
