"""How much of a mismatch each effect's best shape explains, by plain least squares; for tests of selectivity."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from selector.diagnosis.comparison import Comparison
from selector.diagnosis.effects.effect import Effect, Variant
from selector.diagnosis.shapes.signals import rate


def shares(
    comparison: Comparison, response: str, effects: Iterable[Effect], *, rho: float
) -> dict[str, tuple[float, Variant | None]]:
    """Effect id → share of the whitened mismatch and the shape; offset, gain and delay of the simulation are taken off.

    Whitened by 1 − ρ·z⁻¹, run by run: slow courses count less, as they do under coloured noise.
    """
    simulated = comparison.simulated[response]
    nuisance = [np.ones(len(simulated))]
    if np.std(simulated) > 0:
        nuisance += [simulated, rate(comparison, simulated)]
    basis, _ = np.linalg.qr(whitened(comparison, np.column_stack(nuisance), rho))

    def free(columns: np.ndarray) -> np.ndarray:
        return columns - basis @ (basis.T @ columns)

    target = free(whitened(comparison, comparison.difference(response), rho))
    found: dict[str, tuple[float, Variant | None]] = {}
    for effect in effects:
        best: tuple[float, Variant | None] = (0.0, None)
        for variant in effect.variants(comparison, response):
            raw = whitened(comparison, variant.columns, rho)
            columns = free(raw)
            seen = np.linalg.norm(columns, axis=0) > 1e-6 * np.linalg.norm(raw, axis=0)
            if seen.any():
                own, _ = np.linalg.qr(columns[:, seen] / np.linalg.norm(columns[:, seen], axis=0))
                share = float(np.sum((own.T @ target) ** 2) / (target @ target))
                best = max(best, (share, variant), key=lambda one: one[0])
        found[effect.id] = best
    return found


def whitened(comparison: Comparison, columns: np.ndarray, rho: float) -> np.ndarray:
    result = columns.copy()
    result[1:] -= rho * columns[:-1]
    for start in comparison.starts[:-1]:
        result[start] = columns[start] * np.sqrt(1.0 - rho**2)
    return result
