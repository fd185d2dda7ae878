"""Heat conduction on a mesh as matrices: capacity, conduction, films and sources by trilinear finite elements."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from selector.physics.thermal.field.materials import Material
from selector.physics.thermal.field.mesh import BlockMesh

Vector = NDArray[np.float64]
Indices = NDArray[np.int64]


def conduction_matrices(
    body: BlockMesh, materials: Mapping[str, Material]
) -> tuple[sparse.csr_array, sparse.csr_array]:
    """Capacity C_ij = ∫ρc φ_i φ_j dV [J/K] and conduction K_ij = ∫k ∇φ_i·∇φ_j dV [W/K], each of shape (n, n)."""
    from skfem import Basis, BilinearForm, ElementHex1

    basis = Basis(body.mesh, ElementHex1(), intorder=2)
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


def film(body: BlockMesh, facets: Indices) -> tuple[sparse.csr_array, Vector]:
    """Film matrix A_ij = ∫φ_i φ_j dS [m²] of some boundary facets, and its load a = A·1 [m²]."""
    from skfem import BilinearForm, ElementHex1, FacetBasis

    basis = FacetBasis(body.mesh, ElementHex1(), facets=facets, intorder=2)
    matrix = _symmetric(BilinearForm(lambda u, v, w: u * v).assemble(basis))
    return matrix, np.asarray(matrix @ np.ones(len(body.nodes_m)))


def volume_source(body: BlockMesh, cells: Indices) -> Vector:
    """Shares b_i = ∫φ_i dV / V of heat that is spread evenly over some cells; they sum to 1."""
    share = np.zeros(len(body.nodes_m))
    np.add.at(share, body.cells[cells], (body.volume_m3[cells] / 8)[:, None])
    return share / share.sum()


def surface_source(body: BlockMesh, facets: Indices) -> Vector:
    """Shares b_i = ∫φ_i dS / S of heat that is spread evenly over some boundary facets; they sum to 1."""
    corners = body.nodes_m[np.asarray(body.mesh.facets)[:, facets]]
    extent = np.ptp(corners, axis=0)
    area = np.where(extent > 0, extent, 1.0).prod(axis=1)  # facets of boxes: one extent is zero
    share = np.zeros(len(body.nodes_m))
    np.add.at(share, np.asarray(body.mesh.facets)[:, facets], (area / 4)[None, :])
    return share / share.sum()


def _symmetric(matrix: Any) -> sparse.csr_array:
    result = sparse.csr_array(matrix)
    return sparse.csr_array((result + result.T) * 0.5)
