"""Everything a subset search needs of the samples: their cross-products, or a triangular factor of them."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from selector.errors import InputError
from selector.types import Matrix


def cross_products(X: ArrayLike, y: ArrayLike, *, intercept: bool = True) -> Matrix:
    """Cross-products of (X, y) about their means, shape (p + 1, p + 1), the response last.

    A column that is constant up to rounding gets an exact zero. Without an intercept the mean stays in.

    Raises
    ------
    InputError
        The shapes do not fit, or a value is missing or infinite.
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
    return _positive_diagonal(factor)


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


def _positive_diagonal(factor: Matrix) -> Matrix:
    signs = np.where(np.diag(factor) < 0.0, -1.0, 1.0)
    return factor * signs[:, None]


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
