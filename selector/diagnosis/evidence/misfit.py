"""How much structure is left that is nobody's: a simulation is never wrong in one way only.

With many samples all of it is significant, and shapes of the catalogue pick it up whether they are right or not. What
shapes gain that are certainly wrong, those of the catalogue at another time, tells how much that is. Evidence counts in
units of it, as if the noise were larger by that factor (a tempered posterior: J. W. Miller, D. B. Dunson, Robust
Bayesian Inference via Coarsening, JASA 114, 2019).
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from selector.diagnosis.evidence.noise import NoiseModel
from selector.diagnosis.evidence.response import Bench
from selector.types import Matrix, Vector

_SHAPES = 240
_SHIFTS = 12
_NORMAL = 24
_CLEAR = 1.6
"""Below this it may be chance."""


def misfit(bench: Bench, named: Sequence[int], *, seed: int) -> float:
    """Times what noise gains that shapes at a wrong time gain in what is left beside `named`; 1 where it is noise.

    Compared are the medians, over shifts and over draws, of the largest gain of any shape; a shift is by a quarter to
    three quarters of each run.
    """
    if not bench.candidates or len(bench.rows) < _NORMAL:
        return 1.0
    base = np.linalg.qr(bench.base(named))[0]
    left = bench.white_target - base @ (base.T @ bench.white_target)
    left /= max(float(np.sqrt(np.mean(left**2))), 1e-300)
    some = np.unique(np.linspace(0, len(bench.candidates) - 1, _SHAPES).astype(int))
    columns = bench.white_columns[:, [bench.candidates[v].columns.start for v in some]]
    draw = np.random.default_rng(seed)
    noise = draw.standard_normal((len(left), _NORMAL))
    wrong, by_chance = [], []
    for _ in range(_SHIFTS):
        shifted = _elsewhere(bench, columns, draw)
        shifted -= base @ (base.T @ shifted)
        size = np.linalg.norm(shifted, axis=0)
        shifted = shifted[:, size > 1e-6 * size.max(initial=0.0)]
        shifted /= np.linalg.norm(shifted, axis=0)
        if shifted.shape[1] == 0:
            return 1.0
        wrong.append(float(np.max((shifted.T @ left) ** 2)))
        by_chance.append(float(np.median(np.max((shifted.T @ noise) ** 2, axis=0))))
    times = max(float(np.median(wrong) / np.median(by_chance)), _of_repeats(bench, columns, left, draw))
    return times if times > _CLEAR else 1.0


def _of_repeats(bench: Bench, columns: Matrix, left: Vector, draw: np.random.Generator) -> float:
    """The same of what differs between runs of one programme, where there are any: no shape should gain by it.

    Such runs have the same shapes; what they leave differs by noise alone.
    """
    place = np.full(len(bench.target), -1)
    place[bench.rows] = np.arange(len(bench.rows))
    gained = []
    for pair in bench.repeats:
        first, second = (place[rows] for rows in pair)
        both = (first >= 0) & (second >= 0)
        shapes = columns[first[both]]
        norms = np.linalg.norm(shapes, axis=0)
        shapes = shapes[:, norms > 1e-6 * norms.max(initial=0.0)]
        if both.sum() < _NORMAL or shapes.shape[1] == 0:
            continue
        shapes = shapes / np.linalg.norm(shapes, axis=0)
        apart = (left[first[both]] - left[second[both]]) / np.sqrt(2.0)
        by_chance = np.median(np.max((shapes.T @ draw.standard_normal((len(apart), _NORMAL))) ** 2, axis=0))
        gained.append(float(np.max((shapes.T @ apart) ** 2) / by_chance))
    return float(np.median(gained)) if gained else 1.0


def _elsewhere(bench: Bench, columns: Matrix, draw: np.random.Generator) -> Matrix:
    result = np.empty_like(columns)
    edges = np.flatnonzero(np.diff(bench.runs[bench.rows], prepend=-1, append=-1) != 0)
    for first, last in pairwise(edges):
        n = last - first
        result[first:last] = np.roll(columns[first:last], int(draw.integers(n // 4, 3 * n // 4 + 1)), axis=0)
    return result


def tempered(bench: Bench, times: float) -> Bench:
    """The bench with noise of `times` the variance, its target and its shapes smaller accordingly."""
    if times == 1.0:
        return bench
    size = float(np.sqrt(times))
    calm = bench.with_noise(NoiseModel(bench.noise.phi, bench.noise.sd * size))
    if bench.pseudo_target is not None:
        object.__setattr__(calm, "pseudo_target", bench.pseudo_target / size)
    return calm
