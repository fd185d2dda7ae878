"""A large heat system with few states: which temperature fields are enough, and the system written in them."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np
from scipy import linalg

from selector.errors import InputError
from selector.physics.thermal.network.heat_system import HeatSystem, SystemMatrix
from selector.physics.thermal.network.stepping import factorised as solver_of
from selector.types import Array

TIME_SCALES_S = (20.0, 90.0, 400.0, 2000.0, 10000.0, np.inf)
"""Reciprocal shifts of the moments: from the first warming of a bearing to the steady state of a bed."""

TOLERANCE = 3e-4
"""Fields are left out that change none of the responses by more than this share of its norm."""


def reduced_basis(
    system: HeatSystem,
    film_coefficients: Sequence[Mapping[str, float]],
    *,
    time_scales_s: Sequence[float] = TIME_SCALES_S,
    tolerance: float = TOLERANCE,
    max_states: int | None = None,
) -> Array:
    """Fields that span the responses to every input, shape (n, n_reduced), orthonormal in the heat capacity C.

    Block rational Krylov space of order one: for every set of film coefficients h and every time scale τ the fields
    (C/τ + K + Σ h_f·A_f)⁻¹·g for the heat sources, the fluids and (by reciprocity) the displacements g. Each is scaled
    to norm one; the principal directions of all of them are kept down to `tolerance`. The uniform field is the first
    and exact, so that a machine at the temperature of the hall stays there. One factorisation per h and τ.

    `film_coefficients` are the sets [W/(m²·K)] that the machine works with, by film; a film that is not named has 0.
    `time_scales_s` are τ [s], infinite for the steady state. `tolerance` is the relative norm of what is left out.

    Raises InputError if a steady state is asked for where no film takes heat away.
    """
    if np.isinf(max(time_scales_s)) and not all(any(one.values()) for one in film_coefficients):
        raise InputError(
            "no film that takes heat away, but a steady state",
            expected="a film coefficient above 0 in every set",
            where="model reduction",
            advice="give a film a coefficient, or leave the infinite time scale out",
        )
    loads = np.column_stack([*system.sources.values(), *system.film_loads.values(), *system.displacements.values()])
    loads = loads[:, np.any(loads != 0, axis=0)]
    unit = system.uniform / np.sqrt(system.uniform @ (system.capacity @ system.uniform))
    blocks = []
    for coefficients in film_coefficients:
        for tau_s in time_scales_s:
            fields = factorised(system, coefficients, tau_s)(loads)
            rest = _without(fields, unit[:, None], system.capacity)
            norms = _norms(rest, system.capacity)
            uneven = norms > 1e-9 * _norms(fields, system.capacity)  # what is less is round-off of a uniform field
            blocks.append(rest[:, uneven] / norms[uneven])
    snapshots = np.hstack(blocks)
    if not snapshots.shape[1]:
        return unit[:, None]
    weights, directions = linalg.eigh(snapshots.T @ (system.capacity @ snapshots))
    room = system.size - 1 if max_states is None else min(system.size, max_states) - 1
    # below 1e-7 a singular value of the Gram matrix is round-off
    kept = np.flatnonzero(weights > max(tolerance, 1e-7) ** 2)[::-1][: max(room, 0)]
    fields = snapshots @ (directions[:, kept] / np.sqrt(weights[kept]))
    for _ in range(2):  # twice is enough for orthogonality to round-off
        fields = _without(fields, unit[:, None], system.capacity)
        factor = linalg.cholesky(fields.T @ (system.capacity @ fields), lower=False)
        fields = linalg.solve_triangular(factor, fields.T, trans="T").T
    return np.column_stack([unit, fields])


def projected(system: HeatSystem, basis: Array) -> HeatSystem:
    """The system for fields T = basis·x only (Galerkin): symmetric and passive like the system itself.

    `basis` has shape (n, n_reduced), is orthonormal in the heat capacity and contains the uniform field.
    """
    conduction = _congruent(system.conduction, basis)
    uniform = basis.T @ (system.capacity @ system.uniform)
    # no heat flows in a uniform field: round-off of the projection is taken out of the rows
    conduction -= np.outer(conduction @ uniform, uniform) / (uniform @ uniform)
    conduction -= np.outer(uniform, uniform @ conduction) / (uniform @ uniform)
    return HeatSystem(
        capacity=np.eye(basis.shape[1]),
        conduction=(conduction + conduction.T) / 2,
        films={name: _congruent(matrix, basis) for name, matrix in system.films.items()},
        film_loads={name: basis.T @ load for name, load in system.film_loads.items()},
        sources={name: basis.T @ share for name, share in system.sources.items()},
        probes={name: basis.T @ row for name, row in system.probes.items()},
        displacements={name: basis.T @ row for name, row in system.displacements.items()},
        uniform=uniform,
    )


def factorised(system: HeatSystem, coefficients: Mapping[str, float], tau_s: float) -> Callable[[Array], Array]:
    """Solves (C/τ + K + Σ h_f·A_f)·x = g for columns g; infinite τ: the steady state."""
    solver = solver_of(_operator(system, coefficients, tau_s))
    return lambda loads: np.asarray(solver.solve(np.ascontiguousarray(loads)))


def _operator(system: HeatSystem, coefficients: Mapping[str, float], tau_s: float) -> SystemMatrix:
    matrix = system.conduction + system.capacity * (1.0 / tau_s)
    for name, coefficient in coefficients.items():
        if coefficient:
            matrix = matrix + system.films[name] * coefficient
    return matrix


def _norms(fields: Array, capacity: SystemMatrix) -> Array:
    return np.asarray(np.sqrt(np.einsum("ij,ij->j", fields, capacity @ fields)))


def _without(fields: Array, basis: Array, capacity: SystemMatrix) -> Array:
    """Fields less their parts in an orthonormal basis."""
    return fields - basis @ (basis.T @ (capacity @ fields))


def _congruent(matrix: SystemMatrix, basis: Array) -> Array:
    small = np.asarray(basis.T @ (matrix @ basis))
    return (small + small.T) / 2
