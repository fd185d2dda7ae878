"""Compiled store of the open nodes of a subset search, and the closed-form end of a branch."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from selector.models.best_subsets._algebra import DROPPED, FREE, KEPT, insert, kernel, set_rss

HEAP, STACK, NODES, HELD, WORK = 0, 1, 2, 3, 4
"""Places of the counters: nodes in the heap, on the stack, visited in all, slots ever used, work left in this chunk."""


class Tree(NamedTuple):
    """Open nodes of one size; slots are shared by a heap (best bound first) and, when that is full, a stack."""

    counters: Any  # int64 (5,)
    slots: Any  # int64 (3, capacity): the heap, the stack, and the slots that are free again
    bound: Any  # float64 (capacity,)
    scale: Any  # float64 (capacity,): valid factor on the diagonal
    state: Any  # int8 (capacity, p)
    share: Any  # float32 (capacity, p): z of the parent, where the next solve starts


class Scratch(NamedTuple):
    """Work space of one search, by rows: few arrays, because every one of them costs compile time in every kernel."""

    matrices: Any  # float64 (4, (p + 1) · (p + 2)): all columns of the node, its free ones (P), work, inverse
    vectors: Any  # float64 (7, p + 3)
    integers: Any  # int64 (4, p + 1)
    states: Any  # int8 (2, p): the node, a set to try


WHOLE, PM, M, INV = 0, 1, 2, 3
DIAGONAL, Z, U, H, X, Y, OUTCOME = 0, 1, 2, 3, 4, 5, 6
RANKING, ORDER, FREE_COLUMNS, CHOSEN = 0, 1, 2, 3
CURRENT, TRIAL = 0, 1


@kernel
def push(tree: Any, state: Any, z: Any, bound: float, scale: float, depth_first: bool) -> None:
    """Open a node."""
    heap = tree.slots[0]
    stack = tree.slots[1]
    unused = tree.slots[2]
    n = tree.counters
    if n[HELD] > n[HEAP] + n[STACK]:
        slot = unused[n[HELD] - n[HEAP] - n[STACK] - 1]
    else:
        slot = n[HELD]
        n[HELD] += 1
    tree.bound[slot] = bound
    tree.scale[slot] = scale
    for j in range(state.size):
        tree.state[slot, j] = state[j]
        tree.share[slot, j] = z[j]
    if depth_first:
        stack[n[STACK]] = slot
        n[STACK] += 1
        return
    i = n[HEAP]
    n[HEAP] += 1
    while i > 0:
        parent = (i - 1) // 2
        if tree.bound[heap[parent]] <= bound:
            break
        heap[i] = heap[parent]
        i = parent
    heap[i] = slot


@kernel
def pop(tree: Any) -> int:
    heap = tree.slots[0]
    stack = tree.slots[1]
    unused = tree.slots[2]
    n = tree.counters
    if n[STACK] > 0:
        n[STACK] -= 1
        slot = stack[n[STACK]]
    else:
        slot = heap[0]
        n[HEAP] -= 1
        last = heap[n[HEAP]]
        i = 0
        while True:
            child = 2 * i + 1
            if child >= n[HEAP]:
                break
            if child + 1 < n[HEAP] and tree.bound[heap[child + 1]] < tree.bound[heap[child]]:
                child += 1
            if tree.bound[heap[child]] >= tree.bound[last]:
                break
            heap[i] = heap[child]
            i = child
        heap[i] = last
    unused[n[HELD] - n[HEAP] - n[STACK] - 1] = slot
    return int(slot)


@kernel
def open_bound(tree: Any) -> float:
    """The smallest bound of the nodes that are still open; infinite when there are none."""
    heap = tree.slots[0]
    stack = tree.slots[1]
    n = tree.counters
    least = np.inf
    if n[HEAP] > 0:
        least = tree.bound[heap[0]]
    for i in range(n[STACK]):
        least = min(least, tree.bound[stack[i]])
    return float(least)


@kernel
def offer(gram: Any, cross: Any, costs: Any, budget: float, best_rss: Any, best_state: Any, state: Any, w: Any) -> None:
    """Record a complete set if the budget allows it and it is among the best."""
    big = w.matrices[WHOLE]
    order = w.integers[ORDER]
    spent = 0.0
    for j in range(state.size):
        if state[j] == KEPT:
            spent += costs[j]
    if spent <= budget:
        rss = set_rss(gram, cross, state, big, order)
        if rss < best_rss[-1]:
            insert(best_rss, best_state, state, rss)


@kernel
def enumerate_leaves(
    gram: Any,
    cross: Any,
    costs: Any,
    budget: float,
    best_rss: Any,
    best_state: Any,
    w: Any,
    q: Any,
    stride: int,
    t: int,
    n: int,
    rss: float,
    keep: bool,
) -> None:
    """Offer every choice of n <= 2 of t columns in closed form: the ones to keep (q = P) or to drop (q = P⁻¹).

    The change of the RSS by a choice A is v_A' (q_AA)⁻¹ v_A with v the last column: less when kept, more when dropped.
    """
    free = w.integers[FREE_COLUMNS]
    current = w.states[CURRENT]
    trial = w.states[TRIAL]
    value = w.matrices[M]
    sign = -1.0 if keep else 1.0
    first = 1 if n == 0 else t
    last = t if n == 2 else 1
    for i in range(first):
        di = q[i * stride + i]
        vi = q[i * stride + t]
        gi = vi * vi / di if n > 0 else 0.0
        # the only choice there is (n = 0) is offered in any case
        value[i * last] = rss + sign * gi if n > 0 else 0.0
        for j in range(i + 1, last):
            f = q[i * stride + j] / di
            dj = q[j * stride + j] - f * q[i * stride + j]
            vj = q[j * stride + t] - f * vi
            value[i * last + j] = rss + sign * (gi + (vj * vj / dj if dj > 1e-12 * q[j * stride + j] else 0.0))
    inside = KEPT if keep else DROPPED
    for k in range(first * last):
        i = k // last
        j = k - i * last
        if n == 2 and j <= i:
            continue
        if value[k] < best_rss[-1] * (1.0 + 1e-7) + 1e-14:
            for e in range(current.size):
                trial[e] = current[e] if current[e] != FREE else DROPPED
            for e in range(t):
                trial[free[e]] = -inside
            if n > 0:
                trial[free[i]] = inside
            if n > 1:
                trial[free[j]] = inside
            offer(gram, cross, costs, budget, best_rss, best_state, trial, w)
