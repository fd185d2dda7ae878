"""At which frequencies, in which shapes and how damped does a structure ring, and which mode carries a line."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import linalg
from scipy.sparse.csgraph import connected_components

from selector.physics.vibration.structure.source import Source
from selector.physics.vibration.structure.structure import (
    Structure,
    checked_frequencies,
    known_place,
    mass_matrix,
    refuse_unresolved,
    scaled_stiffness_matrix,
    unit_force,
)
from selector.types import Complex

ORTHOGONAL = 1e-10
"""Modes whose product φᵀ·M·φ is above this share of their lengths are not told apart by their eigenvalues."""
COMPLETE = 1e-10
"""How exactly the shapes of all modes must give back every motion to be used as coordinates."""


@dataclass(frozen=True)
class StructureModes:
    """Modes of a structure, lowest frequency first."""

    frequency_hz: NDArray[np.float64]  #: (n,): Damped eigenfrequencies Re √λ / 2π [Hz]
    loss_factor: NDArray[np.float64]  #: (n,): η = Im λ / Re λ; ψ of the mode is 2π·η
    #: (n_members, n): One mode a column, φᵀ·M·φ = 1 (no conjugation), the largest motion with a positive real part
    #: [kg^−½]. If not `complete`: modes for which that is impossible have φᴴ·M·φ = 1.
    shapes: Complex
    eigenvalues_per_s2: Complex  #: (n,): λ [1/s²]
    members: tuple[str, ...]  #: Names of the rows of `shapes`
    complete: bool  #: Whether the shapes span all motions, to rounding

    def __post_init__(self) -> None:
        for values in (self.frequency_hz, self.loss_factor, self.shapes, self.eigenvalues_per_s2):
            values.setflags(write=False)


def structure_modes(structure: Structure) -> StructureModes:
    """All modes of a structure.

    InputError if stiffnesses over masses lie so far apart that rounding decides the lowest modes.
    """
    refuse_unresolved(structure, np.zeros(1))
    eigenvalues, vectors = _eigenpairs(structure)
    order = np.argsort(np.sqrt(eigenvalues).real, kind="stable")
    eigenvalues, vectors = eigenvalues[order], vectors[:, order]
    vectors = _normalised(vectors)
    largest = vectors[np.argmax(np.abs(vectors), axis=0), np.arange(len(eigenvalues))]
    vectors = vectors * np.where(largest.real < 0.0, -1.0, 1.0)
    lost = np.abs(vectors @ vectors.T - np.eye(len(eigenvalues))).max()
    return StructureModes(
        frequency_hz=np.sqrt(eigenvalues).real / (2.0 * math.pi),
        loss_factor=eigenvalues.imag / eigenvalues.real,
        shapes=vectors / np.sqrt(np.diag(mass_matrix(structure)))[:, None],
        eigenvalues_per_s2=eigenvalues,
        members=structure.names,
        complete=bool(lost <= COMPLETE),
    )


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
    frequency = checked_frequencies(frequency_hz)
    modes = structure_modes(structure) if modes is None else modes
    refuse_unresolved(structure, frequency)
    force, place = unit_force(structure, at, against), known_place(structure, of, "of")
    square = (2.0 * math.pi * frequency) ** 2
    if not modes.complete:
        return _by_schur(structure, square, force, place)
    weight = modes.shapes[place] * (modes.shapes.T @ force)
    return np.asarray((weight / (modes.eigenvalues_per_s2 - square[:, None])).sum(axis=1))


def _eigenpairs(structure: Structure) -> tuple[Complex, Complex]:
    """Eigenvalues and vectors of length 1; real shapes where every joint takes the same share of energy.

    Those of the inverse, a compliance: so the low modes, which move most, have the most digits.
    """
    scaled = scaled_stiffness_matrix(structure)
    losses = {joint.loss_factor for joint in structure.joints}
    if len(losses) == 1:
        inverses, vectors = linalg.eigh(linalg.inv(scaled.real))
        return np.asarray(complex(1.0, losses.pop()) / inverses, np.complex128), vectors.astype(np.complex128)
    inverses, vectors = linalg.eig(linalg.inv(scaled))
    return np.asarray(1.0 / inverses, dtype=np.complex128), np.asarray(vectors, dtype=np.complex128)


def _normalised(vectors: Complex) -> Complex:
    """The vectors with vᵀ·v = 1 and 0 between different ones; as they are where vᵀ·v vanishes."""
    normalised = vectors.copy()
    products = vectors.T @ vectors
    # eigenvalues that are equal, or nearly so, leave it open which of their vectors are found
    _, group = connected_components(np.abs(products) > ORTHOGONAL, directed=False)
    for number in range(group.max() + 1):
        together = np.flatnonzero(group == number)
        block = products[np.ix_(together, together)]
        if np.linalg.svd(block, compute_uv=False).min() > 1e-6:
            # the root of a symmetric matrix is a polynomial of it, hence symmetric too
            root = linalg.sqrtm(block)
            normalised[:, together] = vectors[:, together] @ np.linalg.inv(root)
    return normalised


def _by_schur(structure: Structure, square: NDArray[np.float64], force: NDArray[np.float64], place: int) -> Complex:
    """Receptance by back substitution in the triangular form T of the inverse, all frequencies at once.

    (K − ω²)⁻¹ = T·(1 − ω²·T)⁻¹ between unitary matrices; needs no complete modes.
    """
    root = np.sqrt(np.diag(mass_matrix(structure)))
    triangle, unitary = linalg.schur(linalg.inv(scaled_stiffness_matrix(structure)), output="complex")
    load = unitary.conj().T @ (force / root)
    found = np.zeros((len(load), len(square)), dtype=np.complex128)
    for row in range(len(load) - 1, -1, -1):
        rest = load[row] + square * (triangle[row, row + 1 :] @ found[row + 1 :])
        found[row] = rest / (1.0 - square * triangle[row, row])
    return np.asarray((unitary[place] @ triangle) @ found / root[place])


@dataclass(frozen=True)
class CarryingMode:
    """The mode that has the largest part in the motion of the tool against the workpiece by one line."""

    mode: int  #: Its position among the modes
    #: frequency_hz and loss_factor: Of the mode [Hz], η
    frequency_hz: float
    loss_factor: float
    member: str  #: Member that moves most in it
    amplification: float  #: |λ/(λ − ω²)|: its motion at the line over that by a force that does not change


def carrying_mode(
    structure: Structure, modes: StructureModes, source: Source, frequency_hz: float, *, tool: str, workpiece: str
) -> CarryingMode | None:
    """The mode whose part in X_tool − X_workpiece is the largest; None where modes do not span all motions."""
    if not modes.complete:
        return None
    parts = np.abs(relative_parts(structure, modes, source, frequency_hz, tool=tool, workpiece=workpiece))
    k = int(np.argmax(parts))
    square, eigenvalue = (2.0 * math.pi * frequency_hz) ** 2, complex(modes.eigenvalues_per_s2[k])
    return CarryingMode(
        mode=k,
        frequency_hz=float(modes.frequency_hz[k]),
        loss_factor=float(modes.loss_factor[k]),
        member=modes.members[int(np.argmax(np.abs(modes.shapes[:, k])))],
        amplification=abs(eigenvalue / (eigenvalue - square)),
    )


def relative_parts(
    structure: Structure, modes: StructureModes, source: Source, frequency_hz: float, *, tool: str, workpiece: str
) -> NDArray[np.complex128]:
    """Part of every mode in (X_tool − X_workpiece)/F of one source [m/N], shape (n_modes,); their sum is all of it."""
    force = unit_force(structure, source.member, source.against)
    relative = modes.shapes[structure.position(tool)] - modes.shapes[structure.position(workpiece)]
    square = (2.0 * math.pi * frequency_hz) ** 2
    return np.asarray(relative * (modes.shapes.T @ force) / (modes.eigenvalues_per_s2 - square))
