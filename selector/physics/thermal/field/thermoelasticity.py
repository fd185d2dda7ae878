"""Heat conduction and static linear thermoelasticity on a mesh as matrices, solvers, and constants of materials."""

import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from selector.physics.thermal.field.mesh import SolidMesh
from selector.physics.thermal.network.heat_system import Solve, solver_of
from selector.types import Array, Indices, Vector

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
