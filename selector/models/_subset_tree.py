"""Compiled best-first branch and bound for the best subsets of one size, in resumable chunks."""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import njit

from selector.models._subset_algebra import (
    DROPPED,
    FREE,
    INNER,
    KEPT,
    KERNEL,
    PIVOT_TOLERANCE,
    eliminate,
    gather,
    insert,
    set_rss,
)
from selector.models._subset_bound import inverse, largest_scale, relax, root_diagonal, spread_shares
from selector.models._subset_nodes import (
    CHOSEN,
    CURRENT,
    DIAGONAL,
    FREE_COLUMNS,
    HEAP,
    INV,
    NODES,
    ORDER,
    PM,
    RANKING,
    STACK,
    TRIAL,
    WHOLE,
    WORK,
    H,
    M,
    U,
    X,
    Y,
    Z,
    pop,
    push,
)

DONE, PAUSED, FULL = 0, 1, 2
PROOF_TOLERANCE = 1e-9
"""A node is closed when its bound reaches the best RSS less this share of it (or 1e-14 of the total)."""

MAX_SOLVES = 15
MIN_PROGRESS = 0.05
"""Solves of one node stop when the last one closed less than this share of what was left."""


@njit(**INNER)
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


@njit(**INNER)
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
    """Every choice of n <= 2 of t columns in closed form: the ones to keep (q = P) or to drop (q = P⁻¹).

    The change of the RSS by a choice A is v_A' (q_AA)⁻¹ v_A with v the last column: less when kept, more when dropped.
    """
    chosen = w.integers[CHOSEN]
    free = w.integers[FREE_COLUMNS]
    current = w.states[CURRENT]
    trial = w.states[TRIAL]
    sign = -1.0 if keep else 1.0
    for i in range(t - n + 1):
        di = q[i * stride + i]
        vi = q[i * stride + t]
        gi = vi * vi / di
        chosen[0] = i
        for j in range(i + 1 if n > 1 else t - 1, t):
            gj = gi
            if n > 1:
                f = q[i * stride + j] / di
                dj = q[j * stride + j] - f * q[i * stride + j]
                vj = q[j * stride + t] - f * vi
                gj += vj * vj / dj if dj > 1e-12 * q[j * stride + j] else 0.0
                chosen[1] = j
            if rss + sign * gj < best_rss[-1] * (1.0 + 1e-7) + 1e-14:
                for e in range(current.size):
                    trial[e] = current[e]
                for e in range(t):
                    trial[free[e]] = DROPPED if keep else KEPT
                for e in range(n):
                    trial[free[chosen[e]]] = KEPT if keep else DROPPED
                offer(gram, cross, costs, budget, best_rss, best_state, trial, w)


@njit(**INNER)
def expand(
    gram: Any,
    cross: Any,
    size: int,
    costs: Any,
    budget: float,
    root_d: Any,
    tree: Any,
    w: Any,
    best_rss: Any,
    best_state: Any,
    capacity: int,
) -> None:
    """Bound the next node; close it, or open its two children."""
    big = w.matrices[WHOLE]
    pm = w.matrices[PM]
    wm = w.matrices[M]
    inv = w.matrices[INV]
    diagonal = w.vectors[DIAGONAL]
    wz = w.vectors[Z]
    u = w.vectors[U]
    h = w.vectors[H]
    wx = w.vectors[X]
    wy = w.vectors[Y]
    ranking = w.integers[RANKING]
    order = w.integers[ORDER]
    free = w.integers[FREE_COLUMNS]
    chosen = w.integers[CHOSEN]
    current = w.states[CURRENT]
    p = gram.shape[0]
    n = tree.counters
    slot = pop(tree)
    bound0 = tree.bound[slot]
    threshold = best_rss[-1] * (1.0 - PROOF_TOLERANCE) - 1e-14
    if bound0 >= threshold:
        return
    scale = tree.scale[slot]
    for j in range(p):
        current[j] = tree.state[slot, j]
    n[NODES] += 1
    depth_first = n[HEAP] >= capacity - 2 * p - 8
    kept = 0
    spent = 0.0
    for j in range(p):
        if current[j] == KEPT:
            order[kept] = j
            kept += 1
            spent += costs[j]
    total = kept
    for j in range(p):
        if current[j] == FREE:
            order[total] = j
            total += 1
    a = size - kept
    if a < 0 or a > total - kept or spent > budget:
        return
    if budget < np.inf and not _affordable(costs, budget - spent, current, a, wx):
        return
    stride = total + 1
    gather(gram, cross, order, total, big, stride)
    eliminate(big, stride, total, total + 1, kept, PIVOT_TOLERANCE)
    n[WORK] -= total * total * (kept + 3) // 2
    r = 1.0
    for j in range(kept):
        d = big[j * stride + j]
        if d > 0.0:
            r -= big[j * stride + total] ** 2 / d
    # columns that depend on the kept ones bring nothing
    t = 0
    null = -1
    nulls = 0
    for i in range(kept, total):
        if big[i * stride + i] > PIVOT_TOLERANCE:
            free[t] = order[i]
            chosen[t] = i
            t += 1
        else:
            nulls += 1
            if null < 0:
                null = order[i]
    if nulls > 0 and a > 0:
        if best_rss.size > 1 or budget < np.inf:
            _branch(tree, w, null, tree.share[slot], bound0, bound0, scale, depth_first)
            return
        spare = max(0, a - t)
        for i in range(kept, total):
            if big[i * stride + i] <= PIVOT_TOLERANCE:
                current[order[i]] = KEPT if spare > 0 else DROPPED
                spare -= 1
        a = min(a, t)
    if a == 0 or a == t:
        for j in range(t):
            current[free[j]] = KEPT if a == t else DROPPED
        for j in range(p):
            if current[j] == FREE:
                current[j] = DROPPED
        offer(gram, cross, costs, budget, best_rss, best_state, current, w)
        return
    sp = t + 1
    for i in range(t):
        ki = chosen[i]
        for e in range(i, t):
            pm[i * sp + e] = big[ki * stride + chosen[e]]
        pm[i * sp + t] = big[ki * stride + total]
    if a <= 2:
        enumerate_leaves(gram, cross, costs, budget, best_rss, best_state, w, pm, sp, t, a, r, True)
        n[WORK] -= t * t
        return
    if t - a <= 2 and inverse(pm, sp, t, wm, wx, inv):
        rss = r
        for j in range(t):
            rss -= inv[j * sp + t] * pm[j * sp + t]
        enumerate_leaves(gram, cross, costs, budget, best_rss, best_state, w, inv, sp, t, t - a, rss, False)
        n[WORK] -= t * t * t
        return
    missing = False
    for j in range(t):
        diagonal[j] = root_d[free[j]] * scale
        wz[j] = max(tree.share[slot, free[j]], 1e-4)
        ranking[j] = j
        missing = missing or diagonal[j] <= 0.0
    fresh = False
    dependent = -1
    if missing:
        fresh = root_diagonal(pm, sp, t, wm, wx, wy, inv, diagonal)
        n[WORK] -= 10 * t * t * t
        if not fresh:
            for j in range(t):
                diagonal[j] = root_d[free[j]] * scale
                if wm[j * sp + j] <= 0.0 and dependent < 0:
                    dependent = free[j]
    bound = bound0
    now = bound0
    last = -np.inf
    fixed = 0
    for solve in range(MAX_SOLVES):
        spread_shares(wz, t, a)
        now = relax(pm, sp, t, a, r, diagonal, wz, wm, u, h, ranking)
        n[WORK] -= t * t * (t + 12) // 6
        bound = max(bound, now)
        if now >= threshold:
            return
        least_in = h[ranking[a - 1]]
        most_out = h[ranking[a]]
        for j in range(t):
            column = free[j]
            if current[column] == FREE:
                if h[j] <= most_out:
                    if now + least_in - h[j] >= threshold:
                        current[column] = DROPPED
                        fixed += 1
                elif now + h[j] - most_out >= threshold:
                    current[column] = KEPT
                    fixed += 1
        if solve == 0 and not fresh:
            s = largest_scale(pm, sp, t, diagonal, wm, wx, wy)
            n[WORK] -= t * t * (t + 12) // 3
            if s > 1.0:
                scale *= s
                for j in range(t):
                    diagonal[j] *= s
                last = -np.inf
        elif now - last < MIN_PROGRESS * (threshold - now):
            break
        if 5 * fixed > t:
            break
        last = max(last, now)
        for j in range(t):
            wz[j] = max(wz[j] * np.sqrt(h[j]), 1e-150)
    if dependent >= 0 and current[dependent] == FREE:
        for j in range(p):
            wy[j] = tree.share[slot, j]
        _branch(tree, w, dependent, wy, bound, bound, scale, depth_first)
        return
    _open(tree, w, t, a, bound, now, scale, depth_first, fixed)


@njit(**INNER)
def _open(tree: Any, w: Any, t: int, a: int, bound: float, now: float, scale: float, depth: bool, fixed: int) -> None:
    """Choose the column to branch on, or go on with the same node after many columns were fixed."""
    wz = w.vectors[Z]
    h = w.vectors[H]
    wy = w.vectors[Y]
    ranking = w.integers[RANKING]
    free = w.integers[FREE_COLUMNS]
    current = w.states[CURRENT]
    z = wy
    for j in range(current.size):
        z[j] = 1.0
    largest = 0.0
    for j in range(t):
        largest = max(largest, wz[j])
    best = -1.0
    column = -1
    at = -1
    for j in range(t):
        share = wz[j] / max(largest, 1e-300)
        z[free[j]] = share
        if current[free[j]] == FREE:
            v = 1.0 + h[j] if share > 0.999 else share
            if v > best:
                best = v
                column = free[j]
                at = j
    if column < 0 or 5 * fixed > t:
        push(tree, current, z, bound, scale, depth)
        return
    keep = max(bound, now + h[ranking[a - 1]] - h[at])
    drop = max(bound, now + h[at] - h[ranking[a]])
    _branch(tree, w, column, z, keep, drop, scale, depth)


@njit(**INNER)
def _branch(tree: Any, w: Any, column: int, z: Any, keep: float, drop: float, scale: float, depth: bool) -> None:
    wx = w.vectors[X]
    current = w.states[CURRENT]
    for j in range(current.size):
        wx[j] = z[j]
    current[column] = DROPPED
    push(tree, current, wx, drop, scale, depth)
    current[column] = KEPT
    push(tree, current, wx, keep, scale, depth)


@njit(**INNER)
def _affordable(costs: Any, left: float, state: Any, a: int, x: Any) -> bool:
    """Whether the `a` cheapest free columns fit into what is left of the budget."""
    t = 0
    for j in range(state.size):
        if state[j] == FREE:
            i = t
            while i > 0 and x[i - 1] > costs[j]:
                x[i] = x[i - 1]
                i -= 1
            x[i] = costs[j]
            t += 1
    cheapest = 0.0
    for i in range(a):
        cheapest += x[i]
    return bool(cheapest <= left + 1e-12 * abs(left))


@njit(**KERNEL)
def search(
    gram: Any,
    cross: Any,
    size: int,
    costs: Any,
    budget: float,
    root_d: Any,
    tree: Any,
    w: Any,
    best_rss: Any,
    best_state: Any,
    capacity: int,
    work: int,
) -> int:
    """Expand nodes until none is open (DONE), the work is used up (PAUSED) or more room is needed (FULL)."""
    heap = tree.slots[0]
    n = tree.counters
    n[WORK] = work
    room = tree.bound.size
    while n[HEAP] + n[STACK] > 0:
        if n[WORK] < 0:
            return PAUSED
        if room < capacity and n[HEAP] + n[STACK] + 2 > room:
            return FULL
        if n[STACK] == 0 and tree.bound[heap[0]] >= best_rss[-1] * (1.0 - PROOF_TOLERANCE) - 1e-14:
            n[HEAP] = 0
            break
        expand(gram, cross, size, costs, budget, root_d, tree, w, best_rss, best_state, capacity)
    return DONE
