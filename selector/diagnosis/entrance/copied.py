"""What is said when the simulation is the recording itself: there is nothing to explain, and nothing is named."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from selector.diagnosis.answer import Diagnosis, Errors, Fit
from selector.diagnosis.comparison import Comparison
from selector.diagnosis.entrance.unusable import identical_responses


def diagnosis_of_copy(comparison: Comparison, *, seed: int = 0) -> Diagnosis | None:
    """The answer if every response was simulated as it was recorded, to within rounding; None otherwise."""
    if set(identical_responses(comparison)) != set(comparison.responses):
        return None
    return Diagnosis(
        comparison=comparison,
        verdict="nothing-missing",
        headline="The simulation is the recording to within its rounding: there is no difference to explain.",
        fit={name: fit_of_copy(comparison, name) for name in comparison.responses},
        findings=comparison.findings,
        seed=seed,
    )


def fit_of_copy(comparison: Comparison, response: str) -> Fit:
    """Errors of a response that was simulated as it was recorded: nothing to gain."""
    course = comparison.simulated[response]
    difference = comparison.difference(response)
    train, held = (_rmse(difference[rows]) for rows in (~comparison.held_out, comparison.held_out))
    return Fit(
        unit=comparison.channel(response).unit,
        train=Errors(train, train),
        heldout=Errors(held, held),
        recalibrated_heldout=held,
        gap_closed=None,
        placebo_gain=None,
        before=course,
        recalibrated=course,
        after=course,
    )


def _rmse(values: NDArray[np.float64]) -> float:
    seen = values[np.isfinite(values)]
    return float(np.sqrt(np.mean(seen**2))) if len(seen) else float("nan")
