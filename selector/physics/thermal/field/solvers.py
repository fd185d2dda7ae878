"""How the large symmetric systems of a mesh are solved: by sparse factors while memory allows, else by multigrid."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.sparse.linalg import splu

from selector.types import Indices, Vector

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


Solver = Callable[[Vector], Vector]

MULTIGRID_TOLERANCE = 1e-10
"""Residual over right-hand side at which conjugate gradients stop."""


def direct_solver(matrix: sparse.csr_array, places_m: Vector) -> Solver:
    """Solver of a symmetric positive definite system whose unknowns sit at `places_m` (n, 3), factorised once."""
    order = nested_dissection(matrix, places_m)
    permuted = sparse.csc_array(matrix[order][:, order])
    factors = splu(permuted, permc_spec="NATURAL", diag_pivot_thresh=0.0, options={"SymmetricMode": True})

    def solve(right: Vector) -> Vector:
        result = np.empty_like(right, dtype=np.float64)
        result[order] = factors.solve(np.ascontiguousarray(right[order]))
        return result

    return solve


def multigrid_solver(matrix: sparse.csr_array, nodes_m: Vector) -> Solver:
    """Solver of an elastic system with three unknowns a node: conjugate gradients with smoothed aggregation.

    The coarse spaces hold the six motions of a rigid body exactly (Vaněk, Mandel and Brezina 1996).
    """
    import pyamg

    blocks = sparse.bsr_matrix(matrix, blocksize=(3, 3))
    blocks.indices, blocks.indptr = blocks.indices.astype(np.int32), blocks.indptr.astype(np.int32)
    sweep = ("block_gauss_seidel", {"sweep": "symmetric"})
    hierarchy = pyamg.smoothed_aggregation_solver(
        blocks,
        B=rigid_motions(nodes_m),
        strength=("symmetric", {"theta": 0.1}),
        presmoother=sweep,
        postsmoother=sweep,
        max_coarse=500,
    )

    def solution(right: Vector) -> Vector:
        if not right.any():
            return np.zeros_like(right)
        result, failed = hierarchy.solve(right, tol=MULTIGRID_TOLERANCE, accel="cg", maxiter=500, return_info=True)
        if failed:
            raise ArithmeticError(f"conjugate gradients did not reach {MULTIGRID_TOLERANCE:g} in 500 steps")
        return np.asarray(result)

    def solve(right: Vector) -> Vector:
        columns = right.reshape(len(right), -1)
        return np.stack([solution(column) for column in columns.T], axis=1).reshape(right.shape)

    return solve


def rigid_motions(nodes_m: Vector) -> Vector:
    """Three translations and three rotations about the middle, of shape (3·n, 6)."""
    arms = nodes_m - nodes_m.mean(axis=0)
    motions = np.zeros((len(nodes_m), 3, 6))
    for axis in range(3):
        motions[:, axis, axis] = 1.0
        motions[:, :, 3 + axis] = np.cross(np.eye(3)[axis], arms)
    return motions.reshape(-1, 6)
