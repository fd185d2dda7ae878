"""How long may the steps of a model of heat be while it is searched: as long as nobody could tell by its readings."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from selector.diagnosis.comparison import Comparison
from selector.diagnosis.entrance.alignment import comparison_of
from selector.diagnosis.open_model.refit_problem import simulated_rows
from selector.diagnosis.open_model.runnable import OwnModel, Runnable
from selector.errors import InputError
from selector.recording import Recording

_TELLS = 0.01
"""Share of the noise from sample to sample that an error of the steps stays below."""
_DOUBLINGS = 8


def with_longest_steps(
    model: Runnable, recording: Recording, *, responses: Sequence[str] | None = None, holdout: str = "last"
) -> Runnable:
    """The model with the longest internal steps that give what those of its file give, to within a trifle of the noise.

    A search simulates some hundred times. Steps are doubled until it is told; other models than those of heat are
    given back as they are.

    Parameters
    ----------
    model
        What is searched.
    recording, responses, holdout
        As of `alignment.comparison_of`.

    Raises
    ------
    InputError
        The recordings cannot drive the model, or nothing can be compared.
    """
    if not isinstance(model, OwnModel) or model.kind != "thermal" or not hasattr(model.file.run, "step_s"):
        return model
    comparison = comparison_of(recording, model.simulated({}), responses=responses, holdout=holdout)
    chosen = model
    for doubled in range(1, _DOUBLINGS + 1):
        tried = replace(model, step_s=float(model.file.run.step_s) * 2.0**doubled)
        try:
            courses = simulated_rows(comparison, tried.simulated({}))
        except InputError:
            break
        if any(
            not _rms(courses[name] - comparison.simulated[name]) <= _TELLS * _noise(comparison, name)
            for name in comparison.responses
        ):
            break
        chosen = tried
    return chosen


def _noise(comparison: Comparison, name: str) -> float:
    """Root mean square of what changes from sample to sample, as of a course that does not go on."""
    change = np.diff(comparison.difference(name))
    return _rms(change) / np.sqrt(2.0)


def _rms(values: np.ndarray) -> float:
    seen = values[np.isfinite(values)]
    return float(np.sqrt(np.mean(seen**2))) if len(seen) else 0.0
