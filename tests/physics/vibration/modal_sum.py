"""Receptances as sums over modes, or by a triangular form: another way to what `receptances` solves."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import linalg

from selector.physics.vibration.structure import (
    Structure,
    StructureModes,
    known_place,
    masses_kg,
    refuse_unresolved,
    scaled_stiffness_matrix,
    structure_modes,
    unit_force,
)
from selector.types import Complex


def receptance_by_modes(
    structure: Structure,
    frequency_hz: ArrayLike,
    *,
    of: str,
    at: str,
    against: str | None = None,
    modes: StructureModes | None = None,
) -> Complex:
    """Motion of `of` per unit force on `at` [m/N], shape (n_freq,): Σ φ_of·φ_at / (λ − ω²) over all modes.

    The opposite force acts on `against`, by default on the ground. `modes` are those of the structure, where they are
    known already. Where modes are not complete, by the triangular form of Schur instead.

    InputError at a resonance that nothing damps, and for unknown members.
    """
    frequency = np.asarray(frequency_hz, dtype=np.float64)
    modes = structure_modes(structure) if modes is None else modes
    refuse_unresolved(structure, frequency)
    force, place = unit_force(structure, at, against), known_place(structure, of, "of")
    square = (2.0 * math.pi * frequency) ** 2
    if not modes.complete:
        return _by_schur(structure, square, force, place)
    weight = modes.shapes[place] * (modes.shapes.T @ force)
    return np.asarray((weight / (modes.eigenvalues_per_s2 - square[:, None])).sum(axis=1))


def _by_schur(structure: Structure, square: NDArray[np.float64], force: NDArray[np.float64], place: int) -> Complex:
    """Receptance by back substitution in the triangular form T of the inverse, all frequencies at once.

    (K − ω²)⁻¹ = T·(1 − ω²·T)⁻¹ between unitary matrices; needs no complete modes.
    """
    root = np.sqrt(masses_kg(structure))
    triangle, unitary = linalg.schur(linalg.inv(scaled_stiffness_matrix(structure)), output="complex")
    load = unitary.conj().T @ (force / root)
    found = np.zeros((len(load), len(square)), dtype=np.complex128)
    for row in range(len(load) - 1, -1, -1):
        rest = load[row] + square * (triangle[row, row + 1 :] @ found[row + 1 :])
        found[row] = rest / (1.0 - square * triangle[row, row])
    return np.asarray((unitary[place] @ triangle) @ found / root[place])
