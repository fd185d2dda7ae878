"""A subset problem made ready for the compiled search: cross-products, checked, scaled; how far a search is."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.sparse.csgraph import connected_components

from selector.errors import InputError
from selector.findings import Finding
from selector.models.best_subsets._algebra import FREE, KEPT, PIVOT_TOLERANCE, eliminate, inverse_diagonal
from selector.models.best_subsets._tree import PROOF_TOLERANCE, Scratch, Tree
from selector.models.best_subsets.results import Statistics
from selector.models.finding_table import FINDINGS
from selector.types import Matrix


def cross_products(X: ArrayLike, y: ArrayLike, *, intercept: bool = True) -> Matrix:
    """Cross-products of (X, y) about their means, shape (p + 1, p + 1), the response last.

    A column that is constant up to rounding gets an exact zero. Without an intercept the mean stays in.

    Raises InputError: the shapes do not fit, or a value is missing or infinite.
    """
    rows = _rows(X, y, intercept)
    return rows.T @ rows


def factor_from_rows(X: ArrayLike, y: ArrayLike, *, intercept: bool = True) -> Matrix:
    """Upper triangular R with R'R = the cross-products, by QR of the centred rows.

    It keeps twice the digits of `cross_products`, whose elements already hold squares.
    """
    rows = _rows(X, y, intercept)
    n = rows.shape[1]
    factor = np.zeros((n, n))
    upper = np.asarray(np.linalg.qr(rows, mode="r"))
    factor[: upper.shape[0]] = upper
    return factor * np.where(np.diag(factor) < 0.0, -1.0, 1.0)[:, None]


def rss_from_factor(factor: Matrix, columns: tuple[int, ...]) -> float:
    """Residual sum of squares of some columns, by QR of their part of the triangular factor."""
    part = factor[:, [*columns, factor.shape[1] - 1]]
    scale = np.linalg.norm(part, axis=0)
    part = part / np.where(scale > 0.0, scale, 1.0)
    basis, upper, kept = part[:, :0], part[:, -1].copy(), part[:, :-1]
    for column in kept.T:
        rest = column - basis @ (basis.T @ column)
        rest -= basis @ (basis.T @ rest)
        length = float(np.linalg.norm(rest))
        if length > 1e-5:  # the root of the pivot tolerance of the search
            basis = np.column_stack([basis, rest / length])
    upper -= basis @ (basis.T @ upper)
    upper -= basis @ (basis.T @ upper)
    return float(upper @ upper) * float(scale[-1]) ** 2


def _rows(X: ArrayLike, y: ArrayLike, intercept: bool) -> Matrix:
    predictors = np.asarray(X, dtype=np.float64)
    response = np.asarray(y, dtype=np.float64)
    if predictors.ndim != 2 or response.shape != predictors.shape[:1] or not predictors.size:
        raise InputError(
            f"predictors of shape {predictors.shape} and a response of shape {response.shape}",
            expected="(n_samples, n_columns) and (n_samples,), at least one of each",
            where="cross products",
            advice="pass one row per sample",
        )
    rows = np.column_stack([predictors, response])
    if not np.all(np.isfinite(rows)):
        raise InputError(
            f"{int(np.sum(~np.isfinite(rows)))} missing or infinite values",
            expected="finite numbers",
            where="cross products",
            advice="leave those samples out before the regression",
        )
    if intercept:
        size = np.max(np.abs(rows), axis=0)
        rows = rows - rows.mean(axis=0)
        # the mean of equal numbers may differ from them in the last digits
        rows[:, np.max(np.abs(rows), axis=0) <= 1e-13 * size] = 0.0
    return rows


@dataclass(frozen=True)
class Problem:
    """Columns at unit length, response at unit length."""

    #: gram and cross: (p, p) and (p,): A constant column is all zero
    gram: Matrix
    cross: Matrix
    root: NDArray[np.int8]  #: (p,): KEPT where a column must be in
    sst: float
    n_samples: float
    intercept: bool
    max_size: int

    @classmethod
    def of(
        cls, cross: ArrayLike, n_samples: float, must: Iterable[int], intercept: bool, n_best: int, max_size: int | None
    ) -> "Problem":
        """Checked and scaled; see `best_subsets` for the arguments."""
        matrix = checked_cross(cross)
        p = matrix.shape[0] - 1
        kept = checked_columns("must", must, p)
        require(n_best >= 1, f"n_best = {n_best}", "1 or more")
        top = max(min(p, int(n_samples) - intercept - 1), len(kept), 1) if max_size is None else min(max_size, p)
        require(top >= max(1, len(kept)), f"max_size = {max_size}", f"at least {max(1, len(kept))}")
        root = np.array([KEPT if j in kept else FREE for j in range(p)], dtype=np.int8)
        gram, response, sst = scaled(matrix)
        return cls(gram, response, root, sst, float(n_samples), intercept, top)

    @property
    def n_columns(self) -> int:
        """Columns there are."""
        return len(self.root)

    @property
    def n_must(self) -> int:
        """Columns that are in every set."""
        return int(np.sum(self.root == KEPT))

    def scratch(self) -> Scratch:
        """Work space for the compiled search."""
        p = self.n_columns
        return Scratch(
            np.zeros((4, (p + 1) * (p + 2))),
            np.zeros((8, p + 3)),
            np.zeros((4, p + 1), np.int64),
            np.zeros((2, p), np.int8),
        )

    def tree(self, room: int) -> Tree:
        """An empty store of open nodes."""
        p = self.n_columns
        return Tree(
            np.zeros(3, np.int64),
            np.full(room, np.inf),
            np.zeros(room),
            np.zeros((room, p), np.int8),
            np.zeros((room, p), np.float32),
            np.zeros((room, p), np.float32),
        )

    def larger(self, tree: Tree, most: int) -> Tree:
        """The same open nodes with twice the room, or the most there may be."""
        room = tree.bound.size
        grown = self.tree(min(2 * room, most))
        grown.counters[:] = tree.counters
        for name in ("rank", "bound", "state", "share", "diagonal"):
            getattr(grown, name)[:room] = getattr(tree, name)
        return grown

    def statistics(self) -> tuple[Statistics, float]:
        """What turns an RSS into the criteria, and the RSS with all columns."""
        p = self.n_columns
        a = np.zeros((p + 1, p + 1))
        a[:p, :p], a[:p, p], a[p, p] = self.gram, self.cross, 1.0
        flat = a.ravel()
        small = eliminate(flat, p + 1, p + 1, p + 1, p, PIVOT_TOLERANCE)
        full_rss = max(float(flat[-1]), 0.0) * self.sst
        free = self.n_samples - (p - int(small)) - self.intercept
        variance = full_rss / free if free > 0 else float("nan")
        return Statistics(self.sst, self.n_samples, self.intercept, variance), full_rss


def valid_diagonal(problem: Problem) -> tuple[Matrix, tuple[Finding, ...]]:
    """A large D >= 0 with gram - D positive semidefinite, and what is to be said about dependent columns.

    Columns that take part in a linear dependence get 0; the others what the rest of the matrix allows them.
    """
    p = problem.n_columns
    diagonal = _diagonal(problem.gram)
    if diagonal is not None:
        return diagonal, ()
    values, vectors = np.linalg.eigh(problem.gram)
    null = vectors[:, values < 10.0 * PIVOT_TOLERANCE]
    dependent = np.sum(null**2, axis=1) > 1e-8
    rest = np.flatnonzero(~dependent)
    full = np.zeros(p)
    if 0 < len(rest) < p:
        inside = np.flatnonzero(dependent)
        link = problem.gram[np.ix_(rest, inside)]
        inverse = np.linalg.pinv(problem.gram[np.ix_(inside, inside)], rcond=1e-9, hermitian=True)
        part = _diagonal(problem.gram[np.ix_(rest, rest)] - link @ inverse @ link.T)
        if part is not None:
            full[rest] = part
    return full, tuple(_findings(problem, null))


def _diagonal(gram: Matrix) -> Matrix | None:
    t = gram.shape[0]
    pm = np.zeros((t, t + 1))
    pm[:, :t] = gram
    diagonal = np.zeros(t + 1)
    work, out = np.zeros(t * (t + 1)), np.zeros(t * (t + 1))
    done = inverse_diagonal(pm.ravel(), t + 1, t, work, np.zeros(t + 1), np.zeros(t + 1), out, diagonal)
    return diagonal[:t] if done else None


def _findings(problem: Problem, null: Matrix) -> Iterator[Finding]:
    constant = np.diag(problem.gram) <= 0.0
    if constant.any():
        columns = np.flatnonzero(constant).tolist()
        told = f"Columns {columns} do not vary: they add nothing to any set."
        yield FINDINGS.finding("constant-column", told, evidence={"columns": columns})
    links = np.abs(null @ null.T) > 1e-6
    links[constant] = False
    inside = np.flatnonzero(np.diag(links))
    of = connected_components(links[np.ix_(inside, inside)], directed=False)[1]
    for group in dict.fromkeys(of.tolist()):
        columns = inside[of == group].tolist()
        told = f"Columns {columns} are linearly dependent (to 1e-10 of their sums of squares): several sets of them "
        told += "explain the same, and one of those is reported."
        yield FINDINGS.finding("dependent-columns", told, evidence={"columns": columns})


def scaled(matrix: Matrix) -> tuple[Matrix, Matrix, float]:
    """Cross-products of the columns at unit length, those with the response at unit length, and its square."""
    sst = float(matrix[-1, -1])
    squares = np.diag(matrix)[:-1]
    factor = np.where(squares > 0.0, 1.0 / np.sqrt(np.where(squares > 0.0, squares, 1.0)), 0.0)
    gram = matrix[:-1, :-1] * np.outer(factor, factor)
    np.fill_diagonal(gram, np.where(squares > 0.0, 1.0, 0.0))
    return gram, matrix[:-1, -1] * factor / np.sqrt(sst), sst


def checked_cross(cross: ArrayLike) -> Matrix:
    """The matrix as float64, symmetric, with a response that varies."""
    matrix = np.array(cross, dtype=np.float64)
    square = matrix.ndim == 2 and matrix.shape[0] == matrix.shape[1] and matrix.shape[0] >= 2
    require(square, f"cross-products of shape {matrix.shape}", "(p + 1, p + 1) with p >= 1, the response last")
    require(bool(np.all(np.isfinite(matrix))), "missing or infinite cross-products", "finite numbers")
    size = np.sqrt(np.abs(np.diag(matrix)))
    apart = np.abs(matrix - matrix.T) > 1e-9 * np.outer(size, size) + 1e-300
    require(not apart.any(), "cross-products that are not symmetric", "X'X of the centred columns")
    require(bool(matrix[-1, -1] > 0.0), "a response that does not vary", "a response that varies")
    return (matrix + matrix.T) / 2.0


def checked_columns(name: str, columns: Iterable[int], p: int) -> set[int]:
    """The numbers as a set, each a column."""
    chosen = {int(j) for j in columns}
    outside = sorted(j for j in chosen if not 0 <= j < p)
    require(not outside, f"{name} has {outside}", f"numbers from 0 to {p - 1}")
    return chosen


def require(holds: bool, found: str, expected: str) -> None:
    """Raise an InputError unless it holds."""
    if not holds:
        raise InputError(found, expected=expected, where="subset search", advice="correct this argument of the search")


CHUNK_WORK = 30_000_000  #: Multiplications between two looks at the clock: about 0.02 s; Ctrl-C waits no longer.


def relative_gap(best: float, bound: float) -> float:
    """How far the best RSS may be above the optimum, as a share of it: 0 where proved, 1 where nothing is known."""
    if bound >= best * (1.0 - PROOF_TOLERANCE) - 1e-14:
        return 0.0
    return 1.0 if not np.isfinite(best) else float((best - max(bound, 0.0)) / best)
