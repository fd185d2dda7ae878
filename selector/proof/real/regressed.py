"""What a user's static simulation says: displacement as a sum of temperatures at the same moment."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from selector.recording import Recording

Matrix = NDArray[np.float64]

_START = 5


def regressed(
    recording: Recording,
    responses: Sequence[str],
    inputs: Sequence[str],
    fitted: Sequence[str],
    *,
    of_rises: bool = False,
) -> Recording:
    """Ordinary least squares of responses on inputs and a constant, on the runs `fitted`, computed for all runs.

    Parameters
    ----------
    recording
        Its rows without a missing value are fitted.
    responses, inputs
        Channels.
    fitted
        Runs.
    of_rises
        Inputs count from their mean over the first `_START` rows of a run, as displacements do that are zeroed there.
    """

    def regressors(run: str) -> Matrix:
        values = recording.values(run, inputs)
        start = np.nanmean(values[:_START], axis=0) if of_rises else 0.0
        return np.column_stack([np.ones(len(values)), values - start])

    x = np.concatenate([regressors(run) for run in fitted])
    y = np.concatenate([recording.values(run, responses) for run in fitted])
    rows = np.isfinite(x).all(axis=1) & np.isfinite(y).all(axis=1)
    factors = np.linalg.lstsq(x[rows], y[rows], rcond=None)[0]
    courses = {
        run: pd.DataFrame(
            regressors(run) @ factors, columns=list(responses), index=pd.Index(recording.time_s(run), name="time_s")
        )
        for run in recording.runs
    }
    return Recording.from_runs(courses, tuple(recording.channel(name) for name in responses))
