"""How strongly a response asks for every candidate, and what noise alone would have shown."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy import linalg, stats

from selector.diagnosis.evidence.bench import Bench
from selector.diagnosis.evidence.moments import Moments, Solved, inverse_of, losses, scores_of_noise, solved

Vector = NDArray[np.float64]
Matrix = NDArray[np.float64]
_DRAWS = 400
_SHORT = 10
_SIGNED = 150
"""At most this many blocks with a sign each, none shorter than `_SHORT` rows: white noise needs no longer ones."""
_CONTRAST = 0.4


@dataclass(frozen=True, eq=False)
class Tested:
    """How one effect stands in one response, beside all that is named already.

    Attributes
    ----------
    best : int
        Number of the candidate that fits best.
    gain : float
        Fall of the whitened sum of squares by it, all fitted rows, less the price of a shape chosen from the residual.
    cv_gain : float
        The same on blocks that were not fitted, the shape chosen anew for every fold.
    block_gains : ndarray of shape (n_blocks,)
        `cv_gain` block by block.
    contrast : float
        What the best shape gains more if its size may differ from run to run; 0 of an effect that acts in one run only.
    freedoms : int
        Coefficients that `contrast` has more.
    noise : ndarray of shape (n_draws,)
        Gains by noise alone, the best of all shapes.
    largest : float
        Largest amount of the fitted course in the response, over its fitted rows [steps of the reading]; infinite if
        no step was seen.
    """

    best: int
    gain: float
    cv_gain: float
    block_gains: Vector
    contrast: float
    freedoms: int
    noise: Vector
    largest: float

    @property
    def score(self) -> float:
        """Gain less what noise gains on average with as many shapes."""
        return self.gain - float(np.mean(self.noise))

    @property
    def is_the_same_in_all_runs(self) -> bool:
        """Whether one size fits all runs: the contrast is noise (1 in 1000), or small beside the gain itself."""
        return self.contrast <= max(float(stats.chi2.isf(1e-3, max(self.freedoms, 1))), _CONTRAST * self.gain)

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
    gains_of = whole.gain - 2.0 * np.log([candidate.variant.looked_at for candidate in bench.candidates])
    best_of = {name: int(list_[np.argmax(gains_of[list_])]) for name, list_ in numbers.items()}
    draws = noise_gains(bench, base, sums, noise, seed=seed)
    found = {}
    for name, list_ in numbers.items():
        best = best_of[name]
        contrast, freedoms = _contrast(bench, sums, best, whole.gain[best])
        found[name] = Tested(
            best=best,
            gain=max(0.0, float(gains_of[best])),
            cv_gain=float(gains[name].sum()),
            block_gains=gains[name],
            contrast=contrast,
            freedoms=freedoms,
            noise=draws[:, list_].max(axis=1),
            largest=_largest(bench, whole, sums, best),
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


def _largest(bench: Bench, fit: Solved, sums: Moments, v: int) -> float:
    if bench.resolution <= 0.0:
        return np.inf
    q, i = next((q, int(np.flatnonzero(members == v)[0])) for q, members in enumerate(sums.members) if v in members)
    course = (bench.raw(v) @ fit.coefficients[q][i])[bench.fitted]
    return float(np.abs(course - np.median(course)).max()) / bench.resolution


def _contrast(bench: Bench, sums: Moments, v: int, gain: float) -> tuple[float, int]:
    """What candidate `v` gains more with a size of its own in every run, and the coefficients that takes."""
    place = next((q, int(np.flatnonzero(members == v)[0])) for q, members in enumerate(sums.members) if v in members)
    group, within = sums.groups[place[0]][place[1]], sums.within[place[0]][:, place[1]]
    parts = [bench.block_runs == run for run in np.unique(bench.block_runs)]
    parts = [here for here in parts if np.trace(within[here].sum(axis=0)) > 1e-6 * np.trace(within.sum(axis=0))]
    if len(parts) < 2:
        return 0.0, 0
    a, g = sums.base.sum(axis=0), sums.base_target.sum(axis=0)
    cross = np.hstack([sums.cross[here][:, :, group].sum(axis=0) for here in parts])
    target = np.concatenate([sums.target[here][:, group].sum(axis=0) for here in parts])
    own = linalg.block_diag(*[within[here].sum(axis=0) for here in parts])
    inverse = inverse_of(a)
    left = own - cross.T @ inverse @ cross
    score = target - cross.T @ inverse @ g
    split = float(score @ np.linalg.pinv(left, rcond=1e-6, hermitian=True) @ score)
    return max(0.0, split - gain), (len(parts) - 1) * len(group)


def noise_gains(bench: Bench, base: Matrix, sums: Moments, noise: Vector, *, seed: int) -> Matrix:
    """What every candidate gains by noise alone, shape (n_draws, n_variants).

    The noise is `noise`, a whitened residual of the fitted rows, short blocks of it with random signs: how large it is
    where, and what is left of its correlation stay, what depends on a course of the machine does not.
    """
    n = len(noise)
    starts = np.linspace(0, n, int(np.clip(n // _SHORT, 1, _SIGNED)), endpoint=False).astype(int)
    parts = [slice(first, last) for first, last in pairwise([*starts, n])]
    noise_base = np.array([noise[part] @ base[part] for part in parts])
    noise_target = np.array([noise[part] @ bench.white_columns[part] for part in parts])
    signs = np.random.default_rng(seed).choice([-1.0, 1.0], size=(_DRAWS, len(starts)))
    result = np.empty((_DRAWS, sums.n_variants))
    for (score, root), members in zip(scores_of_noise(sums, noise_base, noise_target), sums.members, strict=True):
        drawn = (signs @ score.reshape(len(starts), -1)).reshape(_DRAWS, *score.shape[1:])
        result[:, members] = (np.einsum("vji,dvi->dvj", root, drawn) ** 2).sum(axis=2)
    return result
