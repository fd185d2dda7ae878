"""Two bodies in contact as one: a field with the lumped parts that its mesh does not have."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from selector.errors import InputError
from selector.physics.thermal.heat_system import HeatSystem, Matrix

Vector = NDArray[np.float64]


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

    Raises
    ------
    InputError
        If a contact names what does not exist or does not conduct, or a source or a probe is in both.
    """
    for kind in ("sources", "probes"):
        twice = sorted(set(getattr(body, kind)) & set(getattr(parts, kind)))
        if twice:
            _refuse(f"{kind} {', '.join(twice)} in both bodies", "names of their own", "rename them in one body")
    n, m = body.size, parts.size
    diagonal, between, ends = np.zeros(n), np.zeros((n, m)), np.zeros(m)
    for contact in contacts:
        if contact.source not in body.sources:
            _refuse(f"a contact with {contact.source!r}", "one of " + ", ".join(body.sources), "correct the source")
        if contact.node not in parts.states:
            _refuse(f"a contact with {contact.node!r}", "one of " + ", ".join(parts.states), "correct the node")
        conductance, share = contact.conductance_w_per_k, body.sources[contact.source]
        if not (conductance > 0 and np.isfinite(conductance)):
            _refuse(f"a contact of {conductance:g} W/K", "more than 0", f"correct the contact with {contact.node!r}")
        if share.min() < 0:
            _refuse(f"source {contact.source!r} with negative shares", "a surface or a volume", "choose another source")
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


def _beside(one: Matrix, other: Matrix) -> sparse.csr_array:
    return sparse.csr_array(sparse.block_diag([one, other]))


def _both(one: Vector | None, other: Vector | None, n: int, m: int) -> Vector:
    return np.concatenate([np.zeros(n) if one is None else one, np.zeros(m) if other is None else other])


def _apart(one: Mapping[str, Vector], other: Mapping[str, Vector], n: int, m: int) -> dict[str, Vector]:
    of_body = {name: _both(row, None, n, m) for name, row in one.items()}
    return of_body | {name: _both(None, row, n, m) for name, row in other.items()}


def _refuse(found: str, expected: str, advice: str) -> None:
    raise InputError(found, expected=expected, where="contacts of two bodies", advice=advice)
