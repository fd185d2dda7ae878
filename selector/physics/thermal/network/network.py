"""A machine as a few bodies of even temperature, linked by conductances: the lumped thermal network."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from selector.physics.thermal.network.heat_system import HeatSystem
from selector.types import Vector


@dataclass(frozen=True)
class Network:
    """Bodies of even temperature, the nodes, with what links, wets and heats them, all by the names of the nodes."""

    heat_capacity_j_per_k: Mapping[str, float]  #: Node → mass times specific heat [J/K], above 0
    links: Sequence[tuple[str, str, float]] = ()  #: Two nodes, conductance between them [W/K]; those of the same add up
    #: Film → node → area with which it takes part in the film [m²]. For a convection that is known as W/K, write 1 m²
    #: and the value as the film coefficient of the law.
    area_m2: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    shares: Mapping[str, Mapping[str, float]] = field(default_factory=dict)  #: Source → node → share of its heat
    #: Node → displacement → what 1 K of the node adds to it [µm/K]
    expansion_um_per_k: Mapping[str, Mapping[str, float]] = field(default_factory=dict)

    def heat_system(self) -> HeatSystem:
        """The network as matrices: one state and one probe a node, named like it."""
        row = {name: k for k, name in enumerate(self.heat_capacity_j_per_k)}
        n = len(row)

        def column(values: Mapping[str, float]) -> Vector:
            return np.array([values.get(name, 0.0) for name in row], dtype=np.float64)

        conduction = np.zeros((n, n))
        for first, second, conductance in self.links:
            pair = np.array([row[first], row[second]])
            conduction[np.ix_(pair, pair)] += conductance * np.array([[1.0, -1.0], [-1.0, 1.0]])
        areas = {film: column(values) for film, values in self.area_m2.items()}
        moved = dict.fromkeys(name for values in self.expansion_um_per_k.values() for name in values)
        return HeatSystem(
            capacity=np.diag(column(self.heat_capacity_j_per_k)),
            conduction=conduction,
            films={film: np.diag(area) for film, area in areas.items()},
            film_loads=areas,
            sources={source: column(values) for source, values in self.shares.items()},
            probes={name: np.eye(n)[k] for name, k in row.items()},
            displacements={
                name: column({node: values.get(name, 0.0) for node, values in self.expansion_um_per_k.items()})
                for name in moved
            },
            uniform=np.ones(n),
            states=tuple(row),
        )
