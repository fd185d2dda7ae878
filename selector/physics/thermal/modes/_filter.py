"""The exact response of first-order modes to inputs that are held from block to block (compiled)."""

from collections.abc import Callable

import numpy as np
from numba import njit
from numpy.typing import NDArray

from selector.types import Vector


def _filtered_loop(
    before_s: Vector,
    after_s: Vector,
    speed: Vector,
    share: Vector,
    rate: Vector,
    film: Vector,
    drive: Vector,
    inputs: Vector,
    first: NDArray[np.bool_],
    same_rpm: float,
) -> tuple[Vector, Vector]:
    """Modes x_j' = −(diag(rate) + share·film)·x_j + drive_j·input_j, from rest, at the mean time of every block.

    Shapes: before_s, after_s, speed, share, first (n,), rate (n_modes,) [1/s], film (n_modes, n_modes) symmetric [1/s],
    drive (n_terms, n_modes) [1/s], inputs (n, n_terms); `first` marks the blocks with which a run begins; speeds that
    differ by less than same_rpm share their eigenvectors. Returns the states (n, n_modes, n_terms), and the share
    (n, n_modes) that is left of a start that is not at rest (coupling left out).
    """
    n, modes, terms = len(speed), len(rate), inputs.shape[1]
    out = np.empty((n, modes, terms))
    left = np.empty((n, modes))
    x = np.zeros((modes, terms))
    z = np.zeros((modes, terms))
    remaining = np.ones(modes)
    q = np.eye(modes)
    w = rate.copy()
    steady = np.zeros((modes, terms))
    coupled = np.abs(film).max() > 0.0
    last = -1.0
    for i in range(n):
        if first[i]:
            x[:] = 0.0
            remaining[:] = 1.0
            last = -1.0
        if coupled and (last < 0.0 or abs(speed[i] - last) > same_rpm):
            last = speed[i]
            matrix = share[i] * film
            for k in range(modes):
                matrix[k, k] += rate[k]
            w, q = np.linalg.eigh(matrix)
        for k in range(modes):
            for j in range(terms):
                total = 0.0
                push = 0.0
                for m in range(modes):
                    total += q[m, k] * x[m, j]
                    push += q[m, k] * drive[j, m]
                steady[k, j] = push / w[k] * inputs[i, j]
                z[k, j] = steady[k, j] + (total - steady[k, j]) * np.exp(-before_s[i] * w[k])
        for k in range(modes):
            own = rate[k] + share[i] * film[k, k]
            left[i, k] = remaining[k] * np.exp(-before_s[i] * own)
            remaining[k] = left[i, k] * np.exp(-after_s[i] * own)
            for j in range(terms):
                total = 0.0
                for m in range(modes):
                    total += q[k, m] * z[m, j]
                out[i, k, j] = total
        for k in range(modes):
            rest = np.exp(-after_s[i] * w[k])
            for j in range(terms):
                z[k, j] = steady[k, j] + (z[k, j] - steady[k, j]) * rest
        for k in range(modes):
            for j in range(terms):
                total = 0.0
                for m in range(modes):
                    total += q[k, m] * z[m, j]
                x[k, j] = total
    return out, left


filtered: Callable[..., tuple[Vector, Vector]] = njit(cache=True)(_filtered_loop)
