"""Compiled depth-first search over sets of a given number of sensors, each of which brings columns.

Resumable: everything that a chunk needs stands in the arrays.
"""

from typing import Any, NamedTuple

import numpy as np

from selector.models.best_subsets._algebra import DROPPED, KEPT, insert, kernel, set_rss

DEPTH, WORK, EVALUATED, BOUNDED, VISITED = 0, 1, 2, 3, 4


class Path(NamedTuple):
    """The sensors chosen so far, and work space."""

    counters: Any  # int64 (5,)
    choice: Any  # int64 (depths,): next candidate to try at each depth
    inside: Any  # int8 (n_sensors,): KEPT while a sensor is in the set
    needs: Any  # int64 (n_columns, most owners): sensors of each column, -1 where there are no more
    columns: Any  # int8 (n_columns,): KEPT where all of them are in the set
    order: Any  # int64 (n_columns,)
    work: Any  # float64, flat: the cross-products of those columns


@kernel
def sensors_rss(gram: Any, cross: Any, path: Any) -> float:
    """Residual sum of squares, the total scaled to 1, of the columns that the sensors inside bring."""
    brought = 0
    for j in range(path.columns.size):
        path.columns[j] = KEPT
        for sensor in path.needs[j]:
            if sensor >= 0 and path.inside[sensor] != KEPT:
                path.columns[j] = DROPPED
        brought += path.columns[j] == KEPT
    path.counters[WORK] -= brought**3 // 6 + 2 * path.columns.size
    return float(set_rss(gram, cross, path.columns, path.work, path.order))


@kernel
def combinations(n: int, k: int) -> int:
    """Number of ways to choose k of n."""
    if k < 0 or k > n:
        return 0
    ways = 1
    for i in range(1, k + 1):
        ways = ways * (n - k + i) // i
    return ways


@kernel
def search_sensors(
    gram: Any, cross: Any, ranked: Any, choose: int, path: Any, best_rss: Any, best_state: Any, work: int
) -> bool:
    """Try every way to add `choose` of the `ranked` sensors to those inside, until done or the work is used up.

    Every set is either evaluated, or lies below a superset whose RSS is not less than the worst of the best; the
    counters add up to the number of sets. Returns whether it is done.
    """
    n = path.counters
    inside = path.inside
    n[WORK] = work
    m = ranked.size
    while n[DEPTH] >= 0:
        if n[WORK] < 0:
            return False
        depth = n[DEPTH]
        left = choose - depth
        i = path.choice[depth]
        if m - i < left or left == 0:
            n[DEPTH] -= 1
            if depth > 0:
                inside[ranked[path.choice[depth - 1] - 1]] = DROPPED
            continue
        path.choice[depth] = i + 1
        n[VISITED] += 1
        inside[ranked[i]] = KEPT
        below = combinations(m - i - 1, left - 1)
        threshold = best_rss[-1] * (1.0 - 1e-9) - 1e-14
        if left == 1:
            insert(best_rss, best_state, inside, sensors_rss(gram, cross, path))
            n[EVALUATED] += 1
        elif threshold < np.inf and 500.0 * below > 0.05 * (path.columns.size * (depth + m - i) / m) ** 3:
            for j in range(i, m):
                inside[ranked[j]] = KEPT
            closed = sensors_rss(gram, cross, path) >= threshold
            for j in range(i + 1, m):
                inside[ranked[j]] = DROPPED
            left = 1 if closed else left
            n[BOUNDED] += below if closed else 0
        if left == 1:
            inside[ranked[i]] = DROPPED
        else:
            path.choice[depth + 1] = i + 1
            n[DEPTH] = depth + 1
    return True
