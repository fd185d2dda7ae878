"""Good starting sets: forward and backward steps, each followed by the best swaps, in compiled code."""

from collections.abc import Callable
from typing import Any

import numpy as np

from selector.models.best_subsets._algebra import COUNT, FREE, KEPT, PIVOT_TOLERANCE, insert, kernel, set_rss
from selector.models.best_subsets.problem import Problem


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
    insert(best_rss, best_state, state, set_rss(gram, cross, state, a, order))
    return swaps


def starting_sets(problem: Problem, best_rss: Any, best_state: Any, out_of_time: Callable[[], bool]) -> None:
    """Fill the lists of best sets, (sizes, n_best) and (sizes, n_best, p), from forward and backward passes.

    Not proved to be best: the tree search proves or improves. Sizes beyond the rank are filled up with dependent
    columns. Passes repeat while they improve something, at most three times.
    """
    gram, cross, root, first, top = problem.gram, problem.cross, problem.root, problem.n_must, problem.max_size
    p = problem.n_columns
    matrix, a, order = np.zeros((p + 1, p + 1)), np.empty((p + 1) * (p + 2)), np.empty(p, np.int64)
    for _ in range(3):
        before, state, size = best_rss[:, 0].copy(), root.copy(), first
        swept(gram, cross, state, matrix)
        descend(gram, cross, root, state, matrix, best_rss[size], best_state[size], a, order)
        for step, last in ((1, top), (-1, first)):
            while not out_of_time() and size != last and _step(root, state, matrix, step > 0):
                size += step
                descend(gram, cross, root, state, matrix, best_rss[size], best_state[size], a, order)
        if out_of_time() or not np.any(best_rss[:, 0] < before):
            break
    for size in range(first, top):
        may = np.flatnonzero((best_state[size, 0] != KEPT) & (root == FREE))
        if best_rss[size, 0] < np.inf and best_rss[size + 1, 0] == np.inf and len(may):
            state = best_state[size, 0].copy()
            state[may[0]] = KEPT
            insert(best_rss[size + 1], best_state[size + 1], state, set_rss(gram, cross, state, a, order))


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
