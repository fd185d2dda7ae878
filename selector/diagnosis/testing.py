"""How strongly a response asks for every candidate, and what noise alone would have shown."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from selector.diagnosis.bench import Bench
from selector.diagnosis.moments import Moments, losses, scores_of_noise, solved

Vector = NDArray[np.float64]
Matrix = NDArray[np.float64]
_DRAWS = 400


@dataclass(frozen=True, eq=False)
class Tested:
    """How one effect stands in one response, beside all that is named already.

    Attributes
    ----------
    best : int
        Number of the candidate that fits best.
    gain : float
        Fall of the whitened sum of squares by it, all fitted rows.
    cv_gain : float
        The same on blocks that were not fitted, the shape chosen anew for every fold.
    block_gains : ndarray of shape (n_blocks,)
        `cv_gain` block by block.
    run_gain : float or None
        The same of the best shape with whole runs left out; None of a single fitted run, or of an effect that acts in
        one run only.
    noise : ndarray of shape (n_draws,)
        Gains by noise alone, the best of all shapes.
    """

    best: int
    gain: float
    cv_gain: float
    block_gains: Vector
    run_gain: float | None
    noise: Vector

    @property
    def p_value(self) -> float:
        """Probability that noise gains as much."""
        return tail_probability(self.gain, self.noise)


def tail_probability(gain: float, noise: Vector) -> float:
    """Probability that noise exceeds `gain`, by a Gumbel law through what noise gained in the draws.

    Its scale is not below 2, that of χ² in the tail, so that few draws promise no certainty that they cannot have.
    """
    return float(np.clip(stats.gumbel_r.sf(gain, *_gumbel(noise)), 1e-300, 1.0))


def tail_threshold(probability: float, noise: Vector) -> float:
    """The gain that noise exceeds with this `probability`, by the same law."""
    return float(stats.gumbel_r.isf(probability, *_gumbel(noise)))


def _gumbel(noise: Vector) -> tuple[float, float]:
    scale = max(2.0, float(np.std(noise)) * np.sqrt(6.0) / np.pi)
    return float(np.mean(noise)) - np.euler_gamma * scale, scale


def tests_of(bench: Bench, named: Sequence[int], noise: Vector, *, seed: int) -> dict[str, Tested]:
    """Every effect of a bench, tested beside the candidates `named`.

    `noise` (n_fitted_rows,) is what a fit that leaves nothing out leaves of the whitened target; `seed` decides signs.
    """
    if not bench.candidates:
        return {}
    base = bench.base(named)
    sums = bench.moments(base)
    everywhere = np.ones(len(bench.blocks), dtype=bool)
    whole = solved(sums, everywhere)
    members: dict[str, list[int]] = {}
    for v, candidate in enumerate(bench.candidates):
        members.setdefault(candidate.effect.id, []).append(v)
    numbers = {name: np.array(list_, dtype=np.intp) for name, list_ in members.items()}
    gains = _block_gains(sums, bench.folds, numbers)
    best_of = {name: int(list_[np.argmax(whole.gain[list_])]) for name, list_ in numbers.items()}
    by_run = _run_gains(bench, sums, best_of)
    draws = noise_gains(bench, base, sums, noise, seed=seed)
    found = {}
    for name, list_ in numbers.items():
        best = best_of[name]
        found[name] = Tested(
            best=best,
            gain=float(whole.gain[best]),
            cv_gain=float(gains[name].sum()),
            block_gains=gains[name],
            run_gain=None if bench.candidates[best].variant.run is not None else by_run.get(name),
            noise=draws[:, list_].max(axis=1),
        )
    return found


def _block_gains(sums: Moments, folds: NDArray[np.intp], numbers: dict[str, NDArray[np.intp]]) -> dict[str, Vector]:
    """Per effect and block, what the shape that fits the other folds best gains there."""
    result = {name: np.zeros(len(folds)) for name in numbers}
    for fold in np.unique(folds):
        fit = solved(sums, folds != fold)
        chosen = np.array([list_[np.argmax(fit.gain[list_])] for list_ in numbers.values()], dtype=np.intp)
        for block in np.flatnonzero(folds == fold):
            alone, with_them = losses(sums, fit, np.arange(len(folds)) == block, chosen)
            for name, loss in zip(numbers, with_them, strict=True):
                result[name][block] = alone - loss
    return result


def _run_gains(bench: Bench, sums: Moments, best_of: dict[str, int]) -> dict[str, float]:
    """Per effect, what its best shape, sized by the other runs, gains in each run, summed; empty of a single run."""
    runs = np.unique(bench.block_runs)
    if len(runs) < 2:
        return {}
    result = np.zeros(len(best_of))
    chosen = np.array(list(best_of.values()), dtype=np.intp)
    for run in runs:
        here = bench.block_runs == run
        alone, with_them = losses(sums, solved(sums, ~here), here, chosen)
        result += alone - with_them
    return dict(zip(best_of, result.tolist(), strict=True))


def noise_gains(bench: Bench, base: Matrix, sums: Moments, noise: Vector, *, seed: int) -> Matrix:
    """What every candidate gains by noise alone, shape (n_draws, n_variants).

    The noise is `noise`, a whitened residual of the fitted rows, each block of it with a random sign: what is left of
    correlation within a block stays, what depends on a course of the machine does not.
    """
    n = len(bench.blocks)
    noise_base = np.array([base[rows].T @ noise[rows] for rows in bench.blocks])
    noise_target = np.array([bench.white_columns[rows].T @ noise[rows] for rows in bench.blocks])
    signs = np.random.default_rng(seed).choice([-1.0, 1.0], size=(_DRAWS, n))
    result = np.empty((_DRAWS, sums.n_variants))
    for (score, root), members in zip(scores_of_noise(sums, noise_base, noise_target), sums.members, strict=True):
        drawn = np.einsum("db,bvi->dvi", signs, score)
        result[:, members] = (np.einsum("vji,dvi->dvj", root, drawn) ** 2).sum(axis=2)
    return result
