"""Which finite-element machine does a model file describe, shipped or from a mesh, and how it looks at one moment."""

import dataclasses
import functools
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.spatial import cKDTree

from selector.errors import InputError, ModelFileError, OptionError
from selector.physics.model_text import Key, key_text, unknown_name
from selector.physics.thermal import model_file
from selector.physics.thermal.field.geometry import MachineGeometry
from selector.physics.thermal.field.machine import (
    SENSORS,
    Physics,
    VirtualMachine,
    field_system,
    film_sets,
    machine_laws,
    parts_beside,
    sensor_candidates,
    surface_candidates,
    virtual_machining_centre,
)
from selector.physics.thermal.field.mesh import (
    MATERIALS,
    Material,
    Point,
    SolidMesh,
    elasticity,
    elasticity_to_keep,
    probe_row,
    rigid_motion_reading,
    rigid_motions,
)
from selector.physics.thermal.field.mesh_file import WHOLE, NamedMesh, named_mesh, refused
from selector.physics.thermal.network.heat_system import Conditions, FilmLaw, HeatSystem, Laws, reduced_basis
from selector.physics.thermal.network.transient import simulate_heat
from selector.physics.thermal.schedule import condensed
from selector.types import Indices, Vector


def mesh_of(file: model_file.MeshFile) -> NamedMesh:
    """The mesh that a file names. Errors as `named_mesh`."""
    return named_mesh(Path(file.mesh.file), {"m": 1.0, "mm": 1e-3}[file.mesh.unit], file.mesh.order)


def meshed(file: model_file.MeshFile, laws: Laws) -> VirtualMachine:
    """The machine of a mesh; takes some ten seconds, the same one at once, whatever it goes through.

    Raises ModelFileError: the file does not fit the mesh, or a piece of it is not held or not cooled.
    """
    path = Path(file.mesh.file)
    text = file.model_dump_json(exclude=_NOT_OF_THE_MACHINE)
    return _meshed(_Asked(text, laws, path.stat().st_mtime_ns if path.is_file() else 0, file))


#: Sections that say what a machine goes through, and what is written of it.
_NOT_OF_THE_MACHINE = {"model", "run", "conditions", "gauges", "inputs", "bounds", "candidates"}


@dataclasses.dataclass(frozen=True)
class _Asked:
    """What a machine is made of; files with the same text, laws and mesh have the same machine."""

    text: str
    laws: Laws
    written_ns: int
    file: model_file.MeshFile = dataclasses.field(compare=False)


@functools.lru_cache(maxsize=1)
def _meshed(asked: _Asked) -> VirtualMachine:
    """The last machine is kept, as long as its mesh is not written again."""
    file, laws = asked.file, asked.laws
    named = mesh_of(file)
    body, materials = _with_parts(named, file)
    wetted = {name: named.facets(*film.groups, outer=True) for name, film in file.films.items()}
    springs = _springs(named, body, materials, file)
    _require_whole(body, springs, wetted, film_sets(laws))
    sources = {
        name: np.sum([share * named.shares(group) for group, share in source.shares.items()], axis=0)
        for name, source in file.sources.items()
    }
    probes = {source.at: named.shares(source.at) for source in file.sources.values() if source.at is not None}
    for number, sensor in enumerate(file.sensors):
        if sensor.at is None and sensor.xyz is not None:
            probes[sensor.name] = row_at(body, sensor.xyz, ("sensors", number, "xyz"))
        else:
            probes[sensor.at or sensor.name] = named.shares(sensor.at or sensor.name)
    # a place that is none is told before what takes seconds
    readings = {name: _reading(named, body, name, of) for name, of in file.displacements.items()}
    elastic = elasticity(body, materials, springs)
    rows = {name: elastic.row_um_per_k(reading) for name, reading in readings.items()}
    system = field_system(body, materials, wetted, sources, probes, rows)
    basis = reduced_basis(system, film_sets(laws))
    return VirtualMachine(system, basis, laws, body, materials, springs, elasticity_to_keep(elastic, body))


def _with_parts(named: NamedMesh, file: model_file.MeshFile) -> tuple[SolidMesh, dict[str, Material]]:
    """The body in parts, and the material of each by its name."""
    names, kind = tuple(file.parts), np.full(len(named.body.cells), -1)
    # what is in no other part comes last
    for group in sorted(file.parts, key=lambda name: name == WHOLE):
        cells = named.cells(group) if group != WHOLE else np.flatnonzero(kind < 0)
        if (kind[cells] >= 0).any():
            found = f"elements both in {names[kind[cells].max()]!r} and in {group!r}"
            raise refused(found, "one part for each element", "leave one of the two out of [parts]")
        kind[cells] = names.index(group)
    if (kind < 0).any():
        lacking = [name for name, group in named.groups.items() if (kind[group.cells] < 0).any() and name != WHOLE]
        found = (
            f"{np.sum(kind < 0)} of {len(kind)} elements without a material, in {', '.join(lacking[:8]) or 'no group'}"
        )
        advice = f"add [parts.GROUP], or [parts.{WHOLE}] for the rest"
        raise refused(found, "each element in a group of [parts]", advice)
    materials = {}
    for name, part in file.parts.items():
        said = part.model_dump(exclude={"material"}, exclude_none=True)
        if part.material is None:
            materials[name] = Material(**said)
        elif part.material in MATERIALS:
            materials[name] = dataclasses.replace(MATERIALS[part.material], **said)
        else:
            found, expected, advice = unknown_name("material", part.material, list(MATERIALS))
            where = f"key {key_text(('parts', name, 'material'))}"
            raise ModelFileError(found, expected=expected, where=where, advice=f"{advice} by its numbers")
    return dataclasses.replace(named.body, parts=names, materials=names, kind=kind), materials


#: Stiffness of a rigid support at a node, over Young's modulus times the extent of the body.
_RIGID = 1e5
#: Faces beside each that are looked at, and how far one is off another that lies on it, over its size.
_NEIGHBOURS, _ON = 24, 1e-3


def _springs(named: NamedMesh, body: SolidMesh, materials: Mapping[str, Material], file: model_file.MeshFile) -> Vector:
    """Stiffness [N/m] of the supports at every node, along X, Y, Z, of shape (n_nodes, 3)."""
    springs = np.zeros((len(body.nodes_m), 3))
    rigid = _RIGID * max(material.young_pa for material in materials.values()) * np.ptp(body.nodes_m, axis=0).max()
    for support in file.supports.values():
        for name in support.groups:
            if support.stiffness_n_per_m is not None:
                springs += named.surface_shares(name)[:, None] * np.array(support.stiffness_n_per_m)
            else:
                springs[named.nodes(name)] = rigid
    return springs


def _require_whole(
    body: SolidMesh, springs: Vector, wetted: Mapping[str, Indices], films: Iterable[Mapping[str, float]]
) -> None:
    """Refuses a piece of the body that floats, that no film cools, or that lies on another without common nodes."""
    piece = body.pieces()
    if piece.max() and len(touching := _touching(body, piece)):
        near = ", ".join(f"{x:.3g}" for x in body.facet_centres_m(touching[:1])[0])
        raise refused(
            f"{len(touching)} faces that lie on faces of another piece of the body and share no nodes with them, near "
            f"({near}) m: neither heat nor force would cross",
            "pieces that share the nodes where they touch",
            "join the solids in the mesher (Gmsh: BooleanFragments), or leave a gap where nothing is to cross",
        )
    for number in range(piece.max() + 1):
        nodes = np.unique(body.cells[piece == number])
        near = ", ".join(f"{x:.3g}" for x in body.nodes_m[nodes].mean(axis=0))
        apart = ", which no faces join to the rest," if piece.max() else ""
        what = f"a piece of {np.sum(piece == number)} of {len(piece)} elements around ({near}) m{apart} that"
        motions = rigid_motions(body.nodes_m[nodes] / np.ptp(body.nodes_m[nodes], axis=0).max())
        if np.linalg.matrix_rank(motions[springs[nodes].ravel() > 0], tol=1e-6) < 6:
            advice = "add a group to [supports], or join the parts in the mesher so that they share their nodes"
            raise refused(f"{what} floats: no support holds it against every motion", "a body that is held", advice)
        cooled = [name for name, facets in wetted.items() if number in piece[np.asarray(body.mesh.f2t)[0, facets]]]
        if not all(any(one.get(name) for name in cooled) for one in films):
            found, expected = f"{what} no film cools, at least while there is no coolant", "a way for heat into a fluid"
            raise refused(found, expected, "add a group of its surface to [films]")


def _touching(body: SolidMesh, piece: Indices) -> Indices:
    """Faces of the surface on which another piece of the body lies."""
    owners = np.asarray(body.mesh.f2t)
    surface = np.flatnonzero(owners[1] < 0)
    of, centre = piece[owners[0, surface]], body.facet_centres_m(surface)
    a, b, c = body.nodes_m[np.asarray(body.mesh.facets)[:3, surface]]
    normal = np.cross(b - a, c - a)
    size = np.sqrt(np.linalg.norm(normal, axis=1))
    outward = ((centre - body.cell_centres_m(owners[0, surface])) * normal).sum(axis=1)
    normal *= (np.sign(outward) / size**2)[:, None]
    away, near = cKDTree(centre).query(centre, k=min(_NEIGHBOURS, len(surface)))
    lifted = np.abs(((centre[near] - centre[:, None]) * normal[:, None]).sum(axis=2))
    along = (normal[near] * normal[:, None]).sum(axis=2)
    on = (of[near] != of[:, None]) & (away < size[:, None]) & (lifted < _ON * size[:, None]) & (along < -0.99)
    return surface[on.any(axis=1)]


def _reading(named: NamedMesh, body: SolidMesh, name: str, of: model_file.MeshDisplacement) -> Vector:
    """Reading of shape (3·n_nodes,) of the tool against the work, carried to the same point where it says no other."""
    along = np.array(model_file.direction_of(name, of))
    along /= np.linalg.norm(along)

    def moved(side: str, group: str | None, at_m: Point | None) -> Vector:
        if group is None:
            return np.outer(
                row_at(body, at_m or (0.0, 0.0, 0.0), ("displacements", name, f"{side}_xyz")), along
            ).ravel()
        weights = named.surface_shares(group)
        nodes = body.nodes_m[weights > 0]
        if at_m is not None and np.linalg.matrix_rank(nodes - nodes[0], tol=1e-6 * np.ptp(body.nodes_m)) < 2:
            found = f"a group {group!r} of points on a line, which tells no rotation"
            raise refused(found, "a surface, or three points", f"leave {side}_xyz out, or name another group")
        return rigid_motion_reading(body, weights, at_m, tuple(along))

    # a point that is carried need not be in the body: the end of a test bar
    low, high = body.nodes_m.min(axis=0), body.nodes_m.max(axis=0)
    longest_m = float((high - low).max())
    for side, at in (("tool", of.tool and of.tool_xyz), ("work", of.work and of.work_xyz)):
        away_m = float(np.linalg.norm(np.clip(at, low, high) - at)) if at else 0.0
        if away_m > longest_m:
            raise ModelFileError(
                f"a point {away_m:.3g} m away from the body",
                expected=f"one no farther than the body is long, {longest_m:.3g} m",
                where=f"key displacements.{name}.{side}_xyz",
                advice="give it in m, whatever the mesh has",
            )
    reading = moved("tool", of.tool, of.tool_xyz)
    if of.work is None and of.work_xyz is None:
        return reading
    x, y, z = of.tool_xyz or named.surface_shares(of.tool or "") @ body.nodes_m
    return reading - moved("work", of.work, of.work_xyz or (x, y, z))


def row_at(mesh: SolidMesh, place: Point, key: Key) -> Vector:
    """`probe_row` of a place that this key says."""
    try:
        return probe_row(mesh, place)
    except InputError as error:
        raise error.at(f"key {key_text(key)}", ModelFileError) from None


_HEAT_KEYS = ("on_w", "turning_w", "coolant_w", "speed_w", "torque_share", "softening_per_k")
_FILM_KEYS = ("still_w_per_m2_k", "speed_w_per_m2_k")
_LENGTHS = [length.name for length in dataclasses.fields(MachineGeometry)]


def laws_of(file: model_file.FieldFile) -> Laws:
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
        said = file.sources.get(law.source, model_file.FieldSource()).model_dump(exclude_none=True)
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
        said_of_film = (file.coolant_films if film.while_coolant else file.films).get(film.film, model_file.FieldFilm())
        films.append(dataclasses.replace(film, **said_of_film.model_dump(exclude_none=True)))
    films += [FilmLaw(name, fluid="fixed", **said.model_dump()) for name, said in file.cooled.items()]
    return Laws(tuple(heat), tuple(films))


def law_sections(file: model_file.FieldFile) -> dict[str, dict[str, dict[str, float]]]:
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


def system_of(file: model_file.FieldFile, laws: Laws) -> HeatSystem:
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


def field_of(file: model_file.FieldFile, laws: Laws) -> VirtualMachine:
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


def with_candidates(file: model_file.FieldFile | model_file.MeshFile) -> model_file.FieldFile | model_file.MeshFile:
    """The file with a thermometer at every candidate place instead of its section on them; the file's own come first.

    Raises ModelFileError: the machine has no such surface, the spacing leaves no place or too many, or a name is taken.
    """
    wanted = file.candidates
    if wanted is None:
        return file
    try:
        if isinstance(file, model_file.MeshFile):
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
    if count > model_file.MOST_SENSORS:
        raise ModelFileError(
            f"{len(places)} candidates beside {len(file.sensors)} thermometers",
            expected=f"at most {model_file.MOST_SENSORS} together",
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
    spread = (model_file.Sensor(name=name, place=at.place, xyz=at.xyz_m, **instrument) for name, at in places.items())
    return file.model_copy(update={"sensors": (*file.sensors, *spread), "candidates": None})


@dataclass(frozen=True)
class FieldMoment:
    """A machine at one moment."""

    at_s: float  #: When it is, from the start of the run [s]
    nodes_m: Vector  #: (n_nodes, 3): Places of the nodes [m]
    triangles: Indices  #: (n_triangles, 3): Nodes of the triangles of the surface
    temperature_degc: Vector  #: (n_nodes,): Temperature [°C]
    deformation_um: Vector  #: (n_nodes, 3): Displacement since the start of the run [µm]


def field_moment(file: model_file.FieldFile | model_file.MeshFile, conditions: Conditions, at_s: float) -> FieldMoment:
    """The moment `at_s` [s] of the run that these conditions make of the machine.

    Raises InputError: the time is outside the conditions.
    """
    if isinstance(file, model_file.MeshFile):
        laws = model_file.stated_laws(file)
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
