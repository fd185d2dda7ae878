"""Meshes of bodies of boxes or tetrahedra: temperature anywhere, heat conduction and thermoelasticity as matrices."""

import tomllib
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.optimize import nnls

from selector.errors import InputError, OptionError
from selector.physics.thermal.network.heat_system import Solve, solver_of
from selector.types import Array, Indices, Mask, Vector

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


MULTIGRID_TOLERANCE = 1e-10  #: Residual over right-hand side at which conjugate gradients stop.


def multigrid_solver(matrix: sparse.csr_array, nodes_m: Vector) -> Solve:
    """Solver of an elastic system with three unknowns a node: conjugate gradients with smoothed aggregation.

    The coarse spaces hold the six motions of a rigid body exactly (Vaněk, Mandel and Brezina 1996).
    """
    import pyamg

    blocks = sparse.bsr_matrix(matrix, blocksize=(3, 3))
    blocks.indices, blocks.indptr = blocks.indices.astype(np.int32), blocks.indptr.astype(np.int32)
    sweep = ("block_gauss_seidel", {"sweep": "symmetric"})
    hierarchy = pyamg.smoothed_aggregation_solver(
        blocks,
        B=rigid_motions(nodes_m),
        strength=("symmetric", {"theta": 0.1}),
        presmoother=sweep,
        postsmoother=sweep,
        max_coarse=500,
    )

    def solution(right: Vector) -> Vector:
        if not right.any():
            return np.zeros_like(right)
        result, failed = hierarchy.solve(right, tol=MULTIGRID_TOLERANCE, accel="cg", maxiter=500, return_info=True)
        if failed:
            raise ArithmeticError(f"conjugate gradients did not reach {MULTIGRID_TOLERANCE:g} in 500 steps")
        return np.asarray(result)

    def solve(right: Vector) -> Vector:
        columns = right.reshape(len(right), -1)
        return np.stack([solution(column) for column in columns.T], axis=1).reshape(right.shape)

    return solve


def rigid_motions(nodes_m: Vector) -> Vector:
    """Three translations and three rotations about the middle, of shape (3·n, 6)."""
    arms = nodes_m - nodes_m.mean(axis=0)
    motions = np.zeros((len(nodes_m), 3, 6))
    for axis in range(3):
        motions[:, axis, axis] = 1.0
        motions[:, :, 3 + axis] = np.cross(np.eye(3)[axis], arms)
    return motions.reshape(-1, 6)


#: Share of the stiffness that a sliding layer keeps along its sliding direction: small, but the body stays held.
SLIDING_STIFFNESS = 1e-4


@dataclass(frozen=True)
class Material:
    """An isotropic solid, or a thin layer of rolling elements that slides along one axis."""

    #: conductivity_w_per_m_k, specific_heat_j_per_kg_k and density_kg_per_m3: k [W/(m·K)], c [J/(kg·K)], ρ [kg/m³]
    conductivity_w_per_m_k: float
    specific_heat_j_per_kg_k: float
    density_kg_per_m3: float
    #: expansion_per_k, young_pa and poisson: α [1/K], E [Pa], ν
    expansion_per_k: float
    young_pa: float
    poisson: float
    slides: str = ""  #: {"", "x", "y", "z"}: Axis along which the layer transmits (almost) no force; empty for a solid

    def stiffness_pa(self) -> Array:
        """Stiffness of shape (6, 6) [Pa]; strains in the order xx, yy, zz, yz, zx, xy (shear as angles)."""
        shear = 2 * (1 + self.poisson)
        compliance = np.diag([1.0, 1.0, 1.0, shear, shear, shear])
        compliance[:3, :3] -= self.poisson * (1 - np.eye(3))
        if self.slides:
            along = "xyz".index(self.slides)
            others = [axis for axis in range(3) if axis != along]
            compliance[along, others] = compliance[others, along] = 0.0
            soft = [along, *(3 + axis for axis in others)]  # shear yz, zx, xy is number 3 + the axis it leaves out
            compliance[soft, soft] /= SLIDING_STIFFNESS
        return np.asarray(np.linalg.inv(compliance) * self.young_pa)


_MATERIALS = tomllib.loads(Path(__file__).with_name("materials.toml").read_text(encoding="utf-8"))
#: The materials that `machine_blocks` names.
MATERIALS: Mapping[str, Material] = MappingProxyType({name: Material(**told) for name, told in _MATERIALS.items()})

#: Largest number of nodes whose elastic system is factorised, more takes more than 6 GB; half of it in quadratic cells.
DIRECT_NODES = 60_000
#: The same for factors that are kept with a machine, 0.6 GB.
KEPT_NODES = 25_000
_MODES = 3  # incompatible modes of a cell, one parabola along each axis
_SHEAR = ((1, 2), (2, 0), (0, 1))  # strains 3, 4, 5


@dataclass(frozen=True)
class Elasticity:
    """K·u = F·(T − T_reference) with elastic feet, ready to be solved.

    Degree of freedom 3·i + a is the displacement [m] of node i along axis a.
    """

    stiffness: sparse.csr_array  #: (3n, 3n): K [N/m], feet included
    expansion: sparse.csr_array  #: (3n, n): F [N/K]: forces of the heated material
    solve: Solve  #: u = K⁻¹·f for a force vector of shape (3n,) or several as columns

    def displacement_um(self, rise_k: Vector) -> Vector:
        """Displacement of every node, of shape (n, 3) [µm], for its temperature rise [K]."""
        return np.asarray(self.solve(self.expansion @ rise_k)).reshape(-1, 3) * 1e6

    def row_um_per_k(self, row: Vector) -> Vector:
        """Row Fᵀ·K⁻¹·e of shape (n,) [µm/K] of the reading e·u, `row` e of shape (3n,): adjoint method."""
        return np.asarray(self.expansion.T @ self.solve(row)) * 1e6


def elasticity(
    body: SolidMesh, materials: Mapping[str, Material], springs_n_per_m: Vector, direct: bool | None = None
) -> Elasticity:
    """The elastic body on springs to the ground, `springs_n_per_m` of shape (n, 3), one for each node and axis.

    Trilinear boxes have Wilson's three incompatible parabolas, condensed cell by cell: they pass the patch test and
    bend without locking (Wilson, Taylor, Doherty and Ghaboussi 1973; Taylor, Beresford and Wilson 1976).
    `direct` chooses factors or multigrid; if left out, factors up to `DIRECT_NODES`.
    """
    stiffness, expansion = elastic_matrices(body, materials)
    held = sparse.csr_array(stiffness + sparse.diags_array(springs_n_per_m.ravel()))
    if direct if direct is not None else len(body.nodes_m) * body.degree <= DIRECT_NODES:
        return Elasticity(held, expansion, solver_of(held).solve)
    return Elasticity(held, expansion, multigrid_solver(held, body.nodes_m))


def elasticity_to_keep(elastic: Elasticity, body: SolidMesh) -> Elasticity | None:
    """The same, or None where it takes much memory."""
    return elastic if len(body.nodes_m) * body.degree <= KEPT_NODES else None


def elastic_matrices(body: SolidMesh, materials: Mapping[str, Material]) -> tuple[sparse.csr_array, sparse.csr_array]:
    """Stiffness of shape (3n, 3n) [N/m] of the free body and expansion forces of shape (3n, n) [N/K]."""
    stiffness, expansion = _cell_matrices(body, materials)
    n = len(body.nodes_m)
    cells = np.asarray(body.cells, dtype=np.int32)
    dofs = np.asarray(3 * cells[:, :, None] + np.arange(3), dtype=np.int32).reshape(len(cells), -1)

    def assembled(values: Vector, columns: NDArray[np.int32], size: int) -> sparse.csr_array:
        rows = np.repeat(dofs, columns.shape[1], axis=1).ravel()
        at = (rows, np.tile(columns, (1, dofs.shape[1])).ravel())
        return sparse.csr_array(sparse.coo_array((values.ravel(), at), shape=(3 * n, size)))

    return _symmetric(assembled(stiffness, dofs, 3 * n)), assembled(expansion, cells, n)


def _cell_matrices(body: SolidMesh, materials: Mapping[str, Material]) -> tuple[Vector, Vector]:
    """Stiffness (n_cells, 3m, 3m) and expansion forces (n_cells, 3m, m) of m nodes, incompatible modes condensed."""
    from skfem import Basis

    basis = Basis(body.mesh, body.element, intorder=3)
    kinds = [materials[name] for name in body.materials]
    elastic = np.array([material.stiffness_pa() for material in kinds])
    # stress of a rise of 1 K that cannot expand
    heated = np.array([e[:, :3].sum(axis=1) * m.expansion_per_k for e, m in zip(elastic, kinds, strict=True)])
    n_cells, n_points = basis.dx.shape
    nodes = body.cells.shape[1]
    modes = _MODES if nodes == 8 else 0
    size_m = body.high_m - body.low_m
    wide = 3 * (nodes + modes)
    stiffness = np.zeros((n_cells, wide, wide))
    expansion = np.zeros((n_cells, wide, nodes))
    for point in range(n_points):
        gradients = np.zeros((n_cells, nodes + modes, 3))
        for node in range(nodes):
            gradients[:, node] = basis.basis[node][0].grad[:, :, point].T
        for axis in range(modes):  # 4 ξ (1 − ξ) has the slope 4 (1 − 2 ξ) / length
            gradients[:, nodes + axis, axis] = 4 * (1 - 2 * basis.X[axis, point]) / size_m[:, axis]
        strains = _strains(gradients)
        weight = basis.dx[:, point]
        stress = np.matmul(elastic[body.kind] * weight[:, None, None], strains)
        stiffness += np.matmul(strains.transpose(0, 2, 1), stress)
        shape = np.array([basis.basis[node][0][0, point] for node in range(nodes)])
        force = np.einsum("csi,cs,c->ci", strains, heated[body.kind], weight)
        expansion += force[:, :, None] * shape
    kept = 3 * nodes
    inner = np.concatenate([stiffness[:, kept:, :kept], expansion[:, kept:]], axis=2)
    bubbles = np.linalg.solve(stiffness[:, kept:, kept:], inner)
    coupling = stiffness[:, :kept, kept:]
    return (
        stiffness[:, :kept, :kept] - coupling @ bubbles[:, :, :kept],
        expansion[:, :kept] - coupling @ bubbles[:, :, kept:],
    )


def _strains(gradients: Vector) -> Vector:
    """Strain matrices (n_cells, 6, 3·n_functions) from gradients (n_cells, n_functions, 3)."""
    n_cells, n_functions, _ = gradients.shape
    strains = np.zeros((n_cells, 6, n_functions, 3))
    for axis in range(3):
        strains[:, axis, :, axis] = gradients[:, :, axis]
    for number, (first, second) in enumerate(_SHEAR, start=3):
        strains[:, number, :, first] = gradients[:, :, second]
        strains[:, number, :, second] = gradients[:, :, first]
    return strains.reshape(n_cells, 6, 3 * n_functions)


def rigid_motion_reading(
    body: SolidMesh, weights: Vector, at_m: Sequence[float] | None, along: Sequence[float]
) -> Vector:
    """Reading e of shape (3n,) of the displacement of a point that moves with some nodes, in the direction `along`.

    The nodes move best, in least squares with `weights` of shape (n,), as a rigid body; the point `at_m` [m], which
    need not be in the body, is carried along; None is their centre, for which they need not tell a rotation.
    """
    nodes = np.flatnonzero(weights)
    share = weights[nodes] / weights[nodes].sum()
    centre = share @ body.nodes_m[nodes]
    arms = body.nodes_m[nodes] - centre
    inertia = share @ (arms**2).sum(axis=1) * np.eye(3) - (share * arms.T) @ arms
    # u(at) = mean u + ω × (at − centre), ω = inertia⁻¹ Σ share · arm × u
    # and (ω × r)·e = ω·(r × e)
    turning = np.zeros(3) if at_m is None else np.linalg.solve(inertia, np.cross(np.asarray(at_m) - centre, along))
    reading = np.zeros((len(body.nodes_m), 3))
    reading[nodes] = share[:, None] * (along + np.cross(turning, arms))  # t·(arm × u) = u·(t × arm)
    return reading.ravel()


def conduction_matrices(
    body: SolidMesh, materials: Mapping[str, Material]
) -> tuple[sparse.csr_array, sparse.csr_array]:
    """Capacity C_ij = ∫ρc φ_i φ_j dV [J/K] and conduction K_ij = ∫k ∇φ_i·∇φ_j dV [W/K], each of shape (n, n)."""
    from skfem import Basis, BilinearForm

    basis = Basis(body.mesh, body.element, intorder=2 * body.degree)
    of_cell = [materials[name] for name in body.materials]
    heat = np.array([m.density_kg_per_m3 * m.specific_heat_j_per_kg_k for m in of_cell])[body.kind][:, None]
    conductivity = np.array([m.conductivity_w_per_m_k for m in of_cell])[body.kind][:, None]

    def stored(u: Any, v: Any, w: Any) -> Any:
        return w["rho_c"] * u * v

    def conducted(u: Any, v: Any, w: Any) -> Any:
        return w["k"] * sum(u.grad[i] * v.grad[i] for i in range(3))

    points = basis.dx.shape
    capacity = BilinearForm(stored).assemble(basis, rho_c=np.broadcast_to(heat, points))
    conduction = BilinearForm(conducted).assemble(basis, k=np.broadcast_to(conductivity, points))
    return _symmetric(capacity), _symmetric(conduction)


def film(body: SolidMesh, facets: Indices) -> tuple[sparse.csr_array, Vector]:
    """Film matrix A_ij = ∫φ_i φ_j dS [m²] of some facets, and its load a = A·1 [m²]."""
    from skfem import BilinearForm, FacetBasis

    basis = FacetBasis(body.mesh, body.element, facets=facets, intorder=2 * body.degree)
    matrix = _symmetric(BilinearForm(lambda u, v, w: u * v).assemble(basis))
    return matrix, np.asarray(matrix @ np.ones(len(body.nodes_m)))


def volume_source(body: SolidMesh, cells: Indices) -> Vector:
    """Shares b_i = ∫φ_i dV / V of heat that is spread evenly over some cells; they sum to 1."""
    from skfem import Basis, LinearForm

    share = LinearForm(lambda v, w: v).assemble(Basis(body.mesh, body.element, elements=cells))
    return np.asarray(share / share.sum())


def surface_source(body: SolidMesh, facets: Indices) -> Vector:
    """Shares b_i = ∫φ_i dS / S of heat that is spread evenly over some facets; they sum to 1."""
    load = film(body, facets)[1]
    return load / load.sum()


def _symmetric(matrix: Any) -> sparse.csr_array:
    result = sparse.csr_array(matrix)
    return sparse.csr_array((result + result.T) * 0.5)
