"""A C-frame of cubes by finite differences: a heat system of any size in a few lines, for tests."""

from __future__ import annotations

import numpy as np
from scipy import sparse

from selector.physics.thermal.network.heat_system import HeatSystem, factorised

K_W_PER_M_K, C_J_PER_M3_K = 48.0, 7200.0 * 500.0


def voxel_machine(edge_m: float = 0.08) -> HeatSystem:
    """Bed, column and headstock of cubes; three sources, four films; the C and K of a seven-point scheme."""
    axes = [np.arange(edge_m / 2, length, edge_m) for length in (0.64, 1.44, 1.76)]
    x, y, z = (grid.ravel() for grid in np.meshgrid(*axes, indexing="ij"))
    bed, column = z < 0.35, (y < 0.48) & ((z < 0.35) | (np.abs(x - 0.32) > 0.12) | (y < 0.1) | (y > 0.38))
    head = (y >= 0.4) & (y < 0.96) & (z > 1.1) & (np.abs(x - 0.32) < 0.25)
    there = bed | column | head
    number = np.full(there.shape, -1)
    number[there] = np.arange(there.sum())
    grid = number.reshape([len(axis) for axis in axes])
    x, y, z = x[there], y[there], z[there]
    n = len(x)
    conductance = K_W_PER_M_K * edge_m
    rows, columns, faces = [], [], np.full(n, 6.0)
    for axis in range(3):
        a = np.moveaxis(grid, axis, 0)[:-1].ravel()
        b = np.moveaxis(grid, axis, 0)[1:].ravel()
        both = (a >= 0) & (b >= 0)
        rows.append(a[both])
        columns.append(b[both])
        np.subtract.at(faces, a[both], 1.0)
        np.subtract.at(faces, b[both], 1.0)
    i, j = np.concatenate(rows), np.concatenate(columns)
    links = sparse.coo_array((np.full(len(i), conductance), (i, j)), shape=(n, n)).tocsr()
    links = links + links.T
    conduction = sparse.csr_array(sparse.diags_array(np.asarray(links.sum(axis=1)).ravel()) - links)
    areas = faces * edge_m**2

    def share(where):
        return where / where.sum()

    nose = (z < 1.25) & (y > 0.64) & (np.abs(x - 0.32) < 0.13)
    patches = {"bed": z < 0.35, "column": (z >= 0.35) & (y < 0.4), "head": (z > 1.1) & (y >= 0.4), "nose": nose}
    loads = {name: np.where(where, areas, 0.0) for name, where in patches.items()}
    rise = 10.5 * edge_m  # µm/K of a cube
    return HeatSystem(
        capacity=sparse.csr_array(sparse.diags_array(np.full(n, C_J_PER_M3_K * edge_m**3))),
        conduction=conduction,
        films={name: sparse.csr_array(sparse.diags_array(load)) for name, load in loads.items()},
        film_loads=loads,
        sources={
            "bearing": share(nose.astype(float)),
            "motor": share(((z > 1.6) & (y > 0.6) & (x > 0.3)).astype(float)),
            "nut": share(((z > 0.9) & (z < 1.05) & (y > 0.38) & (y < 0.48) & (x < 0.3)).astype(float)),
        },
        probes={
            "T_nose": share(((z < 1.25) & (y > 0.9)).astype(float)),
            "T_back": share(((y < 0.1) & (z > 0.8) & (z < 0.9)).astype(float)),
            "T_bed": share(((z < 0.1) & (y > 1.2)).astype(float)),
        },
        displacements={
            "X": rise * 1e3 * (x - 0.32) * share((z > 1.1).astype(float)),
            "Y": rise * 1e3 * (0.24 - y) * share((y < 0.5).astype(float)) + 5 * share((z > 1.1).astype(float)),
            "Z": rise * share((y < 0.5).astype(float)) * (z.max() / edge_m),
        },
        uniform=np.ones(n),
    )


def implicit_history(system, steps, step_s):
    """Probes and displacements after each step of SDIRK2 (L-stable, second order), written as plainly as can be.

    `steps` is a list of (film coefficients, fluid temperatures, heat by source), one a step.
    """
    rows = np.vstack([*system.probes.values(), *system.displacements.values()])
    state, out, factors = 20.0 * system.uniform, [], {}
    gamma = 1.0 - 1.0 / np.sqrt(2.0)
    for coefficients, fluids, heat in steps:
        key = tuple(coefficients.items())
        if key not in factors:
            factors[key] = factorised(system, coefficients, gamma * step_s)
        load = sum(watts * system.sources[name] for name, watts in heat.items())
        load = load + sum(h * fluids[name] * system.film_loads[name] for name, h in coefficients.items())

        def slope(at, coefficients=coefficients, load=load):
            flow = system.conduction @ at
            for name, h in coefficients.items():
                flow = flow + h * (system.films[name] @ at)
            return load - flow

        k1 = factors[key](slope(state)) / (gamma * step_s)
        k2 = factors[key](slope(state + step_s * (1 - gamma) * k1)) / (gamma * step_s)
        state = state + step_s * ((1 - gamma) * k1 + gamma * k2)
        out.append(rows @ state)
    return np.array(out)
