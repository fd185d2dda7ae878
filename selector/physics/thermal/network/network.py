"""A machine as a few bodies of even temperature, linked by conductances: the lumped thermal network."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from selector.physics.thermal.network.heat_system import HeatSystem


@dataclass(frozen=True)
class Node:
    """A body of even temperature."""

    name: str  #: Unique in its network
    heat_capacity_j_per_k: float  #: Mass times specific heat [J/K], above 0
    #: Displacement → what 1 K of this node adds to it [µm/K]
    expansion_um_per_k: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True)
class Link:
    """A conductance between two nodes [W/K], above 0; several links of the same two nodes add up."""

    first: str
    second: str
    conductance_w_per_k: float


@dataclass(frozen=True)
class Surface:
    """The area [m²] with which a node takes part in a film; one film may wet several nodes.

    For a convection that is known as W/K, write 1 m² and the value as the film coefficient of the law.
    """

    film: str
    node: str
    area_m2: float


@dataclass(frozen=True)
class HeatShare:
    """The share of a source's heat that goes into a node; the shares of a source make 1."""

    source: str
    node: str
    share: float = 1.0


@dataclass(frozen=True)
class Network:
    """Nodes with what links, wets and heats them; a file that describes it has been checked."""

    #: nodes, links, surfaces and heat_shares: Its parts
    nodes: tuple[Node, ...]
    links: tuple[Link, ...] = ()
    surfaces: tuple[Surface, ...] = ()
    heat_shares: tuple[HeatShare, ...] = ()

    def heat_system(self) -> HeatSystem:
        """The network as matrices: one state and one probe a node, named like it."""
        names = [node.name for node in self.nodes]
        row = {name: k for k, name in enumerate(names)}
        n = len(names)
        conduction = np.zeros((n, n))
        for link in self.links:
            pair = np.array([row[link.first], row[link.second]])
            conduction[np.ix_(pair, pair)] += link.conductance_w_per_k * np.array([[1.0, -1.0], [-1.0, 1.0]])
        areas = _columns([(surface.film, row[surface.node], surface.area_m2) for surface in self.surfaces], n)
        expansions = [
            (displacement, k, value)
            for k, node in enumerate(self.nodes)
            for displacement, value in node.expansion_um_per_k.items()
        ]
        return HeatSystem(
            capacity=np.diag([float(node.heat_capacity_j_per_k) for node in self.nodes]),
            conduction=conduction,
            films={name: np.diag(area) for name, area in areas.items()},
            film_loads=areas,
            sources=_columns([(share.source, row[share.node], share.share) for share in self.heat_shares], n),
            probes={name: np.eye(n)[k] for name, k in row.items()},
            displacements=_columns(expansions, n),
            uniform=np.ones(n),
            states=tuple(names),
        )


def _columns(
    entries: Sequence[tuple[str, int, float]], n: int
) -> dict[str, np.ndarray[tuple[int], np.dtype[np.float64]]]:
    """Name → values added up per node."""
    found: dict[str, np.ndarray[tuple[int], np.dtype[np.float64]]] = {}
    for name, k, value in entries:
        found.setdefault(name, np.zeros(n))[k] += value
    return found
