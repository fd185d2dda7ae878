"""Compiled depth-first search over sets of a given number of sensors, each of which brings columns.

The triangular factor of the columns on the path grows and shrinks with it; up to eight new columns are reduced
together. Resumable: everything that a chunk needs stands in the arrays.
"""

from typing import Any, NamedTuple

import numpy as np

from selector.models.best_subsets._algebra import COUNT, DROPPED, KEPT, PIVOT_TOLERANCE, insert, kernel

DEPTH, WORK, EVALUATED, BOUNDED, VISITED = 0, 1, 2, 3, 4
LANES = 8  #: Columns reduced together: one vector of doubles on current processors.


class Owners(NamedTuple):
    """Which columns a sensor takes part in, and which sensors a column needs."""

    start: Any  # int64 (n_sensors + 1,): where the columns of each sensor begin in `columns`
    columns: Any  # int64: columns by sensor
    needs: Any  # int64 (n_columns, most owners): sensors of each column, -1 where there are no more


class Path(NamedTuple):
    """The sensors chosen so far and the factor of their columns."""

    counters: Any  # int64 (5,)
    choice: Any  # int64 (depths,): next candidate to try at each depth
    count: Any  # int64 (depths + 1,): columns in the factor at each depth
    rss: Any  # float64 (depths + 1,)
    inside: Any  # int8 (n_sensors,): 1 while a sensor is in the set
    stack: Any  # int64 (n_columns,): columns in the factor
    factor: Any  # float64 (n_columns + LANES, n_columns + LANES), upper triangular
    response: Any  # float64 (n_columns,): the response in the basis of the factor
    block: Any  # float64 (n_columns, LANES): new columns in the basis of the factor
    small: Any  # float64 (LANES, LANES + 1): what is left of the new columns, and of the response
    fresh: Any  # int64 (n_columns,): columns that come in with a sensor
    trial: Any  # int8 (n_sensors,)


@kernel
def brought(owners: Any, path: Any, sensor: int) -> int:
    """Collect in `path.fresh` the columns that `sensor`, marked as inside, adds to the set; returns how many."""
    n = COUNT(0)
    for i in range(owners.start[sensor], owners.start[sensor + 1]):
        column = owners.columns[i]
        complete = True
        for k in range(owners.needs.shape[1]):
            need = owners.needs[column, k]
            if need < 0:
                break
            if path.inside[need] == 0:
                complete = False
                break
        if complete:
            path.fresh[n] = column
            n += 1
    return n


@kernel
def reduced(
    gram: Any, cross: Any, path: Any, held: int, first: int, n: int, rss: float, store: bool
) -> tuple[int, float]:
    """RSS after the n <= LANES columns ``path.fresh[first:]`` join the `held` ones of the factor.

    With `store` they are added to the factor. Returns the columns then held and the RSS.
    """
    block = path.block
    factor = path.factor
    response = path.response
    small = path.small
    fresh = path.fresh
    for c in range(LANES):
        column = fresh[first + c] if c < n else -1
        for i in range(held):
            block[i, c] = gram[column, path.stack[i]] if c < n else 0.0
    for i in range(held):
        inverse = 1.0 / factor[i, i]
        source = block[i]
        for c in range(LANES):
            source[c] *= inverse
        for j in range(i + 1, held):
            f = factor[i, j]
            target = block[j]
            for c in range(LANES):
                target[c] -= f * source[c]
    for a in range(n):
        for b in range(a, n):
            small[a, b] = gram[fresh[first + a], fresh[first + b]]
        small[a, LANES] = cross[fresh[first + a]]
    for i in range(held):
        row = block[i]
        yi = response[i]
        for a in range(n):
            f = row[a]
            for b in range(a, n):
                small[a, b] -= f * row[b]
            small[a, LANES] -= f * yi
    for a in range(n):
        d = small[a, a]
        if d <= PIVOT_TOLERANCE:
            small[a, a] = 0.0
            continue
        inverse = 1.0 / d
        y = small[a, LANES]
        rss -= y * y * inverse
        for b in range(a + 1, n):
            f = small[a, b] * inverse
            for e in range(b, n):
                small[b, e] -= f * small[a, e]
            small[b, LANES] -= f * y
    if not store:
        return held, rss
    total = held
    for a in range(n):
        if small[a, a] <= 0.0:
            continue
        for i in range(held):
            factor[i, total] = block[i, a]
        root = np.sqrt(small[a, a])
        factor[total, total] = root
        at = total + 1
        for b in range(a + 1, n):
            if small[b, b] > 0.0:
                factor[total, at] = small[a, b] / root
                at += 1
        response[total] = small[a, LANES] / root
        path.stack[total] = fresh[first + a]
        total += 1
    return total, rss


@kernel
def joined(
    gram: Any, cross: Any, path: Any, held: int, n: int, rss: float, store: bool, floor: float
) -> tuple[int, float]:
    """As `reduced` for any number of new columns; stops early when the RSS falls below `floor`."""
    first = COUNT(0)
    while first < n and rss >= floor:
        width = min(LANES, n - first)
        last = first + width >= n
        held, rss = reduced(gram, cross, path, held, first, width, rss, store or not last)
        first += width
    return held, rss


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
def superset_rss(
    gram: Any, cross: Any, owners: Any, path: Any, depth: int, ranked: Any, after: int, floor: float
) -> float:
    """RSS with the path and every candidate from `after` on: none of their subsets has less. Early out at `floor`."""
    held = path.count[depth]
    rss = path.rss[depth]
    for i in range(after, ranked.size):
        if rss < floor:
            break
        path.inside[ranked[i]] = 1
        n = brought(owners, path, ranked[i])
        held, rss = joined(gram, cross, path, held, n, rss, True, floor)
        path.counters[WORK] -= held * held * n // 2
    for i in range(after, ranked.size):
        path.inside[ranked[i]] = 0
    return float(rss)


@kernel
def search_sensors(
    gram: Any, cross: Any, owners: Any, ranked: Any, choose: int, path: Any, best_rss: Any, best_state: Any, work: int
) -> bool:
    """Try every way to add `choose` of the `ranked` sensors to those inside, until done or the work is used up.

    Every set is either evaluated, or lies below a superset whose RSS is not less than the worst of the best; the
    counters add up to the number of sets. Returns whether it is done.
    """
    n = path.counters
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
                path.inside[ranked[path.choice[depth - 1] - 1]] = 0
            continue
        path.choice[depth] = i + 1
        sensor = ranked[i]
        below = combinations(m - i - 1, left - 1)
        n[VISITED] += 1
        path.inside[sensor] = 1
        new = brought(owners, path, sensor)
        held = path.count[depth]
        n[WORK] -= held * (held + 8) * (new + 7) // 8 * 4 + 100
        if left == 1:
            _, rss = joined(gram, cross, path, held, new, path.rss[depth], False, -np.inf)
            path.inside[sensor] = 0
            n[EVALUATED] += 1
            if rss < best_rss[-1]:
                for k in range(path.trial.size):
                    path.trial[k] = KEPT if path.inside[k] == 1 else DROPPED
                path.trial[sensor] = KEPT
                insert(best_rss, best_state, path.trial, max(rss, 0.0))
            continue
        held, rss = joined(gram, cross, path, held, new, path.rss[depth], True, -np.inf)
        path.count[depth + 1] = held
        path.rss[depth + 1] = rss
        threshold = best_rss[-1] * (1.0 - 1e-9) - 1e-14
        worth = threshold < np.inf and 500.0 * below > 0.2 * float(held + 3 * (m - i)) ** 3
        if worth and superset_rss(gram, cross, owners, path, depth + 1, ranked, i + 1, threshold) >= threshold:
            path.inside[sensor] = 0
            n[BOUNDED] += below
            continue
        path.choice[depth + 1] = i + 1
        n[DEPTH] = depth + 1
    return True
