"""Compiled closed-form end of a branch of the subset search: at most two columns left to choose."""

from __future__ import annotations

from typing import Any

from selector.models._subset_algebra import DROPPED, FREE, KEPT, insert, kernel, set_rss
from selector.models._subset_nodes import CURRENT, FREE_COLUMNS, ORDER, TRIAL, WHOLE, M


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
