"""Coefficients of machines of one type: their mean, how far machines are apart, what few runs of another one add."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.stats import f

from selector.types import Array, Mask

FEWEST = 3  #: Machines of a type; fewer stand alone.
UNLIKE = 0.05  #: Probability with which a machine like the others is taken for one that is not, at most.
ALONE = 0.01  #: Probability with which one of a type is left out of what is learnt, as it stands alone.
MUCH_MORE_LIKELY = 10.0  #: Difference of the Bayesian information criterion (Kass & Raftery 1995).
_STEPS, _STILL = 300, 1e-3  #: Of the search for the covariance, and the relative change that ends it.
_RANK = 1e-10


@dataclass(frozen=True)
class Evidence:
    """What the runs of one machine say about its coefficients."""

    normal: Array  #: (k, k): W'W over its samples, W = [1, columns]
    right: Array  #: (k,): W'y
    noise_um2: float  #: How far runs are apart, as the variance of a sample; NaN of a single run

    @classmethod
    def of(cls, products: Array) -> "Evidence":
        """From the cross-products of [1, columns, response] in each run, shape (n_runs, k + 1, k + 1).

        Neighbouring samples are all but copies of each other, so the run is the unit of the noise: the sums W'(y − Wb)
        of runs scatter by more than their samples tell, and the variance is larger by as much.
        """
        normal, right = products[:, :-1, :-1], products[:, :-1, -1]
        total = normal.sum(axis=0)
        size = np.sqrt(np.maximum(np.diag(total), 1e-300))
        inverse = np.linalg.pinv(total / size / size[:, None], _RANK, hermitian=True) / size / size[:, None]
        scores, share = right - normal @ (inverse @ right.sum(axis=0)), inverse @ normal
        free = float(np.trace(share.sum(axis=0)) - np.einsum("rij,rji->", share, share))
        noise = float(np.einsum("ri,ij,rj->", scores, inverse, scores)) / free if free > 1e-6 else float("nan")
        return cls(total, right.sum(axis=0), noise)


@dataclass(frozen=True)
class Population:
    """Coefficients of a type of machines: normal, with this mean and covariance."""

    members: tuple[int, ...]  #: Positions of its machines
    mean: Array  #: (k,)
    covariance: Array  #: (k, k): Of a further machine: between machines, and what is not known of the mean
    noise_um2: float  #: How far runs of a machine are apart, as the variance of a sample

    @property
    def limit(self) -> float:
        """Distance beyond which a machine is unlike these."""
        return self.distance_beyond(UNLIKE)

    def distance_beyond(self, probability: float) -> float:
        """That few of such machines are farther than this: Hotelling's T², by so few members."""
        return float(f.isf(probability, len(self.mean), max(len(self.members) - 1, 1)))

    def posterior(self, evidence: Evidence) -> tuple[Array, Array]:
        """Coefficients of one more machine, and their covariance."""
        noise = float(np.fmax(evidence.noise_um2, self.noise_um2))
        spread = _posterior_covariance(self.covariance, evidence.normal / noise)
        return self.mean + spread @ (evidence.right - evidence.normal @ self.mean) / noise, spread

    def distance(self, evidence: Evidence) -> float:
        """Squared Mahalanobis distance of a machine's runs, for each coefficient: about 1 of a machine of this type."""
        rest = evidence.right - evidence.normal @ self.mean
        size = np.sqrt(np.maximum(np.diag(evidence.normal), 1e-300))
        spread = evidence.normal @ self.covariance @ evidence.normal + self.noise_um2 * evidence.normal
        inverse = np.linalg.pinv(spread / size / size[:, None], _RANK, hermitian=True)
        return float(rest / size @ inverse @ (rest / size)) / len(rest)


def population_of(machines: Sequence[Evidence]) -> Population:
    """The population that these machines are from: restricted maximum likelihood by expectation and maximisation.

    The mean is that of generalised least squares; a machine whose runs are farther apart than usual counts less.
    """
    noise = np.array([one.noise_um2 for one in machines])
    usual = float(np.nanmedian(noise)) if np.isfinite(noise).any() else 0.0
    usual = max(usual, 1e-12)
    noise = np.fmax(noise, usual)
    a = np.array([one.normal for one in machines]) / noise[:, None, None]
    b = np.array([one.right for one in machines]) / noise[:, None]
    own = np.array([np.linalg.lstsq(one.normal, one.right, rcond=_RANK)[0] for one in machines])
    covariance = np.diag(own.var(axis=0) + 1e-12)
    for _ in range(_STEPS):
        spread = _posterior_covariance(covariance, a)
        seen = spread @ a
        turned = np.swapaxes(seen, 1, 2)
        of_mean = np.linalg.pinv((a - a @ seen).sum(axis=0), 1e-12, hermitian=True)
        mean = of_mean @ (b - np.einsum("mij,mj->mi", turned, b)).sum(axis=0)
        apart = np.einsum("mij,mj->mi", spread, b - a @ mean)
        found = (apart[:, :, None] * apart[:, None, :] + spread + seen @ of_mean @ turned).mean(axis=0)
        change = float(np.abs(found - covariance).max() / np.abs(found).max())
        covariance = found
        if change < _STILL:
            break
    return Population(tuple(range(len(machines))), mean, covariance + of_mean, usual)


def parted(machines: Sequence[Evidence]) -> tuple[Population, tuple[tuple[int, ...], ...]]:
    """The population of these machines without those that stand alone, and the one or two types that they fall into.

    Fewer than `FEWEST` machines that differ from all others are no type, and nothing is learnt from them.
    """
    members = list(range(len(machines)))
    while True:
        kept = [machines[i] for i in members]
        whole = replace(population_of(kept), members=tuple(members))
        apart = _apart(kept, whole) if len(kept) > FEWEST else np.zeros(len(kept), dtype=np.bool_)
        types = [tuple(i for i, of in zip(members, apart, strict=True) if of == part) for part in (False, True)]
        large, small = sorted(types, key=len, reverse=True)
        few = small if 0 < len(small) < FEWEST <= len(large) else _alone(machines, whole)
        if not few:
            return whole, (large, small) if small else (large,)
        members = [i for i in members if i not in few]


def _alone(machines: Sequence[Evidence], whole: Population) -> tuple[int, ...]:
    """The machine that is farthest from this population, if it is unlike all others of it."""
    if len(whole.members) <= FEWEST:
        return ()
    farthest = max(whole.members, key=lambda i: whole.distance(machines[i]))
    members = tuple(i for i in whole.members if i != farthest)
    others = replace(population_of([machines[i] for i in members]), members=members)
    is_unlike = others.distance(machines[farthest]) > others.distance_beyond(ALONE / len(whole.members))
    return (farthest,) if is_unlike else ()


def _apart(machines: Sequence[Evidence], whole: Population) -> Mask:
    """Which machines are of another type than the others, shape (n_machines,).

    Two normal distributions are much more likely than one for what their coefficients predict, in one of the three
    directions in which that differs most.
    """
    from sklearn.mixture import GaussianMixture  # takes a second

    metric = sum(one.normal / max(one.normal[0, 0], 1.0) for one in machines) / len(machines)
    values, vectors = np.linalg.eigh(metric)
    predicted = np.array([whole.posterior(one)[0] for one in machines]) @ vectors * np.sqrt(np.maximum(values, 0.0))
    left, size, _ = np.linalg.svd(predicted - predicted.mean(axis=0), full_matrices=False)
    best, apart = MUCH_MORE_LIKELY, np.zeros(len(machines), dtype=np.bool_)
    for scores in (left * size).T[:3, :, None]:
        one, two = (GaussianMixture(n, covariance_type="tied", random_state=0).fit(scores) for n in (1, 2))
        gain = one.bic(scores) - two.bic(scores)
        if gain > best:
            best, apart = gain, two.predict(scores) == 1
    return apart


def _posterior_covariance(prior: Array, precision: Array) -> Array:
    """(prior⁻¹ + precision)⁻¹ without an inverse of the prior, which may be singular; shape of `precision`."""
    values, vectors = np.linalg.eigh(prior)
    root = vectors * np.sqrt(np.maximum(values, 0.0))
    return np.asarray(root @ np.linalg.inv(np.eye(len(prior)) + root.T @ precision @ root) @ root.T)
