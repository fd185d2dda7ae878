"""Small studies for the tests of figures and of the report: made here, from a seed, by the real procedure."""

from __future__ import annotations

import functools

import numpy as np
import pandas as pd

from selector.recording import Channel, Recording
from selector.selection import Options, Selection, select

HOSTILE = ("<script>alert(1)</script>", "T\"2' & <b>%{y}</b> {{7*7}}")
"""Names of channels that would run, break out of an attribute, or be filled in, if they were not escaped."""


def recording(
    n_sensors: int = 6, n_runs: int = 4, n_samples: int = 200, *, useless: bool = False, slow: bool = False
) -> Recording:
    """Heating runs: three hidden heat sources, sensors that follow one of them each, two displacements.

    With `useless` the displacements have nothing to do with any sensor and differ from run to run; with `slow` Y lags
    behind the sensors.
    """
    rng = np.random.default_rng(7)
    time_s = np.arange(n_samples) * 60.0
    names = [*HOSTILE, *(f"T{k}" for k in range(3, n_sensors + 1))]
    gains = rng.uniform(0.6, 1.4, n_sensors)
    runs = {}
    for r in range(n_runs):
        heat = rng.uniform(0.0, 12.0, n_samples // 40 + 1).repeat(40)[:n_samples]
        sources = np.array([_lagged(heat, step) for step in (1 / 20, 1 / 60, 1 / 150)])
        table = {name: 20 + gains[k] * sources[k % 3] + rng.normal(0, 0.05, n_samples) for k, name in enumerate(names)}
        if useless:
            table["Z"] = table["Y"] = rng.normal(0, 30) + np.cumsum(rng.normal(0, 1.0, n_samples))
        else:
            table["Z"] = 6.0 * sources[0] + 2.7 * sources[1] + (r % 2) * 0.4 * sources[2]
            table["Y"] = 5.0 * sources[1] - 1.5 * sources[2]
        if slow:
            table["Y"] = 5.0 * _lagged(sources[1], 1 / 90)
        for name in ("Z", "Y"):
            table[name] = table[name] + rng.normal(0, 0.4, n_samples)
        runs[f"day {r + 1}"] = pd.DataFrame(table, index=time_s)
    channels = [Channel(name, "temperature", "degC") for name in names]
    channels += [Channel(name, "displacement", "um", axis=name) for name in ("Z", "Y")]
    return Recording.from_runs(runs, channels)


def _lagged(heat: np.ndarray, step: float) -> np.ndarray:
    state, out = 0.0, np.empty(len(heat))
    for k, now in enumerate(heat):
        state += step * (now - state)
        out[k] = state
    return out


@functools.cache
def small() -> Selection:
    """Six sensors with hostile names, four runs, two displacements, products offered."""
    runs = {f"day {k}": {"file": f"day {k}.csv", "sha256": f"{k:064x}"} for k in range(1, 5)}
    return select(
        recording(),
        Options(max_sensors=3, interactions=True),
        provenance={"machine": "Bench 6 (simulated)", "runs": runs},
    )


@functools.cache
def single_run() -> Selection:
    """One run, so that stretches of it are left out."""
    return select(recording(4, 1, 240), Options(responses=("Z",), max_sensors=2))


@functools.cache
def useless() -> Selection:
    """A model that is no better than nothing."""
    return select(recording(5, 4, 160, useless=True), Options(responses=("Z",), max_sensors=2))
