"""Which columns to keep: the exact best subsets of every size, with proof or with the gap that is left.

A branch and bound for each size over the perspective relaxation; see docs/explanation/best-subset-search.md. Only
the cross-products are used, so the cost does not depend on the number of samples.
"""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from types import MappingProxyType

import numpy as np
from numpy.typing import ArrayLike, NDArray

from selector.models.best_subsets import _nodes as nodes
from selector.models.best_subsets._algebra import DROPPED, KEPT
from selector.models.best_subsets._start import starting_sets
from selector.models.best_subsets._tree import DONE, FULL, PROOF_TOLERANCE, search
from selector.models.best_subsets.cross_products import cross_products, factor_from_rows, rss_from_factor
from selector.models.best_subsets.problem import CHUNK_WORK, Cancel, Problem, is_set, relative_gap, valid_diagonal
from selector.models.best_subsets.results import (
    Coverage,
    SearchProgress,
    SensorSet,
    SensorSetSearch,
    Statistics,
    Subset,
    SubsetSearch,
    adjusted_r2,
    aicc,
    bic,
    mallows_cp,
)
from selector.models.best_subsets.sensor_sets import best_sensor_sets

__all__ = [
    "Coverage",
    "SearchProgress",
    "SensorSet",
    "SensorSetSearch",
    "Subset",
    "SubsetSearch",
    "adjusted_r2",
    "aicc",
    "best_sensor_sets",
    "best_subsets",
    "bic",
    "cross_products",
    "factor_from_rows",
    "is_compiled",
    "mallows_cp",
]

MAX_OPEN_NODES = 200_000
"""Open nodes of one size held in memory; beyond it the search goes depth first."""


def is_compiled() -> bool:
    """Whether the compiled search is in its cache; else the first search takes about half a minute longer."""
    places = [Path(__file__).parent / "__pycache__", *map(Path, filter(None, [os.environ.get("NUMBA_CACHE_DIR")]))]
    return any(next(place.rglob("*.nbi"), None) for place in places)


def best_subsets(
    cross: ArrayLike,
    n_samples: float,
    *,
    max_size: int | None = None,
    n_best: int = 1,
    must: Iterable[int] = (),
    never: Iterable[int] = (),
    costs: Sequence[float] | None = None,
    budget: float | None = None,
    intercept: bool = True,
    factor: NDArray[np.float64] | None = None,
    time_limit_s: float | None = None,
    progress: Callable[[SearchProgress], None] | None = None,
    cancel: Cancel | None = None,
) -> SubsetSearch:
    """The exact `n_best` subsets of least residual sum of squares of every size.

    Parameters
    ----------
    cross : array of shape (p + 1, p + 1)
        Cross-products about the means, response last (`cross_products`); about zero if `intercept` is False.
    n_samples : number
        Samples behind `cross`; only the criteria depend on it.
    max_size : int, optional
        Default: all columns, but no more than leave one degree of freedom.
    must, never : iterable of int
        Columns that are in every set, or in none.
    costs, budget : optional
        Price of each column, and the most that a set may cost.
    factor : array of shape (p + 1, p + 1), optional
        `factor_from_rows` of the same samples: the reported RSS are then computed from it, to more digits.
    time_limit_s, progress, cancel
        After the time [s], or when `cancel` is set or returns True, the best so far is returned with its gap. The
        clock and `cancel` are looked at about every 0.02 s; between, no Python runs. KeyboardInterrupt passes through.

    Raises
    ------
    InputError
        The matrix, a column number or a price cannot be used.
    """
    problem = Problem.of(cross, n_samples, must, never, costs, budget, intercept, n_best, max_size)
    started = time.perf_counter()
    p, top = problem.n_columns, problem.max_size
    best_rss = np.full((p + 1, n_best), np.inf)
    best_state = np.full((p + 1, n_best, p), DROPPED, dtype=np.int8)
    limits = (problem.costs, problem.budget)
    state, swept, pace = np.zeros(p, np.int8), np.zeros((p + 1, p + 1)), np.zeros(4, np.int64)
    start = (problem.gram, problem.cross, problem.root, *limits, top, best_rss, best_state, state, swept, pace)

    def out_of_time() -> bool:
        late = time_limit_s is not None and time.perf_counter() - started >= time_limit_s
        return is_set(cancel) or late

    stopped = False
    while not stopped and not starting_sets(*start, CHUNK_WORK):
        stopped = out_of_time()
    diagonal, findings = valid_diagonal(problem)
    scratch = problem.scratch()
    floor = max(1, problem.n_must)
    open_sizes = {size: _SizeSearch(problem, size) for size in range(floor, top + 1)}
    full_rss, rank = problem.full_rss_and_rank()
    bound = dict.fromkeys(open_sizes, full_rss / problem.sst * (1.0 - PROOF_TOLERANCE))
    visited = dict.fromkeys(open_sizes, 0)
    chunks = 0  # a short look at every size comes first
    while open_sizes and not stopped:
        for size in list(open_sizes):
            part = open_sizes[size]
            for _ in range(max(chunks, 1)):
                work = CHUNK_WORK if chunks else CHUNK_WORK // 20
                ended = part.run(problem, diagonal, scratch, best_rss[size], best_state[size], work)
                visited[size] = part.visited
                bound[size] = np.inf if ended else max(bound[size], nodes.open_bound(part.tree))
                if ended:
                    del open_sizes[size]
                if progress is not None:
                    seconds = time.perf_counter() - started
                    gap = relative_gap(best_rss[size, 0], bound[size])
                    done = len(bound) - len(open_sizes)
                    progress(SearchProgress(done, len(bound), size, gap, sum(visited.values()), seconds))
                stopped = out_of_time()
                if ended or stopped:
                    break
            if stopped:
                break
        chunks = max(2 * chunks, 1)
    if problem.unconstrained:  # adding a column never raises the RSS
        for size in sorted(bound)[-2::-1]:
            above = min(bound[size + 1], float(best_rss[size + 1, 0]))
            bound[size] = max(bound[size], above)
    found = [size for size in bound if np.isfinite(best_rss[size, 0])]
    statistics = Statistics(problem.sst, problem.n_samples, intercept, _variance(problem, full_rss, rank))
    by_size = {
        size: tuple(
            _subset(problem, statistics, state, rss, factor)
            for rss, state in zip(best_rss[size], best_state[size], strict=True)
            if np.isfinite(rss)
        )
        for size in found
    }
    return SubsetSearch(
        by_size=MappingProxyType(by_size),
        proved=not open_sizes,
        gap=MappingProxyType({size: relative_gap(best_rss[size, 0], bound[size]) for size in bound}),
        lower_bound=MappingProxyType(
            {size: problem.sst * min(float(best_rss[size, 0]), bound[size]) for size in bound}
        ),
        nodes=sum(visited.values()),
        seconds=time.perf_counter() - started,
        findings=findings,
    )


class _SizeSearch:
    """The open nodes of one size."""

    def __init__(self, problem: Problem, size: int) -> None:
        self.size = size
        self.tree = problem.tree(64)
        nodes.push(self.tree, problem.root, np.ones(problem.n_columns + 1), 0.0, 1.0, False)

    @property
    def visited(self) -> int:
        return int(self.tree.counters[nodes.NODES])

    def run(
        self,
        problem: Problem,
        diagonal: NDArray[np.float64],
        scratch: nodes.Scratch,
        best_rss: NDArray[np.float64],
        best_state: NDArray[np.int8],
        work: int,
    ) -> bool:
        """Work for one chunk; whether no node is open any more."""
        while True:
            outcome = search(
                problem.gram,
                problem.cross,
                self.size,
                problem.costs,
                problem.budget,
                diagonal,
                self.tree,
                scratch,
                best_rss,
                best_state,
                max(MAX_OPEN_NODES, 2 * problem.n_columns + 40),
                work,
            )
            if outcome != FULL:
                return bool(outcome == DONE)
            self.tree = problem.larger(self.tree)


def _variance(problem: Problem, full_rss: float, rank: int) -> float:
    """Noise variance of the model with every column that may be used; NaN without degrees of freedom."""
    free = problem.n_samples - rank - problem.intercept
    return full_rss / free if free > 0 else float("nan")


def _subset(
    problem: Problem,
    statistics: Statistics,
    state: NDArray[np.int8],
    rss: float,
    factor: NDArray[np.float64] | None,
) -> Subset:
    columns = tuple(int(problem.allowed[j]) for j in np.flatnonzero(state == KEPT))
    total = float(rss) * problem.sst if factor is None else rss_from_factor(factor, columns)
    return Subset(columns, *statistics.of(total, len(columns)))
