"""What a subset search returns, as values."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any, TypeVar

from selector.errors import InputError
from selector.findings import Finding
from selector.models.subset_scores import CRITERIA, Criterion, adjusted_r2, aicc, bic, mallows_cp


@dataclass(frozen=True)
class Subset:
    """One set of columns.

    Attributes
    ----------
    columns : tuple of int
        Sorted column numbers.
    rss : float
        Residual sum of squares, in squared units of the response.
    r2, adjusted_r2, aicc, bic, cp : float
        See `selector.models.subset_scores`; NaN where the samples do not suffice.
    """

    columns: tuple[int, ...]
    rss: float
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
class SearchProgress:
    """How far a search is: proved of all sizes; the size at work, its relative gap; nodes so far; time [s]."""

    proved_sizes: int
    sizes: int
    size: int
    gap: float
    nodes: int
    seconds: float


@dataclass(frozen=True)
class SubsetSearch:
    """The best subsets of every size, best first, and what was proved about them.

    Attributes
    ----------
    by_size : mapping of int to tuple of Subset
        A size is missing when no set of that size is allowed (or, if stopped, none was found).
    proved : bool
        Every list is complete: no set that is not in it has an RSS below that of its last one, by more than 1e-9 of it.
    gap : mapping of int to float
        (RSS found - proved lower bound) / RSS found of the best set: 0.0 where proved, 1.0 where nothing is known.
    lower_bound : mapping of int to float
        Proved lower bound on the RSS of each size; infinite when it is proved that no set is allowed.
    nodes : int
        Nodes of the search tree visited.
    seconds : float
        Time taken [s].
    findings : tuple of Finding
        Constant and linearly dependent columns.
    """

    by_size: Mapping[int, tuple[Subset, ...]]
    proved: bool
    gap: Mapping[int, float]
    lower_bound: Mapping[int, float]
    nodes: int
    seconds: float
    findings: tuple[Finding, ...] = ()

    def __getstate__(self) -> dict[str, Any]:
        return _picklable(vars(self))

    def best(self, criterion: Criterion = "adjusted_r2") -> Subset:
        """The best subset over all sizes: largest adjusted R², or smallest AICc, BIC or Cp; ties to the smaller set.

        Raises
        ------
        InputError
            The criterion is unknown, or not available at any size.
        """
        return best_of([subset for _, sets in sorted(self.by_size.items()) for subset in sets], criterion)


@dataclass(frozen=True)
class Coverage:
    """All sets of one number of sensors: evaluated one by one, excluded by a bound, too expensive, still open."""

    evaluated: int
    bounded: int
    unaffordable: int
    left: int

    @property
    def total(self) -> int:
        """Number of sets there are."""
        return self.evaluated + self.bounded + self.unaffordable + self.left


@dataclass(frozen=True)
class SensorSetSearch:
    """The best sensor sets of every number of sensors, best first; fields as in `SubsetSearch`.

    Attributes
    ----------
    coverage : mapping of int to Coverage
        How every set of each number of sensors was dealt with.
    """

    by_size: Mapping[int, tuple[SensorSet, ...]]
    proved: bool
    gap: Mapping[int, float]
    lower_bound: Mapping[int, float]
    coverage: Mapping[int, Coverage]
    nodes: int
    seconds: float
    findings: tuple[Finding, ...] = ()

    def __getstate__(self) -> dict[str, Any]:
        return _picklable(vars(self))

    def best(self, criterion: Criterion = "adjusted_r2") -> SensorSet:
        """The best sensor set over all numbers of sensors; as `SubsetSearch.best`."""
        return best_of([found for _, sets in sorted(self.by_size.items()) for found in sets], criterion)


def _picklable(fields: Mapping[str, Any]) -> dict[str, Any]:
    """Read-only views cannot be pickled; what comes back has plain dictionaries in their place."""
    return {name: dict(value) if isinstance(value, MappingProxyType) else value for name, value in fields.items()}


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
