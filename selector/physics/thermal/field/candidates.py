"""Where could a thermometer be fixed, and which lines draw the machine."""

from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.spatial import KDTree

from selector.errors import OptionError
from selector.physics.ranges import joined
from selector.physics.thermal.field.geometry import MachineGeometry, machine_blocks
from selector.physics.thermal.field.geometry import surfaces as surfaces_of
from selector.physics.thermal.field.machine import Sensor
from selector.physics.thermal.field.mesh import SolidMesh, block_mesh
from selector.types import Indices, Mask, Vector

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
