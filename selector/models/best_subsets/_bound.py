"""Compiled lower bound of one node of the subset search: the perspective relaxation, and closed-form leaves.

A node keeps some columns, has dropped others, and must choose `a` of the `t` free ones. With P the cross-products of
the free columns given the kept ones, c those with the response, r the residual sum of squares of the kept ones, and
any diagonal D >= 0 for which P - D has no negative eigenvalue, every choice A of `a` columns and every vector u obey

    RSS(A)  >=  r - u'(P - D)u - (sum of the `a` largest h_j),   h_j = (c - (P - D)u)_j² / D_jj.

The best u solves (P - D + D/z) u = c for the shares 0 < z <= 1 with sum `a` that minimise the relaxed RSS; a few
solves find it nearly, and the bound holds at every one of them. See docs/explanation/best-subset-search.md.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from selector.models.best_subsets._algebra import PIVOT_TOLERANCE, back_substitute, eliminate, kernel

SMALLEST_SHARE = 1e-9
"""Shares z are kept above this; the bound stays valid, the matrix stays finite."""


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
def inverse(pm: Any, stride: int, t: int, m: Any, x: Any, out: Any) -> bool:
    """Inverse of P into the upper triangle of `out`, coefficients P⁻¹c into its column t; False when P is singular."""
    for i in range(t):
        for e in range(i, t + 1):
            m[i * stride + e] = pm[i * stride + e]
    if eliminate(m, stride, t, t + 1, t, PIVOT_TOLERANCE) > 0:
        return False
    back_substitute(m, stride, t, x)
    for j in range(t):
        out[j * stride + t] = x[j]
    for k in range(t):
        for j in range(t):
            x[j] = 0.0
        x[k] = 1.0
        _solve(m, stride, t, x)
        for j in range(k + 1):
            out[j * stride + k] = x[j]
    return True


@kernel
def inverse_diagonal(pm: Any, stride: int, t: int, m: Any, x: Any, y: Any, out: Any, diagonal: Any) -> bool:
    """A valid D in proportion to 1/diag(P⁻¹), nearly as large as can be; False when P is singular."""
    if not inverse(pm, stride, t, m, x, out):
        return False
    for j in range(t):
        # the correlations of P⁻¹ have no root above t
        diagonal[j] = 0.999 / (out[j * stride + j] * t)
    _rescale(pm, stride, t, diagonal, m, x, y)
    return True


@kernel
def root_diagonal(pm: Any, stride: int, t: int, m: Any, x: Any, y: Any, out: Any, diagonal: Any) -> bool:
    """`inverse_diagonal`, then raised column by column and scaled again; False when P is singular.

    With E the inverse of P - D, column j may rise by any share of 1/E_jj below 1.
    """
    if not inverse_diagonal(pm, stride, t, m, x, y, out, diagonal):
        return False
    full = np.empty((t, t))
    for _sweep in range(2):
        for j in range(t):
            diagonal[j] *= 0.9
        if not _shifted(pm, stride, t, diagonal, 1.0, m):
            break
        for k in range(t):
            for j in range(t):
                x[j] = 0.0
            x[k] = 1.0
            _solve(m, stride, t, x)
            for j in range(t):
                full[k, j] = x[j]
        for j in range(t):
            step = 0.3 / full[j, j]
            diagonal[j] += step
            f = step / (1.0 - step * full[j, j])
            for i in range(t):
                x[i] = full[i, j] * f
                y[i] = full[i, j]
            for i in range(t):
                for e in range(t):
                    full[i, e] += x[i] * y[e]
        shrink = 1.0
        while not _shifted(pm, stride, t, diagonal, shrink, m) and shrink > 1e-3:
            shrink *= 0.97
        for j in range(t):
            diagonal[j] *= shrink
    _rescale(pm, stride, t, diagonal, m, x, y)
    return True


@kernel
def _rescale(pm: Any, stride: int, t: int, diagonal: Any, m: Any, x: Any, y: Any) -> None:
    for _ in range(20):
        scale = largest_scale(pm, stride, t, diagonal, m, x, y)
        for j in range(t):
            diagonal[j] *= scale
        if scale < 1.02:
            break
