"""Meshes of bodies: of boxes that are put together here, of tetrahedra; and the temperature anywhere in them."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import Any

import numpy as np
from scipy import sparse
from scipy.optimize import nnls

from selector.errors import InputError, OptionError
from selector.types import Indices, Mask, Vector

Point = tuple[float, float, float]

VOID = ""  #: Part name of a block that cuts its room out of the blocks before it.


@dataclass(frozen=True)
class Block:
    """A box of a part; a later block takes the room of the blocks before it."""

    part: str  #: Name of the part; `VOID` cuts
    material: str  #: Name of its material
    #: low_m and high_m: Opposite corners [m]
    low_m: Point
    high_m: Point

    def __post_init__(self) -> None:
        if not all(low < high for low, high in zip(self.low_m, self.high_m, strict=True)):
            raise OptionError(
                f"a block from {self.low_m} to {self.high_m} m",
                expected="a high corner above the low one along X, Y and Z",
                where=f"block of the part {self.part or 'void'!r}",
                advice="correct the lengths of the machine",
            )


@dataclass(frozen=True)
class SolidMesh:
    """A body of elements of one form (boxes, or tetrahedra with 4 or 10 nodes) with its parts."""

    nodes_m: Vector  #: (n_nodes, 3): Places of the nodes [m]; those at corners first
    cells: Indices  #: (n_cells, n_nodes_of_a_cell): Nodes of every cell, in scikit-fem's order
    #: parts and materials: Name of the part and of the material of every kind of cell
    parts: tuple[str, ...]
    materials: tuple[str, ...]
    kind: Indices  #: (n_cells,): Which of them each cell is

    @property
    def element(self) -> Any:
        """Shape functions for scikit-fem: trilinear, linear or quadratic."""
        import skfem

        forms = {8: skfem.ElementHex1, 4: skfem.ElementTetP1, 10: skfem.ElementTetP2}
        return forms[self.cells.shape[1]]()

    @cached_property
    def mesh(self) -> Any:
        """The mesh for scikit-fem, of the corners alone."""
        from skfem import MeshHex, MeshTet

        corners = self.cells[:, : 8 if self.cells.shape[1] == 8 else 4]
        form = MeshHex if corners.shape[1] == 8 else MeshTet
        return form(np.ascontiguousarray(self.nodes_m[: corners.max() + 1].T), np.ascontiguousarray(corners.T))

    @property
    def degree(self) -> int:
        """Of the shape functions along an edge."""
        return 2 if self.cells.shape[1] == 10 else 1

    @cached_property
    def low_m(self) -> Vector:
        """Lower corner of the box around every cell, of shape (n_cells, 3) [m]."""
        return np.asarray(self.nodes_m[self.cells].min(axis=1))

    @cached_property
    def high_m(self) -> Vector:
        """Upper corner of the box around every cell, of shape (n_cells, 3) [m]."""
        return np.asarray(self.nodes_m[self.cells].max(axis=1))

    @cached_property
    def volume_m3(self) -> Vector:
        """Volume of every cell [m³]."""
        if self.cells.shape[1] == 8:
            return np.asarray((self.high_m - self.low_m).prod(axis=1))
        first, *others = self.nodes_m[np.asarray(self.mesh.t)]
        return np.abs(np.linalg.det(np.stack([other - first for other in others], axis=1))) / 6

    def cells_of(self, *parts: str) -> Indices:
        """Numbers of the cells of these parts."""
        kinds = [i for i, part in enumerate(self.parts) if part in parts]
        return np.flatnonzero(np.isin(self.kind, kinds))

    def surface_of(self, parts: Iterable[str], where: Callable[[Vector], Mask] | None = None) -> Indices:
        """Boundary facets (numbers in `mesh`) of these parts; `where` picks by the facets' centres (n, 3) [m]."""
        facets = np.asarray(self.mesh.boundary_facets())
        owner = np.asarray(self.mesh.f2t)[0, facets]
        facets = facets[np.isin(owner, self.cells_of(*parts))]
        return facets if where is None else facets[where(self.facet_centres_m(facets))]

    def facet_centres_m(self, facets: Indices) -> Vector:
        """Centres of facets, of shape (n_facets, 3) [m]."""
        return np.asarray(self.nodes_m[np.asarray(self.mesh.facets)[:, facets]].mean(axis=0))

    def cell_centres_m(self, cells: Indices) -> Vector:
        """Centres of cells, of shape (n_cells, 3) [m]."""
        return np.asarray(self.nodes_m[np.asarray(self.mesh.t)[:, cells]].mean(axis=0))

    def pieces(self) -> Indices:
        """Which body each cell belongs to, from 0; an edge or a corner in common is a hinge and joins no bodies."""
        beside = np.asarray(self.mesh.f2t)
        first, second = beside[:, beside[1] >= 0]
        n = len(self.cells)
        links = sparse.coo_array((np.ones(len(first)), (first, second)), shape=(n, n))
        return np.asarray(sparse.csgraph.connected_components(links, directed=False)[1])

    def triangles(self) -> Indices:
        """Triangles of the whole surface as numbers of nodes, of shape (n_triangles, 3), outward by the right hand."""
        facets = np.asarray(self.mesh.boundary_facets())
        corners = np.asarray(self.mesh.facets)[:, facets].T
        places = self.nodes_m[corners]
        middle = places.mean(axis=1)
        outward = (middle - self.cell_centres_m(np.asarray(self.mesh.f2t)[0, facets]))[:, None, :]
        # corners in order around the middle, whatever order the mesh has them in
        arms = places - middle[:, None, :]
        across = np.cross(outward, arms[:, :1])
        around = np.argsort(np.arctan2((arms * across).sum(axis=2), (arms * arms[:, :1]).sum(axis=2)), axis=1)
        ring = np.take_along_axis(corners, around, axis=1)
        fan = [0, 1, 2, 0, 2, 3][: 3 * corners.shape[1] - 6]
        return np.asarray(ring[:, fan].reshape(-1, 3), dtype=np.int64)

    def nearest(self, place_m: Vector) -> tuple[Vector, Vector]:
        """The point of the body nearest to a place [m], and the row (n_nodes,) that reads what the nodes hold there."""
        away = np.linalg.norm(np.clip(place_m, self.low_m, self.high_m) - place_m, axis=1)
        nearest, found = np.inf, (0, place_m, place_m)
        for cell in np.argsort(away, kind="stable"):
            if away[cell] > nearest:  # no point of a cell is nearer than its box
                break
            point, inside = self._nearest_in(int(cell), place_m)
            if (distance := float(np.linalg.norm(point - place_m))) < nearest:
                nearest, found = distance, (int(cell), point, inside)
        cell, point, inside = found
        row = np.zeros(len(self.nodes_m))
        for k, node in enumerate(self.cells[cell]):
            row[node] = self.element.lbasis(inside[:, None], k)[0].item()
        return point, row

    def _nearest_in(self, cell: int, place_m: Vector) -> tuple[Vector, Vector]:
        low, high = self.low_m[cell], self.high_m[cell]
        if self.cells.shape[1] == 8:
            point = np.clip(place_m, low, high)
            return point, (point - low) / (high - low)
        corners = self.nodes_m[np.asarray(self.mesh.t)[:, cell]]
        # shares of the corners, none below 0, that sum to 1: a heavy equation says so
        heavy = 1e6 * (high - low).max()
        shares = nnls(np.vstack([(corners - low).T, np.full(4, heavy)]), np.r_[place_m - low, heavy])[0]
        shares /= shares.sum()
        return shares @ corners, shares[1:]


def block_mesh(blocks: Sequence[Block], cell_m: float | Point) -> SolidMesh:
    """The mesh of a union of boxes.

    The faces of all blocks give the lines of a tensor grid, divided so that no cell is longer than `cell_m` [m] (one
    length, or one for each axis).
    """
    sizes = (cell_m, cell_m, cell_m) if isinstance(cell_m, int | float) else cell_m
    lines = [_lines(blocks, axis, float(size)) for axis, size in enumerate(sizes)]
    paint = np.full([len(line) - 1 for line in lines], -1)
    solids = [(block.part, block.material) for block in blocks if block.part != VOID]
    kinds = list(dict.fromkeys(solids))
    middles = [(line[1:] + line[:-1]) / 2 for line in lines]
    for block in blocks:
        room = np.ix_(
            *((low < m) & (m < high) for low, m, high in zip(block.low_m, middles, block.high_m, strict=True))
        )
        paint[room] = -1 if block.part == VOID else kinds.index((block.part, block.material))
    return _mesh_of_cells(lines, paint, kinds)


def _lines(blocks: Sequence[Block], axis: int, cell_m: float) -> Vector:
    faces = np.unique(np.round([(block.low_m[axis], block.high_m[axis]) for block in blocks], 9))
    pieces = [
        np.linspace(low, high, max(1, int(np.ceil((high - low) / cell_m - 1e-9))), endpoint=False)
        for low, high in pairwise(faces)
    ]
    return np.concatenate([*pieces, faces[-1:]])


def _mesh_of_cells(lines: Sequence[Vector], paint: Indices, kinds: Sequence[tuple[str, str]]) -> SolidMesh:
    """Cells of the grid that a block has painted, and the nodes that they use."""
    from skfem import ElementHex1

    solid = np.argwhere(paint >= 0)
    corners = solid[:, None, :] + ElementHex1.doflocs.astype(np.int64)[None]
    shape = tuple(len(line) for line in lines)
    used, cells = np.unique(np.ravel_multi_index(tuple(np.moveaxis(corners, 2, 0)), shape), return_inverse=True)
    nodes = np.stack([line[i] for line, i in zip(lines, np.unravel_index(used, shape), strict=True)], axis=1)
    return SolidMesh(
        nodes_m=nodes,
        cells=cells.reshape(-1, 8).astype(np.int64),
        parts=tuple(part for part, _ in kinds),
        materials=tuple(material for _, material in kinds),
        kind=paint[tuple(solid.T)].astype(np.int64),
    )


REACH_M = 0.03  #: How far from the body a sensor may be named and still be put on its surface [m].


def probe_row(body: SolidMesh, place_m: Point, name: str = "probe") -> Vector:
    """Row of shape (n_nodes,) that reads the temperature at a place; outside, at the nearest point of the surface.

    Raises InputError if the place is more than `REACH_M` away from the body.
    """
    place = np.asarray(place_m, dtype=np.float64)
    nearest, row = body.nearest(place)
    away = float(np.linalg.norm(nearest - place))
    if not away <= REACH_M:
        raise InputError(
            f"a place ({', '.join(f'{x:g}' for x in place)}) m, {away * 1000:.0f} mm away from the body",
            expected=f"a place in the body or at most {REACH_M * 1000:.0f} mm outside",
            where=f"sensor {name!r}",
            advice="correct the coordinates [m]; the nearest point of the body is "
            f"({', '.join(f'{x:.3f}' for x in nearest)})",
        )
    return row
