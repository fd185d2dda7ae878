"""A machine as a few bodies of even temperature, linked by conductances: the lumped thermal network."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from types import MappingProxyType

import numpy as np

from selector.errors import InputError
from selector.physics.thermal.network.heat_system import HeatSystem


@dataclass(frozen=True)
class Node:
    """A body of even temperature."""

    name: str  #: Unique in its network
    heat_capacity_j_per_k: float  #: Mass times specific heat [J/K], above 0
    place: str = ""  #: Where it is, in the user's words
    xyz_m: tuple[float, float, float] | None = None  #: Its position [m]
    #: Displacement → what 1 K of this node adds to it [µm/K]
    expansion_um_per_k: Mapping[str, float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        object.__setattr__(self, "expansion_um_per_k", MappingProxyType(dict(self.expansion_um_per_k)))


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
    """Nodes with what links, wets and heats them.

    Raises
    ------
    InputError
        If a name is empty, repeated or unknown, a node is linked to itself, or a number is missing or has a sign
        that it cannot have.
    """

    #: nodes, links, surfaces and heat_shares: Its parts
    nodes: tuple[Node, ...]
    links: tuple[Link, ...] = ()
    surfaces: tuple[Surface, ...] = ()
    heat_shares: tuple[HeatShare, ...] = ()

    def __post_init__(self) -> None:
        for name in ("nodes", "links", "surfaces", "heat_shares"):
            object.__setattr__(self, name, tuple(getattr(self, name)))
        if not self.nodes:
            _refuse("no nodes", "at least one node", "network", "describe the parts of the machine as nodes")
        names = [node.name for node in self.nodes]
        for node in self.nodes:
            where = f"node {node.name!r}"
            if not node.name or names.count(node.name) > 1:
                _refuse("a name that is empty or used twice", "a name of its own", where, "rename one of the nodes")
            _require_above_zero(node.heat_capacity_j_per_k, "heat_capacity_j_per_k", where)
            for displacement, value in node.expansion_um_per_k.items():
                if not np.isfinite(value):
                    _refuse(f"expansion {value} for {displacement!r}", "a number [µm/K]", where, "correct the value")
        for link in self.links:
            where = f"link {link.first!r} – {link.second!r}"
            self._require_node(link.first, where)
            self._require_node(link.second, where)
            if link.first == link.second:
                _refuse("a node linked to itself", "two different nodes", where, "correct one of the names")
            _require_above_zero(link.conductance_w_per_k, "conductance_w_per_k", where)
        for surface in self.surfaces:
            where = f"film {surface.film!r} on node {surface.node!r}"
            self._require_node(surface.node, where)
            _require_above_zero(surface.area_m2, "area_m2", where)
        totals: dict[str, float] = {}
        for share in self.heat_shares:
            where = f"source {share.source!r} on node {share.node!r}"
            self._require_node(share.node, where)
            _require_above_zero(share.share, "share", where)
            totals[share.source] = totals.get(share.source, 0.0) + share.share
        for source, total in totals.items():
            # shares are written with a few decimals
            if abs(total - 1.0) > 1e-6:
                _refuse(
                    f"shares that make {total:g}",
                    "shares that make 1",
                    f"source {source!r}",
                    "give all of its heat to nodes; heat that never enters the machine belongs in the law's watts",
                )

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

    def _require_node(self, name: str, where: str) -> None:
        known = [node.name for node in self.nodes]
        if name not in known:
            _refuse(
                f"no node called {name!r}",
                "one of " + ", ".join(known[:20]) + (" …" if len(known) > 20 else ""),
                where,
                "correct the name, or add the node",
            )


def _columns(
    entries: Sequence[tuple[str, int, float]], n: int
) -> dict[str, np.ndarray[tuple[int], np.dtype[np.float64]]]:
    """Name → values added up per node."""
    found: dict[str, np.ndarray[tuple[int], np.dtype[np.float64]]] = {}
    for name, k, value in entries:
        found.setdefault(name, np.zeros(n))[k] += value
    return found


def _require_above_zero(value: float, name: str, where: str) -> None:
    if not (np.isfinite(value) and value > 0):
        _refuse(f"{name} = {value:g}", "a number above 0", where, "correct the value, or leave this part out")


def _refuse(found: str, expected: str, where: str, advice: str) -> None:
    raise InputError(found, expected=expected, where=where, advice=advice)
