"""How much of what is left is structure that is nobody's, or strays, and what evidence counts for beside it."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from selector.diagnosis.evidence.noise import NoiseModel
from selector.diagnosis.evidence.response import Bench
from selector.diagnosis.shapes.residual import least_squares
from selector.types import Matrix, Vector

_SHAPES = 240
_SHIFTS = 12
_DRAWS = 60
_FEWEST_ROWS = 24
#: Times the largest of the draws of noise, which are of white noise, while what is left is so only about.
_BEYOND = 1.2


def misfit(bench: Bench, named: Sequence[int], *, seed: int) -> float:
    """Times what noise gains that shapes at a wrong time gain in what is left beside `named`; 1 where it is noise.

    A simulation is never wrong in one way only. With many samples all structure that is nobody's is significant, and
    shapes of the catalogue pick it up whether they are right or not. What shapes gain that are certainly wrong, those
    of the catalogue at another time, tells how much that is. Evidence counts in units of it, as if the noise were
    larger by that factor (a tempered posterior: J. W. Miller, D. B. Dunson, Robust Bayesian Inference via Coarsening,
    JASA 114, 2019).

    Counted is the largest gain of any shape, in the median over shifts by a quarter to three quarters of each run. Some
    courses are much the same wherever they are moved, so that the median is chance itself: it has to be beyond that of
    all draws of noise.
    """
    if not bench.candidates or len(bench.rows) < _FEWEST_ROWS:
        return 1.0
    base = np.linalg.qr(bench.base(named))[0]
    left = bench.white_target - base @ (base.T @ bench.white_target)
    left /= max(float(np.sqrt(np.mean(left**2))), 1e-300)
    some = np.unique(np.linspace(0, len(bench.candidates) - 1, _SHAPES).astype(int))
    columns = bench.white_columns[:, [bench.candidates[v].columns.start for v in some]]
    draw = np.random.default_rng(seed)
    beside_noise = np.column_stack([left, draw.standard_normal((len(left), _DRAWS))])
    gains = []
    for _ in range(_SHIFTS):
        shifted = columns[elsewhere(bench.runs[bench.rows], draw)]
        gains.append(_largest_gains(shifted - base @ (base.T @ shifted), beside_noise))
    return max(_times(np.median(gains, axis=0)), _of_repeats(bench, left, draw))


def _of_repeats(bench: Bench, left: Vector, draw: np.random.Generator) -> float:
    """The same of what differs between runs of one programme, by noise alone: no shape should gain by it."""
    shapes = [one.columns.start for one in bench.candidates]
    place = np.full(len(bench.target), -1)
    place[bench.rows] = np.arange(len(bench.rows))
    gains = []
    for pair in bench.repeats:
        first, second = (place[rows] for rows in pair)
        both = (first >= 0) & (second >= 0)
        if both.sum() < _FEWEST_ROWS:
            continue
        apart = (left[first[both]] - left[second[both]]) / np.sqrt(2.0)
        noise = draw.standard_normal((len(apart), _DRAWS))
        of_first = bench.white_columns[np.ix_(first[both], shapes)]
        gains.append(_largest_gains(of_first, np.column_stack([apart, noise])))
    return _times(np.median(gains, axis=0)) if gains else 1.0


def _largest_gains(columns: Matrix, targets: Matrix) -> Vector:
    """The largest gain of any column alone, in each of the targets; 0 where no column is left."""
    size = np.linalg.norm(columns, axis=0)
    columns = columns[:, size > 1e-6 * size.max(initial=0.0)]
    columns = columns / np.linalg.norm(columns, axis=0)
    return np.asarray(np.max((columns.T @ targets) ** 2, axis=0, initial=0.0))


def _times(gains: Vector) -> float:
    """Times by which the first gain is above the median of the others, which are of noise; 1 if not beyond them all."""
    own, by_chance = float(gains[0]), gains[1:]
    return own / float(np.median(by_chance)) if own > _BEYOND * float(np.max(by_chance)) else 1.0


def elsewhere(runs: NDArray[np.intp], draw: np.random.Generator) -> NDArray[np.intp]:
    """Rows of which every run is shifted by a quarter to three quarters of it, round its end."""
    rows = np.arange(len(runs))
    for run in np.unique(runs):
        here = np.flatnonzero(runs == run)
        rows[here] = np.roll(here, int(draw.integers(len(here) // 4, 3 * len(here) // 4 + 1)))
    return rows


def tempered(bench: Bench, times: float) -> Bench:
    """The bench with noise of `times` the variance, its target and its shapes smaller accordingly."""
    if times == 1.0:
        return bench
    size = float(np.sqrt(times))
    calm = replace(bench.with_noise(NoiseModel(bench.noise.phi, bench.noise.sd * size)), is_misfit=True)
    return calm if bench.pseudo_target is None else replace(calm, pseudo_target=bench.pseudo_target / size)


#: Robust standard deviations beyond which a reading counts no more: 95 % efficient where the noise is normal.
_BEND = 1.345
_WORTH = 0.9  #: Share of the noise's variance that must be saved; of normal noise nothing is.


def with_pseudo_target(bench: Bench, chosen: Sequence[int]) -> Bench:
    """The bench with Huber's pseudo-values for the target, if its noise has heavy tails.

    Beside the `chosen` candidates a whitened residual r counts as ψ(r)/E ψ′, with ψ the residual up to a bend, whose
    variance is E ψ²/(E ψ′)² (P. J. Huber, Robust Statistics, 1981, sections 7.3 and 7.6). Least squares on these
    values is the robust estimate, to first order in what is still missing.
    """
    base = bench.base(chosen)
    if len(base) <= 2 * base.shape[1]:
        return bench
    fit = base @ least_squares(base, bench.white_target)
    left = bench.white_target - fit
    bend = _BEND * 1.4826 * float(np.median(np.abs(left - np.median(left))))
    inside = float(np.mean(np.abs(left) < bend))
    variance = float(np.mean(left**2))
    if bend <= 0.0 or inside <= 0.0 or variance <= 0.0:
        return bench
    pseudo = np.clip(left, -bend, bend) / inside
    saved = float(np.mean(pseudo**2)) / variance
    if saved >= _WORTH:
        return bench
    size = float(np.sqrt(saved))
    quieter = bench.with_noise(NoiseModel(bench.noise.phi, bench.noise.sd * size))
    return replace(quieter, pseudo_target=(fit + pseudo) / size)
