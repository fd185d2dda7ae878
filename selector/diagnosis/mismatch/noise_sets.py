"""What a residual would look like if it were noise alone: its own innovations in another order."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.stats import norm, rankdata

from selector.diagnosis.comparison import Comparison
from selector.diagnosis.mismatch.background import Background, background, seen_rows, spectrum
from selector.diagnosis.shapes.signals import filled, rate

Vector = NDArray[np.float64]
Matrix = NDArray[np.float64]
_CACHED = 2**18
"""Readings of a block of sets."""


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
    n = len(comparison.time_s)
    parts = [np.arange(part.start, part.stop) for _, part in comparison.rows_of_runs()]
    noises: dict[str, _Noise] = {}
    stacks: dict[str, Matrix] = {}
    for response, residual in residuals.items():
        rows = seen_rows(comparison, residual)
        seen = np.concatenate(rows)
        taken = recalibrated_away(comparison, response, rows) if len(seen) else np.zeros((n, 0))
        own = _without(np.where(np.isin(np.arange(n), seen), residual, 0.0)[None, :], taken, seen)
        spread = float(np.std(own[0, seen])) if len(seen) else 0.0
        if spread <= 1e-9 * float(np.nanmax(np.abs(comparison.recorded[response]), initial=0.0)) or spread == 0.0:
            continue
        model = background(spectrum(own, rows), wanders=wanders)
        bringing = model.innovations(own, rows)[0]
        untold = bringing == 0.0
        bringing[untold] = rng.choice(bringing[~untold], int(untold.sum()))
        step = comparison.resolution.get(response, 0.0)
        if step > 0.7 * spread:
            # Readings of a few steps say little of the noise before it was rounded: normal values in the same order.
            ranks = rankdata(bringing + 1e-6 * spread * rng.standard_normal(len(bringing)))
            bringing = float(np.std(bringing)) * norm.ppf((ranks - 0.5) / len(ranks))
        course = filled(comparison, comparison.recorded[response] - residual)
        noises[response] = _Noise(model, bringing, taken, seen, step, spread, course)
        stacks[response] = np.empty((1 + n_sets, n))
        stacks[response][0] = own[0]
    for block in blocks(1, 1 + n_sets, n):
        drawn = np.tile(np.arange(n), (block.stop - block.start, 1))
        mixed = [rng.permuted(drawn[:, part], axis=1) for part in parts]
        earlier = [rng.permuted(part, axis=1) for part in mixed]
        for response, noise in noises.items():
            stacks[response][block] = noise.sets(parts, earlier, mixed)
    return stacks


@dataclass(frozen=True, eq=False)
class _Noise:
    """Noise of one response: its model, innovations of shape (n_rows,), and what its readings are made of."""

    model: Background
    bringing: Vector
    taken: Matrix
    seen: NDArray[np.intp]
    step: float
    spread: float
    course: Vector

    def sets(
        self,
        parts: Sequence[NDArray[np.intp]],
        earlier: Sequence[NDArray[np.intp]],
        mixed: Sequence[NDArray[np.intp]],
    ) -> Matrix:
        """Residuals of innovations in these orders, run by run, shape (n_sets, n_rows)."""
        shaped = np.empty((len(mixed[0]), len(self.bringing)))
        for part, before, after in zip(parts, earlier, mixed, strict=True):
            drawn = np.concatenate([self.bringing[before], self.bringing[after]], axis=1)
            shaped[:, part] = self.model.coloured(drawn, len(part))
        if self.step > 0.0:
            shaped *= np.sqrt(max(1.0 - self.step**2 / 12.0 / self.spread**2, 0.05))
            shaped = self.step * np.round((self.course + shaped) / self.step) - self.course
        return _without(shaped, self.taken, self.seen)


def blocks(first: int, stop: int, n_rows: int) -> list[slice]:
    """Sets from `first` to `stop` in blocks that stay in a processor's cache."""
    size = max(1, _CACHED // n_rows)
    return [slice(at, min(at + size, stop)) for at in range(first, stop, size)]


def _without(values: Matrix, taken: Matrix, seen: NDArray[np.intp]) -> Matrix:
    """Readings without the recalibration; 0 where there are none."""
    result = np.zeros_like(values)
    result[:, seen] = values[:, seen] - (values[:, seen] @ taken[seen]) @ taken[seen].T
    return result
