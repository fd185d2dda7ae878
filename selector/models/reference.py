"""What "rise" is counted from: the reading at the start of a run."""

from __future__ import annotations

import functools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2

from selector.recording import RunSource

START_SAMPLES = 15
NOISE_SAMPLES = 30
SMALL_BEND = 0.7
"""Largest next power, in its standard errors. At 1 a bend hides behind the noise and the start is off by more than one
sample's noise; much below, too few samples are used (0.6 of a sample's noise on warming and cooling runs at 0.7)."""


def start_reading(time_s: NDArray[np.float64], samples: NDArray[np.float64]) -> tuple[float, float]:
    """Level at the start of a run and its standard error, from the first samples.

    One sample carries the whole noise of the gauge into every later rise of the run. A straight line or a parabola
    through the first k samples, read off at the first of them, carries less. Of both and all k up to 30, the one with
    the smallest standard error is taken among those that the samples do not contradict: by their scatter (χ² at 10 %,
    noise from second differences), and by the next power, which must be small against its own standard error, since
    a bend that is barely seen already shifts the start. A level run is not assumed to be level for the same reason.

    Parameters
    ----------
    time_s, samples : ndarray of shape (n_samples,)
        The run's first samples (30 are enough); NaN = missing.

    Returns
    -------
    float, float
        Start level and its standard error, NaN if there is no reading. The error is NaN if it cannot be estimated.
    """
    known = np.isfinite(samples)
    found, time = samples[known][:NOISE_SAMPLES], time_s[known][:NOISE_SAMPLES]
    if len(found) == 0:
        return np.nan, np.nan
    if len(found) < 4:
        return float(found[0]), np.nan
    # second differences see the noise and not the warming
    noise = float(np.median(np.abs(np.diff(found, 2)))) / (0.6745 * np.sqrt(6.0))
    noise = max(noise, _quantum(found) / np.sqrt(12.0))
    if noise < 0.1 * float(np.median(np.abs(np.diff(found)))):
        # a smooth curve, whose second differences are its bend and not noise
        return float(found[0]), noise
    best = (float(found[0]), noise)
    for fit in _start_fits(tuple((time - time[0]).tolist())):
        if noise * fit.gain >= best[1]:
            continue
        values = found[: fit.basis.shape[0]]
        coefficients = fit.solver @ values
        misfit = float((((values - fit.basis @ coefficients) / noise) ** 2).sum())
        bend = abs(float(fit.next_power @ values))
        if misfit <= fit.limit and bend <= SMALL_BEND * noise * float(np.linalg.norm(fit.next_power)):
            best = (float(coefficients[0]), noise * fit.gain)
    return best


@dataclass(frozen=True)
class _StartFit:
    """A polynomial through the first samples: its least squares, done once for each pattern of time stamps.

    `gain` is the standard error of the start for a noise of 1, `next_power @ samples` the next coefficient.
    """

    basis: NDArray[np.float64]
    solver: NDArray[np.float64]
    next_power: NDArray[np.float64]
    gain: float
    limit: float


@functools.lru_cache(maxsize=256)
def _start_fits(time: tuple[float, ...]) -> tuple[_StartFit, ...]:
    fits = []
    for k in range(4, len(time) + 1):
        powers = np.vander(np.array(time[:k]) / time[k - 1], 4, increasing=True)
        for order in range(1, min(2, k - 3) + 1):
            basis = powers[:, : order + 1]
            solver = np.asarray(np.linalg.pinv(basis), dtype=np.float64)
            further = np.asarray(np.linalg.pinv(powers[:, : order + 2])[-1], dtype=np.float64)
            limit = float(chi2.ppf(0.9, k - order - 1))
            fits.append(_StartFit(basis, solver, further, float(np.linalg.norm(solver[0])), limit))
    return tuple(fits)


def start_readings(source: RunSource, names: Sequence[str]) -> dict[str, dict[str, tuple[float, float]]]:
    """`start_reading` of every channel in every run: {run: {channel: (level, standard error)}}.

    A channel whose first reading comes later than `START_SAMPLES` samples into the run has no start: (NaN, NaN).
    """
    wanted = tuple(dict.fromkeys(names))
    starts: dict[str, dict[str, tuple[float, float]]] = {}
    for run in source.runs:
        times: list[NDArray[np.float64]] = []
        parts: list[NDArray[np.float64]] = []
        for time_s, values in source.chunks(run, wanted):
            times.append(time_s[: 4 * NOISE_SAMPLES])
            parts.append(values[: 4 * NOISE_SAMPLES])
            if sum(map(len, times)) >= 4 * NOISE_SAMPLES:
                break
        if not times:
            starts[run] = dict.fromkeys(wanted, (np.nan, np.nan))
            continue
        time, head = np.concatenate(times), np.concatenate(parts)
        starts[run] = {
            name: start_reading(time, head[:, j]) if np.isfinite(head[:START_SAMPLES, j]).any() else (np.nan, np.nan)
            for j, name in enumerate(wanted)
        }
    return starts


def gauge_start(level: float, standard_error: float) -> float:
    """The offset of a displacement gauge at the start of a run [µm]; 0 when it cannot be told from zero.

    A gauge is zeroed before a run. Subtracting the first reading of a gauge that *was* zeroed would only add its
    noise to the whole run. The start is the best of many fits and its standard error knows nothing of that choice, so
    an offset counts as one from eight standard errors on.
    """
    if not np.isfinite(level):
        return 0.0
    if np.isfinite(standard_error) and abs(level) <= 8.0 * standard_error:
        return 0.0
    return level


def _quantum(found: NDArray[np.float64]) -> float:
    steps = np.abs(np.diff(np.unique(found)))
    steps = steps[steps > 1e-9 * max(1.0, float(np.abs(found).max()))]
    return float(steps.min()) if len(steps) and len(np.unique(found)) <= len(found) // 2 else 0.0
