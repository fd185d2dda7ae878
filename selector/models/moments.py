"""Cross-products of regression columns, run by run: everything a selection needs, after one pass over the samples.

Because runs add up, leaving one out is a subtraction: proof on unseen runs then costs no second look at the data.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from selector.models.design import Columns, Design
from selector.models.rows import block_bounds
from selector.models.terms import Scaling
from selector.recording import RunSource

_ROWS = 20_000


@dataclass(frozen=True)
class Fold:
    """A part of the data that is left out as a whole: a run, a condition, or a block of a single run."""

    name: str
    runs: tuple[str, ...]
    block: int | None = None


@dataclass(frozen=True)
class Moments:
    """Cross-products of (1, columns, responses) in each fold.

    Attributes
    ----------
    products : ndarray of shape (n_folds, 1 + n_columns + n_responses, same)
        W'W of the fold's rows, W = [1, columns, responses].
    folds : tuple of Fold
    n_columns, n_responses : int
    whole : ndarray of shape (k, k)
        The same over all rows of these folds; with blocks, rows purged between them are in here only.
    """

    products: NDArray[np.float64]
    folds: tuple[Fold, ...]
    n_columns: int
    n_responses: int
    whole: NDArray[np.float64]

    @property
    def n_samples(self) -> NDArray[np.float64]:
        """Samples in each fold, shape (n_folds,)."""
        return self.products[:, 0, 0]

    def only(self, folds: Sequence[int]) -> Moments:
        """The moments of some folds; a fold may stand several times, as in a bootstrap over runs."""
        if list(folds) == list(range(len(self.folds))):
            return self
        products = self.products[list(folds)]
        names = tuple(self.folds[i] for i in folds)
        return Moments(products, names, self.n_columns, self.n_responses, products.sum(axis=0))

    def centred(self) -> tuple[NDArray[np.float64], float]:
        """Centred cross-products of (columns, responses) over all rows, and the number of samples."""
        return centred(self.whole)


def centred(total: NDArray[np.float64]) -> tuple[NDArray[np.float64], float]:
    """Cross-products about the mean, from those of [1, ...]; and the number of samples.

    A column that rests gets exact zeros: what centring leaves of it is rounding.
    """
    n = float(total[0, 0])
    sums = total[0, 1:]
    cross = total[1:, 1:] - np.outer(sums, sums) / max(n, 1.0)
    rests = np.diag(cross) <= 1e-13 * np.diag(total)[1:]
    cross[rests, :] = 0.0
    cross[:, rests] = 0.0
    return (cross + cross.T) / 2.0, n


def scaling_of(source: RunSource, design: Design) -> Scaling:
    """Centre (mean) and scale (standard deviation) of every variable over all complete samples, in one pass."""
    n = 0.0
    mean = np.zeros(len(design.variables))
    spread = np.zeros(len(design.variables))
    for run in source.runs:
        for piece in design.pieces(source, run):
            values = piece.variables
            m = len(values)
            here = values.mean(axis=0)
            delta = here - mean
            spread += ((values - here) ** 2).sum(axis=0) + delta**2 * n * m / (n + m)
            mean += delta * m / (n + m)
            n += m
    deviation = np.sqrt(spread / max(n - 1.0, 1.0))
    floor = 1e-12 * np.maximum(1.0, np.abs(mean))
    scale = np.where(deviation > floor, deviation, 1.0)
    return Scaling(design.variables, tuple(map(float, mean)), tuple(map(float, scale)))


def moments(
    source: RunSource,
    design: Design,
    columns: Columns,
    *,
    n_blocks: int = 1,
) -> Moments:
    """Cross-products of every run (`n_blocks` = 1), or of the blocks of every run.

    Blocks are those of `rows.block_bounds`.

    One pass; memory O(n_folds · n_columns²), whatever the number of samples.
    """
    size = 1 + len(columns.terms) + len(design.responses)
    folds: list[Fold] = []
    products: list[NDArray[np.float64]] = []
    whole = np.zeros((size, size))
    for run in source.runs:
        if n_blocks == 1:
            parts = [np.zeros((size, size))]
            for _, variables, responses in _slices(source, design, run):
                _add(parts[0], columns, variables, responses)
            whole += parts[0]
        else:
            parts = _block_products(source, design, columns, run, whole, n_blocks)
        for i, product in enumerate(parts):
            if product[0, 0] > 0:
                folds.append(
                    Fold(run if n_blocks == 1 else f"{run} block {i + 1}", (run,), i if n_blocks > 1 else None)
                )
                products.append(product)
    stacked = np.array(products) if products else np.zeros((0, size, size))
    return Moments(stacked, tuple(folds), len(columns.terms), len(design.responses), whole)


def _block_products(
    source: RunSource, design: Design, columns: Columns, run: str, whole: NDArray[np.float64], n_blocks: int
) -> list[NDArray[np.float64]]:
    n = sum(len(piece.time_s) for piece in design.pieces(source, run))
    bounds = block_bounds(n, n_blocks)
    totals = [np.zeros_like(whole) for _ in bounds]
    for first, variables, responses in _slices(source, design, run):
        _add(whole, columns, variables, responses)
        for total, (start, stop) in zip(totals, bounds, strict=True):
            part = slice(max(start - first, 0), max(stop - first, 0))
            if len(variables[part]):
                _add(total, columns, variables[part], responses[part])
    return totals


def _slices(
    source: RunSource, design: Design, run: str
) -> Iterator[tuple[int, NDArray[np.float64], NDArray[np.float64]]]:
    """(position of the first row in the run, variables, responses) of at most `_ROWS` rows at a time."""
    first = 0
    for piece in design.pieces(source, run):
        for start in range(0, len(piece.time_s), _ROWS):
            rows = slice(start, start + _ROWS)
            yield first + start, piece.variables[rows], piece.responses[rows]
        first += len(piece.time_s)


def _add(
    total: NDArray[np.float64], columns: Columns, variables: NDArray[np.float64], responses: NDArray[np.float64]
) -> None:
    rows = np.empty((len(variables), total.shape[0]), order="F")
    rows[:, 0] = 1.0
    rows[:, 1 : 1 + len(columns.terms)] = columns.matrix(variables)
    rows[:, 1 + len(columns.terms) :] = responses
    total += rows.T @ rows


def coefficients(total: NDArray[np.float64], columns: Sequence[int], responses: Sequence[int]) -> NDArray[np.float64]:
    """(intercept, coefficients) of the least-squares fit on some columns, for several responses at once.

    Parameters
    ----------
    total : ndarray of shape (..., k, k)
        Cross-products of [1, columns, responses], one matrix or a stack of them.
    columns : sequence of int
        Positions of the columns in `total` (the constant, position 0, is always in).
    responses : sequence of int
        Positions of the responses in `total`.

    Returns
    -------
    ndarray of shape (..., 1 + len(columns), n_responses)
        Minimum-norm solution where columns are linearly dependent.
    """
    index = np.array([0, *columns])
    normal = total[..., index[:, None], index]
    right = total[..., index[:, None], np.asarray(responses)]
    diagonal = np.sqrt(np.maximum(np.einsum("...ii->...i", normal), 1e-300))
    scaled = normal / diagonal[..., :, None] / diagonal[..., None, :]
    rhs = right / diagonal[..., :, None]
    try:
        # a pivot below the rounding of the cross-products would give noise for coefficients
        factor = np.linalg.cholesky(scaled)
        if np.all(np.einsum("...ii->...i", factor) > 1e-6):
            return np.linalg.solve(scaled, rhs) / diagonal[..., :, None]
    except np.linalg.LinAlgError:
        pass
    solution = np.matmul(np.linalg.pinv(scaled, rcond=1e-12, hermitian=True), rhs)
    return solution / diagonal[..., :, None]


def squared_error(
    product: NDArray[np.float64], columns: Sequence[int], responses: Sequence[int], beta: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Σ (y − ŷ)² of coefficients on rows that are known by their cross-products only, shape (..., n_responses).

    `product` has shape (..., k, k) and `beta` (..., 1 + len(columns), n_responses), as `coefficients` gives it.
    """
    index = np.array([0, *columns])
    at = np.asarray(responses)
    part = product[..., index[:, None], index]
    cross = product[..., index[:, None], at]
    total = product[..., at, at]
    return np.maximum(total - 2.0 * (beta * cross).sum(axis=-2) + (beta * (part @ beta)).sum(axis=-2), 0.0)
