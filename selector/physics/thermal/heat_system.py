"""Heat conduction of a machine as matrices: the common form of lumped networks, finite elements and reduced models."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

Vector = NDArray[np.float64]
Matrix = NDArray[np.float64] | sparse.csr_array
"""Dense for small systems (networks, reduced models), sparse for finite elements."""


@dataclass(frozen=True)
class HeatSystem:
    """C·dT/dt = −K·T − Σ_f h_f·(A_f·T − θ_f·a_f) + Σ_s q_s·b_s, with readings and displacements linear in T.

    h_f [W/(m²·K)] and θ_f [°C] are the film coefficient and the fluid temperature of surface f; q_s [W] is the heat of
    source s. They change with time and belong to the laws of the machine (`laws`), not to this value.

    Attributes
    ----------
    capacity : matrix of shape (n, n)
        C [J/K].
    conduction : matrix of shape (n, n)
        K [W/K], symmetric; its rows sum to zero.
    films : mapping of str to matrix of shape (n, n)
        A_f [m²] of every surface that meets a fluid.
    film_loads : mapping of str to ndarray of shape (n,)
        a_f = A_f·1 [m²].
    sources : mapping of str to ndarray of shape (n,)
        b_s, the share of every state in the heat of the source.
    probes : mapping of str to ndarray of shape (n,)
        Row p: the temperature [°C] at the probe is p·T.
    displacements : mapping of str to ndarray of shape (n,)
        Row d [µm/K]: the displacement [µm] is d·(T − T_reference·uniform).
    uniform : ndarray of shape (n,)
        States of a body at 1 °C everywhere (ones, unless the system was reduced).
    states : tuple of str
        Names of the states where they have names (the nodes of a network), else empty.
    """

    capacity: Matrix
    conduction: Matrix
    films: Mapping[str, Matrix]
    film_loads: Mapping[str, Vector]
    sources: Mapping[str, Vector]
    probes: Mapping[str, Vector]
    displacements: Mapping[str, Vector]
    uniform: Vector
    states: tuple[str, ...] = field(default=())

    def __post_init__(self) -> None:
        n = self.capacity.shape[0]
        for name in ("films", "film_loads", "sources", "probes", "displacements"):
            items = dict(getattr(self, name))
            for key, value in items.items():
                if value.shape[0] != n:
                    raise ValueError(f"{name}[{key!r}] has {value.shape[0]} rows, the capacity matrix has {n}")
            object.__setattr__(self, name, MappingProxyType(items))
        if set(self.films) != set(self.film_loads):
            raise ValueError(f"films {sorted(self.films)} and film loads {sorted(self.film_loads)} differ")

    @property
    def size(self) -> int:
        """Number of states."""
        return int(self.capacity.shape[0])
