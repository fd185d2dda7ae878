"""Which columns, or which sensors, to keep: the exact best sets of every size, with proof or with the gap that is left.

Columns: a branch and bound for each size over the perspective relaxation; see docs/explanation/best-subset-search.md.
Only the cross-products are used, so the cost does not depend on the number of samples. Sensors may bring several
columns each.
"""

import multiprocessing
import os
import threading
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from contextvars import ContextVar
from functools import partial
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from selector.models.best_subsets import _sensor_tree as tree
from selector.models.best_subsets._algebra import DROPPED, KEPT, insert
from selector.models.best_subsets._start import starting_sets
from selector.models.best_subsets._tree import DONE, FULL, NODES, PROOF_TOLERANCE, WORK, Scratch, push, search
from selector.models.best_subsets._wide import MANY_COLUMNS, WideSearch, better_for_few, curvature, shared_directions
from selector.models.best_subsets.problem import (
    CHUNK_WORK,
    Problem,
    checked_columns,
    cross_products,
    relative_gap,
    require,
    rss_from_factor,
    valid_diagonal,
)
from selector.models.best_subsets.results import Coverage, SensorSet, SensorSetSearch, Statistics, Subset, SubsetSearch
from selector.types import Array

States = NDArray[np.int8]
MAX_OPEN_BYTES = 2**30  #: Memory for the open nodes of all sizes together; beyond it the search goes depth first.


def compile_search() -> None:
    """Compiles the search on a small example, or takes it from its cache: some 15 s the first time, then none."""
    rows = np.random.default_rng(0).normal(size=(40, 9))
    cross = cross_products(rows[:, :8], rows[:, 8])
    best_subsets(cross, len(rows), n_best=2)
    best_sensor_sets(cross, len(rows), [(k,) for k in range(8)], n_sensors=8, max_sensors=3)
    curvature(np.eye(3), np.ones(3), 2, np.ones(3))


#: Set when nobody waits for the searches of this thread any more.
_GIVEN_UP: ContextVar[threading.Event | None] = ContextVar("given_up", default=None)


def _cores() -> int:
    """Threads that searches may use here: a worker of a pool has the other cores' workers beside it."""
    return 1 if multiprocessing.parent_process() else os.cpu_count() or 1


@contextmanager
def side_by_side() -> Iterator[ThreadPoolExecutor]:
    """A thread for each core; the searches that run in them are given up when the block ends, by Ctrl-C too."""
    given_up = threading.Event()
    with ThreadPoolExecutor(_cores(), initializer=_GIVEN_UP.set, initargs=(given_up,)) as threads:
        try:
            yield threads
        finally:
            given_up.set()


def _end(started: float, time_limit_s: float | None) -> Callable[[], bool]:
    """Whether the time is over, or nobody waits any more, whenever it is asked."""
    given_up, end = _GIVEN_UP.get() or threading.Event(), started + (np.inf if time_limit_s is None else time_limit_s)
    return lambda: given_up.is_set() or time.perf_counter() >= end


def best_subsets(
    cross: ArrayLike,
    n_samples: float,
    *,
    max_size: int | None = None,
    n_best: int = 1,
    must: Iterable[int] = (),
    intercept: bool = True,
    factor: Array | None = None,
    time_limit_s: float | None = None,
) -> SubsetSearch:
    """The exact `n_best` subsets of least residual sum of squares of every size.

    `cross`, shape (p + 1, p + 1), are cross-products about the means, response last (`cross_products`); about zero if
    `intercept` is False. Only the criteria depend on `n_samples`. `max_size` is by default as many columns as leave one
    degree of freedom; columns in `must` are in every set. With the `factor_from_rows` of the same samples the reported
    RSS have more digits. After `time_limit_s` the best so far is returned with its gap: every core has its own sizes to
    search and looks at the clock about every 0.02 s. KeyboardInterrupt passes through.

    Raises InputError: the matrix or a column number cannot be used.
    """
    problem = Problem.of(cross, n_samples, must, intercept, n_best, max_size)
    started = time.perf_counter()
    p, top = problem.n_columns, problem.max_size
    best_rss = np.full((p + 1, n_best), np.inf)
    best_state = np.full((p + 1, n_best, p), DROPPED, dtype=np.int8)
    late, is_over = threading.Event(), _end(started, time_limit_s)

    def out_of_time() -> bool:
        if is_over():
            late.set()
        return late.is_set()

    starting_sets(problem, best_rss, best_state, out_of_time)
    diagonal, findings = valid_diagonal(problem)
    sizes = range(max(1, problem.n_must), top + 1)
    parts = {} if out_of_time() else _searches(problem, sizes, diagonal)
    statistics, full_rss = problem.statistics()
    bound = dict.fromkeys(sizes, full_rss / problem.sst * (1.0 - PROOF_TOLERANCE))

    def searched(size: int, scratch: Scratch, work: int) -> None:
        part = parts[size]
        part.run(problem, scratch, best_rss[size], best_state[size], work)
        bound[size] = np.inf if part.ended else max(bound[size], part.open_bound())
        out_of_time()

    # a short look at every size first: closed forms, then from the largest, whose bound holds for the smaller ones, too
    scratch = problem.scratch()
    for size in sorted(parts, key=lambda size: (size > problem.n_must + 2, -size)):
        if not late.is_set():
            searched(size, scratch, CHUNK_WORK // 20)
    open_sizes = [size for size in sizes if size not in parts or not parts[size].ended]
    if open_sizes and not late.is_set():
        node_bytes = 9 * problem.n_columns + 32
        for size in open_sizes:
            parts[size].most = max(parts[size].most, MAX_OPEN_BYTES // (len(open_sizes) * node_bytes))
        spaces = [problem.scratch() for _ in range(min(_cores(), len(open_sizes)))]
        with ThreadPoolExecutor(len(spaces)) as threads:
            try:
                while open_sizes and not late.is_set():
                    # those with the largest gap for the work that they have had
                    open_sizes.sort(key=lambda size: -relative_gap(best_rss[size, 0], bound[size]) / parts[size].spent)
                    list(threads.map(partial(searched, work=CHUNK_WORK), open_sizes, spaces))
                    open_sizes = [size for size in open_sizes if not parts[size].ended]
            finally:
                late.set()
    # adding a column never raises the RSS
    for size in sorted(bound)[-2::-1]:
        bound[size] = max(bound[size], min(bound[size + 1], float(best_rss[size + 1, 0])))
    return SubsetSearch(
        **_of_sizes(problem, bound, best_rss, best_state, partial(_subset, problem, statistics, factor)),
        proved=not open_sizes,
        nodes=sum(part.visited for part in parts.values()),
        seconds=time.perf_counter() - started,
        findings=findings,
    )


def _searches(problem: Problem, sizes: range, diagonal: Array) -> "dict[int, _SizeSearch | WideSearch]":
    """For every size the search whose bound is the better one."""
    parts: dict[int, _SizeSearch | WideSearch] = {}
    few = problem.n_columns >= MANY_COLUMNS
    directions = shared_directions(problem) if few else problem.gram
    for size in sizes:
        few = few and better_for_few(problem, directions, size, diagonal)
        parts[size] = WideSearch(problem, size, directions) if few else _SizeSearch(problem, size, diagonal)
    return parts


class _SizeSearch:
    """The open nodes of one size."""

    def __init__(self, problem: Problem, size: int, diagonal: Array) -> None:
        self.size, self.ended, self.spent, self.visited = size, False, 0, 0
        self.most = 2 * problem.n_columns + 40  #: Open nodes there may be
        self.tree = problem.tree(min(64, self.most))
        push(self.tree, problem.root, np.ones(problem.n_columns), diagonal, 0.0, False)

    def open_bound(self) -> float:
        """The smallest bound of the nodes that are still open."""
        return float(np.min(self.tree.bound, where=self.tree.rank < np.inf, initial=np.inf))

    def run(self, problem: Problem, scratch: Scratch, best_rss: Array, best_state: States, work: int) -> None:
        """Work for one chunk; it has ended when no node is open any more."""
        outcome = FULL
        while outcome == FULL:
            best = best_rss, best_state, self.most, work
            outcome = search(problem.gram, problem.cross, self.size, self.tree, scratch, *best)
            self.spent += work - int(self.tree.counters[WORK])
            if outcome == FULL:
                self.tree = problem.larger(self.tree, self.most)
        self.ended, self.visited = bool(outcome == DONE), int(self.tree.counters[NODES])


def _of_sizes(
    problem: Problem, bound: Mapping[int, float], best_rss: Any, best_state: Any, made: Callable[[States, float], Any]
) -> dict[str, Any]:
    """What a search says of every size: its sets, the gap that is left, and the lower bound of the RSS."""
    least = {size: float(best_rss[size][0]) for size in bound}
    sets = {
        size: tuple(
            made(state, rss) for rss, state in zip(best_rss[size], best_state[size], strict=True) if np.isfinite(rss)
        )
        for size in bound
        if np.isfinite(least[size])
    }
    return {
        "by_size": MappingProxyType(sets),
        "gap": MappingProxyType({size: relative_gap(least[size], bound[size]) for size in bound}),
        "lower_bound": MappingProxyType({size: problem.sst * min(least[size], bound[size]) for size in bound}),
    }


def _subset(problem: Problem, statistics: Statistics, factor: Array | None, state: States, rss: float) -> Subset:
    columns = tuple(np.flatnonzero(state == KEPT).tolist())
    total = float(rss) * problem.sst if factor is None else rss_from_factor(factor, columns)
    return Subset(columns, *statistics.of(total, len(columns)))


def best_sensor_sets(
    cross: ArrayLike,
    n_samples: float,
    owners: Sequence[Sequence[int]],
    *,
    n_sensors: int,
    max_sensors: int,
    n_best: int = 1,
    must: Iterable[int] = (),
    always: Iterable[int] = (),
    time_limit_s: float | None = None,
) -> SensorSetSearch:
    """The exact `n_best` sensor sets of least residual sum of squares for every number of sensors.

    A set of sensors brings every column whose owners are all in it: `owners` are the sensors of each of the p columns,
    (1,) for x1², (1, 2) for x1·x2; () is the same as naming the column in `always`, those of every model. There are
    `n_sensors`, of which a set may have `max_sensors`; those in `must` are in every set. `cross`, `n_samples` and
    `time_limit_s` are those of `best_subsets`.

    Raises InputError: the matrix, an owner or a sensor number cannot be used.
    """
    started = time.perf_counter()
    fixed = set(always)
    problem = Problem.of(cross, n_samples, fixed, True, n_best, np.shape(cross)[0] - 1)
    p = problem.n_columns
    require(len(owners) == p, f"owners of {len(owners)} columns", f"one entry for each of the {p} columns")
    needs = [() if j in fixed else tuple(sorted({int(s) for s in one})) for j, one in enumerate(owners)]
    checked_columns("owners", (s for one in needs for s in one), n_sensors)
    kept = checked_columns("must", must, n_sensors)
    candidates = [s for s in range(n_sensors) if s not in kept]
    least, most = max(1, len(kept)), min(max_sensors, len(kept) + len(candidates))
    require(least <= most, f"max_sensors = {max_sensors}", f"at least {least}, and a sensor that may be used")
    house = _House(problem, needs, n_sensors)
    alone = {s: house.state_and_rss({*kept, s})[1] for s in candidates}
    ranked = np.array(sorted(candidates, key=lambda s: (alone[s], s)), dtype=np.int64)
    statistics, full_rss = problem.statistics()
    best_rss = {size: np.full(n_best, np.inf) for size in range(least, most + 1)}
    best_state = {size: np.full((n_best, n_sensors), DROPPED, np.int8) for size in best_rss}
    coverage: dict[int, Coverage] = {}
    bound: dict[int, float] = {}
    visited, stopped, is_over = 0, False, _end(started, time_limit_s)
    for size in best_rss:
        choose, best = size - len(kept), (best_rss[size], best_state[size])
        if size - 1 in best_rss and np.isfinite(best_rss[size - 1][0]):
            smaller = set(np.flatnonzero(best_state[size - 1][0] == KEPT).tolist())
            for s in set(candidates) - smaller:
                insert(*best, *house.state_and_rss({*smaller, s}))
        path = house.path(kept, choose)
        if choose == 0:
            insert(*best, *house.state_and_rss(kept))
            path.counters[tree.EVALUATED] = 1
        ended = choose == 0
        while not ended and not stopped:
            ended = tree.search_sensors(problem.gram, problem.cross, ranked, choose, path, *best, CHUNK_WORK)
            stopped = not ended and is_over()
        counters = path.counters
        visited += int(counters[tree.VISITED])
        done = int(counters[tree.EVALUATED]), int(counters[tree.BOUNDED])
        coverage[size] = Coverage(*done, left=tree.combinations(len(ranked), choose) - sum(done))
        bound[size] = full_rss / problem.sst * (1.0 - 1e-9) if coverage[size].left else np.inf
    return SensorSetSearch(
        **_of_sizes(problem, bound, best_rss, best_state, partial(house.sensor_set, statistics)),
        proved=not stopped,
        coverage=MappingProxyType(coverage),
        nodes=visited,
        seconds=time.perf_counter() - started,
    )


class _House:
    """Sensors and the columns that they bring, for one problem."""

    def __init__(self, problem: Problem, needs: list[tuple[int, ...]], n_sensors: int) -> None:
        self.problem, self.needs, self.n_sensors = problem, needs, n_sensors
        self._table = np.full((len(needs), max([1, *map(len, needs)])), -1, dtype=np.int64)
        for j, one in enumerate(needs):
            self._table[j, : len(one)] = one

    def path(self, sensors: Iterable[int], choose: int = 0) -> tree.Path:
        """Start of a search for `choose` sensors beside some."""
        p = self.problem.n_columns
        inside = np.full(self.n_sensors, DROPPED, np.int8)
        inside[sorted(sensors)] = KEPT
        columns, flat = np.zeros(p, np.int8), np.zeros((p + 1) * (p + 2))
        choice = np.zeros(choose + 2, np.int64)
        return tree.Path(np.zeros(5, np.int64), choice, inside, self._table, columns, np.zeros(p, np.int64), flat)

    def state_and_rss(self, sensors: Iterable[int]) -> tuple[States, float]:
        """A set as the search holds it, and its residual sum of squares, the total scaled to 1."""
        path = self.path(sensors)
        return path.inside, float(tree.sensors_rss(self.problem.gram, self.problem.cross, path))

    def sensor_set(self, statistics: Statistics, state: States, rss: float) -> SensorSet:
        """The value that is returned."""
        sensors = tuple(np.flatnonzero(state == KEPT).tolist())
        columns = tuple(j for j, one in enumerate(self.needs) if set(sensors).issuperset(one))
        return SensorSet(columns, *statistics.of(float(rss) * self.problem.sst, len(columns)), sensors=sensors)
