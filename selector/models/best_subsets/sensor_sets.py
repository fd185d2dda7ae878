"""Which sensors to keep when a sensor brings several columns: the exact best sets of every number of sensors."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from selector.models.best_subsets import _sensor_tree as tree
from selector.models.best_subsets._algebra import DROPPED, KEPT, insert, set_rss
from selector.models.best_subsets.problem import CHUNK_WORK, Problem, checked_columns, require
from selector.models.best_subsets.results import SensorSet, SensorSetSearch, Statistics

States = NDArray[np.int8]


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
    intercept: bool = True,
) -> SensorSetSearch:
    """The exact `n_best` sensor sets of least residual sum of squares for every number of sensors.

    A set of sensors brings every column whose owners are all in it.

    Parameters
    ----------
    cross : array of shape (p + 1, p + 1)
        Cross-products of the columns about their means, response last.
    n_samples : number
        Samples behind `cross`; only the criteria depend on it.
    owners : sequence of p sequences of int
        Sensors of each column: (1,) for x1², (1, 2) for x1·x2; () is the same as naming the column in `always`.
    n_sensors, max_sensors : int
        Sensors there are, and the most that a set may have.
    must : iterable of int
        Sensors that are in every set.
    always : iterable of int
        Columns that are in every model.

    Raises
    ------
    InputError
        The matrix, an owner or a sensor number cannot be used.
    """
    fixed = set(always)
    problem = Problem.of(cross, n_samples, fixed, intercept, n_best, np.shape(cross)[0] - 1)
    p = problem.n_columns
    require(len(owners) == p, f"owners of {len(owners)} columns", f"one entry for each of the {p} columns")
    needs = [() if j in fixed else tuple(sorted({int(s) for s in one})) for j, one in enumerate(owners)]
    checked_columns("owners", (s for one in needs for s in one), n_sensors)
    kept = checked_columns("must", must, n_sensors)
    candidates = [s for s in range(n_sensors) if s not in kept]
    least, most = max(1, len(kept)), min(max_sensors, n_sensors)
    require(least <= most, f"max_sensors = {max_sensors}", f"at least {least}, and a sensor that may be used")
    house = _House(problem, needs, n_sensors, kept)
    alone = {s: house.rss({*kept, s}) for s in candidates}
    ranked = np.array(sorted(candidates, key=lambda s: (alone[s], s)), dtype=np.int64)
    statistics = problem.statistics()
    by_size: dict[int, tuple[SensorSet, ...]] = {}
    visited = 0
    smaller = None
    for size in range(least, most + 1):
        best_rss, best_state = np.full(n_best, np.inf), np.full((n_best, n_sensors), DROPPED, np.int8)
        choose = size - len(kept)
        if choose == 0:
            house.offer(kept, best_rss, best_state)
        elif smaller is not None:
            house.extend(smaller, candidates, best_rss, best_state)
        path = house.path(choose)
        while not tree.search_sensors(
            problem.gram, problem.cross, house.owners, ranked, choose, path, best_rss, best_state, CHUNK_WORK
        ):
            pass
        visited += int(path.counters[tree.VISITED])
        smaller = best_state[0]
        found = [state for rss, state in zip(best_rss, best_state, strict=True) if np.isfinite(rss)]
        by_size[size] = tuple(house.sensor_set(state, statistics) for state in found)
    return SensorSetSearch(by_size, visited)


class _House:
    """Sensors and the columns that they bring, for one problem."""

    def __init__(self, problem: Problem, needs: list[tuple[int, ...]], n_sensors: int, kept: set[int]) -> None:
        self.problem, self.needs, self.n_sensors, self.kept = problem, needs, n_sensors, kept
        by_sensor: list[list[int]] = [[] for _ in range(n_sensors)]
        for j, one in enumerate(needs):
            for s in one:
                by_sensor[s].append(j)
        table = np.full((len(needs), max([1, *map(len, needs)])), -1, dtype=np.int64)
        for j, one in enumerate(needs):
            table[j, : len(one)] = one
        self.owners = tree.Owners(
            np.cumsum([0, *map(len, by_sensor)]).astype(np.int64),
            np.array([j for columns in by_sensor for j in columns], dtype=np.int64),
            table,
        )
        p = problem.n_columns
        self._flat = np.zeros((p + 1) * (p + 2))
        self._order = np.zeros(p, np.int64)
        self._factor = np.zeros((p + tree.LANES, p + tree.LANES))

    def columns(self, sensors: Iterable[int]) -> tuple[int, ...]:
        """Columns that a set of sensors brings, those without owners included."""
        chosen = set(sensors)
        return tuple(j for j, one in enumerate(self.needs) if chosen.issuperset(one))

    def rss(self, sensors: Iterable[int]) -> float:
        """Residual sum of squares of a set of sensors, the total scaled to 1."""
        state = np.full(self.problem.n_columns, DROPPED, np.int8)
        state[list(self.columns(sensors))] = KEPT
        return float(set_rss(self.problem.gram, self.problem.cross, state, self._flat, self._order))

    def offer(self, sensors: Iterable[int], best_rss: NDArray[np.float64], best_state: States) -> None:
        """Record a set of sensors if it is among the best."""
        state = np.full(self.n_sensors, DROPPED, np.int8)
        state[sorted(sensors)] = KEPT
        insert(best_rss, best_state, state, self.rss(sensors))

    def extend(
        self,
        smaller: States,
        candidates: list[int],
        best_rss: NDArray[np.float64],
        best_state: States,
    ) -> None:
        """Record every set of one sensor more than a given one."""
        inside = {int(s) for s in np.flatnonzero(smaller == KEPT)}
        for s in candidates:
            if s not in inside:
                self.offer({*inside, s}, best_rss, best_state)

    def path(self, choose: int) -> tree.Path:
        """Start of a search: the columns that are in every set are in the factor."""
        p = self.problem.n_columns
        path = tree.Path(
            np.zeros(3, np.int64),
            np.zeros(choose + 2, np.int64),
            np.zeros(choose + 2, np.int64),
            np.ones(choose + 2),
            np.zeros(self.n_sensors, np.int8),
            np.zeros(p + tree.LANES, np.int64),
            self._factor,
            np.zeros(p + tree.LANES),
            np.zeros((p + tree.LANES, tree.LANES)),
            np.zeros((tree.LANES, tree.LANES + 1)),
            np.zeros(p + tree.LANES, np.int64),
            np.zeros(self.n_sensors, np.int8),
        )
        path.inside[sorted(self.kept)] = 1
        first = self.columns(self.kept)
        path.fresh[: len(first)] = first
        gram, cross = self.problem.gram, self.problem.cross
        path.count[0], path.rss[0] = tree.joined(gram, cross, path, 0, len(first), 1.0, True, -np.inf)
        return path

    def sensor_set(self, state: States, statistics: Statistics) -> SensorSet:
        """The value that is returned."""
        sensors = tuple(int(s) for s in np.flatnonzero(state == KEPT))
        columns = self.columns(sensors)
        return SensorSet(columns, *statistics.of(self.rss(sensors) * self.problem.sst, len(columns)), sensors=sensors)
