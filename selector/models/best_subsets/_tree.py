"""Compiled best-first branch and bound for the best subsets of one size, in resumable chunks; its open nodes."""

from typing import Any, NamedTuple

import numpy as np

from selector.models.best_subsets._algebra import (
    COUNT,
    DROPPED,
    FREE,
    KEPT,
    PIVOT_TOLERANCE,
    eliminate,
    gather,
    insert,
    inverse,
    inverse_after_elimination,
    inverse_diagonal,
    kernel,
    raised,
    relax,
    set_rss,
    spread_shares,
)

#: Places of the counters: open nodes, nodes visited in all, work left in this chunk.
OPEN, NODES, WORK = 0, 1, 2


class Tree(NamedTuple):
    """Open nodes of one size; the next one is looked for, which costs little beside a node."""

    counters: Any  # int64 (3,)
    rank: Any  # float64 (capacity,): the least comes first: the bound, below 0 when room is short; infinite: free
    bound: Any  # float64 (capacity,)
    state: Any  # int8 (capacity, p)
    share: Any  # float32 (capacity, p): z of the parent, where the next solve starts
    diagonal: Any  # float32 (capacity, p): a valid D of the parent


class Scratch(NamedTuple):
    """Work space of one search, by rows: few arrays, because every one of them costs compile time in every kernel."""

    matrices: Any  # float64 (4, (p + 1) · (p + 2)): all columns of the node, its free ones (P), work, inverse
    vectors: Any  # float64 (8, p + 3)
    integers: Any  # int64 (4, p + 1)
    states: Any  # int8 (2, p): the node, a set to try


WHOLE, PM, M, INV = 0, 1, 2, 3
ROUNDED = 1.0 - 1e-7  #: Keeps a D valid that is stored in single precision.
DIAGONAL, Z, U, H, X, Y, OUTCOME, HANDED = 0, 1, 2, 3, 4, 5, 6, 7
RANKING, ORDER, FREE_COLUMNS, CHOSEN = 0, 1, 2, 3
CURRENT, TRIAL = 0, 1


@kernel
def push(tree: Any, state: Any, z: Any, diagonal: Any, bound: float, depth_first: bool) -> None:
    """Open a node."""
    slot = np.argmax(tree.rank)
    tree.counters[OPEN] += 1
    tree.rank[slot] = -tree.counters[OPEN] if depth_first else bound
    tree.bound[slot] = bound
    for j in range(state.size):
        tree.state[slot, j] = state[j]
        tree.share[slot, j] = z[j]
        tree.diagonal[slot, j] = diagonal[j] * ROUNDED


@kernel
def offer(gram: Any, cross: Any, best_rss: Any, best_state: Any, state: Any, w: Any) -> None:
    """Record a complete set if it is among the best."""
    insert(best_rss, best_state, state, set_rss(gram, cross, state, w.matrices[WHOLE], w.integers[ORDER]))


@kernel
def enumerate_leaves(
    gram: Any, cross: Any, best_rss: Any, best_state: Any, w: Any, q: Any, t: int, n: int, rss: float, keep: Any
) -> None:
    """Offer every choice of n <= 2 of t columns in closed form: the ones to keep (q = P) or to drop (q = P⁻¹).

    The change of the RSS by a choice A is v_A' (q_AA)⁻¹ v_A with v the last column: less when kept, more when dropped.
    """
    free = w.integers[FREE_COLUMNS]
    current = w.states[CURRENT]
    trial = w.states[TRIAL]
    own = w.vectors[U]
    response = w.vectors[H]
    value = w.vectors[Z]
    stride = t + 1
    for j in range(t):
        own[j] = q[j * stride + j]
        response[j] = q[j * stride + t]
    sign = -1.0 if keep else 1.0
    inside = KEPT if keep else DROPPED
    for i in range(t if n > 0 else 1):
        inverse = 1.0 / own[i] if own[i] > 1e-14 else 0.0
        row = q[i * stride : i * stride + t]
        # the only choice there is (n = 0) is offered in any case
        value[i] = rss + sign * response[i] * response[i] * inverse if n > 0 else 0.0
        for j in range(i + 1, t if n == 2 else 0):
            f = row[j] * inverse
            d = own[j] - f * row[j]
            v = response[j] - f * response[i]
            value[j] = value[i] + (sign * v * v / d if d > 1e-14 else 0.0)
        for j in range(i + 1 if n == 2 else i, t if n == 2 else i + 1):
            if value[j] < best_rss[-1] * (1.0 + 1e-7) + 1e-14:
                for e in range(current.size):
                    trial[e] = current[e] if current[e] != FREE else DROPPED
                for e in range(t):
                    trial[free[e]] = -inside
                if n > 0:
                    trial[free[i]] = inside
                    trial[free[j]] = inside
                offer(gram, cross, best_rss, best_state, trial, w)


@kernel
def enumerate_triples(
    gram: Any, cross: Any, best_rss: Any, best_state: Any, w: Any, q: Any, t: int, rss: float
) -> None:
    """Offer every choice of three of t columns with cross-products q: each with the pairs of those after it."""
    free = w.integers[FREE_COLUMNS]
    part = w.matrices[M]
    stride = t + 1
    for i in range(t - 2):
        n = t - 1 - i
        d = q[i * stride + i]
        top = q[i * stride + i + 1 : i * stride + t + 1]
        for j in range(n):
            f = top[j] / d
            source = q[(i + 1 + j) * stride + i + 1 : (i + 1 + j) * stride + t + 1]
            for e in range(j, n + 1):
                part[j * (n + 1) + e] = source[e] - f * top[e]
        column = free[0]
        for j in range(n):
            free[j] = free[j + 1]
        w.states[CURRENT, column] = KEPT
        left = rss - q[i * stride + t] ** 2 / d
        enumerate_leaves(gram, cross, best_rss, best_state, w, part, n, COUNT(2), left, np.bool_(True))
        w.states[CURRENT, column] = DROPPED


DONE, PAUSED, FULL = 0, 1, 2
CLOSED, AGAIN = -1, -2

#: A node is closed when its bound reaches the best RSS less this share of it (or 1e-14 of the total).
PROOF_TOLERANCE = 1e-9
MAX_SOLVES = 60
MIN_PROGRESS = 0.02  #: The shares have settled when the last solve closed less than this share of what was left.
MIN_RAISE = 0.2  #: D is raised again when raising it closed this share of what was left.
BARRIER = 1.5  #: Of what is left to close, for each column: it keeps room for the children to raise D.


@kernel
def expand(gram: Any, cross: Any, size: int, tree: Any, slot: int, w: Any, best_rss: Any, best_state: Any) -> int:
    """Bound a node: CLOSED, AGAIN (many columns were fixed), or the column to branch on.

    What is to be opened stands in the scratch: the state in CURRENT, the shares in Y, bounds in OUTCOME.
    """
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
    bound0 = tree.bound[slot]
    threshold = best_rss[-1] * (1.0 - PROOF_TOLERANCE) - 1e-14
    if bound0 >= threshold:
        return CLOSED
    for j in range(p):
        current[j] = tree.state[slot, j]
    n[NODES] += 1
    kept = COUNT(0)
    for j in range(p):
        if current[j] == KEPT:
            order[kept] = j
            kept += 1
    total = kept
    for j in range(p):
        if current[j] == FREE:
            order[total] = j
            total += 1
    a = size - kept
    if a < 0 or a > total - kept:
        return CLOSED
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
    t = COUNT(0)
    null = COUNT(-1)
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
        if best_rss.size > 1:
            return _carried(tree, w, slot, null, bound0)
        spare = max(0, a - t)
        for i in range(kept, total):
            if big[i * stride + i] <= PIVOT_TOLERANCE:
                current[order[i]] = KEPT if spare > 0 else DROPPED
                spare -= 1
        a = min(a, t)
    sp = t + 1
    for i in range(t):
        ki = chosen[i]
        for e in range(i, t):
            pm[i * sp + e] = big[ki * stride + chosen[e]]
        pm[i * sp + t] = big[ki * stride + total]
    leaf = a <= 2
    few = a
    which = PM
    keep = True
    if not leaf and t - a <= 2 and inverse(pm, sp, t, wm, wx, inv):
        n[WORK] -= t * t * t
        leaf = True
        few = t - a
        which = INV
        keep = False
        for j in range(t):
            r -= inv[j * sp + t] * pm[j * sp + t]
    if leaf or a == t:
        if a == t:
            few = COUNT(0)
            keep = False
        n[WORK] -= t * t
        enumerate_leaves(gram, cross, best_rss, best_state, w, w.matrices[which], t, few, r, keep)
        return CLOSED
    least = np.inf
    for j in range(t):
        diagonal[j] = tree.diagonal[slot, free[j]]
        least = min(least, diagonal[j])
        wz[j] = max(tree.share[slot, free[j]], 1e-4)
        ranking[j] = j
    dependent = COUNT(-1)
    if least <= 0.0:
        n[WORK] -= 10 * t * t * t
        if not inverse_diagonal(pm, sp, t, wm, wx, wy, inv, diagonal):
            for j in range(t):
                diagonal[j] = tree.diagonal[slot, free[j]]
                if wm[j * sp + j] <= 0.0 and dependent < 0:
                    dependent = free[j]
    bound = bound0
    now = bound0
    last = -np.inf
    settled = -np.inf
    fixed = COUNT(0)
    for solve in range(MAX_SOLVES):
        spread_shares(wz, t, a)
        now = relax(pm, sp, t, a, r, diagonal, wz, wm, u, h, ranking)
        n[WORK] -= t * t * (t + 12) // 6
        bound = max(bound, now)
        if now >= threshold:
            return CLOSED
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
        if a == 3 and solve == 1 and 5 * fixed <= t:
            n[WORK] -= t * t * t // 6
            enumerate_triples(gram, cross, best_rss, best_state, w, pm, t, r)
            return CLOSED
        if 5 * fixed > t or solve == MAX_SOLVES - 1:
            break
        if now - last < MIN_PROGRESS * (threshold - now):
            if now - settled < MIN_RAISE * (threshold - now) or dependent >= 0 or threshold == np.inf:
                break
            settled = now
            n[WORK] -= t * t * (t + 12)
            if not raised(pm, sp, t, diagonal, wz, u, BARRIER * (threshold - now) / t, wm, big, inv, wx, wy):
                break
            last = -np.inf
        last = max(last, now)
        for j in range(t):
            wz[j] = max(wz[j] * np.sqrt(h[j] * np.sqrt(h[j])), 1e-150)
    if dependent >= 0 and current[dependent] == FREE:
        return _carried(tree, w, slot, dependent, bound)
    n[WORK] -= t * t * t // 3
    inverse_after_elimination(wm, sp, t, inv)
    return _chosen(w, t, a, bound, now, fixed)


@kernel
def _carried(tree: Any, w: Any, slot: int, column: int, bound: float) -> int:
    """Branch on a given column; the children start where this node did."""
    shares = w.vectors[Y]
    outcome = w.vectors[OUTCOME]
    handed = w.vectors[HANDED]
    for j in range(tree.share.shape[1]):
        shares[j] = tree.share[slot, j]
        handed[j] = tree.diagonal[slot, j]
    outcome[0] = bound
    outcome[1] = bound
    return column


@kernel
def _chosen(w: Any, t: int, a: int, bound: float, now: float, fixed: int) -> int:
    """The free column to branch on, or AGAIN after many columns were fixed.

    By what the relaxed RSS rises at fixed shares when the column is dropped, plus what it rises when it is kept, each
    less what the others gain or lose by the change of its share.
    """
    z = w.vectors[Z]
    h = w.vectors[H]
    shares = w.vectors[Y]
    outcome = w.vectors[OUTCOME]
    ranking = w.integers[RANKING]
    free = w.integers[FREE_COLUMNS]
    current = w.states[CURRENT]
    diagonal = w.vectors[DIAGONAL]
    handed = w.vectors[HANDED]
    inv = w.matrices[INV]
    for j in range(current.size):
        shares[j] = 1.0
        handed[j] = 0.0
    largest = 1e-300
    for j in range(t):
        largest = max(largest, z[j])
    best = -1.0
    at = COUNT(-1)
    for j in range(t):
        share = z[j] / largest
        shares[free[j]] = share
        handed[free[j]] = diagonal[j]
        rest = 1.0 - z[j]
        own = min(max(diagonal[j] * inv[j * (t + 1) + j] / z[j], 1e-12), 1.0)
        v = z[j] * (h[j] / own - h[ranking[a]]) + h[j] * rest * rest * (1.0 - own) / (1.0 - rest * own)
        if current[free[j]] == FREE and v > best:
            best = v
            at = j
    outcome[0] = bound
    outcome[1] = bound
    if at < 0 or 5 * fixed > t:
        return AGAIN
    outcome[0] = max(bound, now + h[ranking[a - 1]] - h[at])
    outcome[1] = max(bound, now + h[at] - h[ranking[a]])
    return int(free[at])


@kernel
def search(
    gram: Any, cross: Any, size: int, tree: Any, w: Any, best_rss: Any, best_state: Any, most: int, work: int
) -> int:
    """Expand nodes until none is open (DONE), the work is used up (PAUSED) or more room is needed (FULL)."""
    current = w.states[CURRENT]
    outcome = w.vectors[OUTCOME]
    n = tree.counters
    n[WORK] = work
    room = tree.bound.size
    while n[WORK] >= 0:
        slot = int(np.argmin(tree.rank))
        if tree.rank[slot] >= best_rss[-1] * (1.0 - PROOF_TOLERANCE) - 1e-14:
            return DONE
        if room < most and n[OPEN] + 2 > room:
            return FULL
        tree.rank[slot] = np.inf
        n[OPEN] -= 1
        column = expand(gram, cross, size, tree, slot, w, best_rss, best_state)
        depth_first = n[OPEN] >= most - 2 * gram.shape[0] - 8
        # the child that keeps the column comes last: a stack takes it first
        for child in range(0 if column == CLOSED else 1 if column == AGAIN else 2):
            if column >= 0:
                current[column] = DROPPED if child == 0 else KEPT
            push(tree, current, w.vectors[Y], w.vectors[HANDED], outcome[1 - child], depth_first)
    return PAUSED
