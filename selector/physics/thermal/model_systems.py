"""Which equations does a thermal model file describe: its network or its field machine as matrices, its modes."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from selector.physics.thermal.heat_system import HeatSystem
from selector.physics.thermal.laws import FilmLaw, HeatLaw, Laws
from selector.physics.thermal.model_file import FieldFile, ModesFile, NetworkFile
from selector.physics.thermal.model_schema import FilmKeys, SourceLaw
from selector.physics.thermal.modes import ModalModel
from selector.physics.thermal.network import HeatShare, Link, Network, Node, Surface
from selector.physics.thermal.speed_law import SpeedLaw

Point = tuple[float, float, float]


@dataclass(frozen=True)
class HeatMachine:
    """A body with its laws, and where its probes sit.

    Attributes
    ----------
    system : HeatSystem
        The body.
    laws : Laws
        How it is heated and cooled.
    place_of_probe, xyz_of_probe : mapping of str to str, to three floats [m]
        In words, and on the machine, where it is known.
    """

    system: HeatSystem
    laws: Laws
    place_of_probe: Mapping[str, str] = field(default_factory=dict)
    xyz_of_probe: Mapping[str, Point] = field(default_factory=dict)

    @property
    def probes(self) -> tuple[str, ...]:
        """Names of the places whose temperature is known."""
        return tuple(self.system.probes)


def heat_machine(file: NetworkFile | FieldFile, built: HeatMachine | None = None) -> HeatMachine:
    """The body and the laws of a network or of the field machine.

    `built` is a machine of the same kind and geometry; its body is used again where only laws differ.
    """
    if isinstance(file, FieldFile):
        raise NotImplementedError
    return network_machine(file)


def network_machine(file: NetworkFile) -> HeatMachine:
    """The network of a model file: one probe a node, one displacement for every name among the expansions."""
    network = Network(
        nodes=tuple(
            Node(name, node.heat_capacity_j_per_k, node.place or "", node.xyz, node.expansion_um_per_k)
            for name, node in file.nodes.items()
        ),
        links=tuple(Link(*link.between, link.conductance_w_per_k) for link in file.links),
        surfaces=tuple(
            Surface(name, node, area) for name, film in file.films.items() for node, area in film.area_m2.items()
        ),
        heat_shares=tuple(
            HeatShare(name, node, share)
            for name, source in file.sources.items()
            for node, share in source.shares.items()
        ),
    )
    laws = Laws(
        tuple(heat_law(name, source) for name, source in file.sources.items()),
        tuple(film_law(name, film) for name, film in file.films.items()),
    )
    return HeatMachine(
        network.heat_system(),
        laws,
        {name: node.place for name, node in file.nodes.items() if node.place is not None},
        {name: node.xyz for name, node in file.nodes.items() if node.xyz is not None},
    )


def modal_machine(file: ModesFile) -> ModalModel:
    """The modes of a model file; between tested speeds a gain is n^exponent times a factor that is interpolated."""
    modes = file.modes
    speed = np.array(modes.speed_rpm)
    law = SpeedLaw((modes.exponent,), reference_rpm=float(speed[-1]), knots_rpm=tuple(modes.speed_rpm))
    steady = np.stack([np.array(rows, dtype=np.float64) for rows in modes.gains_um.values()], axis=-1)
    factor = (speed / speed[-1]) ** modes.exponent
    return ModalModel(
        responses=tuple(modes.gains_um),
        tau_s=np.array(modes.tau_s),
        gains_um=steady / factor[:, None, None],
        law=law,
        fastest_rpm=float(speed[-1]),
        cooling_growth=np.zeros(len(modes.tau_s)),
    )


def heat_law(name: str, keys: SourceLaw) -> HeatLaw:
    """The law of a source of a model file."""
    values = keys.model_dump(exclude={"shares", "at"})
    return HeatLaw(source=name, at=keys.at or "", **values)


def film_law(name: str, keys: FilmKeys) -> FilmLaw:
    """The law of a film of a model file."""
    return FilmLaw(film=name, **keys.model_dump(exclude={"area_m2"}))
