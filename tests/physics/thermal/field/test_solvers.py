"""Both solvers give the same displacements."""

from __future__ import annotations

import numpy as np
import pytest

from selector.physics.thermal.field.mesh import (
    MATERIALS,
    MULTIGRID_TOLERANCE,
    Block,
    block_mesh,
    elastic_matrices,
    elasticity,
    rigid_motions,
)


def angle():
    blocks = [
        Block("foot", "cast iron", (0.0, 0.0, 0.0), (0.6, 0.3, 0.1)),
        Block("wall", "cast iron", (0.0, 0.0, 0.1), (0.1, 0.3, 0.7)),
    ]
    return block_mesh(blocks, 0.05)


def on_springs(body):
    return np.where(np.isclose(body.nodes_m[:, 2:], 0.0), 1e7, 0.0) * np.ones(3)


def test_factors_and_multigrid_agree():
    body = angle()
    rng = np.random.default_rng(1)
    rise = rng.uniform(0, 10, len(body.nodes_m))
    direct = elasticity(body, MATERIALS, on_springs(body), direct=True)
    iterated = elasticity(body, MATERIALS, on_springs(body), direct=False)
    exact = direct.displacement_um(rise)
    # the residual stops at 1e-10 of the load; what is left is amplified by the root of the condition number, < 1e4
    assert np.abs(iterated.displacement_um(rise) - exact).max() < 1e4 * MULTIGRID_TOLERANCE * np.abs(exact).max()
    loads = rng.standard_normal((3 * len(body.nodes_m), 2))
    assert np.abs(direct.stiffness @ direct.solve(loads) - loads).max() < 1e-9
    assert np.abs(direct.stiffness @ iterated.solve(loads) - loads).max() < 1e-8
    assert not iterated.solve(np.zeros(3 * len(body.nodes_m))).any()


def test_the_free_body_resists_no_rigid_motion():
    body = angle()
    stiffness, expansion = elastic_matrices(body, MATERIALS)
    motions = rigid_motions(body.nodes_m)
    scale = abs(stiffness).max()
    assert np.abs(stiffness @ motions).max() < 1e-12 * scale  # round-off
    # forces of expansion are in balance: no resultant, no moment
    assert np.abs(motions.T @ expansion).max() < 1e-12 * abs(expansion).max()
    assert np.linalg.eigvalsh((stiffness + stiffness.T).toarray() / 2)[0] > -1e-10 * scale


def test_multigrid_that_does_not_converge_says_so(monkeypatch):
    body = angle()
    monkeypatch.setattr("selector.physics.thermal.field.mesh.MULTIGRID_TOLERANCE", 1e-40)
    elastic = elasticity(body, MATERIALS, on_springs(body), direct=False)
    with pytest.raises(ArithmeticError, match="conjugate gradients"):
        elastic.displacement_um(np.ones(len(body.nodes_m)))
