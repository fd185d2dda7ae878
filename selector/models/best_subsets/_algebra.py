"""Compiled linear algebra of the subset search: elimination, Schur complements, bookkeeping of the best sets.

Matrices are flat row-major arrays with an explicit row stride; only the upper triangle is used and the cross-products
with the response stand in the column after the last predictor. Predictors are scaled to unit length, so a pivot is
the share of a column that the columns before it do not explain.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar

import numpy as np
from numba import njit

PIVOT_TOLERANCE = 1e-10
"""A column whose unexplained share (1 - R² on the columns before it) is below this adds nothing.

A pivot of a cross-product matrix carries a rounding error near n_columns · 1e-16, so 1e-10 keeps five digits.
"""

FREE, KEPT, DROPPED = 0, 1, -1
F = TypeVar("F", bound=Callable[..., Any])


def kernel(function: F) -> F:
    """Compile at the first call, and keep the machine code on disk.

    Fused multiply-add, but no reassociation: no result depends on the vector width.
    """
    options: dict[str, Any] = {"cache": True, "nogil": True, "fastmath": {"contract", "nsz"}, "error_model": "numpy"}
    compiled: F = njit(**options)(function)
    return compiled


_U = np.uint64


@kernel
def eliminate(a: Any, stride: int, rows: int, columns: int, pivots: int, tolerance: float) -> int:
    """Gaussian elimination of the first `pivots` rows in place; returns how many pivots were at or below `tolerance`.

    A small pivot is set to 0 and its row is not used: its column depends on the columns before it. Four rows are
    eliminated at a time, which loads every target row once for four updates.
    """
    n = _U(stride)
    r = _U(rows)
    c = _U(columns)
    m = _U(pivots)
    one = _U(1)
    four = _U(4)
    small = 0
    j = _U(0)
    while j < m:
        width = m - j
        if width > four:
            width = four
        end = j + width
        for q in range(j, end):
            d = a[q * n + q]
            if d <= tolerance:
                small += 1
                for e in range(q, c):
                    a[q * n + e] = 0.0
                continue
            inverse = 1.0 / d
            stop = end if width == four else r
            for i in range(q + one, stop):
                f = -a[q * n + i] * inverse
                for e in range(i, c):
                    a[i * n + e] += f * a[q * n + e]
        if width == four:
            j1 = j + one
            j2 = j1 + one
            j3 = j2 + one
            d0, d1, d2, d3 = a[j * n + j], a[j1 * n + j1], a[j2 * n + j2], a[j3 * n + j3]
            i0 = -1.0 / d0 if d0 > 0.0 else 0.0
            i1 = -1.0 / d1 if d1 > 0.0 else 0.0
            i2 = -1.0 / d2 if d2 > 0.0 else 0.0
            i3 = -1.0 / d3 if d3 > 0.0 else 0.0
            for i in range(end, r):
                f0 = a[j * n + i] * i0
                f1 = a[j1 * n + i] * i1
                f2 = a[j2 * n + i] * i2
                f3 = a[j3 * n + i] * i3
                for e in range(i, c):
                    a[i * n + e] += f0 * a[j * n + e] + f1 * a[j1 * n + e] + f2 * a[j2 * n + e] + f3 * a[j3 * n + e]
        j = end
    return small


@kernel
def back_substitute(a: Any, stride: int, t: int, solution: Any) -> None:
    """Coefficients after `eliminate`, with the right-hand side in column t; 0 where a pivot was too small."""
    for j in range(t - 1, -1, -1):
        d = a[j * stride + j]
        if d <= 0.0:
            solution[j] = 0.0
            continue
        s = a[j * stride + t]
        row = a[j * stride + j + 1 : j * stride + t]
        tail = solution[j + 1 : t]
        for e in range(row.size):
            s -= row[e] * tail[e]
        solution[j] = s / d


@kernel
def gather(gram: Any, cross: Any, order: Any, n: int, a: Any, stride: int) -> None:
    """Copy the upper triangle of ``gram[order, order]`` and ``cross[order]`` into the flat matrix."""
    for i in range(n):
        source = gram[order[i]]
        base = i * stride
        for e in range(i, n):
            a[base + e] = source[order[e]]
        a[base + n] = cross[order[i]]


@kernel
def set_rss(gram: Any, cross: Any, state: Any, a: Any, order: Any) -> float:
    """Residual sum of squares, total scaled to 1, of the columns with ``state == KEPT``, from scratch."""
    n = 0
    for j in range(state.size):
        if state[j] == KEPT:
            order[n] = j
            n += 1
    stride = n + 1
    gather(gram, cross, order, n, a, stride)
    eliminate(a, stride, n, n + 1, n, PIVOT_TOLERANCE)
    rss = 1.0
    for j in range(n):
        d = a[j * stride + j]
        if d > 0.0:
            x = a[j * stride + n]
            rss -= x * x / d
    return max(rss, 0.0)


@kernel
def insert(best_rss: Any, best_state: Any, state: Any, rss: float) -> bool:
    """Put a set into the sorted list of the best ones of its size, unless it is there already."""
    n = best_rss.size
    if not rss < best_rss[n - 1]:
        return False
    p = state.size
    for i in range(n):
        if best_rss[i] == np.inf:
            break
        same = True
        for j in range(p):
            if (best_state[i, j] == KEPT) != (state[j] == KEPT):
                same = False
                break
        if same:
            return False
    i = n - 1
    while i > 0 and best_rss[i - 1] > rss:
        best_rss[i] = best_rss[i - 1]
        for j in range(p):
            best_state[i, j] = best_state[i - 1, j]
        i -= 1
    best_rss[i] = rss
    for j in range(p):
        best_state[i, j] = KEPT if state[j] == KEPT else DROPPED
    return True
