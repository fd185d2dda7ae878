"""Compiled search for good starting sets: forward and backward steps, each followed by the best swaps."""

from typing import Any

import numpy as np

from selector.models.best_subsets._algebra import COUNT, DROPPED, FREE, KEPT, PIVOT_TOLERANCE, insert, kernel, set_rss

PHASE, SIZE, PASS, IMPROVED = 0, 1, 2, 3
BEGIN, FORWARD, BACKWARD, FILL = 0, 1, 2, 3


@kernel
def _sweep(v: Any, k: int) -> None:
    """Exchange variable k between the inside and the outside of the set, in place (the sweep operator)."""
    n = v.shape[0]
    row = v[k]
    d = row[k]
    inverse = 1.0 / d
    for e in range(n):
        row[e] *= inverse
    for i in range(n):
        if i != k:
            other = v[i]
            f = other[k]
            if f != 0.0:
                for e in range(n):
                    other[e] -= f * row[e]
                other[k] = -f * inverse
    row[k] = inverse


@kernel
def swept(gram: Any, cross: Any, state: Any, v: Any) -> None:
    """Fill `v` with the matrix swept on the columns of the set, save those that depend on the ones before them."""
    p = state.size
    for i in range(p):
        for j in range(p):
            v[i, j] = gram[i, j]
        v[i, p] = cross[i]
        v[p, i] = cross[i]
    v[p, p] = 1.0
    for j in range(p):
        if state[j] == KEPT and v[j, j] > PIVOT_TOLERANCE:
            _sweep(v, j)


@kernel
def descend(
    gram: Any, cross: Any, root: Any, state: Any, v: Any, best_rss: Any, best_state: Any, a: Any, order: Any
) -> int:
    """Swap one column in the set for one outside it while that lowers the RSS; record the set (and its neighbours).

    `v` is the matrix swept on `state`; both follow the swaps. Columns with ``root == KEPT`` stay. Returns the swaps.
    """
    p = state.size
    several = best_rss.size > 1
    swaps = 0
    while swaps < 4 * p:
        now = v[p, p]
        best = now - 1e-13 - 1e-9 * abs(now)
        leave = COUNT(-1)
        enter = COUNT(-1)
        for i in range(p):
            if state[i] != KEPT or root[i] == KEPT:
                continue
            ci = v[i, i]
            coefficient = v[i, p] / ci
            without = now + v[i, p] * coefficient
            for j in range(p):
                if state[j] == KEPT or root[j] != FREE:
                    continue
                x = v[i, j]
                pivot = v[j, j] + x * x / ci
                if pivot <= PIVOT_TOLERANCE:
                    continue
                y = v[j, p] + x * coefficient
                rss = without - y * y / pivot
                if rss < best:
                    best = rss
                    leave = i
                    enter = j
                if several and rss < best_rss[-1] * (1.0 - 1e-9):
                    state[i] = FREE
                    state[j] = KEPT
                    insert(best_rss, best_state, state, set_rss(gram, cross, state, a, order))
                    state[i] = KEPT
                    state[j] = FREE
        if leave < 0 or v[leave, leave] <= 0.0:
            break
        _sweep(v, leave)
        if v[enter, enter] <= PIVOT_TOLERANCE:
            _sweep(v, leave)
            break
        _sweep(v, enter)
        state[leave] = FREE
        state[enter] = KEPT
        swaps += 1
    rss = set_rss(gram, cross, state, a, order)
    if rss < best_rss[-1]:
        insert(best_rss, best_state, state, rss)
    return swaps


@kernel
def starting_sets(
    gram: Any,
    cross: Any,
    root: Any,
    max_size: int,
    best_rss: Any,
    best_state: Any,
    state: Any,
    v: Any,
    pace: Any,
    work: int,
) -> bool:
    """Fill the lists of best sets, (sizes, n_best) and (sizes, n_best, p), from forward and backward passes.

    Not proved to be best: the tree search proves or improves. Sizes beyond the rank are filled up with dependent
    columns. Passes repeat while they improve something, at most three times. Returns whether it is done before the
    work is used up; it goes on from `pace` (phase, size, pass, improved; zeros to begin), `state` and `v`.
    """
    p = root.size
    a = np.empty((p + 1) * (p + 2))
    order = np.empty(p, np.int64)
    first = COUNT(0)
    for j in range(p):
        if root[j] == KEPT:
            first += 1
    while pace[PHASE] != FILL:
        if work < 0:
            return False
        moved = True
        if pace[PHASE] == BEGIN:
            for j in range(p):
                state[j] = root[j]
            swept(gram, cross, state, v)
            pace[PHASE] = FORWARD
            pace[SIZE] = first
            pace[IMPROVED] = 0
        elif pace[PHASE] == FORWARD:
            moved = pace[SIZE] < max_size and _step(root, state, v, True)
            if moved:
                pace[SIZE] += 1
            else:
                pace[PHASE] = BACKWARD
        else:
            moved = pace[SIZE] > first and _step(root, state, v, False)
            if moved:
                pace[SIZE] -= 1
            else:
                pace[PASS] += 1
                pace[PHASE] = BEGIN if pace[IMPROVED] == 1 and pace[PASS] < 3 else FILL
        if moved:
            size = pace[SIZE]
            before = best_rss[size, 0]
            swaps = descend(gram, cross, root, state, v, best_rss[size], best_state[size], a, order)
            work -= (swaps + 1) * (3 * p * p + 2 * size * (p - size)) + size * size * size // 6
            if best_rss[size, 0] < before:
                pace[IMPROVED] = 1
    for size in range(first, max_size):
        if best_rss[size, 0] < np.inf and best_rss[size + 1, 0] == np.inf:
            _fill_up(gram, cross, root, size, state, best_rss, best_state, a, order)
    return True


@kernel
def _step(root: Any, state: Any, v: Any, forward: bool) -> bool:
    """Takes in the column that explains most, or lets the one go that explains least; False where there is none."""
    p = state.size
    moved = COUNT(-1)
    best = np.inf
    for j in range(p):
        may = root[j] == FREE and state[j] != KEPT if forward else root[j] != KEPT and state[j] == KEPT
        if may and v[j, j] > (PIVOT_TOLERANCE if forward else 0.0):
            share = v[j, p] * v[j, p] / v[j, j]
            worth = -share if forward else share
            if worth < best:
                best = worth
                moved = j
    if moved < 0:
        return False
    _sweep(v, moved)
    state[moved] = KEPT if forward else FREE
    return True


@kernel
def _fill_up(
    gram: Any, cross: Any, root: Any, size: int, state: Any, best_rss: Any, best_state: Any, a: Any, order: Any
) -> None:
    """A set of the next size: the best of this size and the first column that may still come in."""
    enter = COUNT(-1)
    for j in range(root.size):
        state[j] = best_state[size, 0, j]
        if enter < 0 and state[j] != KEPT and root[j] == FREE:
            enter = j
    if enter >= 0:
        state[enter] = KEPT
        insert(best_rss[size + 1], best_state[size + 1], state, set_rss(gram, cross, state, a, order))
        state[enter] = DROPPED
