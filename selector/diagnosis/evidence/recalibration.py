"""What the simulation's own offset, gain and delay explain, and whether that is more than noise."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from selector.diagnosis.effects.effect import Quantity
from selector.diagnosis.evidence.bench import OF_MODEL, Bench
from selector.diagnosis.evidence.testing import tail_probability

Vector = NDArray[np.float64]
_DRAWS = 400
_FLOOR = 0.02
"""Share of the mean square that recalibration has to take away to be worth a word."""


@dataclass(frozen=True)
class Recalibrated:
    """Recalibration of one response.

    Attributes
    ----------
    p_value : float
        Probability that noise gains as much.
    gain : float
        Fall of the whitened sum of squares.
    share : float
        Share of the mean square of the mismatch, over the fitted rows, that recalibration takes away.
    quantities : mapping of str to Quantity
        ``offset`` [unit], ``gain`` (1 = none), ``delay`` [s], with 95 % intervals.
    """

    p_value: float
    gain: float
    share: float
    quantities: Mapping[str, Quantity]

    @property
    def matters(self) -> bool:
        """Whether it is more than noise and more than a trifle."""
        return self.p_value < 1e-3 and self.share > _FLOOR


def recalibrated(bench: Bench, named: list[int], noise: Vector, unit: str, *, seed: int) -> Recalibrated:
    """How the simulation would have to be recalibrated beside the candidates `named`, and how sure that is."""
    columns, target = bench.base(named), bench.white_target
    own = bench.white_nuisance.shape[1]
    effects = columns[:, own:]
    kept = np.eye(len(target), 0) if effects.shape[1] == 0 else np.linalg.qr(effects)[0]
    nuisance = columns[:, :own] - kept @ (kept.T @ columns[:, :own])
    size = np.maximum(np.linalg.norm(nuisance, axis=0), 1e-300)
    left, singular, _ = np.linalg.svd(nuisance / size, full_matrices=False)
    left = left[:, singular > 1e-6 * singular.max(initial=0.0)]
    gain = float(((left.T @ target) ** 2).sum())
    scores = np.array([left[rows].T @ noise[rows] for rows in bench.blocks])
    signs = np.random.default_rng(seed).choice([-1.0, 1.0], size=(_DRAWS, len(scores)))
    drawn = ((signs @ scores) ** 2).sum(axis=1)
    beta, covariance = bench.coefficients(named)
    rows = bench.fitted
    raw = bench.target[rows] - bench.raw_base(named)[rows][:, own:] @ beta[own:]
    after = raw - bench.nuisance[rows] @ beta[:own]
    before = float(np.mean(raw**2))
    return Recalibrated(
        p_value=tail_probability(gain, drawn),
        gain=gain,
        share=max(0.0, 1.0 - float(np.mean(after**2)) / before) if before > 0.0 else 0.0,
        quantities={
            name: _quantity(name, beta[k], float(np.sqrt(covariance[k, k])), unit)
            for k, name in enumerate(bench.nuisance_names)
            if not name.startswith(OF_MODEL)
        },
    )


def _quantity(name: str, value: float, error: float, unit: str) -> Quantity:
    base = 1.0 if name == "gain" else 0.0
    word = {"gain": "1", "delay": "s"}.get(name, unit)
    return Quantity(base + value, word, base + value - 1.96 * error, base + value + 1.96 * error)
