"""Slow and obvious twins of what `selector.sensors` computes quickly."""

from __future__ import annotations

import numpy as np

from selector.sensors.groups import _relation, f_of_scatter


def max_min_composition(r, s):
    """Composition with entries max_k min(r_ik, s_kj), shape (m, p), of relations of shape (m, n) and (n, p)."""
    left, right = np.asarray(r, dtype=np.float64), np.asarray(s, dtype=np.float64)
    composed = np.minimum(left[:, :1], right[:1])
    for k in range(1, left.shape[1]):
        np.maximum(composed, np.minimum(left[:, k : k + 1], right[k : k + 1]), out=composed)
    return composed


def transitive_closure_by_squaring(r):
    """Transitive closure, and the number of squarings made: R → R² → R⁴ … until R^2k = R^k, P step 2.

    The last squaring, which changes nothing, is counted.
    """
    power = _relation(r)
    squarings = 0
    while True:
        square = max_min_composition(power, power)
        squarings += 1
        if np.array_equal(square, power):
            return square, squarings
        power = square


def f_statistic(similarity, partition):
    """F of a partition, the scatter summed up group by group."""
    s = np.asarray(similarity, dtype=np.float64)
    n = len(s)
    within = sum(len(group) - float(s[np.ix_(group, group)].sum()) / len(group) for group in partition.members)
    return f_of_scatter(n - float(s.sum()) / n, within, n, len(partition.members))
