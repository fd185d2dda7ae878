"""In which order to eliminate the unknowns of a mesh so that its factors stay sparse."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

Indices = NDArray[np.int64]

_LEAF = 60  # unknowns below which cutting further gains nothing


def nested_dissection(matrix: sparse.csr_array, places_m: NDArray[np.float64]) -> Indices:
    """Permutation of shape (n,) by nested dissection with planes (George 1973).

    The unknowns, which sit at `places_m` (n, 3), are cut in halves across their longest extent; those of one half that
    have a neighbour in the other separate them and come last. Unknowns at one place stay together.
    """
    # work on places, not on unknowns: the three displacements of a node share their neighbours
    _, first, place_of = np.unique(places_m, axis=0, return_index=True, return_inverse=True)
    place_of = place_of.ravel()
    gather = sparse.csr_array(
        (np.ones(len(place_of)), (place_of, np.arange(len(place_of)))), shape=(len(first), len(place_of))
    )
    graph = sparse.csr_array(gather @ (abs(matrix) @ gather.T))
    places = places_m[first]
    order: list[Indices] = []
    stack = [(np.arange(len(first)), False)]
    while stack:
        part, finished = stack.pop()
        if finished or len(part) <= _LEAF:
            order.append(part)
            continue
        low, separator, high = _cut(graph, places, part)
        if not len(low) or not len(high):
            order.append(part)
            continue
        stack += [(separator, True), (low, False), (high, False)]
    ranks = np.empty(len(first), dtype=np.int64)
    ranks[np.concatenate(order)] = np.arange(len(first))
    return np.argsort(ranks[place_of], kind="stable")


def _cut(graph: sparse.csr_array, places_m: NDArray[np.float64], part: Indices) -> tuple[Indices, Indices, Indices]:
    """The two halves of a part and what separates them: the smallest separator among the three axes."""
    best: tuple[Indices, Indices, Indices] | None = None
    for axis in range(3):
        along = places_m[part, axis]
        middle = np.median(along)
        upper = along > middle if (along > middle).any() else along >= middle
        if upper.all() or not upper.any():
            continue
        high, low = part[upper], part[~upper]
        side = np.zeros(graph.shape[0])
        side[high] = 1.0
        touching = (graph[low] @ side) > 0
        cut = (low[~touching], low[touching], high)
        if min(len(cut[0]), len(cut[2])) and (best is None or len(cut[1]) < len(best[1])):
            best = cut
    return best or (part[:0], part, part[:0])
