"""What several rigs share: repeats of a cycle, and cuts of long records."""

from __future__ import annotations

import numpy as np
import pandas as pd

from benchmarks.real.case import SIMULATED, Vector

SILENT = ("nothing-missing", "miscalibrated")


def period_of(course: Vector, times: Vector) -> float:
    """Period [s] of a course that repeats: the slope of its upward crossings of the mean over their number."""
    centred = course - course.mean()
    up = np.flatnonzero((centred[:-1] < 0.0) & (centred[1:] >= 0.0))
    share = -centred[up] / (centred[up + 1] - centred[up])
    crossings = times[up] + share * (times[up + 1] - times[up])
    crossings = crossings[np.r_[True, np.diff(crossings) > 0.5 * np.median(np.diff(crossings))]]
    return float(np.polyfit(np.arange(len(crossings)), crossings, 1)[0])


def folded(frame: pd.DataFrame, names: tuple[str, ...], period_s: float, first_s: float, bins: int) -> pd.DataFrame:
    """The rows after `first_s`, beside the mean cycle of those before it."""
    phase = (frame.index.to_numpy() / period_s) % 1.0
    known = frame.index.to_numpy() < first_s
    cell = np.minimum((phase * bins).astype(int), bins - 1)
    centre = (np.arange(bins) + 0.5) / bins
    out = frame.copy()
    for name in names:
        means = pd.Series(frame[name].to_numpy()[known]).groupby(cell[known]).mean()
        out[name + SIMULATED] = np.interp(phase, centre[means.index], means.to_numpy(), period=1.0)
    out = out[~known]
    return out.set_axis(out.index - out.index[0])
