"""In which shapes, and with which time constants, a body forgets its temperatures."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import linalg, sparse

from selector.physics.thermal.heat_system import HeatSystem

Vector = NDArray[np.float64]
Matrix = NDArray[np.float64]


@dataclass(frozen=True)
class Eigenmodes:
    """Solutions of (K + Σ h_f·A_f)·v = λ·C·v, slowest first.

    Attributes
    ----------
    rate_per_s : ndarray of shape (n,)
        λ [1/s]; 0 for a part that no fluid reaches.
    shapes : ndarray of shape (n, n)
        One mode a column, vᵀ·C·v = 1.
    """

    rate_per_s: Vector
    shapes: Matrix

    @property
    def tau_s(self) -> Vector:
        """Time constants 1/λ [s], longest first; infinite for a part that no fluid reaches."""
        with np.errstate(divide="ignore"):
            return np.asarray(1.0 / self.rate_per_s)


def eigenmodes(system: HeatSystem, film_w_per_m2_k: Mapping[str, float]) -> Eigenmodes:
    """Eigenmodes of a system at given film coefficients (a film that is not named has none).

    All n modes of the dense symmetric problem: meant for networks and reduced systems, up to some thousand states.

    Raises
    ------
    KeyError
        If a film is named that the system does not have.
    """
    stiffness = dense(conductance(system, film_w_per_m2_k))
    rate, shapes = linalg.eigh(stiffness, dense(system.capacity))
    # what rounding leaves of a rate of zero, relative to the fastest
    rate[rate < 4 * np.finfo(float).eps * len(rate) * rate[-1]] = 0.0
    return Eigenmodes(rate, shapes)


def conductance(system: HeatSystem, film_w_per_m2_k: Mapping[str, float]) -> NDArray[np.float64] | sparse.csr_array:
    """K + Σ h_f·A_f [W/K], dense or sparse as the system is."""
    total = system.conduction
    for name, value in film_w_per_m2_k.items():
        if value != 0.0:
            total = total + value * system.films[name]
    return total


def dense(matrix: NDArray[np.float64] | sparse.csr_array) -> Matrix:
    """The same matrix as an array."""
    return matrix.toarray() if sparse.issparse(matrix) else np.asarray(matrix, dtype=np.float64)
