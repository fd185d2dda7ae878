"""What a subset search returns, and the criteria that rank subsets of different size."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any, Literal, TypeVar

from selector.errors import InputError
from selector.findings import Finding

Criterion = Literal["adjusted_r2", "aicc", "bic", "cp"]
CRITERIA: tuple[Criterion, ...] = ("adjusted_r2", "aicc", "bic", "cp")


def adjusted_r2(r2: float, n_samples: float, n_terms: int, intercept: bool = True) -> float:
    """R² corrected for the number of terms (P §5: R'² = 1 - (m-1)/(m-p-1)·(1 - R²), m samples, p terms).

    Without an intercept the formula changes to 1 - m/(m-p)·(1 - R²), **and so does R² itself**: it then measures
    against zero instead of the mean. Never rank models with and without an intercept together by it.

    `n_terms` does not count the intercept. NaN when there are not more samples than coefficients.
    """
    free = n_samples - n_terms - intercept
    return 1.0 - (n_samples - intercept) / free * (1.0 - r2) if free > 0 else math.nan


def aicc(rss: float, n_samples: float, n_terms: int, intercept: bool = True) -> float:
    """Akaike's criterion with the small-sample correction (Hurvich and Tsai 1989), up to a constant of the data.

    The noise variance counts as a parameter. NaN when there are too few samples for the correction.
    """
    k = n_terms + intercept + 1
    free = n_samples - k - 1
    return _deviance(rss, n_samples) + 2.0 * k + 2.0 * k * (k + 1) / free if free > 0 else math.nan


def bic(rss: float, n_samples: float, n_terms: int, intercept: bool = True) -> float:
    """Schwarz's criterion, up to a constant of the data; the noise variance counts as a parameter."""
    return _deviance(rss, n_samples) + (n_terms + intercept + 1) * math.log(n_samples)


def mallows_cp(rss: float, n_samples: float, n_terms: int, noise_variance: float, intercept: bool = True) -> float:
    """Mallows' Cp = RSS/σ² - m + 2·(number of coefficients); NaN when σ² of the full model is not known."""
    if not noise_variance > 0.0:
        return math.nan
    return rss / noise_variance - n_samples + 2.0 * (n_terms + intercept)


def _deviance(rss: float, n_samples: float) -> float:
    return n_samples * math.log(rss / n_samples) if rss > 0.0 else -math.inf


@dataclass(frozen=True)
class Subset:
    """One set of columns."""

    columns: tuple[int, ...]  #: Sorted column numbers
    rss: float  #: Residual sum of squares, in squared units of the response
    #: r2, adjusted_r2, aicc, bic and cp: see `best_subsets.results`; NaN where the samples do not suffice
    r2: float
    adjusted_r2: float
    aicc: float
    bic: float
    cp: float


@dataclass(frozen=True)
class SensorSet(Subset):
    """One set of sensors, with the columns that it brings; the criteria count columns, not sensors."""

    sensors: tuple[int, ...]


@dataclass(frozen=True)
class SubsetSearch:
    """The best subsets of every size, best first, and what was proved about them."""

    #: A size is missing when no set of that size is allowed (or, if stopped, none was found)
    by_size: Mapping[int, tuple[Subset, ...]]
    #: Every list is complete: no set that is not in it has an RSS below that of its last one, by more than 1e-9 of it
    proved: bool
    #: (RSS found - proved lower bound) / RSS found of the best set: 0.0 where proved, 1.0 where nothing is known
    gap: Mapping[int, float]
    #: Proved lower bound on the RSS of each size; infinite when it is proved that no set is allowed
    lower_bound: Mapping[int, float]
    nodes: int  #: Nodes of the search tree visited
    seconds: float  #: Time taken [s]
    findings: tuple[Finding, ...] = ()  #: Constant and linearly dependent columns

    def __getstate__(self) -> dict[str, Any]:
        """Read-only views cannot be pickled; what comes back has plain dictionaries in their place."""
        return {name: dict(of) if isinstance(of, MappingProxyType) else of for name, of in vars(self).items()}

    def best(self, criterion: Criterion = "adjusted_r2") -> Subset:
        """The best subset over all sizes: largest adjusted R², or smallest AICc, BIC or Cp; ties to the smaller set.

        Raises InputError: the criterion is unknown, or not available at any size.
        """
        return best_of([subset for _, sets in sorted(self.by_size.items()) for subset in sets], criterion)


@dataclass(frozen=True)
class Coverage:
    """All sets of one number of sensors: evaluated one by one, excluded by a bound, still open."""

    evaluated: int
    bounded: int
    left: int


@dataclass(frozen=True, kw_only=True)
class SensorSetSearch(SubsetSearch):
    """The best sensor sets of every number of sensors, best first."""

    by_size: Mapping[int, tuple[SensorSet, ...]]
    coverage: Mapping[int, Coverage]  #: How every set of each number of sensors was dealt with


S = TypeVar("S", bound=Subset)


def best_of(sets: list[S], criterion: Criterion) -> S:
    """The first set of the best value."""
    if criterion not in CRITERIA:
        raise InputError(
            f"criterion {criterion!r}",
            expected="one of " + ", ".join(CRITERIA),
            where="subset search",
            advice="choose one of these criteria",
        )
    sign = -1.0 if criterion == "adjusted_r2" else 1.0
    known = [one for one in sets if not math.isnan(getattr(one, criterion))]
    if not known:
        raise InputError(
            f"no subset with a value of {criterion}",
            expected="more samples than coefficients",
            where="subset search",
            advice="use more samples, or another criterion",
        )
    return min(known, key=lambda one: sign * float(getattr(one, criterion)))


@dataclass(frozen=True)
class Statistics:
    """What turns an RSS into the criteria: total sum of squares, samples, intercept, variance of the full model."""

    sst: float
    n_samples: float
    intercept: bool
    noise_variance: float

    def of(self, rss: float, n_terms: int) -> tuple[float, float, float, float, float, float]:
        """RSS, R², adjusted R², AICc, BIC and Cp."""
        n, intercept = self.n_samples, self.intercept
        r2 = 1.0 - rss / self.sst
        return (
            rss,
            r2,
            adjusted_r2(r2, n, n_terms, intercept),
            aicc(rss, n, n_terms, intercept),
            bic(rss, n, n_terms, intercept),
            mallows_cp(rss, n, n_terms, self.noise_variance, intercept),
        )
