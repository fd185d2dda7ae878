"""Compiled linear algebra of the subset search, and the lower bound of one node.

Matrices are flat row-major arrays with an explicit row stride; only the upper triangle is used and the cross-products
with the response stand in the column after the last predictor. Predictors are scaled to unit length, so a pivot is
the share of a column that the columns before it do not explain.

P, c, r, D, u, h and z are those of *The bound* in docs/explanation/best-subset-search.md.
"""

from collections.abc import Callable
from typing import Any, TypeVar

import numpy as np
from numba import njit

#: A column whose unexplained share (1 - R² on the columns before it) is below this adds nothing.
#:
#: A pivot of a cross-product matrix carries a rounding error near n_columns · 1e-16, so 1e-10 keeps five digits.
PIVOT_TOLERANCE = 1e-10
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

#: Where a count that is handed on begins: for a plain 0 what it is handed to would be compiled once more.
COUNT: Any = np.int64


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
                if f0 == 0.0 and f1 == 0.0 and f2 == 0.0 and f3 == 0.0:
                    continue  # columns of another response
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
    n = COUNT(0)
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
def insert(best_rss: Any, best_state: Any, state: Any, rss: float) -> None:
    """Put a set into the sorted list of the best ones of its size, unless it is there already."""
    if not rss < best_rss[-1]:
        return
    for i in range(best_rss.size):
        same = best_rss[i] < np.inf
        for e in range(state.size):
            same &= (best_state[i, e] == KEPT) == (state[e] == KEPT)
        if same:
            return
    i = best_rss.size - 1
    while i > 0 and best_rss[i - 1] > rss:
        best_rss[i] = best_rss[i - 1]
        for e in range(state.size):
            best_state[i, e] = best_state[i - 1, e]
        i -= 1
    best_rss[i] = rss
    for e in range(state.size):
        best_state[i, e] = KEPT if state[e] == KEPT else DROPPED


SMALLEST_SHARE = 1e-9  #: Shares z are kept above this; the bound stays valid, the matrix stays finite.


@kernel
def spread_shares(z: Any, t: int, a: int) -> None:
    """Scale positive weights so that they sum to `a` with none above 1."""
    capped = 0
    for _ in range(t):
        total = 0.0
        for j in range(t):
            if z[j] < 1.0:
                total += z[j]
        f = (a - capped) / max(total, 1e-300)
        more = 0
        for j in range(t):
            if z[j] < 1.0:
                z[j] *= f
                if z[j] >= 1.0:
                    z[j] = 1.0
                    more += 1
        capped += more
        if more == 0 or capped >= a:
            break
    for j in range(t):
        z[j] = min(1.0, max(z[j], SMALLEST_SHARE))


@kernel
def sort_descending(h: Any, ranking: Any, t: int) -> None:
    """Insertion sort of `ranking` so that ``h[ranking]`` falls; fast when it nearly does already."""
    for i in range(1, t):
        x = ranking[i]
        hx = h[x]
        j = i - 1
        while j >= 0 and h[ranking[j]] < hx:
            ranking[j + 1] = ranking[j]
            j -= 1
        ranking[j + 1] = x


@kernel
def relax(
    pm: Any, stride: int, t: int, a: int, r: float, diagonal: Any, z: Any, m: Any, u: Any, h: Any, ranking: Any
) -> float:
    """One solve at the shares `z`: the bound; fills `u`, `h` and the ranking of `h`."""
    for i in range(t):
        source = pm[i * stride + i : i * stride + t + 1]
        target = m[i * stride + i : i * stride + t + 1]
        for e in range(source.size):
            target[e] = source[e]
        m[i * stride + i] += diagonal[i] * (1.0 / z[i] - 1.0)
    eliminate(m, stride, t, t + 1, t, 1e-14)
    back_substitute(m, stride, t, u)
    bound = r
    for j in range(t):
        q = diagonal[j] * u[j] / z[j]
        bound -= u[j] * (pm[j * stride + t] - q)
        h[j] = q * u[j] / z[j]
    sort_descending(h, ranking, t)
    for i in range(a):
        bound -= h[ranking[i]]
    return bound


@kernel
def _shifted(pm: Any, stride: int, t: int, diagonal: Any, shift: float, m: Any) -> bool:
    """Eliminate P - shift · D in place of `m`; whether it is positive definite with a margin for rounding."""
    for i in range(t):
        source = pm[i * stride + i : i * stride + t]
        target = m[i * stride + i : i * stride + t]
        for e in range(source.size):
            target[e] = source[e]
        m[i * stride + i] -= shift * diagonal[i] + 1e-15 * t
    return bool(eliminate(m, stride, t, t, t, 0.0) == 0)


@kernel
def _solve(m: Any, stride: int, t: int, x: Any) -> None:
    for j in range(t):
        f = -x[j] / m[j * stride + j]
        row = m[j * stride + j + 1 : j * stride + t]
        rest = x[j + 1 : t]
        for e in range(row.size):
            rest[e] += f * row[e]
    for j in range(t - 1, -1, -1):
        s = x[j]
        row = m[j * stride + j + 1 : j * stride + t]
        rest = x[j + 1 : t]
        for e in range(row.size):
            s -= row[e] * rest[e]
        x[j] = s / m[j * stride + j]


@kernel
def largest_scale(pm: Any, stride: int, t: int, diagonal: Any, m: Any, x: Any, y: Any) -> float:
    """A factor >= 1, near the largest, by which a valid D may be multiplied with P - D still without negative roots.

    Three inverse iterations estimate it from above; an elimination then verifies what is returned.
    """
    if not _shifted(pm, stride, t, diagonal, 0.9, m):
        return 1.0
    for j in range(t):
        x[j] = 1.0 if (j & 1) == 0 else -0.7
    least = np.inf
    for _ in range(3):
        norm = 0.0
        for j in range(t):
            y[j] = diagonal[j] * x[j]
            norm += x[j] * y[j]
        if norm <= 0.0:
            return 1.0
        f = 1.0 / np.sqrt(norm)
        for j in range(t):
            y[j] *= f
            x[j] = y[j]
        _solve(m, stride, t, x)
        top = 0.0
        bottom = 0.0
        for j in range(t):
            top += x[j] * y[j]
            bottom += x[j] * x[j] * diagonal[j]
        least = top / bottom
    for share in (0.9, 0.6):
        scale = 0.9 + share * least
        if scale > 1.01 and _shifted(pm, stride, t, diagonal, scale, m):
            return scale
    return 1.0


@kernel
def inverse_after_elimination(m: Any, stride: int, t: int, out: Any) -> None:
    """Inverse of the symmetric matrix that `eliminate` left as `m`, both triangles, row by row from the last."""
    for i in range(t - 1, -1, -1):
        d = 1.0 / m[i * stride + i]
        target = out[i * stride + i + 1 : i * stride + t]
        for e in range(target.size):
            target[e] = 0.0
        k = i + 1
        while k < t:
            f0 = -d * m[i * stride + k]
            r0 = out[k * stride + i + 1 : k * stride + t]
            if t - k < 4:
                for e in range(target.size):
                    target[e] += f0 * r0[e]
                k += 1
                continue
            f1 = -d * m[i * stride + k + 1]
            f2 = -d * m[i * stride + k + 2]
            f3 = -d * m[i * stride + k + 3]
            r1 = out[(k + 1) * stride + i + 1 : (k + 1) * stride + t]
            r2 = out[(k + 2) * stride + i + 1 : (k + 2) * stride + t]
            r3 = out[(k + 3) * stride + i + 1 : (k + 3) * stride + t]
            for e in range(target.size):
                target[e] += f0 * r0[e] + f1 * r1[e] + f2 * r2[e] + f3 * r3[e]
            k += 4
        corner = d
        for e in range(i + 1, t):
            corner -= m[i * stride + e] * d * out[i * stride + e]
            out[e * stride + i] = out[i * stride + e]
        out[i * stride + i] = corner


@kernel
def inverse(pm: Any, stride: int, t: int, m: Any, x: Any, out: Any) -> bool:
    """Inverse of P into `out`, coefficients P⁻¹c into its column t; False when P is singular."""
    for i in range(t):
        for e in range(i, t + 1):
            m[i * stride + e] = pm[i * stride + e]
    if eliminate(m, stride, t, t + 1, t, PIVOT_TOLERANCE) > 0:
        return False
    back_substitute(m, stride, t, x)
    inverse_after_elimination(m, stride, t, out)
    for j in range(t):
        out[j * stride + t] = x[j]
    return True


@kernel
def raised(
    pm: Any, stride: int, t: int, diagonal: Any, z: Any, u: Any, barrier: float, m: Any, e: Any, q: Any, x: Any, y: Any
) -> bool:
    """One Newton step of D > 0 towards the largest bound; False, and nothing is changed, if P - D is singular.

    To be called after `relax`, whose elimination it finds in `m` and spoils. With w = 1/z - 1 and E = (P - D)⁻¹, the
    slope of bound + barrier · (log det(P - D) + sum of log D) is w u² - barrier · (diag E - 1/D).
    """
    if not _shifted(pm, stride, t, diagonal, 1.0, e):
        return False
    inverse_after_elimination(m, stride, t, q)
    inverse_after_elimination(e, stride, t, m)
    for j in range(t):
        x[j] = u[j] * (1.0 / z[j] - 1.0)
    for i in range(t):
        f = 2.0 * x[i]
        for k in range(i, t):
            q[i * stride + k] = f * x[k] * q[i * stride + k] + barrier * m[i * stride + k] * m[i * stride + k]
        d = 1.0 / diagonal[i]
        q[i * stride + i] += barrier * d * d
        q[i * stride + t] = x[i] * u[i] - barrier * (m[i * stride + i] - d)
    eliminate(q, stride, t, t + 1, t, 0.0)
    back_substitute(q, stride, t, y)
    step = 1.0
    for j in range(t):
        if y[j] < 0.0:
            step = min(step, -0.9 * diagonal[j] / y[j])
    for _ in range(5):
        for j in range(t):
            x[j] = diagonal[j] + step * y[j]
        if _shifted(pm, stride, t, x, 1.0 + 1e-7, e):
            for j in range(t):
                diagonal[j] = x[j]
            break
        step *= 0.5
    return True


@kernel
def inverse_diagonal(pm: Any, stride: int, t: int, m: Any, x: Any, y: Any, out: Any, diagonal: Any) -> bool:
    """A valid D in proportion to 1/diag(P⁻¹), nearly as large as can be; False when P is singular."""
    if not inverse(pm, stride, t, m, x, out):
        return False
    for j in range(t):
        # the correlations of P⁻¹ have no root above t
        diagonal[j] = 0.999 / (out[j * stride + j] * t)
    for _ in range(20):
        scale = largest_scale(pm, stride, t, diagonal, m, x, y)
        for j in range(t):
            diagonal[j] *= scale
        if scale < 1.02:
            break
    return True
