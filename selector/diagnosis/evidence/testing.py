"""How strongly one response, or several together, ask for every candidate, and what noise alone would have shown."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy import linalg, stats

from selector.diagnosis.effects.effect import Variant
from selector.diagnosis.evidence.moments import Moments, Solved, inverse_of, scores_of_noise, solved
from selector.diagnosis.evidence.response import Bench
from selector.types import Matrix, Vector

_DRAWS = 400
_SHORT = 10
#: At most this many blocks with a sign each, none shorter than `_SHORT` rows: white noise needs no longer ones.
_SIGNED = 150
_CONTRAST = 0.4
#: Of a coefficient, in units of the gain: that of a size that before was known to a factor of about three.
_PRICE = 2.0


@dataclass(frozen=True, eq=False)
class Tested:
    """How one effect stands in one response, beside all that is named already."""

    best: int  #: Number of the candidate that fits best
    #: Fall of the whitened sum of squares by it, all fitted rows, less the price of a shape chosen from the residual
    gain: float
    #: Twice the logarithm of how much more likely the record is with the effect than without: exp((gain − price)/2)
    #: averaged over all its shapes (D. J. C. MacKay, Information Theory, Inference and Learning Algorithms, 2003,
    #: chapter 28). An effect that can take many shapes has to share its evidence among them.
    evidence: float
    noise: Vector  #: (n_draws,): The same of noise alone
    #: What the best shape gains more if its size may differ from run to run; 0 of an effect that acts in one run only
    contrast: float
    freedoms: int  #: Coefficients that `contrast` has more
    #: Largest amount of the fitted course in the response, over its fitted rows [steps of the reading]; infinite if no
    #: step was seen
    largest: float
    shapes: tuple[Variant, ...] = ()  #: All its shapes here
    #: of_shapes and noise_of_shapes: (n_shapes,): Evidence of every shape by itself, of the record and of noise alone,
    #: however likely it was beforehand
    of_shapes: Vector = field(default_factory=lambda: np.empty(0))
    noise_of_shapes: Matrix = field(default_factory=lambda: np.empty((0, 0)))

    @property
    def is_the_same_in_all_runs(self) -> bool:
        """Whether one size fits all runs: the contrast is noise (1 in 1000), or small beside the gain itself."""
        return self.contrast <= max(float(stats.chi2.isf(1e-3, max(self.freedoms, 1))), _CONTRAST * self.gain)


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
    whole = solved(sums)
    numbers = members_of(bench)
    costs = costs_of(bench)
    prices = prices_of(bench)
    worth = whole.gain - prices
    # of those that fit alike, to the rounding, the first
    best_of = {name: int(of[np.argmax(worth[of] > worth[of].max() - 1e-6)]) for name, of in numbers.items()}
    draws = noise_gains(bench, base, sums, noise, seed=seed)
    found = {}
    for name, of in numbers.items():
        best = best_of[name]
        contrast, freedoms = _contrast(bench, sums, best, whole.gain[best])
        found[name] = Tested(
            best=best,
            gain=max(0.0, float(whole.gain[best] - 2.0 * np.log(bench.candidates[best].variant.looked_at))),
            evidence=float(evidence_of(whole.gain[of], prices[of])),
            noise=evidence_of(draws[:, of], prices[of]),
            contrast=contrast,
            freedoms=freedoms,
            largest=_largest(bench, whole, sums, best),
            shapes=tuple(bench.candidates[v].variant for v in of),
            of_shapes=whole.gain[of] - costs[of],
            noise_of_shapes=draws[:, of] - costs[of],
        )
    return found


def members_of(bench: Bench) -> dict[str, NDArray[np.intp]]:
    """Effect → numbers of its candidates."""
    members: dict[str, list[int]] = {}
    for v, candidate in enumerate(bench.candidates):
        members.setdefault(candidate.effect.id, []).append(v)
    return {name: np.array(of, dtype=np.intp) for name, of in members.items()}


def prices_of(bench: Bench) -> Vector:
    """What every candidate has to gain to be as likely as nothing: more if other shapes of the effect are likelier."""
    weights = np.array([candidate.variant.weight for candidate in bench.candidates])
    for of in members_of(bench).values():
        weights[of] /= np.mean(weights[of])
    return np.asarray(costs_of(bench) - 2.0 * np.log(weights))


def costs_of(bench: Bench) -> Vector:
    """What the coefficients of every candidate cost that physics does not say already, and a shape picked by eye."""
    looks = np.array([candidate.variant.looked_at for candidate in bench.candidates])
    free = np.array([_free_coefficients(candidate.variant) for candidate in bench.candidates])
    return np.asarray(_PRICE * free + 2.0 * np.log(looks))


def _free_coefficients(variant: Variant) -> int:
    """Coefficients that are not known to a factor of two beforehand."""
    if variant.bounds is None:
        return len(variant.names)
    return sum(not 0.0 < high < 2.0 * low for low, high in variant.bounds)


def evidence_of(gains: Matrix | Vector, prices: Vector) -> Vector:
    """Twice the logarithm of exp((gain − price)/2), averaged over the shapes along the last axis."""
    return np.asarray(2.0 * (_log_sum(0.5 * (gains - prices)) - np.log(len(prices))))


def _log_sum(of: Matrix | Vector) -> Vector:
    """Log Σ exp over the last axis; of finite numbers `scipy.special.logsumexp` bit for bit, twice as fast."""
    top = of.max(axis=-1, keepdims=True)
    rest = of - top
    at_top = rest == 0.0
    rest[at_top] = -np.inf
    count = at_top.sum(axis=-1)
    return np.asarray(np.log1p(np.exp(rest).sum(axis=-1) / count) + np.log(count) + top[..., 0])


def _largest(bench: Bench, fit: Solved, sums: Moments, v: int) -> float:
    if bench.resolution <= 0.0:
        return np.inf
    q, i = sums.place(v)
    course = (bench.raw(v) @ fit.coefficients[q][i])[bench.fitted]
    return float(np.abs(course - np.median(course)).max()) / bench.resolution


def _contrast(bench: Bench, sums: Moments, v: int, gain: float) -> tuple[float, int]:
    """What candidate `v` gains more with a size of its own in every run, and the coefficients that takes."""
    q, i = sums.place(v)
    group, within = sums.groups[q][i], sums.within[q][:, i]
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


_HALF = float(np.log(0.5))
Key = tuple[object, ...]


def together(evidence: Sequence[Vector | float]) -> Vector:
    """Evidence of responses in each of which the effect is as likely to show as not."""
    return np.asarray(np.sum([2.0 * _shown_or_not(0.5 * np.asarray(one)) for one in evidence], axis=0))


def of_all(tested: Sequence[Tested]) -> tuple[float, Vector]:
    """Evidence of an effect in several responses, and that of noise in every draw.

    As likely as not the shape is the same wherever it shows; then the responses share what choosing it costs.
    """
    apart = together([one.evidence for one in tested])
    apart_noise = together([one.noise for one in tested])
    places = _places_of_shared(tested) if len(tested) > 1 else []
    if not places or not places[0]:
        return float(apart), apart_noise
    same = _of_one_shape([one.of_shapes[at] for one, at in zip(tested, places, strict=True)])
    same_noise = _of_one_shape([one.noise_of_shapes[:, at] for one, at in zip(tested, places, strict=True)])
    return float(_either(apart, same)), _either(apart_noise, same_noise)


def _either(apart: Vector, same: Vector) -> Vector:
    return np.asarray(2.0 * (_HALF + np.logaddexp(0.5 * apart, 0.5 * same)))


def _of_one_shape(evidence: Sequence[Matrix | Vector]) -> Vector:
    """The same averaged over shapes, which are in one order in all responses, along the last axis."""
    total = np.sum([_shown_or_not(0.5 * of) for of in evidence], axis=0)
    return np.asarray(2.0 * (_log_sum(total) - np.log(total.shape[-1])))


def _shown_or_not(half: Vector) -> Vector:
    return np.asarray(_HALF + np.logaddexp(0.0, half))


def _places_of_shared(tested: Sequence[Tested]) -> list[list[int]]:
    """For every response, where among its shapes those stand that all responses have, and have once."""
    keys = [[_key_of(variant) for variant in one.shapes] for one in tested]
    counts = [Counter(of) for of in keys]
    shared = [key for key in keys[0] if all(count[key] == 1 for count in counts)]
    where = [{key: k for k, key in enumerate(of)} for of in keys]
    return [[places[key] for key in shared] for places in where]


def _key_of(variant: Variant) -> Key:
    """What makes a shape the same in another response: run, sources and shape parameters."""
    parameters = tuple(sorted((name, float(f"{one.value:.4g}")) for name, one in variant.shape.items()))
    return (variant.run, variant.regime, tuple(sorted(variant.sources)), len(variant.names), parameters)
