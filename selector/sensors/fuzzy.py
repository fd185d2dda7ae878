"""Which sensors hang together through others: max–min composition and transitive closure of a fuzzy relation."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numba import njit
from numpy.typing import ArrayLike, NDArray

from selector.errors import InputError
from selector.types import Matrix


@dataclass(frozen=True, eq=False)
class ClosureChain:
    """The whole closure of a relation over n sensors in 2n − 1 numbers.

    Sensors in the order in which a maximum spanning tree reaches them from sensor 0, always over the strongest link
    that leaves the sensors reached so far (Prim). Then, for positions a < b,

        t(order[a], order[b]) = min(levels[a], …, levels[b − 1]).

    ≤: for every k in a … b − 1, each path between the two leaves the first k + 1 sensors, and levels[k] is the
    strongest link that does. ≥: order[b] hangs on some parent at position p. If p ≥ a, follow the parent and use
    induction on b. If p < a, that link could already be taken at all steps after p, so levels[p … b − 2] are at least
    levels[b − 1], and the way p … a runs over links that are no weaker than the minimum.
    """

    #: (n,): Sensors; groups of every λ-cut are contiguous here, so it is also a leaf order of the dendrogram
    order: NDArray[np.int64]
    #: (n − 1,): levels[k] links order[k + 1] to the sensors before it; each is bit-equal to an entry of the relation
    levels: NDArray[np.float64]
    parents: NDArray[np.int64]  #: (n − 1,): The sensor at the other end of that link


def max_min_composition(r: ArrayLike, s: ArrayLike) -> Matrix:
    """Composition with entries max_k min(r_ik, s_kj), shape (m, p), of relations of shape (m, n) and (n, p).

    Raises InputError: the inner sizes differ or are 0, or an entry is not finite.
    """
    left, right = np.asarray(r, dtype=np.float64), np.asarray(s, dtype=np.float64)
    if left.ndim != 2 or right.ndim != 2 or left.shape[1] != right.shape[0] or left.shape[1] == 0:
        raise _unusable(f"shapes {left.shape} and {right.shape}", "shapes (m, n) and (n, p) with n ≥ 1")
    if not (np.isfinite(left).all() and np.isfinite(right).all()):
        raise _unusable("NaN or infinity in a relation", "finite entries")
    composed: Matrix = np.minimum(left[:, :1], right[:1])
    for k in range(1, left.shape[1]):
        np.maximum(composed, np.minimum(left[:, k : k + 1], right[k : k + 1]), out=composed)
    return composed


def closure_chain(r: ArrayLike) -> ClosureChain:
    """Maximum spanning tree of a similarity relation as a chain, in O(n²); see `ClosureChain` for its meaning.

    It has shape (n_sensors, n_sensors), is exactly symmetric with unit diagonal, its entries within [-1, 1].

    Anything else raises InputError, NaN too: an unknown similarity is neither 0 nor 1.
    """
    parts = _chain(_relation(r))
    for part in parts:
        part.setflags(write=False)
    return ClosureChain(*parts)


def transitive_closure(r: ArrayLike) -> Matrix:
    """Smallest max–min transitive relation that contains r, P step 2, shape (n_sensors, n_sensors), read-only.

    t_ij is the widest bottleneck over all paths from i to j. Nothing is computed but comparisons, so that every
    entry is bit-equal to an entry of r. O(n²) time, against O(n³ log n) of the squaring in the source; negative
    entries are welcome. Errors as `closure_chain`.
    """
    order, levels, _ = _chain(_relation(r))
    closure: Matrix = _closure_of_chain(order, levels)
    closure.setflags(write=False)
    return closure


def transitive_closure_by_squaring(r: ArrayLike) -> tuple[Matrix, int]:
    """Transitive closure as the source has it, and the number of squarings made: R → R² → R⁴ … until R^2k = R^k.

    The slow and obvious twin of `transitive_closure`, for tests and for comparison; P step 2. The last squaring, which
    changes nothing, is counted. Errors as `closure_chain`.
    """
    power: Matrix = _relation(r)
    squarings = 0
    while True:
        square = max_min_composition(power, power)
        squarings += 1
        if np.array_equal(square, power):
            square.setflags(write=False)
            return square, squarings
        power = square


def _relation(r: ArrayLike) -> Matrix:
    """A read-only C-ordered view or copy of r, checked."""
    relation = np.ascontiguousarray(r, dtype=np.float64)
    if relation.ndim != 2 or relation.shape[0] != relation.shape[1] or np.ndim(r) != 2 or relation.shape[0] == 0:
        raise _unusable(f"an array of shape {np.shape(r)}", "a square matrix with at least one sensor")
    # always read-only, so that the kernels are compiled for one type only
    relation = relation.view()
    relation.setflags(write=False)
    i, j = _first_flaw(relation)
    if i < 0:
        return relation
    here, there = float(relation[i, j]), float(relation[j, i])
    if not (np.isfinite(here) and np.isfinite(there)):
        raise _unusable(f"{here} at ({i}, {j}) and {there} at ({j}, {i})", "finite entries")
    if i == j:
        raise _unusable(f"{here!r} on the diagonal, sensor {i}", "exactly 1: every sensor is like itself")
    if here != there:
        raise _unusable(f"{here!r} at ({i}, {j}) but {there!r} at ({j}, {i})", "an exactly symmetric matrix")
    raise _unusable(f"{here!r} at ({i}, {j})", "entries within [-1, 1]")


def _unusable(found: str, expected: str) -> InputError:
    return InputError(
        found,
        expected=expected,
        where="similarity relation",
        advice="make the matrix with selector.sensors.correlation_similarity or similarity_from_cross_products",
    )


def _first_flaw_loop(r: Matrix) -> tuple[int, int]:
    n = r.shape[0]
    block = 64  # two blocks of 64 × 64 float64 fit the first-level cache; the mirrored entries are read by columns
    for top in range(0, n, block):
        for left in range(top, n, block):
            for i in range(top, min(top + block, n)):
                if left == top and r[i, i] != 1.0:
                    return i, i
                for j in range(max(left, i + 1), min(left + block, n)):
                    # written so that NaN counts as a flaw
                    if not (r[i, j] == r[j, i] and -1.0 <= r[i, j] <= 1.0):
                        return i, j
    return -1, -1


def _chain_loop(r: Matrix) -> tuple[NDArray[np.int64], Matrix, NDArray[np.int64]]:
    n = r.shape[0]
    order = np.zeros(n, dtype=np.int64)
    levels = np.empty(n - 1, dtype=np.float64)
    parents = np.zeros(n - 1, dtype=np.int64)
    strongest = r[0].copy()
    parent = np.zeros(n, dtype=np.int64)
    outside = np.ones(n, dtype=np.bool_)
    newest = 0
    for k in range(1, n):
        outside[newest] = False
        following = -1
        level = -np.inf
        for j in range(n):
            if outside[j]:
                if r[newest, j] > strongest[j]:
                    strongest[j] = r[newest, j]
                    parent[j] = newest
                if strongest[j] > level:
                    level = strongest[j]
                    following = j
        order[k] = following
        levels[k - 1] = level
        parents[k - 1] = parent[following]
        newest = following
    return order, levels, parents


def _closure_of_chain_loop(order: NDArray[np.int64], levels: Matrix) -> Matrix:
    n = order.shape[0]
    closure = np.empty((n, n), dtype=np.float64)
    for a in range(n):
        row = closure[order[a]]
        row[order[a]] = 1.0
        weakest = 1.0
        for b in range(a + 1, n):
            weakest = min(weakest, levels[b - 1])
            row[order[b]] = weakest
        weakest = 1.0
        for b in range(a - 1, -1, -1):
            weakest = min(weakest, levels[b])
            row[order[b]] = weakest
    return closure


_first_flaw: Callable[..., Any] = njit(cache=True)(_first_flaw_loop)
_chain: Callable[..., Any] = njit(cache=True)(_chain_loop)
_closure_of_chain: Callable[..., Any] = njit(cache=True)(_closure_of_chain_loop)
