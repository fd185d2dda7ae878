"""Search for a few of very many columns, best bound first, over a bound that lives on how few they are.

F, N, w, D, g and h are those of *A few of hundreds of columns* in docs/explanation/best-subset-search.md.
"""

import heapq
import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from selector.models.best_subsets import _algebra, _tree
from selector.models.best_subsets._algebra import DROPPED, FREE, KEPT, PIVOT_TOLERANCE, kernel
from selector.models.best_subsets.problem import Problem
from selector.types import Array, Indices, Matrix

MANY_COLUMNS = 250  #: With fewer, a node of `_tree.py` costs so little that its search is quicker.
WIDTH = 16  #: Of F, in eigenvectors.
#: The median D of this bound has to be so many times that of the other one, and this share of N_jj.
LARGER, LEAST_MEDIAN = 2.5, 0.1
MOST_SETS = 4e9  #: So many sets of up to four are tried one by one, some nanoseconds each, where no bound is good.
LEAST_SHARE = 0.03  #: Of N_jj; a column that keeps less is given away.
EVEN_SHARE, MOST_SHARE = 0.8, 0.97  #: Of N_jj, what other columns may take from it after and before weights are evened.
ROUNDING = 1e-14  #: Of an element of N.
MAX_SOLVES, MAX_WEIGHTINGS = 40, 8
MIN_PROGRESS, MIN_RAISE = 0.02, 0.05  #: Shares, and weights, have settled when they close less of what is left.
OF_COLUMNS, SHORT = 500, 0.1  #: All triples of t columns are tried where the bound is short by 0.1 (t / 500)³.
MOST_GIVEN = 500  #: Open nodes that remember what they need of their free columns.


@kernel
def curvature(n: Any, w: Any, count: int, d: Any) -> None:
    """D of the symmetric N for `count` + 1 columns to choose."""
    top = np.zeros(count + 1)
    for i in range(d.size):
        row = n[i]
        top[:] = 0.0
        for j in range(d.size):
            x = abs(row[j]) * w[j]
            if x > top[0] and j != i:
                k = 0
                while k + 1 < count and top[k + 1] < x:
                    top[k] = top[k + 1]
                    k += 1
                top[k] = x
        taken = 0.0
        for k in range(count):
            taken += top[k]
        d[i] = row[i] - taken / w[i] - ROUNDING * (count + 1)


def evened(n: Matrix, w: Array, a: int) -> tuple[Array, Array]:
    """Weights, and their D, after columns from which others take too much have got more weight."""
    d, taken = np.empty(len(w)), np.zeros(len(w))
    for _ in range(8):
        w = w * np.clip(taken / EVEN_SHARE, 1.0, 10.0) ** 0.7
        curvature(n, w, a - 1, d)
        taken = 1.0 - d / np.maximum(np.diagonal(n), 1e-300)
        if taken.max() < MOST_SHARE:
            break
    return w, d


@dataclass(frozen=True)
class Given:
    """What a bound needs to know of the free columns; the gifts are used, but not counted: a weaker bound."""

    gifts: tuple[int, ...]
    prices: Array  #: What each gift explains
    free: Indices  #: Column numbers, the gifts left out
    r: float
    c: Array
    basis: Matrix  #: F, a column for each direction
    d: Array
    w: Array

    def relaxed(self, a: int, z: Array, threshold: float) -> tuple[float, Array, Array]:
        """The largest bound found, its h, and its shares; g is best for shares z of the columns with sum `a`."""
        best, c, basis = (-np.inf, self.c, z), self.c, self.basis
        slow = 0
        for _ in range(MAX_SOLVES):
            z = z.copy()
            _algebra.spread_shares(z, len(z), a)
            scaled = basis * (z / self.d)[:, None]
            g = np.linalg.solve(np.eye(basis.shape[1]) + basis.T @ scaled, scaled.T @ c)
            h = (c - basis @ g) ** 2 / self.d
            now = float(self.r - g @ g - np.sum(np.partition(h, -a)[-a:]))
            slow = 0 if now - best[0] >= MIN_PROGRESS * (threshold - now) else slow + 1
            if now > best[0]:
                best = now, h, z
            if now >= threshold or slow == 2:
                break
            z = np.maximum(z * (h / max(h.max(), 1e-300)) ** 0.75, 1e-150)
        return best


def conditioned(
    problem: Problem, directions: Matrix, columns: tuple[int, ...], free: Indices
) -> tuple[Array, Array, Matrix, Matrix]:
    """What each of some columns explains, and c, F and N of the free ones; what depends on the columns is 0 in all."""
    p, used = problem.n_columns, list(columns)
    rows = np.column_stack([problem.gram[used], directions[used], problem.cross[used]])
    for i, j in enumerate(used):
        rest = rows[i] - rows[:i, j] @ rows[:i]
        rows[i] = 0.0
        if rest[j] > PIVOT_TOLERANCE:
            rows[i] = rest / np.sqrt(rest[j])
    part, of_f, of_y = rows[:, free], rows[:, p:-1], rows[:, -1]
    values, vectors = np.linalg.eigh(np.eye(directions.shape[1]) - of_f.T @ of_f)
    seen = values > 1e-9
    basis = (directions[free] - part.T @ of_f) @ (vectors[:, seen] / np.sqrt(values[seen]))
    c = problem.cross[free] - part.T @ of_y
    n = problem.gram[np.ix_(free, free)]
    null = np.flatnonzero(np.diagonal(n) - np.sum(part**2, axis=0) <= PIVOT_TOLERANCE)
    both = np.vstack([part, basis.T])
    n -= both.T @ both
    n[null] = n[:, null] = c[null] = basis[null] = 0.0
    n[null, null] = 1.0
    return of_y**2, c, basis, n


def shared_directions(problem: Problem) -> Matrix:
    """Eigenvectors of the columns, the noise of each taken for its unit, with their roots."""
    values, vectors = np.linalg.eigh(problem.gram)
    noise = np.ones(len(values))
    if values[0] > PIVOT_TOLERANCE:
        noise = 1.0 / np.sqrt(np.sum(vectors**2 / values, axis=1))
        values, vectors = np.linalg.eigh(problem.gram / np.outer(noise, noise))
    last = slice(-WIDTH, None)
    return np.asarray(noise[:, None] * vectors[:, last] * np.sqrt(np.maximum(values[last], 0.0)))


def better_for_few(problem: Problem, directions: Matrix, size: int, diagonal: Array) -> bool:
    """Whether this bound is the better one for a size, or there are so few sets that all can be tried."""
    a, free = size - problem.n_must, np.flatnonzero(problem.root == FREE)
    if a < 3 or (a < 5 and math.comb(len(free), a) <= MOST_SETS):
        return True
    n = conditioned(problem, directions, tuple(np.flatnonzero(problem.root == KEPT).tolist()), free)[-1]
    variance = np.maximum(np.diagonal(n), 1e-300)
    share = float(np.median(evened(n, 1.0 / np.sqrt(variance), a)[1] / variance))
    return share > max(LARGER * float(np.median(diagonal[free] / variance)), LEAST_MEDIAN)


@dataclass(frozen=True)
class _Node:
    bound: float
    kept: tuple[int, ...]
    free: Indices
    given: Given | None  #: Of a node that has kept the same columns
    #: w and z: (p,): Where weights and shares start
    w: Array | None
    z: Array


class WideSearch:
    """The open nodes of one size."""

    def __init__(self, problem: Problem, size: int, directions: Matrix) -> None:
        self.size, self.ended, self.visited, self.spent, self.most = size, False, 0, 0, 1000
        self._problem, self._directions, self._pushed = problem, directions, 0
        self._heap: list[tuple[float, int, _Node]] = []
        kept, free = (np.flatnonzero(problem.root == state) for state in (KEPT, FREE))
        self._push(_Node(0.0, tuple(kept.tolist()), free, None, None, np.ones(problem.n_columns)))

    def open_bound(self) -> float:
        """The smallest bound of the nodes that are still open; infinite when there are none."""
        return min((node.bound for _, _, node in self._heap), default=np.inf)

    def _push(self, node: _Node) -> None:
        self._pushed += 1
        # a node takes four times the room of one of `_tree.py`; where there is none, the youngest come first
        full = 4 * len(self._heap) > self.most
        heapq.heappush(self._heap, (-np.inf, -self._pushed, node) if full else (node.bound, self._pushed, node))

    def run(self, problem: Problem, scratch: _tree.Scratch, best_rss: Array, best_state: Any, work: int) -> None:
        """Work for one chunk; it has ended when no node is open any more."""
        self._scratch, self._best_rss, self._best_state = scratch, best_rss, best_state
        end = self.spent + work
        while self._heap and self.spent < end:
            node = self._heap[0][2]
            children = self._children(node) if node.bound < self._threshold() else []
            heapq.heappop(self._heap)
            for child in children:
                self._push(child)
        self.ended = not self._heap

    def _threshold(self) -> float:
        return float(self._best_rss[-1]) * (1.0 - _tree.PROOF_TOLERANCE) - 1e-14

    def _children(self, node: _Node) -> list[_Node]:
        a, t, given = self.size - len(node.kept), len(node.free), node.given
        self.visited += 1
        self.spent += 50 * t**2
        if a <= 2 or a >= t:
            self._offer_choices(node, a)
            return []
        if given is None or t == len(given.gifts) or t < 0.7 * (len(given.free) + len(given.gifts)):
            given = self._given(node, a)
        else:
            inside = np.isin(given.free, node.free, assume_unique=True)
            given = replace(given, **{name: getattr(given, name)[inside] for name in ("free", "c", "basis", "d", "w")})
        now, h, z = given.relaxed(min(a, len(given.free)), node.z[given.free], self._threshold())
        if now >= self._threshold():
            return []
        if a == 3 and now < self._threshold() * (1.0 - SHORT * (t / OF_COLUMNS) ** 3):
            self._offer_choices(node, a)
            return []
        return self._branched(node, given, now, h, z)

    def _branched(self, node: _Node, given: Given, now: float, h: Array, z: Array) -> list[_Node]:
        """The children of a node that is not closed, less the columns with which none gets below the threshold."""
        a = min(self.size - len(node.kept), len(h))
        order = np.argsort(-h, kind="stable")
        if not given.gifts:
            self._offer([*node.kept, *given.free[order[:a]]])
        out = order[a:]
        out = out[now + h[order[a - 1]] - h[out] >= self._threshold()]
        w, shares = np.full(len(node.z), np.median(given.w)), np.full(len(node.z), 1e-4)
        w[given.free], shares[given.free] = given.w, np.maximum(z, 1e-4)
        bound, same = max(node.bound, now), given if len(self._heap) < MOST_GIVEN else None
        most_out = h[order[a]] if a < len(h) else 0.0
        column, without = int(given.free[order[0]]), max(bound, now + float(h[order[0]] - most_out))
        if given.gifts and given.prices.max() > h[order[0]]:
            column, without, same = given.gifts[int(np.argmax(given.prices))], bound, None
        free = np.setdiff1d(np.append(np.delete(given.free, out), np.array(given.gifts, np.int64)), [column])
        return [
            _Node(without, node.kept, free, same, w, shares),
            _Node(bound, (*node.kept, column), free, None, w, shares),
        ]

    def _given(self, node: _Node, a: int) -> Given:
        """With the weights of the largest bound; a column that others leave no curvature is given away."""
        gifts: list[int] = []
        free, null, problem, threshold = node.free, node.free, self._problem, self._threshold()
        while True:
            # a single column shares nothing
            directions = self._directions[:, : 0 if len(free) == 1 else None]
            prices, c, basis, n = conditioned(problem, directions, (*node.kept, *gifts), free)
            null = free[c == 0.0] if not gifts else null
            variance = np.maximum(np.diagonal(n), 1e-300)
            w, d = evened(n, 1.0 / np.sqrt(variance) if node.w is None else node.w[free], a)
            short = np.flatnonzero(d < LEAST_SHARE * variance)
            if not len(short):
                break
            # one of those that take it from one another, some in a round
            taken: list[int] = []
            most = min(4 + len(short) // 8, len(free) - 1)
            for i in short[np.argsort((d / variance)[short], kind="stable")]:
                if len(taken) < most and np.all(n[i, taken] ** 2 < 0.04 * variance[i] * variance[taken]):
                    taken.append(int(i))
            gifts += free[taken].tolist()
            free = np.delete(free, taken)
        a = min(a, len(free))
        r, prices = 1.0 - float(np.sum(prices)), prices[len(node.kept) :]
        if not prices.all() or not np.isin(free[c == 0.0], null).all():
            r = 0.0  # what depends on gifts alone may add to a set without them
        found = best = Given(tuple(gifts), prices, free, r, c, basis, d, w)
        last, z = -np.inf, node.z[free]
        for _ in range(MAX_WEIGHTINGS):
            now, h, z = found.relaxed(a, z, threshold)
            best = found if now > last else best
            if now >= threshold or now - last < MIN_RAISE * (threshold - now):
                break
            last, level = now, max(float(np.partition(h, -a)[-a]), 1e-300)
            w, d = evened(n, found.w * np.clip(h / level, 0.3, 3.0) ** 0.25, self.size - len(node.kept))
            if np.any(d < LEAST_SHARE * variance):
                break
            found = replace(found, d=d, w=w)
        return best

    def _offer(self, columns: Any) -> None:
        state = np.full(self._problem.n_columns, DROPPED, np.int8)
        state[columns] = KEPT
        _tree.offer(self._problem.gram, self._problem.cross, self._best_rss, self._best_state, state, self._scratch)

    def _offer_choices(self, node: _Node, a: int) -> None:
        """Every choice of all, or of at most three, of the free columns."""
        problem, scratch, t = self._problem, self._scratch, len(node.free)
        if a > t:
            return
        explained, c, _, gram = conditioned(problem, self._directions[:, :0], node.kept, node.free)
        state = scratch.states[_tree.CURRENT]
        state[:] = DROPPED
        state[list(node.kept)], state[node.free] = KEPT, FREE
        scratch.integers[_tree.FREE_COLUMNS][:t] = node.free
        flat, r = np.column_stack([gram, c]).ravel(), 1.0 - float(np.sum(explained))
        of = (problem.gram, problem.cross, self._best_rss, self._best_state, scratch, flat, t)
        if a == 3 < t:
            _tree.enumerate_triples(*of, r)
        else:
            few, keep = (0, False) if a == t else (a, True)
            _tree.enumerate_leaves(*of, few, r, keep)
