"""How far does a black box get: a Gaussian process of the residual over everything recorded; it names nothing."""

from __future__ import annotations

import warnings
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from selector.diagnosis.comparison import Comparison
from selector.diagnosis.shapes.signals import course
from selector.proof.candidates import Candidates

Vector = NDArray[np.float64]
MOST_POINTS = 250
_CLEAR_NATS = 4.0
"""Gain of log likelihood over noise alone that is called structure: two parameters and more by Akaike."""


@dataclass(frozen=True, eq=False)
class Discrepancy:
    """What the process leaves of the difference over all rows [unit], and whether it saw more than noise."""

    left: Vector
    is_structured: bool


def discrepancy(comparison: Comparison, offered: Candidates, seed: int) -> Discrepancy:
    """The discrepancy term of Kennedy and O'Hagan (J. R. Statist. Soc. B 63, 2001, 425), after recalibration.

    Its inputs are the recorded channels that are no response and the simulated response; it is fitted to at most
    `MOST_POINTS` evenly taken rows.
    """
    from sklearn.exceptions import ConvergenceWarning
    from sklearn.gaussian_process import GaussianProcessRegressor
    from sklearn.gaussian_process.kernels import RBF, ConstantKernel, WhiteKernel

    left = offered.left(())
    names = [channel.name for channel in comparison.channels if channel.name not in comparison.responses]
    inputs = np.column_stack([*(course(comparison, name) for name in names), offered.nuisances[:, 1]])
    spread = inputs[offered.fitted].std(axis=0)
    inputs = (inputs - inputs[offered.fitted].mean(axis=0)) / np.where(spread > 0, spread, 1.0)
    rows = np.flatnonzero(offered.fitted)
    rows = rows[np.linspace(0, len(rows) - 1, min(MOST_POINTS, len(rows))).astype(int)]
    size = float(left[rows].std())
    if size == 0.0:
        return Discrepancy(left, False)
    target = left[rows] / size
    kernel = ConstantKernel(0.3, (1e-4, 1e2)) * RBF(2.0, (0.1, 1e2)) + WhiteKernel(0.7, (1e-4, 1e1))
    with warnings.catch_warnings():
        # bounds that are reached are an answer: no structure, or no noise
        warnings.simplefilter("ignore", ConvergenceWarning)
        process = GaussianProcessRegressor(kernel, random_state=seed).fit(inputs[rows], target)
    likelihood = float(process.log_marginal_likelihood_value_)
    noise_alone = -0.5 * len(rows) * (np.log(2 * np.pi * np.mean(target**2)) + 1.0)
    kept = np.flatnonzero(offered.held_out)
    result = left.copy()
    result[kept] -= size * process.predict(inputs[kept]) if len(kept) else 0.0
    return Discrepancy(result, bool(likelihood - noise_alone > _CLEAR_NATS))
