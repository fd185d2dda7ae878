"""Which columns to keep: the exact best subsets of every size, with proof.

A branch and bound for each size over the perspective relaxation; see docs/explanation/best-subset-search.md. Only
the cross-products are used, so the cost does not depend on the number of samples.
"""

from __future__ import annotations

import os
from collections.abc import Iterable
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from selector.models.best_subsets import _nodes as nodes
from selector.models.best_subsets._algebra import DROPPED, KEPT
from selector.models.best_subsets._start import starting_sets
from selector.models.best_subsets._tree import FULL, PAUSED, search
from selector.models.best_subsets.cross_products import rss_from_factor
from selector.models.best_subsets.problem import CHUNK_WORK, Problem, valid_diagonal
from selector.models.best_subsets.results import Subset, SubsetSearch

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
    intercept: bool = True,
    factor: NDArray[np.float64] | None = None,
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
    must : iterable of int
        Columns that are in every set.
    factor : array of shape (p + 1, p + 1), optional
        `factor_from_rows` of the same samples: the reported RSS are then computed from it, to more digits.

    Raises
    ------
    InputError
        The matrix or a column number cannot be used.
    """
    problem = Problem.of(cross, n_samples, must, intercept, n_best, max_size)
    p, top = problem.n_columns, problem.max_size
    best_rss = np.full((p + 1, n_best), np.inf)
    best_state = np.full((p + 1, n_best, p), DROPPED, dtype=np.int8)
    state, swept, pace = np.zeros(p, np.int8), np.zeros((p + 1, p + 1)), np.zeros(4, np.int64)
    start = (problem.gram, problem.cross, problem.root, top, best_rss, best_state, state, swept, pace)
    while not starting_sets(*start, CHUNK_WORK):
        pass
    diagonal, findings = valid_diagonal(problem)
    scratch, statistics = problem.scratch(), problem.statistics()
    by_size: dict[int, tuple[Subset, ...]] = {}
    visited = 0
    for size in range(max(1, problem.n_must), top + 1):
        visited += _searched(problem, size, diagonal, scratch, best_rss[size], best_state[size])
        found = []
        for rss, kept in zip(best_rss[size], best_state[size] == KEPT, strict=True):
            if np.isfinite(rss):
                columns = tuple(np.flatnonzero(kept).tolist())
                total = float(rss) * problem.sst if factor is None else rss_from_factor(factor, columns)
                found.append(Subset(columns, *statistics.of(total, len(columns))))
        if found:
            by_size[size] = tuple(found)
    return SubsetSearch(by_size, visited, findings)


def _searched(
    problem: Problem,
    size: int,
    diagonal: NDArray[np.float64],
    scratch: nodes.Scratch,
    best_rss: NDArray[np.float64],
    best_state: NDArray[np.int8],
) -> int:
    """Completes the lists of the best sets of one size; the nodes that were visited for it."""
    tree = problem.tree(64)
    nodes.push(tree, problem.root, np.ones(problem.n_columns + 1), 0.0, 1.0, False)
    most = max(MAX_OPEN_NODES, 2 * problem.n_columns + 40)
    outcome = PAUSED
    while outcome in (PAUSED, FULL):
        tree = problem.larger(tree) if outcome == FULL else tree
        outcome = search(
            problem.gram, problem.cross, size, diagonal, tree, scratch, best_rss, best_state, most, CHUNK_WORK
        )
    return int(tree.counters[nodes.NODES])
