"""Heat conduction of a machine as matrices: the common form, two bodies as one, and its time constants."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray
from scipy import linalg, sparse

from selector.types import Matrix, Vector

SystemMatrix = NDArray[np.float64] | sparse.csr_array
"""Dense for small systems (networks, reduced models), sparse for finite elements."""


@dataclass(frozen=True)
class HeatSystem:
    """C·dT/dt = −K·T − Σ_f h_f·(A_f·T − θ_f·a_f) + Σ_s q_s·b_s, with readings and displacements linear in T.

    h_f [W/(m²·K)] and θ_f [°C] are the film coefficient and the fluid temperature of surface f; q_s [W] is the heat of
    source s. They change with time and belong to the laws of the machine (`laws`), not to this value.
    """

    capacity: SystemMatrix  #: (n, n): C [J/K]
    conduction: SystemMatrix  #: (n, n): K [W/K], symmetric; its rows sum to zero
    films: Mapping[str, SystemMatrix]  #: (n, n): A_f [m²] of every surface that meets a fluid
    film_loads: Mapping[str, Vector]  #: (n,): a_f = A_f·1 [m²]
    sources: Mapping[str, Vector]  #: (n,): b_s, the share of every state in the heat of the source
    probes: Mapping[str, Vector]  #: (n,): Row p: the temperature [°C] at the probe is p·T
    displacements: Mapping[str, Vector]  #: (n,): Row d [µm/K]: the displacement [µm] is d·(T − T_reference·uniform)
    uniform: Vector  #: (n,): States of a body at 1 °C everywhere (ones, unless the system was reduced)
    #: Names of the states where they have names (the nodes of a network), else empty
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


@dataclass(frozen=True)
class Contact:
    """A contact between the surface of a field and a node: heat flows at `conductance_w_per_k` [W/K].

    `source` names the surface by the heat source that acts on it: a contact spreads its heat as that source does.
    """

    source: str
    node: str
    conductance_w_per_k: float


def joined(body: HeatSystem, parts: HeatSystem, contacts: Sequence[Contact]) -> HeatSystem:
    """One system of both: first the states of `body`, then those of `parts`; sparse.

    Every point of the surface conducts to the node: K gains G·diag(b), −G·b and G, where b is the source's share at
    the states (never negative). A film or a displacement that both have is the sum of both; sources and probes have
    names of their own.
    """
    n, m = body.size, parts.size
    diagonal, between, ends = np.zeros(n), np.zeros((n, m)), np.zeros(m)
    for contact in contacts:
        conductance, share = contact.conductance_w_per_k, body.sources[contact.source]
        node = parts.states.index(contact.node)
        diagonal += conductance * share
        between[:, node] -= conductance * share
        ends[node] += conductance * share.sum()
    link = sparse.csr_array(between)
    joints = sparse.block_array(
        [[sparse.diags_array(diagonal), link], [link.T, sparse.diags_array(ends)]], format="csr"
    )
    films = [*body.films, *(name for name in parts.films if name not in body.films)]
    empty, bare = sparse.csr_array((n, n)), sparse.csr_array((m, m))
    return HeatSystem(
        capacity=_beside(body.capacity, parts.capacity),
        conduction=_beside(body.conduction, parts.conduction) + joints,
        films={name: _beside(body.films.get(name, empty), parts.films.get(name, bare)) for name in films},
        film_loads={name: _both(body.film_loads.get(name), parts.film_loads.get(name), n, m) for name in films},
        sources=_apart(body.sources, parts.sources, n, m),
        probes=_apart(body.probes, parts.probes, n, m),
        displacements={
            name: _both(body.displacements.get(name), parts.displacements.get(name), n, m)
            for name in dict.fromkeys([*body.displacements, *parts.displacements])
        },
        uniform=np.r_[body.uniform, parts.uniform],
    )


def _beside(one: SystemMatrix, other: SystemMatrix) -> sparse.csr_array:
    return sparse.csr_array(sparse.block_diag([one, other]))


def _both(one: Vector | None, other: Vector | None, n: int, m: int) -> Vector:
    return np.concatenate([np.zeros(n) if one is None else one, np.zeros(m) if other is None else other])


def _apart(one: Mapping[str, Vector], other: Mapping[str, Vector], n: int, m: int) -> dict[str, Vector]:
    of_body = {name: _both(row, None, n, m) for name, row in one.items()}
    return of_body | {name: _both(None, row, n, m) for name, row in other.items()}


def time_constants_s(system: HeatSystem, film_w_per_m2_k: Mapping[str, float]) -> Vector:
    """Time constants [s] at given film coefficients, longest first; infinite for a part that no fluid reaches.

    All n of the dense symmetric problem (K + Σ h_f·A_f)·v = λ·C·v, 1/λ: meant for networks and reduced systems, up to
    some thousand states. A film that is not named has none.
    """
    rate = linalg.eigh(dense(conductance(system, film_w_per_m2_k)), dense(system.capacity))[0]
    # what rounding leaves of a rate of zero, relative to the fastest
    rate[rate < 4 * np.finfo(float).eps * len(rate) * rate[-1]] = 0.0
    with np.errstate(divide="ignore"):
        return np.asarray(1.0 / rate)


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
