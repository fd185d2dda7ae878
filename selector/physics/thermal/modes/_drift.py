"""Readings with white noise upon a slow random walk, made independent of each other (compiled)."""

from collections.abc import Callable

import numpy as np
from numba import njit
from numpy.typing import NDArray

from selector.types import Vector


def _whitened_loop(
    values: Vector,
    time_s: Vector,
    variance: Vector,
    walk: float,
    ripple: float,
    ripple_s: float,
    first: NDArray[np.bool_],
) -> tuple[Vector, float]:
    """Values (n, n_columns) less what the rows before predict, per standard deviation, and the sum of its logarithms.

    Every run begins (`first`) with a zero of which nothing is known, which then walks by `walk` [µm²/s]. Upon it is a
    ripple of variance `ripple` [µm²] that forgets itself within `ripple_s` [s], and white noise of `variance` (n,)
    [µm²]; where that is infinite the row tells nothing and becomes 0. So does the first row that tells something: it
    is the zero. A Kalman filter of two states.
    """
    n, columns = values.shape
    out = np.zeros((n, columns))
    zero, wave = np.zeros(columns), np.zeros(columns)
    a, b, c = 0.0, 0.0, 0.0  # covariance of zero and ripple: [[a, b], [b, c]]
    logs, known = 0.0, False
    for i in range(n):
        if first[i]:
            zero[:] = 0.0
            wave[:] = 0.0
            a, b, c, known = 0.0, 0.0, ripple, False
        else:
            since = time_s[i] - time_s[i - 1]
            kept = np.exp(-since / ripple_s)
            a += walk * since
            b *= kept
            c = ripple + (c - ripple) * kept * kept
            for j in range(columns):
                wave[j] *= kept
        if not np.isfinite(variance[i]):
            continue
        if known:
            total = a + 2.0 * b + c + variance[i]
            gain, other, scale = (a + b) / total, (b + c) / total, 1.0 / np.sqrt(total)
            for j in range(columns):
                ahead = values[i, j] - zero[j] - wave[j]
                out[i, j] = ahead * scale
                zero[j] += gain * ahead
                wave[j] += other * ahead
            ab, bc = a + b, b + c
            a -= gain * ab
            b -= gain * bc
            c -= other * bc
            logs += 0.5 * np.log(total)
        else:
            zero[:] = values[i]
            a, b, known = c + variance[i], -c, True
    return out, logs


whitened: Callable[..., tuple[Vector, float]] = njit(cache=True)(_whitened_loop)


def _evidence(rows: Vector, logs: float, gain: Vector) -> tuple[float, Vector, Vector]:
    """Negative log marginal likelihood of the last of the `whitened` columns (n, n_columns + 1) given the others.

    Their coefficients are normal about 0 with standard deviations `gain` (n_columns,); `logs` is what `whitened` gives.
    Also the lower root L of the precision of coefficients / `gain`, and L⁻¹ times their products with the last column.
    """
    n = len(gain)
    # all products of columns, the last column included, in one matrix; then Cholesky, whose last row is the half
    root = rows.T @ rows
    for j in range(n):
        for i in range(n + 1):
            root[i, j] *= gain[j]
            root[j, i] *= gain[j]
        root[j, j] += 1.0
    for j in range(n):
        for i in range(j, n + 1):
            total = root[i, j]
            for k in range(j):
                total -= root[i, k] * root[j, k]
            root[i, j] = np.sqrt(total) if i == j else total / root[j, j]
        logs += np.log(root[j, j])
        for i in range(j):
            root[i, j] = 0.0
    half = root[n, :n].copy()
    return logs + 0.5 * (root[n, n] - (half * half).sum()), root[:n, :n].copy(), half


evidence: Callable[..., tuple[float, Vector, Vector]] = njit(cache=True)(_evidence)
