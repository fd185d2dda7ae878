"""What is left wanders slowly, as noise of long memory does and a slow effect may: said, where it is no structure."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from selector.diagnosis.comparison import Comparison
from selector.diagnosis.finding_table import FINDINGS
from selector.diagnosis.mismatch.background import seen_rows, spectrum, wandering
from selector.diagnosis.mismatch.omnibus import Structure
from selector.diagnosis.wording import amount, duration_words
from selector.findings import Finding, Where
from selector.types import Vector

_SLOW = 12.0
"""Samples of memory from which noise is said to wander."""
_TRIFLE = 0.1
"""Share of the variance that has to wander to be worth a word."""


def told_of_wandering(
    comparison: Comparison, residuals: Mapping[str, Vector], structures: Sequence[Structure]
) -> tuple[Finding, ...]:
    """A finding for every response whose residual wanders slowly and shows no structure.

    Parameters
    ----------
    comparison : Comparison
    residuals : mapping of str to ndarray of shape (n_rows,)
        Response → what is left [its unit]; NaN where missing.
    structures : sequence of Structure
        What is no noise; of its responses nothing is said.
    """
    found = []
    for response in residuals.keys() - {structure.channel for structure in structures}:
        rows = seen_rows(comparison, residuals[response])
        if not any(len(here) for here in rows):
            continue
        parts = wandering(spectrum(np.nan_to_num(residuals[response])[None, :], rows))
        variance, memory = (values.ravel() for values in parts)
        slow = memory >= _SLOW
        share = float(variance[slow].sum() / max(float(variance.sum()), 1e-300))
        if share < _TRIFLE:
            continue
        logs = np.log(memory[slow]) @ variance[slow] / variance[slow].sum()
        time_s = min(float(np.exp(logs)) * comparison.period_s, 0.5 * comparison.longest_s)
        size = float(np.sqrt(variance[slow].sum()))
        unit = comparison.channel(response).unit
        found.append(
            FINDINGS.finding(
                "slow-remainder",
                f"What is left in {response} wanders slowly: {amount(size, unit)} rms, correlation time about "
                f"{duration_words(time_s)}. This record cannot tell noise that wanders from a slow effect that nobody "
                "recorded.",
                Where(channel=response),
                evidence={"correlation_time_s": time_s, "rms": size, "unit": unit, "share_of_variance": share},
            )
        )
    return tuple(sorted(found, key=lambda finding: finding.where.channel or ""))
