"""What several rigs of the fifth set share: a law fitted to the first runs, and evenly sampled tables."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np
import pandas as pd
from scipy.optimize import least_squares as minimised

from benchmarks.real.case import SIMULATED, Vector

Law = Callable[[Vector, pd.DataFrame], Vector]
"""The simulated course of a run by its parameters."""


def simulated(
    runs: Mapping[str, pd.DataFrame], name: str, law: Law, guess: Sequence[float], n_fitted: int | None = None
) -> Vector:
    """Adds the course that fits the first runs, all but the last if nothing else is said; the parameters found."""
    known = list(runs.values())[: len(runs) - 1 if n_fitted is None else n_fitted]
    scale = np.abs(np.array(guess)) + 1e-9
    found = minimised(
        lambda x: np.concatenate([law(x, run) - run[name].to_numpy() for run in known]), guess, x_scale=scale
    ).x
    for run in runs.values():
        run[name + SIMULATED] = law(found, run)
    return np.asarray(found)


def over(frame: pd.DataFrame, step_s: float) -> pd.DataFrame:
    """A table of evenly sampled rows over the time from its start [s]."""
    return frame.set_axis(pd.Index(step_s * np.arange(len(frame)), name="time_s"))


def first_share(run: pd.DataFrame, share: float = 0.7) -> pd.DataFrame:
    """The part of a single run that is fitted: the rest is held out."""
    return run.iloc[: int(share * len(run))]
