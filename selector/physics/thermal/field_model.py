"""Which field machine does a model file describe, with which candidate places, and how it looks at one moment."""

import dataclasses
import functools
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from selector.errors import ModelFileError, OptionError
from selector.physics.model_text import key_text, unknown_name
from selector.physics.thermal.field.candidates import sensor_candidates, surface_candidates
from selector.physics.thermal.field.geometry import MachineGeometry
from selector.physics.thermal.field.machine import (
    SENSORS,
    Physics,
    VirtualMachine,
    film_sets,
    machine_laws,
    parts_beside,
    virtual_machining_centre,
)
from selector.physics.thermal.field.thermoelasticity import elasticity
from selector.physics.thermal.mesh_model import mesh_of, meshed, row_at
from selector.physics.thermal.model_file import (
    MOST_SENSORS,
    FieldFile,
    FieldFilm,
    FieldSource,
    MeshFile,
    Sensor,
    stated_laws,
)
from selector.physics.thermal.network.heat_system import HeatSystem, reduced_basis
from selector.physics.thermal.network.laws import Conditions, FilmLaw, Laws
from selector.physics.thermal.network.transient import simulate_heat
from selector.physics.thermal.schedule import condensed
from selector.types import Vector

_HEAT_KEYS = ("on_w", "turning_w", "coolant_w", "speed_w", "torque_share", "softening_per_k")
_FILM_KEYS = ("still_w_per_m2_k", "speed_w_per_m2_k")
_LENGTHS = [length.name for length in dataclasses.fields(MachineGeometry)]


def laws_of(file: FieldFile) -> Laws:
    """The shipped laws with what the file says in their place, key by key.

    Raises ModelFileError: the machine has no such source or film, or a source without a lubricant is told to soften.
    """
    shipped = machine_laws(file.field.physics)
    _require_known(file.sources, [law.source for law in shipped.heat], "source", "sources")
    _require_known(file.films, [law.film for law in shipped.films if not law.while_coolant], "film", "films")
    _require_known(
        file.coolant_films, [law.film for law in shipped.films if law.while_coolant], "film", "coolant_films"
    )
    surfaces = {law.film for law in shipped.films} - parts_beside()[0].heat_capacity_j_per_k.keys()
    _require_known(file.cooled, sorted(surfaces), "surface", "cooled")
    heat = []
    for law in shipped.heat:
        said = file.sources.get(law.source, FieldSource()).model_dump(exclude_none=True)
        if said.get("softening_per_k") and not law.at:
            raise ModelFileError(
                "softening of a source without lubricant",
                expected="one of " + ", ".join(other.source for other in shipped.heat if other.at),
                where=f"key {key_text(('sources', law.source, 'softening_per_k'))}",
                advice="leave softening_per_k out here",
            )
        heat.append(dataclasses.replace(law, **said))
    films = []
    for film in shipped.films:
        said_of_film = (file.coolant_films if film.while_coolant else file.films).get(film.film, FieldFilm())
        films.append(dataclasses.replace(film, **said_of_film.model_dump(exclude_none=True)))
    films += [FilmLaw(name, fluid="fixed", **said.model_dump()) for name, said in file.cooled.items()]
    return Laws(tuple(heat), tuple(films))


def law_sections(file: FieldFile) -> dict[str, dict[str, dict[str, float]]]:
    """All laws of the machine as sections of a model file; what is switched off is left out."""
    laws = laws_of(file)
    sections: dict[str, dict[str, dict[str, float]]] = {"sources": {}, "films": {}, "coolant_films": {}}
    for heat in laws.heat:
        keys = (*_HEAT_KEYS, *(("exponent", "reference_rpm") if heat.speed_w else ()))
        sections["sources"][heat.source] = {key: getattr(heat, key) for key in keys if getattr(heat, key)}
    for film in laws.films:
        if film.fluid == "fixed":
            continue
        keys = (*_FILM_KEYS, *(("exponent", "reference_rpm") if film.speed_w_per_m2_k else ()))
        values = {key: getattr(film, key) for key in keys if getattr(film, key)}
        sections["coolant_films" if film.while_coolant else "films"][film.film] = values
    return sections


def system_of(file: FieldFile, laws: Laws) -> HeatSystem:
    """The reduced field with the thermometers of the file; takes ten seconds to a minute.

    Raises ModelFileError: a thermometer is at a place that the machine does not have, a gauge reads a displacement that
    it does not have, or a length is not one of its.
    """
    settings = file.field
    _require_known(settings.geometry, _LENGTHS, "length", "field", "geometry")
    anywhere = {s.name: s.xyz for s in file.sensors if s.at is None and s.xyz is not None}
    for number, sensor in enumerate(file.sensors):
        if sensor.name not in anywhere and (sensor.at or sensor.name) not in SENSORS:
            _refuse_name("place", sensor.at or sensor.name, list(SENSORS), ("sensors", number, "at"))
    machine = field_of(file, laws)
    read = machine.full.displacements
    for number, gauge in enumerate(file.gauges):
        if (gauge.of or gauge.name) not in read:
            _refuse_name("displacement", gauge.of or gauge.name, list(read), ("gauges", number, "of"))
    probes = dict(machine.system.probes)
    for number, sensor in enumerate(file.sensors):
        if sensor.name in anywhere:
            row = row_at(machine.mesh, anywhere[sensor.name], ("sensors", number, "xyz"))
            probes[sensor.name] = machine.basis.T @ np.r_[row, np.zeros(machine.full.size - len(row))]
    return dataclasses.replace(machine.system, probes=probes)


@functools.lru_cache(maxsize=1)
def _shipped(physics: Physics, geometry: tuple[tuple[str, float], ...], refinement: float) -> VirtualMachine:
    """The last machine is kept for the next model."""
    return virtual_machining_centre(physics, geometry=MachineGeometry(**dict(geometry)), refinement=refinement)


def field_of(file: FieldFile, laws: Laws) -> VirtualMachine:
    """The machine that `system_of` reduces, with the shipped thermometers; at once after it."""
    settings = file.field
    machine = _shipped(settings.physics, tuple(sorted(settings.geometry.items())), settings.refinement)
    if laws.films != machine.laws.films:
        # other film coefficients ask for other fields; with the same ones, what was reduced once is kept
        return dataclasses.replace(machine, laws=laws, basis=reduced_basis(machine.full, film_sets(laws)))
    found = dataclasses.replace(machine, laws=laws)
    vars(found)["system"] = machine.system
    return found


def _require_known(names: Iterable[str], known: list[str], what: str, *section: str) -> None:
    for name in names:
        if name not in known:
            _refuse_name(what, name, known, (*section, name))


def _refuse_name(what: str, name: str, known: list[str], key: tuple[str | int, ...]) -> None:
    found, expected, advice = unknown_name(what, name, known)
    raise ModelFileError(found, expected=expected, where=f"key {key_text(key)}", advice=advice)


def with_candidates(file: FieldFile | MeshFile) -> FieldFile | MeshFile:
    """The file with a thermometer at every candidate place instead of its section on them; the file's own come first.

    Raises ModelFileError: the machine has no such surface, the spacing leaves no place or too many, or a name is taken.
    """
    wanted = file.candidates
    if wanted is None:
        return file
    try:
        if isinstance(file, MeshFile):
            mesh = mesh_of(file)
            surfaces = {name: mesh.facets(name, outer=True) for name in wanted.surfaces}
            places = surface_candidates(mesh.body, surfaces, wanted.spacing_m)
        else:
            _require_known(file.field.geometry, _LENGTHS, "length", "field", "geometry")
            places = sensor_candidates(MachineGeometry(**file.field.geometry), wanted.spacing_m, wanted.surfaces)
    except OptionError as error:
        where = "key field.geometry" if "geometry" in error.where else "key candidates"
        raise error.at(where, ModelFileError) from None
    count = len(file.sensors) + len(places)
    if count > MOST_SENSORS:
        raise ModelFileError(
            f"{len(places)} candidates beside {len(file.sensors)} thermometers",
            expected=f"at most {MOST_SENSORS} together",
            where="key candidates.spacing_m",
            advice="enlarge the spacing, or name fewer surfaces",
        )
    named = [(("sensors", number, "name"), sensor.name) for number, sensor in enumerate(file.sensors)]
    named += [(("gauges", number, "name"), gauge.name) for number, gauge in enumerate(file.gauges)]
    for key, name in named:
        if name in places:
            raise ModelFileError(
                f"{name!r}, as a candidate is called",
                expected="names other than P01, P02 and so on",
                where=f"key {key_text(key)}",
                advice="give it another name",
            )
    instrument = wanted.model_dump(include={"lag_s", "noise_k", "resolution_k"})
    spread = (Sensor(name=name, place=at.place, xyz=at.xyz_m, **instrument) for name, at in places.items())
    return file.model_copy(update={"sensors": (*file.sensors, *spread), "candidates": None})


@dataclass(frozen=True)
class FieldMoment:
    """A machine at one moment."""

    at_s: float  #: When it is, from the start of the run [s]
    nodes_m: Vector  #: (n_nodes, 3): Places of the nodes [m]
    triangles: NDArray[np.int64]  #: (n_triangles, 3): Nodes of the triangles of the surface
    temperature_degc: Vector  #: (n_nodes,): Temperature [°C]
    deformation_um: Vector  #: (n_nodes, 3): Displacement since the start of the run [µm]


def field_moment(file: FieldFile | MeshFile, conditions: Conditions, at_s: float) -> FieldMoment:
    """The moment `at_s` [s] of the run that these conditions make of the machine.

    Raises InputError: the time is outside the conditions.
    """
    if isinstance(file, MeshFile):
        laws = stated_laws(file)
        machine = meshed(file, laws)
    else:
        laws = laws_of(file)
        machine = field_of(file, laws)
    mesh = machine.mesh
    start_degc = float(conditions.ambient_degc[0]) if file.run.start_degc is None else file.run.start_degc
    history = simulate_heat(
        machine.system,
        laws,
        condensed(conditions, file.run.step_s),
        time_s=[],
        step_s=file.run.step_s,
        start_degc=start_degc,
        keep_states_at_s=[at_s],
    )
    degc = machine.basis[: len(mesh.nodes_m)] @ history.states[0]
    elastic = machine.elastic or elasticity(mesh, machine.materials, machine.springs_n_per_m)
    return FieldMoment(at_s, mesh.nodes_m, mesh.triangles(), degc, elastic.displacement_um(degc - start_degc))
