"""What several rigs of the third set share: a lag of first order, its fit, and pieces of long records."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np
import pandas as pd
from scipy.optimize import least_squares as minimised

from benchmarks.real.case import Vector

SILENT = ("nothing-missing", "miscalibrated")


def lagged(course: Vector, times: Vector, tau_s: float, start: float | None = None) -> Vector:
    """What follows a course with a time constant, settled at its first value or at `start`."""
    value = float(course[0]) if start is None else start
    out = np.empty(len(course))
    steps = np.diff(times, append=times[-1])
    for k, (wanted, step) in enumerate(zip(course, steps, strict=True)):
        out[k] = value
        value += (1.0 - np.exp(-step / tau_s)) * (wanted - value)
    return out


def fitted(model: Callable[[Vector, pd.DataFrame], Vector], runs: Sequence[pd.DataFrame], name: str,
           guess: Sequence[float]) -> Vector:  # fmt: skip
    """Parameters of a model that leave least of a column of some runs."""

    def left(x: Vector) -> Vector:
        return np.concatenate([model(x, frame) - frame[name].to_numpy() for frame in runs])

    return np.asarray(minimised(left, np.asarray(guess, dtype=np.float64), x_scale=np.abs(guess)).x)


def pieces(frame: pd.DataFrame, spans_s: Mapping[str, tuple[float, float]]) -> dict[str, pd.DataFrame]:
    """Parts of a record by their spans of time [s], each from a start of its own."""
    found = {}
    for name, (first_s, last_s) in spans_s.items():
        part = frame[(frame.index >= first_s) & (frame.index < last_s)]
        found[name] = part.set_axis(pd.Index(part.index - part.index[0], name="time_s"))
    return found
