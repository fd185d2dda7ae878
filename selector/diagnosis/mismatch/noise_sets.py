"""What a residual would look like if it were noise alone: its own innovations in another order."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.stats import norm, rankdata

from selector.diagnosis.comparison import Comparison
from selector.diagnosis.mismatch.background import background, seen_rows, spectrum
from selector.diagnosis.shapes.signals import filled, rate

Vector = NDArray[np.float64]
Matrix = NDArray[np.float64]


def recalibrated_away(comparison: Comparison, response: str, rows: Sequence[NDArray[np.intp]]) -> Matrix:
    """Orthonormal columns of what a recalibration takes: an offset a run, gain and delay; shape (n_rows, p)."""
    n = len(comparison.time_s)
    seen = np.concatenate(rows)
    simulated = filled(comparison, comparison.simulated[response])
    columns = [(comparison.run_index == k).astype(np.float64) for k in range(len(comparison.runs))]
    columns += [simulated, rate(comparison, simulated)]
    table = np.zeros((n, len(columns)))
    table[seen] = np.column_stack(columns)[seen]
    size = np.linalg.norm(table, axis=0)
    left, values, _ = np.linalg.svd(table[:, size > 0] / size[size > 0], full_matrices=False)
    return np.asarray(left[:, values > 1e-6])


def noise_alone(
    comparison: Comparison,
    residuals: Mapping[str, Vector],
    n_sets: int,
    rng: np.random.Generator,
    *,
    wanders: bool = True,
) -> dict[str, Matrix]:
    """Residuals as noise alone would make them: innovations in another order, the same for all responses.

    Response → shape (1 + n_sets, n_rows): the first is the residual itself, all with the recalibration taken off.
    Readings are rounded as the recorded ones are (`Comparison.resolution`). Missing rows are 0. A response without
    enough readings, or without any residual, is not in the result. `wanders`: as of `background`.
    """
    parts = [np.arange(part.start, part.stop) for _, part in comparison.rows_of_runs()]
    mixed = [rng.permuted(np.tile(part, (n_sets, 1)), axis=1) for part in parts]
    earlier = [rng.permuted(part, axis=1) for part in mixed]
    found = {}
    for response, residual in residuals.items():
        rows = seen_rows(comparison, residual)
        seen = np.concatenate(rows)
        taken = recalibrated_away(comparison, response, rows) if len(seen) else np.zeros((len(residual), 0))
        own = _without(np.where(np.isin(np.arange(len(residual)), seen), residual, 0.0)[None, :], taken, seen)
        spread = float(np.std(own[0, seen])) if len(seen) else 0.0
        if spread <= 1e-9 * float(np.nanmax(np.abs(comparison.recorded[response]), initial=0.0)) or spread == 0.0:
            continue
        model = background(spectrum(own, rows), wanders=wanders)
        bringing = model.innovations(own, rows)[0]
        unseen, untold = np.setdiff1d(np.arange(len(residual)), seen), bringing == 0.0
        bringing[untold] = rng.choice(bringing[~untold], int(untold.sum()))
        step = comparison.resolution.get(response, 0.0)
        if step > 0.7 * spread:
            # Readings of a few steps say little of the noise before it was rounded: normal values in the same order.
            ranks = rankdata(bringing + 1e-6 * spread * rng.standard_normal(len(bringing)))
            bringing = float(np.std(bringing)) * norm.ppf((ranks - 0.5) / len(ranks))
        shaped = np.empty((n_sets, len(residual)))
        for part, before, after in zip(parts, earlier, mixed, strict=True):
            drawn = np.concatenate([bringing[before], bringing[after]], axis=1)
            shaped[:, part] = model.coloured(drawn)[:, len(part) :]
        if step > 0.0:
            shaped *= np.sqrt(max(1.0 - step**2 / 12.0 / spread**2, 0.05))
            course = filled(comparison, comparison.recorded[response] - residual)
            shaped = step * np.round((course + shaped) / step) - course
        shaped[:, unseen] = 0.0
        found[response] = np.concatenate([own, _without(shaped, taken, seen)])
    return found


def _without(values: Matrix, taken: Matrix, seen: NDArray[np.intp]) -> Matrix:
    result = np.zeros_like(values)
    result[:, seen] = values[:, seen] - (values[:, seen] @ taken[seen]) @ taken[seen].T
    return result
