"""What "rise" is counted from: the reading at the start of a run."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from selector.recording import Channel

START_SAMPLES = 15


class RunSource(Protocol):
    """What a study needs from recordings, whole in memory or read piece by piece."""

    @property
    def runs(self) -> tuple[str, ...]:
        """Names of the runs."""

    @property
    def channels(self) -> tuple[Channel, ...]:
        """The channels."""

    def chunks(self, run: str, names: Sequence[str]) -> Iterator[tuple[NDArray[np.float64], NDArray[np.float64]]]:
        """(time_s, values) pieces of a run, in order."""


def start_reading(samples: NDArray[np.float64]) -> tuple[float, float]:
    """Level at the start of a run and its standard error, from the first samples.

    One sample carries the whole noise of the gauge into every later rise. The mean of the first k samples carries
    less, and stays right as long as the reading has not begun to move: the largest k ≤ 15 is taken for which the two
    halves of the stretch agree within twice the standard error of their difference. A noise-free recording that
    moves at once gives the first sample itself.

    Parameters
    ----------
    samples : ndarray of shape (n_samples,)
        The run's first samples (15 are enough); NaN = missing.

    Returns
    -------
    float, float
        Start level and its standard error, NaN if there is no reading. The error is NaN if it cannot be estimated.
    """
    found = samples[np.isfinite(samples)][:START_SAMPLES]
    if len(found) == 0:
        return np.nan, np.nan
    if len(found) < 4:
        return float(found[0]), np.nan
    # second differences see the noise and not the warming
    noise = float(np.sqrt(np.median(np.diff(found, 2) ** 2) / (0.4549 * 6.0)))
    quantum = _quantum(found)
    noise = max(noise, quantum / np.sqrt(12.0))
    best = 1
    for k in range(2, len(found) + 1):
        half = k // 2
        difference = abs(float(found[k - half : k].mean() - found[:half].mean()))
        if difference <= 2.0 * noise * np.sqrt(2.0 / half) * 0.5:
            best = k
        elif difference > 4.0 * noise:
            break
    return float(found[:best].mean()), noise / np.sqrt(best)


def start_readings(source: RunSource, names: Sequence[str]) -> dict[str, dict[str, tuple[float, float]]]:
    """`start_reading` of every channel in every run: {run: {channel: (level, standard error)}}."""
    starts: dict[str, dict[str, tuple[float, float]]] = {}
    for run in source.runs:
        missing = dict.fromkeys(names)
        found: dict[str, tuple[float, float]] = {}
        for _, values in source.chunks(run, tuple(missing)):
            for j, name in enumerate(missing):
                if name not in found or not np.isfinite(found[name][0]):
                    column = values[:, j]
                    first = np.flatnonzero(np.isfinite(column))[:1]
                    found[name] = start_reading(column[int(first[0]) :]) if len(first) else (np.nan, np.nan)
            if all(np.isfinite(level) for level, _ in found.values()):
                break
        starts[run] = found
    return starts


def gauge_start(level: float, standard_error: float) -> float:
    """The offset of a displacement gauge at the start of a run [µm]; 0 when it cannot be told from zero.

    A gauge is zeroed before a run. Subtracting the first reading of a gauge that *was* zeroed would only add its
    noise to the whole run, so an offset counts as one from four standard errors on.
    """
    if not np.isfinite(level):
        return 0.0
    if np.isfinite(standard_error) and abs(level) <= 4.0 * standard_error:
        return 0.0
    return level


def _quantum(found: NDArray[np.float64]) -> float:
    steps = np.abs(np.diff(np.unique(found)))
    steps = steps[steps > 1e-9 * max(1.0, float(np.abs(found).max()))]
    return float(steps.min()) if len(steps) and len(np.unique(found)) <= len(found) // 2 else 0.0
