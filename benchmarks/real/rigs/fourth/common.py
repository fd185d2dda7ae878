"""What several rigs of the fourth set share: the quick lag of first order, MATLAB files, and the silent verdicts."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from numba import njit
from scipy.io import loadmat

from benchmarks.real.case import Vector

SILENT = ("nothing-missing", "miscalibrated")


@njit(cache=True)
def lagging(course: Vector, step_s: float, tau_s: float, start: float) -> Vector:  # type: ignore[misc]
    """What follows an evenly sampled course with a time constant, from a start."""
    share = 1.0 - np.exp(-step_s / tau_s)
    value, out = start, np.empty(len(course))
    for k in range(len(course)):
        out[k] = value
        value += share * (course[k] - value)
    return out


def step_of(frame: pd.DataFrame) -> float:
    """Sampling interval [s] of a run."""
    return float(np.median(np.diff(frame.index.to_numpy())))


def numbers(path: Path) -> dict[str, Any]:
    """The variables of a MATLAB file."""
    return dict(loadmat(path, squeeze_me=True))


def evenly(times: Vector, step_s: float, **columns: Vector) -> pd.DataFrame:
    """Columns read at even moments between the first and the last one."""
    grid = np.arange(times[0], times[-1], step_s)
    index = pd.Index(grid - grid[0], name="time_s")
    return pd.DataFrame({name: np.interp(grid, times, values) for name, values in columns.items()}, index=index)
