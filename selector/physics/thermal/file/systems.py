"""Which equations does a thermal model file describe, and how fast is that machine."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from selector.physics.thermal.file.model_file import FieldFile, ModesFile, NetworkFile
from selector.physics.thermal.modes.modes import ModalModel, SpeedLaw
from selector.physics.thermal.network.heat_system import HeatSystem, time_constants_s
from selector.physics.thermal.network.laws import Conditions, FilmLaw, HeatLaw, Laws, film_coefficients, summed
from selector.physics.thermal.network.network import Network
from selector.types import Vector

Point = tuple[float, float, float]


@dataclass(frozen=True)
class HeatMachine:
    """A body with its laws, and where its probes sit."""

    system: HeatSystem  #: The body
    laws: Laws  #: How it is heated and cooled
    probes: tuple[str, ...]  #: Probes that are read where the file names no thermometers
    #: place_of_probe and xyz_of_probe: In words, and on the machine, where it is known
    place_of_probe: Mapping[str, str] = field(default_factory=dict)
    xyz_of_probe: Mapping[str, Point] = field(default_factory=dict)


def heat_machine(file: NetworkFile | FieldFile, built: HeatMachine | None = None) -> HeatMachine:
    """The body and the laws of a network or of the field machine.

    `built` is the machine of a file that differs in its laws only; a field machine is then not built again.

    Raises ModelFileError: the file names a source, film, place or length that the field machine does not have.
    """
    if isinstance(file, NetworkFile):
        return network_machine(file)
    # scikit-fem comes in with the field machine, which most model files do not need
    from selector.physics.thermal import field_model
    from selector.physics.thermal.field.virtual_machine import SENSORS

    laws = field_model.laws_of(file)
    if built is not None:
        return replace(built, laws=laws)
    return HeatMachine(
        field_model.system_of(file, laws),
        laws,
        tuple(SENSORS),
        {name: sensor.place for name, sensor in SENSORS.items()},
        {name: sensor.xyz_m for name, sensor in SENSORS.items()},
    )


def network_machine(file: NetworkFile) -> HeatMachine:
    """The network of a model file: one probe a node, one displacement for every name among the expansions."""
    network = Network(
        {name: node.heat_capacity_j_per_k for name, node in file.nodes.items()},
        [(*link.between, link.conductance_w_per_k) for link in file.links],
        {name: film.area_m2 for name, film in file.films.items()},
        {name: source.shares for name, source in file.sources.items()},
        {name: node.expansion_um_per_k for name, node in file.nodes.items()},
    )
    laws = Laws(
        tuple(
            HeatLaw(source=name, at=source.at or "", **source.model_dump(exclude={"shares", "at"}))
            for name, source in file.sources.items()
        ),
        tuple(FilmLaw(film=name, **film.model_dump(exclude={"area_m2"})) for name, film in file.films.items()),
    )
    return HeatMachine(
        network.heat_system(),
        laws,
        tuple(file.nodes),
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


SLOWEST = 6


def slowest_time_constants(machine: HeatMachine | ModalModel, conditions: Conditions) -> dict[str, Vector]:
    """What is held → the slowest time constants [s] then, longest first; infinite for a part that no fluid reaches.

    The machine stands without coolant, turns at the fastest speed of the conditions, and does so with coolant if that
    is ever on; states that have the same films are told once. Those of a reduced system are its slowest ones, which the
    reduction keeps. Thermal modes say theirs themselves.
    """
    if isinstance(machine, ModalModel):
        return {"standing": machine.tau_s[::-1][:SLOWEST]}
    fastest = float(conditions.spindle_speed.max())
    corners = {"standing": (0.0, 0.0), f"at {fastest:g} r/min": (fastest, 0.0)}
    if conditions.coolant_on.any():
        corners[f"at {fastest:g} r/min with coolant"] = (fastest, 1.0)
    found: dict[str, Vector] = {}
    seen = []
    for name, (speed, coolant) in corners.items():
        films = _films(machine.laws, conditions, speed, coolant)
        if films not in seen:
            found[name] = time_constants_s(machine.system, films)[:SLOWEST]
        seen.append(films)
    return found


def _films(laws: Laws, conditions: Conditions, speed_rpm: float, coolant_on: float) -> dict[str, float]:
    """Film → coefficient [W/(m²·K)] while this is held."""
    count = len(conditions.time_s)
    held = replace(conditions, spindle_speed=np.full(count, speed_rpm), coolant_on=np.full(count, coolant_on))
    return summed([law.film for law in laws.films], film_coefficients(laws, held)[0])
