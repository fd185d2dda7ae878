"""Static linear thermoelasticity on a mesh: how the body deforms under a temperature field."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from selector.physics.thermal.field.materials import Material
from selector.physics.thermal.field.mesh import BlockMesh
from selector.physics.thermal.field.solvers import Solver, direct_solver, multigrid_solver

Vector = NDArray[np.float64]
Indices = NDArray[np.int64]

DIRECT_NODES = 60_000
"""Largest number of nodes whose elastic system is factorised; more takes more than 6 GB."""

_MODES = 3  # incompatible modes of a cell, one parabola along each axis
_SHEAR = ((1, 2), (2, 0), (0, 1))  # strains 3, 4, 5


@dataclass(frozen=True)
class Elasticity:
    """K·u = F·(T − T_reference) with elastic feet, ready to be solved.

    Degree of freedom 3·i + a is the displacement [m] of node i along axis a.

    Attributes
    ----------
    stiffness : sparse matrix of shape (3n, 3n)
        K [N/m], feet included.
    expansion : sparse matrix of shape (3n, n)
        F [N/K]: forces of the heated material.
    solve : callable
        u = K⁻¹·f for a force vector of shape (3n,) or several as columns.
    """

    stiffness: sparse.csr_array
    expansion: sparse.csr_array
    solve: Solver

    def displacement_um(self, rise_k: Vector) -> Vector:
        """Displacement of every node, of shape (n, 3) [µm], for its temperature rise [K]."""
        return np.asarray(self.solve(self.expansion @ rise_k)).reshape(-1, 3) * 1e6

    def row_um_per_k(self, row: Vector) -> Vector:
        """Row Fᵀ·K⁻¹·e of shape (n,) [µm/K] of the reading e·u, `row` e of shape (3n,): adjoint method."""
        return np.asarray(self.expansion.T @ self.solve(row)) * 1e6


def elasticity(
    body: BlockMesh, materials: Mapping[str, Material], springs_n_per_m: Vector, direct: bool | None = None
) -> Elasticity:
    """The elastic body on springs to the ground, `springs_n_per_m` of shape (n, 3), one for each node and axis.

    Trilinear cells with Wilson's three incompatible parabolas, condensed cell by cell: on boxes they pass the patch
    test and bend without locking (Wilson, Taylor, Doherty and Ghaboussi 1973; Taylor, Beresford and Wilson 1976).
    `direct` chooses factors or multigrid; if left out, factors up to `DIRECT_NODES`.
    """
    stiffness, expansion = elastic_matrices(body, materials)
    held = sparse.csr_array(stiffness + sparse.diags_array(springs_n_per_m.ravel()))
    if direct if direct is not None else len(body.nodes_m) <= DIRECT_NODES:
        solver = direct_solver(held, np.repeat(body.nodes_m, 3, axis=0))
    else:
        solver = multigrid_solver(held, body.nodes_m)
    return Elasticity(held, expansion, solver)


def elastic_matrices(body: BlockMesh, materials: Mapping[str, Material]) -> tuple[sparse.csr_array, sparse.csr_array]:
    """Stiffness of shape (3n, 3n) [N/m] of the free body and expansion forces of shape (3n, n) [N/K]."""
    stiffness, expansion = _cell_matrices(body, materials)
    n = len(body.nodes_m)
    dofs = (3 * body.cells[:, :, None] + np.arange(3)).reshape(-1, 24)
    rows, columns = np.repeat(dofs, 24, axis=1).ravel(), np.tile(dofs, (1, 24)).ravel()
    total = sparse.coo_array((stiffness.ravel(), (rows, columns)), shape=(3 * n, 3 * n)).tocsr()
    rows, columns = np.repeat(dofs, 8, axis=1).ravel(), np.tile(body.cells, (1, 24)).ravel()
    forces = sparse.coo_array((expansion.ravel(), (rows, columns)), shape=(3 * n, n)).tocsr()
    return sparse.csr_array((total + total.T) * 0.5), sparse.csr_array(forces)


def _cell_matrices(body: BlockMesh, materials: Mapping[str, Material]) -> tuple[Vector, Vector]:
    """Stiffness (n_cells, 24, 24) and expansion forces (n_cells, 24, 8), incompatible modes condensed."""
    from skfem import Basis, ElementHex1

    basis = Basis(body.mesh, ElementHex1(), intorder=3)
    kinds = [materials[name] for name in body.materials]
    elastic = np.array([material.stiffness_pa() for material in kinds])
    # stress of a rise of 1 K that cannot expand
    heated = np.array([e[:, :3].sum(axis=1) * m.expansion_per_k for e, m in zip(elastic, kinds, strict=True)])
    n_cells, n_points = basis.dx.shape
    size_m = body.high_m - body.low_m
    wide = 3 * (8 + _MODES)
    stiffness = np.zeros((n_cells, wide, wide))
    expansion = np.zeros((n_cells, wide, 8))
    for point in range(n_points):
        gradients = np.zeros((n_cells, 8 + _MODES, 3))
        for corner in range(8):
            gradients[:, corner] = basis.basis[corner][0].grad[:, :, point].T
        for axis in range(_MODES):  # 4 ξ (1 − ξ) has the slope 4 (1 − 2 ξ) / length
            gradients[:, 8 + axis, axis] = 4 * (1 - 2 * basis.X[axis, point]) / size_m[:, axis]
        strains = _strains(gradients)
        weight = basis.dx[:, point]
        stress = np.matmul(elastic[body.kind] * weight[:, None, None], strains)
        stiffness += np.matmul(strains.transpose(0, 2, 1), stress)
        shape = np.array([basis.basis[corner][0][0, point] for corner in range(8)])
        force = np.einsum("csi,cs,c->ci", strains, heated[body.kind], weight)
        expansion += force[:, :, None] * shape
    modes = np.linalg.solve(stiffness[:, 24:, 24:], np.concatenate([stiffness[:, 24:, :24], expansion[:, 24:]], axis=2))
    coupling = stiffness[:, :24, 24:]
    return stiffness[:, :24, :24] - coupling @ modes[:, :, :24], expansion[:, :24] - coupling @ modes[:, :, 24:]


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


def rigid_motion_reading(body: BlockMesh, weights: Vector, at_m: Sequence[float], axis: int) -> Vector:
    """Reading e of shape (3n,) of the displacement along `axis` of a point that moves with some nodes.

    The nodes move best, in least squares with `weights` of shape (n,), as a rigid body; the point `at_m` [m], which
    need not be in the body, is carried along.
    """
    nodes = np.flatnonzero(weights)
    share = weights[nodes] / weights[nodes].sum()
    centre = share @ body.nodes_m[nodes]
    arms = body.nodes_m[nodes] - centre
    inertia = share @ (arms**2).sum(axis=1) * np.eye(3) - (share * arms.T) @ arms
    # u(at) = mean u + ω × (at − centre), ω = inertia⁻¹ Σ share · arm × u
    lever = np.cross(np.asarray(at_m) - centre, np.eye(3)[axis])  # (ω × r)·e = ω·(r × e)
    turning = np.linalg.solve(inertia, lever)
    reading = np.zeros((len(body.nodes_m), 3))
    reading[nodes] = share[:, None] * (np.eye(3)[axis] + np.cross(turning, arms))  # t·(arm × u) = u·(t × arm)
    return reading.ravel()
