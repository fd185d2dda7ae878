"""The groups of sensors at level λ, and at every other level."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import overload

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.special import fdtri

from selector.errors import InputError, OptionError
from selector.sensors.cohesion import FStatistic, chaining_findings, f_of_scatter, f_statistic
from selector.sensors.fuzzy import closure_chain
from selector.sensors.similarity import sensor_names

__all__ = [
    "Dendrogram",
    "FStatistic",
    "LambdaAxis",
    "LambdaStep",
    "Partition",
    "chaining_findings",
    "dendrogram",
    "f_statistic",
    "lambda_axis",
    "lambda_cut",
]


@dataclass(frozen=True)
class Partition:
    """A division of n sensors into groups.

    Two partitions are equal when the same sensors are grouped in the same way, whatever the level.

    Attributes
    ----------
    labels : tuple of int
        Group of each sensor. Any labels may be given; they are numbered anew in first-seen order.
    level : float
        The λ of the cut.
    names : tuple of str
        Names of the sensors; x0, x1, … when none are given.
    """

    labels: tuple[int, ...]
    level: float = field(compare=False)
    names: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        numbers: dict[int, int] = {}
        labels = tuple(numbers.setdefault(int(label), len(numbers)) for label in self.labels)
        object.__setattr__(self, "labels", labels)
        object.__setattr__(self, "names", sensor_names(self.names, len(labels)))

    @cached_property
    def members(self) -> tuple[tuple[int, ...], ...]:
        """Indices of the sensors of each group, groups in order of their first sensor."""
        found: list[list[int]] = [[] for _ in range(len(set(self.labels)))]
        for sensor, label in enumerate(self.labels):
            found[label].append(sensor)
        return tuple(tuple(group) for group in found)

    @property
    def groups(self) -> tuple[tuple[str, ...], ...]:
        """Names of the sensors of each group, groups in order of their first sensor."""
        return tuple(tuple(self.names[sensor] for sensor in group) for group in self.members)

    def is_nested_in(self, other: Partition) -> bool:
        """Whether every group lies within one group of `other`; a partition is nested in itself.

        Raises
        ------
        InputError
            The two are not partitions of the same sensors.
        """
        if self.names != other.names:
            raise InputError(
                f"partitions of {len(self.names)} and {len(other.names)} sensors with different names",
                expected="two partitions of the same sensors in the same order",
                where="partitions",
                advice="cut the same similarity at both levels",
            )
        return len(set(zip(self.labels, other.labels, strict=True))) == len(self.members)


@dataclass(frozen=True)
class LambdaStep:
    """All λ in (low, high] cut the same partition; `f` is None for one group and for n groups, where it has no sense.

    The lowest step reaches down to −1 and includes it.
    """

    low: float
    high: float
    partition: Partition
    f: FStatistic | None


@dataclass(frozen=True)
class LambdaAxis(Sequence[LambdaStep]):
    """Every distinct λ-cut, from the finest partition to one group; each is nested in the next.

    A sequence of `LambdaStep`, whose partitions are made when asked for. The finest partition is all sensors alone,
    unless some have similarity exactly 1.

    Attributes
    ----------
    order : tuple of int
        Sensors such that the groups of every cut are contiguous.
    levels : tuple of float
        levels[k] is the closure level that links order[k] and order[k + 1].
    highs : tuple of float
        Upper end of the λ-interval of each step, descending.
    f_statistics : tuple of FStatistic or None
        One per step.
    names : tuple of str
        Names of the sensors.
    """

    order: tuple[int, ...]
    levels: tuple[float, ...]
    highs: tuple[float, ...]
    f_statistics: tuple[FStatistic | None, ...]
    names: tuple[str, ...]

    def __len__(self) -> int:
        return len(self.highs)

    @overload
    def __getitem__(self, index: int) -> LambdaStep: ...
    @overload
    def __getitem__(self, index: slice) -> tuple[LambdaStep, ...]: ...
    def __getitem__(self, index: int | slice) -> LambdaStep | tuple[LambdaStep, ...]:
        if isinstance(index, slice):
            return tuple(self[i] for i in range(*index.indices(len(self))))
        i = range(len(self))[index]
        high = self.highs[i]
        labels = _labels_at(np.asarray(self.order), np.asarray(self.levels), high)
        low = self.highs[i + 1] if i + 1 < len(self) else -1.0
        return LambdaStep(low, high, Partition(labels, high, self.names), self.f_statistics[i])

    def __iter__(self) -> Iterator[LambdaStep]:
        return (self[i] for i in range(len(self)))

    def at(self, level: float) -> LambdaStep:
        """The step whose interval holds λ = `level`."""
        _checked_level(level)
        return self[max(i for i, high in enumerate(self.highs) if level <= high)]

    def strongest(self, alpha: float = 0.05) -> LambdaStep | None:
        """The step whose F exceeds the critical value F_α(r − 1, n − r) most, (F − F_α) / F_α; None if none does.

        Infinite F (groups of exact duplicates) does not compete: remove duplicates first. A heuristic, as the
        p-value is: see `selector.sensors.cohesion.f_statistic`.
        """
        excess: dict[int, float] = {}
        for i, f in enumerate(self.f_statistics):
            if f is not None and math.isfinite(f.value):
                critical = float(fdtri(f.between_df, f.within_df, 1 - alpha))
                excess[i] = (f.value - critical) / critical
        best = max(excess, key=lambda i: excess[i], default=None)
        return self[best] if best is not None and excess[best] > 0 else None


@dataclass(frozen=True, eq=False)
class Dendrogram:
    """Merges of groups as λ falls.

    Attributes
    ----------
    linkage : ndarray of shape (n_sensors − 1, 4)
        SciPy's linkage matrix, single linkage, heights 1 − level.
    levels : ndarray of shape (n_sensors − 1,)
        Exact closure level of each merge, descending. Cut by these: 1 − (1 − level) has other bits than level.
    leaf_order : tuple of int
        Sensors from left to right, without crossings.
    """

    linkage: NDArray[np.float64]
    levels: NDArray[np.float64]
    leaf_order: tuple[int, ...]


def lambda_cut(similarity: ArrayLike, level: float, names: Sequence[str] = ()) -> Partition:
    """Groups of sensors with t_ij ≥ `level` in the transitive closure, P step 3.

    `similarity` of shape (n_sensors, n_sensors) may be the relation or its closure; the cut is the same. A cut
    exactly at a closure level is exact: nothing is computed but comparisons.

    Raises
    ------
    InputError
        As for `selector.sensors.fuzzy.closure_chain`.
    OptionError
        The level is not within [-1, 1].
    """
    _checked_level(level)
    chain = closure_chain(similarity)
    return Partition(_labels_at(chain.order, chain.levels, level), float(level), tuple(names))


def lambda_axis(similarity: ArrayLike, names: Sequence[str] = ()) -> LambdaAxis:
    """Every distinct λ-cut of a relation of shape (n_sensors, n_sensors), with its F-statistic; O(n²) for all.

    Raises
    ------
    InputError
        As for `selector.sensors.fuzzy.closure_chain`.
    """
    s = np.asarray(similarity, dtype=np.float64)
    chain = closure_chain(s)
    n = len(chain.order)
    highs = sorted({1.0, *(float(level) for level in chain.levels)}, reverse=True)
    # groups are intervals of the chain: merging two adds one off-diagonal block to the sum inside groups
    ordered = s[np.ix_(chain.order, chain.order)]
    total = n - ordered.sum() / n
    stop_of = {start: start + 1 for start in range(n)}
    start_of = {stop: start for start, stop in stop_of.items()}
    inside = np.ones(n)
    within = 0.0
    merges = iter(np.argsort(-chain.levels, kind="stable"))
    waiting = next(merges, None)
    statistics: list[FStatistic | None] = []
    for high in highs:
        while waiting is not None and chain.levels[waiting] >= high:
            middle = int(waiting) + 1
            start, stop = start_of.pop(middle), stop_of.pop(middle)
            grown = inside[start] + inside[middle] + 2 * ordered[start:middle, middle:stop].sum()
            within += inside[start] / (middle - start) + inside[middle] / (stop - middle) - grown / (stop - start)
            inside[start], stop_of[start], start_of[stop] = grown, stop, start
            waiting = next(merges, None)
        statistics.append(f_of_scatter(total, within, n, len(stop_of)))
    return LambdaAxis(
        order=tuple(chain.order.tolist()),
        levels=tuple(chain.levels.tolist()),
        highs=tuple(highs),
        f_statistics=tuple(statistics),
        names=sensor_names(names, n),
    )


def dendrogram(similarity: ArrayLike) -> Dendrogram:
    """Single-linkage tree of a relation of shape (n_sensors, n_sensors), for figures.

    Raises
    ------
    InputError
        As for `selector.sensors.fuzzy.closure_chain`.
    """
    chain = closure_chain(similarity)
    n = len(chain.order)
    merges = np.argsort(-chain.levels, kind="stable")
    linkage = np.empty((n - 1, 4))
    stop_of = {start: start + 1 for start in range(n)}
    start_of = {stop: start for start, stop in stop_of.items()}
    node = dict(enumerate(chain.order.tolist()))
    for row, k in enumerate(merges.tolist()):
        start, stop = start_of.pop(k + 1), stop_of.pop(k + 1)
        linkage[row] = node[start], node[k + 1], 1 - chain.levels[k], stop - start
        node[start], stop_of[start], start_of[stop] = n + row, stop, start
    levels = chain.levels[merges]
    linkage.setflags(write=False)
    levels.setflags(write=False)
    return Dendrogram(linkage, levels, tuple(chain.order.tolist()))


def _labels_at(order: NDArray[np.int64], levels: NDArray[np.float64], level: float) -> tuple[int, ...]:
    labels = np.empty(len(order), dtype=np.int64)
    labels[order] = np.concatenate(([0], np.cumsum(levels < level)))
    return tuple(labels.tolist())


def _checked_level(level: float) -> None:
    if not -1 <= level <= 1:
        raise OptionError(
            f"λ = {level}",
            expected="a level within [-1, 1]; similarities lie there",
            where="λ",
            advice="choose a level such as 0.995, or auto",
        )
