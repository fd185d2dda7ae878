"""The C-frame machining centre as a field and reduced with its laws; where thermometers fit, and what lines draw it."""

import tomllib
from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Literal

import numpy as np
from scipy.spatial import KDTree

from selector.errors import InputError, OptionError
from selector.physics.ranges import joined
from selector.physics.thermal.field import geometry as shapes
from selector.physics.thermal.field.geometry import MachineGeometry, machine_blocks
from selector.physics.thermal.field.geometry import surfaces as surfaces_of
from selector.physics.thermal.field.mesh import (
    MATERIALS,
    Elasticity,
    Material,
    Point,
    SolidMesh,
    block_mesh,
    conduction_matrices,
    elasticity,
    elasticity_to_keep,
    film,
    probe_row,
    rigid_motion_reading,
    surface_source,
    volume_source,
)
from selector.physics.thermal.network import heat_system
from selector.physics.thermal.network.heat_system import Conditions, FilmLaw, HeatLaw, Laws, film_coefficients, summed
from selector.types import Indices, Mask, Vector

CELL_M = 0.04  #: Longest cell at refinement 1 [m]: one cell in a wall, about 20 000 nodes.
#: Stiffness of one foot along X, Y, Z [N/m]: an assumption; docs/explanation/thermal-field.md says what hangs on it.
FOOT_N_PER_M = (1e8, 1e8, 5e8)
#: How far below the spindle face the lower and the upper gauge touch the test bar [m]; 250 mm apart (P).
BAR_M = (0.30, 0.05)


@dataclass(frozen=True)
class FieldMachine:
    """A machine as a field."""

    geometry: shapes.MachineGeometry  #: Its lengths
    mesh: SolidMesh  #: Its mesh; `mesh.nodes_m` are the places of the states of `system`
    system: (
        heat_system.HeatSystem
    )  #: Conduction with films, sources, probes, and the displacements of the tool against the table
    elasticity: Elasticity  #: Its factorised stiffness

    def deformation(self, temperature_degc: Vector, reference_degc: float = 20.0) -> Vector:
        """Displacement of every node, of shape (n_nodes, 3) [µm], for the temperatures of the nodes [°C].

        Raises InputError if there is not one finite temperature for every node.
        """
        temperature = np.asarray(temperature_degc, dtype=np.float64)
        if temperature.shape != (self.system.size,) or not np.isfinite(temperature).all():
            raise InputError(
                f"temperatures of shape {temperature.shape}"
                + ("" if np.isfinite(temperature).all() else ", some of them no number"),
                expected=f"one finite temperature [°C] for each of {self.system.size} nodes",
                where="field",
                advice="pass a state of the unreduced system, FieldMachine.system",
            )
        return self.elasticity.displacement_um(temperature - reference_degc)


def field_machine(
    geometry: shapes.MachineGeometry | None = None,
    refinement: float = 1.0,
    probes: Mapping[str, Point] | None = None,
    materials: Mapping[str, Material] = MATERIALS,
    foot_n_per_m: tuple[float, float, float] = FOOT_N_PER_M,
) -> FieldMachine:
    """The machine meshed, assembled and factorised.

    Displacements of the tool against the table [µm]: X and Y along their axes, Z counted positive towards the table;
    `Y_lower` and `Y_upper` on a test bar (rigid, cold) in the spindle, `Y` their mean. X and Z are those of the
    middle of the spindle face.

    No cell is longer than 40 mm / refinement: 1 gives about 20 000 nodes, 0.2 8 000, 1.25 50 000. `probes` are places
    of virtual sensors [m], in the body or at most 30 mm outside.

    Raises OptionError if the lengths do not fit together or the refinement is not above 0. Raises InputError if a
    sensor is too far from the body.
    """
    if not refinement > 0 or not np.isfinite(refinement):
        raise OptionError(
            f"refinement {refinement:g}", expected="a number above 0", where="mesh", advice="use 1, or 0.5 for a try"
        )
    geometry = shapes.MachineGeometry() if geometry is None else geometry
    body = block_mesh(shapes.machine_blocks(geometry), CELL_M / refinement)
    # a place that is none is told before what takes seconds
    readings = {name: probe_row(body, place, name) for name, place in (probes or {}).items()}
    elastic = elasticity(body, materials, foot_springs(body, geometry, foot_n_per_m))
    rows = {name: elastic.row_um_per_k(reading) for name, reading in displacement_readings(body, geometry).items()}
    rows["Y"] = (rows["Y_lower"] + rows["Y_upper"]) / 2
    sources = {name: volume_source(body, body.cells_of(*parts)) for name, parts in shapes.heated_parts().items()}
    sources |= {name: surface_source(body, facets) for name, facets in shapes.heated_surfaces(body, geometry).items()}
    system = field_system(body, materials, shapes.surfaces(body, geometry), sources, readings, rows)
    return FieldMachine(geometry, body, system, elastic)


def field_system(
    body: SolidMesh,
    materials: Mapping[str, Material],
    wetted: Mapping[str, Indices],
    sources: Mapping[str, Vector],
    probes: Mapping[str, Vector],
    displacements: Mapping[str, Vector],
) -> heat_system.HeatSystem:
    """A body as a heat system, one state a node; `wetted` are the facets of every film, the others its rows."""
    capacity, conduction = conduction_matrices(body, materials)
    films = {name: film(body, facets) for name, facets in wetted.items()}
    return heat_system.HeatSystem(
        capacity=capacity,
        conduction=conduction,
        films={name: matrix for name, (matrix, _) in films.items()},
        film_loads={name: load for name, (_, load) in films.items()},
        sources=sources,
        probes=probes,
        displacements=displacements,
        uniform=np.ones(len(body.nodes_m)),
    )


def foot_springs(
    body: SolidMesh, geometry: shapes.MachineGeometry, foot_n_per_m: tuple[float, float, float] = FOOT_N_PER_M
) -> Vector:
    """Stiffness [N/m] of the feet at every node, along X, Y, Z, of shape (n_nodes, 3)."""
    springs = np.zeros((len(body.nodes_m), 3))
    for facets in shapes.feet(body, geometry).values():
        springs += surface_source(body, facets)[:, None] * np.array(foot_n_per_m)
    return springs


def displacement_readings(body: SolidMesh, geometry: shapes.MachineGeometry) -> dict[str, Vector]:
    """Readings of shape (3·n_nodes,) of the tool against the table.

    The bar moves rigidly with the face of the spindle, the stand of the gauges with the top of the table; so a
    motion of the whole machine on its feet is not seen. `Y` is the mean of `Y_lower` and `Y_upper`.
    """
    g = geometry
    nose = surface_source(body, body.surface_of(["spindle"], lambda c: np.isclose(c[:, 2], g.nose_z_m)))
    table = surface_source(body, body.surface_of(["table"], lambda c: np.isclose(c[:, 2], g.table_top_m)))

    def against_table(below_m: float, axis: int) -> Vector:
        at = (0.0, g.spindle_y_m, g.nose_z_m - below_m)
        along = np.eye(3)[axis]
        return rigid_motion_reading(body, nose, at, along) - rigid_motion_reading(body, table, at, along)

    lower, upper = (against_table(below, 1) for below in BAR_M)
    return {"X": against_table(0.0, 0), "Z": -against_table(0.0, 2), "Y_lower": lower, "Y_upper": upper}


#: What the machine has: constant films and lubricants; films that grow with the speed; lubricants that soften too.
Physics = Literal["linear", "convection", "everything"]
MAX_RPM = 3000.0  #: Highest speed of the spindle [r/min].
#: Parts whose mean temperature thins their lubricant; probes of the same names read it.
LUBRICATED = ("lower bearing", "upper bearing", "gearbox")
_CONSTANT_RPM = 1500.0
_NUMBERS = tomllib.loads(Path(__file__).with_name("machining_centre.toml").read_text(encoding="utf-8"))
_SOFTENING_PER_K = 0.012


def machine_laws(physics: Physics = "everything") -> Laws:
    """The laws of all sources and films.

    ``"linear"`` keeps every film at its coefficient for 1500 r/min and every lubricant as thick as at 20 °C: then heat
    is a function of the speed alone, and temperatures are linear in it.
    """
    softening = _SOFTENING_PER_K if physics == "everything" else 0.0
    return Laws(heat=tuple(_heat(softening)), films=_films(moving=physics != "linear"))


def parts_beside() -> tuple[heat_system.Network, tuple[tuple[str, str, float], ...]]:
    """Hydraulic unit and coolant tank as a network, and the contact of the hydraulic line with the headstock."""
    network = heat_system.Network(
        {"hydraulic unit": 22e3, "coolant tank": 400e3},
        area_m2={"hydraulic unit": {"hydraulic unit": 0.75}, "coolant tank": {"coolant tank": 1.0}},
        shares={"hydraulic pump": {"hydraulic unit": 1.0}},
    )
    return network, (("hydraulic line", "hydraulic unit", 3.0),)


def _heat(softening_per_k: float) -> Iterator[HeatLaw]:
    for source, told in _NUMBERS["heat"].items():
        law = HeatLaw(source, **told)
        if law.speed_w:
            law = replace(law, reference_rpm=MAX_RPM)
        if source in LUBRICATED:
            law = replace(law, softening_per_k=softening_per_k, at=source)
        yield law


def _films(*, moving: bool) -> tuple[FilmLaw, ...]:
    def air(film: str, still: float, fast: float) -> FilmLaw:
        """Film of `fast` more at the highest speed; constant at that of 1500 r/min where films do not move."""
        if moving:
            return FilmLaw(film, still, fast, reference_rpm=MAX_RPM, exponent=0.8)
        return FilmLaw(film, still + fast * (_CONSTANT_RPM / MAX_RPM) ** 0.8)

    return (
        *(air(film, *told) for film, told in _NUMBERS["air"].items()),
        FilmLaw("coolant tank", 1500.0, fluid="coolant"),  # the tank is at the temperature of the coolant
        *(FilmLaw(film, told, while_coolant=True, fluid="coolant") for film, told in _NUMBERS["washed"].items()),
    )


@dataclass(frozen=True)
class Sensor:
    """A thermometer: where it sits in words, and its place [m]."""

    place: str
    xyz_m: Point


#: The 37 thermometers of the recording `fixtures/vmc37`.
SENSORS: Mapping[str, Sensor] = {
    name: Sensor(place, (x, y, z)) for name, (place, x, y, z) in _NUMBERS["sensors"].items()
}

_IN_PARTS = {"T15": "hydraulic unit", "T37": "coolant tank"}


@dataclass(frozen=True)
class VirtualMachine:
    """A machine that can be run."""

    #: The field joined with the parts beside it, before the reduction: displacements X, Y, Z, Y_lower, Y_upper; probes:
    #: the sensors and the `LUBRICATED` parts
    full: heat_system.HeatSystem
    #: (n_full, n_reduced): Temperatures of the states of `full` are ``basis @ state``; the first are the nodes of the
    #: mesh
    basis: Vector
    laws: Laws  #: What heats and cools it
    mesh: SolidMesh  #: For pictures and for sensors anywhere
    materials: Mapping[str, Material]  #: Those that the mesh names
    springs_n_per_m: Vector  #: (n_nodes, 3): What holds the nodes along X, Y, Z [N/m]
    elastic: Elasticity | None = None  #: The body on these springs, where its factors take little memory

    @cached_property
    def system(self) -> heat_system.HeatSystem:
        """The reduced field."""
        return heat_system.projected(self.full, self.basis)


def virtual_machining_centre(
    physics: Physics = "everything",
    *,
    geometry: shapes.MachineGeometry | None = None,
    refinement: float = 1.0,
    sensors: Mapping[str, Point] | None = None,
    tolerance: float = heat_system.TOLERANCE,
) -> VirtualMachine:
    """The machine meshed, assembled, joined with the parts beside it and reduced; takes some ten seconds.

    `sensors` are places of virtual sensors [m]; left out: the 37 of `SENSORS`. `geometry` and `refinement` are those
    of `field_machine`, `tolerance` that of `reduced_basis`.

    Raises InputError if a sensor is not on the machine.
    """
    laws = machine_laws(physics)
    places = {name: sensor.xyz_m for name, sensor in SENSORS.items()} if sensors is None else dict(sensors)
    beside = _IN_PARTS if sensors is None else {}
    machine = field_machine(geometry, refinement, {name: at for name, at in places.items() if name not in beside})
    network, contacts = parts_beside()
    parts = network.heat_system()
    rows = {name: parts.probes[node] for name, node in beside.items()}
    full = heat_system.joined(machine.system, replace(parts, probes=rows), contacts)
    lubricants = {part: full.sources[part] for part in LUBRICATED}
    in_order = {name: full.probes[name] for name in places}
    full = replace(full, probes=in_order | lubricants)
    basis = heat_system.reduced_basis(full, film_sets(laws), tolerance=tolerance)
    springs = foot_springs(machine.mesh, machine.geometry)
    elastic = elasticity_to_keep(machine.elasticity, machine.mesh)
    return VirtualMachine(full, basis, laws, machine.mesh, MATERIALS, springs, elastic)


def film_sets(laws: Laws) -> tuple[dict[str, float], ...]:
    """Film coefficients [W/(m²·K)] at rest and at full speed, each dry and with coolant."""
    fastest = max([MAX_RPM, *(law.reference_rpm for law in laws.films if law.speed_w_per_m2_k)])
    corners = Conditions(np.arange(4.0), np.array([0.0, fastest] * 2), coolant_on=np.array([0.0, 0.0, 1.0, 1.0]))
    sets = []
    for row in film_coefficients(laws, corners):
        total = summed([law.film for law in laws.films], row)
        if total not in sets:
            sets.append(total)
    return tuple(sets)


#: Surfaces that stand still or hardly move, stay dry, and are outside; the table carries the work and moves most.
ACCESSIBLE = ("headstock", "motor", "column", "saddle", "bed")
SPACING_M = 0.3  #: Usual distance between neighbours [m]: some eighty places.
SMALLEST_SPACING_M = 0.03
MOST_CANDIDATES = 1000  #: As many as a model file may have thermometers.
FOOT_M = 0.04  #: Side of the flat square that a thermometer and its hole need [m].
ROOM_M = 0.15  #: Free depth in front of the wall that a short drill needs [m].
COARSE_M = 1.0  #: Cells as long as the blocks allow: the faces of the machine without more cells than they ask for.
_CORNERS = ((-1, -1), (-1, 1), (1, -1), (1, 1))
_SIDES = (("left", "right"), ("rear", "front"), ("underside", "top"))


@dataclass(frozen=True)
class _Face:
    """A flat piece of surface: rectangles in one plane, of one part."""

    part: str
    axis: int
    side: int
    level_m: float
    low_m: Vector
    high_m: Vector

    @property
    def area_m2(self) -> float:
        return float((self.high_m - self.low_m).prod(axis=1).sum())

    def has(self, points_m: Vector) -> Mask:
        """Which points (n, 2) of the plane lie on the face."""
        place = points_m[:, None, :]
        inside = np.all((place >= self.low_m - 1e-9) & (place <= self.high_m + 1e-9), axis=2)
        return np.asarray(np.any(inside, axis=1))

    def lattice(self, spacing_m: float) -> Vector:
        """Points (n, 3) in even rows over the face, from the top down, where a whole foot finds room."""
        low, high = self.low_m.min(axis=0), self.high_m.max(axis=0)
        rows = []
        for first, last in zip(low, high, strict=True):
            count = max(1, round((last - first) / spacing_m))
            rows.append(first + (last - first) * (np.arange(count) + 0.5) / count)
        flat = np.stack(np.meshgrid(*rows, indexing="ij"), axis=-1).reshape(-1, 2)
        fits = np.ones(len(flat), dtype=np.bool_)
        for corner in _CORNERS:
            fits &= self.has(flat + FOOT_M / 2 * np.array(corner))
        points = np.insert(flat[fits], self.axis, self.level_m, axis=1)
        return np.asarray(points[np.lexsort((points[:, 0], points[:, 1], -points[:, 2]))])


def sensor_candidates(
    geometry: MachineGeometry | None = None, spacing_m: float = SPACING_M, surfaces: Sequence[str] = ACCESSIBLE
) -> dict[str, Sensor]:
    """Name (``P01``, ``P02``, …) → place of every candidate, at most `MOST_CANDIDATES`.

    Every flat face is divided evenly; a place is left out if its foot does not fit on the face, if there is no room
    in front of it, or if it is nearer to an earlier place, on another face, than half the spacing.

    `spacing_m` is about the distance between neighbours on a face [m]; `surfaces` are named as `geometry.surfaces` has
    them, but for those inside.

    Raises OptionError if the machine has no such surface, or the spacing leaves no place, or too many.
    """
    if not SMALLEST_SPACING_M <= spacing_m < np.inf:
        _refuse(f"{spacing_m:g} m between candidates", f"{SMALLEST_SPACING_M:g} m or more", f"use {SPACING_M:g}")
    geometry = MachineGeometry() if geometry is None else geometry
    body = block_mesh(machine_blocks(geometry), COARSE_M)
    free = _Free(body)
    kept = np.zeros((0, 3))
    found: list[Sensor] = []
    for face in _faces(body, geometry, surfaces):
        points = face.lattice(spacing_m)
        points = points[free.room(points, face.axis, face.side)]
        # neighbours on one face are far enough apart
        near = np.linalg.norm(points[:, None] - kept, axis=2) < spacing_m / 2
        points = points[~near.any(axis=1)]
        kept = np.vstack([kept, points])
        side = _SIDES[face.axis][face.side > 0]
        for x, y, z in np.round(points, 4) + 0.0:
            found.append(Sensor(f"{face.part}, {side}, {z:.2f} m high", (float(x), float(y), float(z))))
        if len(found) > MOST_CANDIDATES:
            break
    return _numbered(found, spacing_m)


def _numbered(found: Sequence[Sensor], spacing_m: float) -> dict[str, Sensor]:
    """Name → candidate."""
    if len(found) > MOST_CANDIDATES:
        _refuse(
            f"more than {MOST_CANDIDATES} candidates, {spacing_m:g} m apart",
            f"at most {MOST_CANDIDATES}",
            "enlarge the spacing, or name fewer surfaces",
        )
    if not found:
        _refuse("no place where a thermometer fits", "at least one", "name other surfaces, or make the spacing smaller")
    digits = max(2, len(str(len(found))))
    return {f"P{number:0{digits}d}": sensor for number, sensor in enumerate(found, 1)}


def surface_candidates(body: SolidMesh, surfaces: Mapping[str, Indices], spacing_m: float) -> dict[str, Sensor]:
    """The same on facets of a body of any form: points that are `spacing_m` [m] or more apart, from the top down.

    Whether a thermometer finds a flat place and room in front of it is not asked.

    Raises OptionError if the spacing leaves too many places.
    """
    from skfem import FacetBasis

    names, points = [], []
    for name, facets in surfaces.items():
        longest_m = np.ptp(body.nodes_m[np.asarray(body.mesh.facets)[:, facets]], axis=0).max()
        order = min(2 + int(4 * longest_m / spacing_m), 18)
        spread = FacetBasis(body.mesh, body.element, facets=facets, intorder=order)
        there = np.round(np.asarray(spread.global_coordinates()).reshape(3, -1).T, 4) + 0.0
        points.append(there[np.lexsort((there[:, 0], there[:, 1], -there[:, 2]))])
        names += [name] * len(there)
    places = np.concatenate(points)
    tree, free = KDTree(places), np.ones(len(places), dtype=np.bool_)
    found: list[Sensor] = []
    for k, (x, y, z) in enumerate(places):
        if free[k]:
            free[tree.query_ball_point(places[k], spacing_m)] = False
            found.append(Sensor(f"{names[k]}, {z:.2f} m high", (float(x), float(y), float(z))))
    return _numbered(found, spacing_m)


def _faces(body: SolidMesh, geometry: MachineGeometry, surfaces: Sequence[str]) -> Iterator[_Face]:
    """Faces of the surfaces in their order, the largest of each first."""
    outer = {name: facets for name, facets in surfaces_of(body, geometry).items() if not name.endswith(" inside")}
    for name in surfaces:
        if name not in outer:
            _refuse(f"no surface called {name!r}", "one of " + ", ".join(outer), "correct the name of the surface")
    for name in dict.fromkeys(surfaces):
        facets = outer[name]
        owner = np.asarray(body.mesh.f2t)[0, facets]
        corners = body.nodes_m[np.asarray(body.mesh.facets)[:, facets]]
        low, high = corners.min(axis=0), corners.max(axis=0)
        axis = np.argmin(high - low, axis=1)
        level = np.take_along_axis(low, axis[:, None], axis=1)[:, 0]
        inward = np.take_along_axis(body.low_m[owner], axis[:, None], axis=1)[:, 0] >= level - 1e-9
        side = np.where(inward, -1, 1)
        planes: dict[tuple[str, int, int, float], list[int]] = {}
        for i, cell in enumerate(owner):
            part = body.parts[body.kind[cell]]
            planes.setdefault((part, int(axis[i]), int(side[i]), round(float(level[i]), 9)), []).append(i)
        faces = []
        for (part, along, outward, at), members in planes.items():
            across = [other for other in range(3) if other != along]
            faces.append(_Face(part, along, outward, at, low[members][:, across], high[members][:, across]))
        yield from sorted(faces, key=lambda face: (-round(face.area_m2, 6), face.axis, face.side, face.level_m))


class _Free:
    """Where the air is: the grid of the mesh, and which of its cells are solid."""

    def __init__(self, body: SolidMesh) -> None:
        self.lines = [np.unique(body.nodes_m[:, axis]) for axis in range(3)]
        self.solid = np.zeros([len(line) + 1 for line in self.lines], dtype=np.bool_)
        self.solid[self._cells((body.low_m + body.high_m) / 2)] = True

    def room(self, points_m: Vector, axis: int, side: int) -> Mask:
        """Which feet on a wall have `ROOM_M` of air in front of them, above the floor."""
        depths = np.arange(0.005, ROOM_M, 0.005)[:, None]
        ahead = np.tile(points_m[:, None, None], (1, len(depths), 1 + len(_CORNERS), 1))
        ahead[..., axis] += side * depths
        ahead[..., [one for one in range(3) if one != axis]] += (FOOT_M / 2 - 1e-6) * np.array([(0, 0), *_CORNERS])
        flat = ahead.reshape(-1, 3)
        free = ~self.solid[self._cells(flat)] & (flat[:, 2] > 0)
        return np.asarray(free.reshape(ahead.shape[:3]).all(axis=(1, 2)))

    def _cells(self, points_m: Vector) -> tuple[Indices, ...]:
        """Numbers along X, Y, Z of the cells that points (n, 3) are in; 0 and the last are outside."""
        return tuple(np.searchsorted(line, values) for line, values in zip(self.lines, points_m.T, strict=True))


def _refuse(found: str, expected: str, advice: str) -> None:
    raise OptionError(found, expected=expected, where="candidates for thermometers", advice=advice)


def machine_outline(geometry: MachineGeometry | None = None) -> tuple[Vector, ...]:
    """Edges of the machine without its chambers: straight lines of shape (2, 3) [m].

    An edge is where two outer faces meet at an angle, or where an outer face ends.
    """
    geometry = MachineGeometry() if geometry is None else geometry
    body = block_mesh(machine_blocks(geometry), COARSE_M)
    outer = [facets for name, facets in surfaces_of(body, geometry).items() if not name.endswith(" inside")]
    corners = np.asarray(body.mesh.facets)[:, np.concatenate(outer)].T
    places = body.nodes_m[corners]
    normal = np.argmin(np.ptp(places, axis=1), axis=1)
    meeting: dict[tuple[int, int], list[int]] = defaultdict(list)
    for facet, axis, points in zip(corners, normal, places, strict=True):
        for i in range(4):
            for j in range(i):
                # corners that differ along one axis only are the ends of a side
                if (np.abs(points[i] - points[j]) > 1e-9).sum() == 1:
                    first, last = sorted((int(facet[i]), int(facet[j])))
                    meeting[first, last].append(int(axis))
    pieces: dict[tuple[int, float, float], list[tuple[float, float]]] = defaultdict(list)
    for (first, last), axes in meeting.items():
        if len(axes) > 1 and len(set(axes)) == 1:
            continue
        start, end = body.nodes_m[first], body.nodes_m[last]
        along = int(np.argmax(np.abs(end - start)))
        u, v = (round(float(start[other]), 9) for other in range(3) if other != along)
        pieces[along, u, v].append((float(min(start[along], end[along])), float(max(start[along], end[along]))))
    lines = []
    for (along, u, v), spans in sorted(pieces.items()):
        for low, high in joined(spans, 1e-9):
            lines.append(np.insert(np.array([[u, v], [u, v]]), along, [low, high], axis=1))
    return tuple(lines)
