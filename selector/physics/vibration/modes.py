"""At which frequencies, in which shapes and how damped does a structure ring: modes of the complex-symmetric pencil.

The dissipation ψ differs from joint to joint, so the shapes are complex: K·φ = λ·M·φ with φᵀ·M·φ = 1, without
conjugation. Where two modes fall together in shape too (a defective pencil) no set of shapes spans all motions; what
is asked of such a structure is answered by the triangular form of Schur, which always exists.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import linalg
from scipy.sparse.csgraph import connected_components

from selector.errors import InputError
from selector.physics.system import StateSpace
from selector.physics.vibration.coupled import (
    checked_frequencies,
    known_place,
    mass_matrix,
    refuse_unresolved,
    scaled_stiffness_matrix,
    stiffness_matrix,
    unit_force,
)
from selector.physics.vibration.structure import Structure

Complex = NDArray[np.complex128]

ORTHOGONAL = 1e-10
"""Modes whose product φᵀ·M·φ is above this share of their lengths are not told apart by their eigenvalues."""
COMPLETE = 1e-10
"""How exactly the shapes of all modes must give back every motion to be used as coordinates."""


@dataclass(frozen=True)
class StructureModes:
    """Modes of a structure, lowest frequency first.

    Attributes
    ----------
    frequency_hz : ndarray of shape (n,)
        Damped eigenfrequencies Re √λ / 2π [Hz].
    loss_factor : ndarray of shape (n,)
        η = Im λ / Re λ; ψ of the mode is 2π·η.
    shapes : complex ndarray of shape (n_members, n)
        One mode a column, φᵀ·M·φ = 1 (no conjugation), the largest motion with a positive real part [kg^−½]. If not
        `complete`: modes for which that is impossible have φᴴ·M·φ = 1.
    eigenvalues_per_s2 : complex ndarray of shape (n,)
        λ [1/s²].
    members : tuple of str
        Names of the rows of `shapes`.
    complete : bool
        Whether the shapes span all motions, to rounding.
    """

    frequency_hz: NDArray[np.float64]
    loss_factor: NDArray[np.float64]
    shapes: Complex
    eigenvalues_per_s2: Complex
    members: tuple[str, ...]
    complete: bool

    def __post_init__(self) -> None:
        for values in (self.frequency_hz, self.loss_factor, self.shapes, self.eigenvalues_per_s2):
            values.setflags(write=False)


def structure_modes(structure: Structure) -> StructureModes:
    """All modes of a structure.

    Raises
    ------
    InputError
        If stiffnesses over masses lie so far apart that rounding decides the lowest modes.
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

    Raises
    ------
    InputError
        At a resonance that nothing damps, and for unknown members.
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


def state_space(
    structure: Structure, at_hz: float, *, inputs: Sequence[str] | None = None, outputs: Sequence[str] | None = None
) -> StateSpace:
    """The structure with the viscous dampers c = η·j/ω that take the same energy at one frequency.

    States: displacement [m] and speed [m/s] of every member. Inputs: forces on members [N]; outputs: displacements of
    members [m]; by default of all. At `at_hz` its frequency response is that of the structure.

    Raises
    ------
    InputError
        If `at_hz` [Hz] is not above 0, or a member is unknown.
    """
    if not (math.isfinite(at_hz) and at_hz > 0.0):
        raise InputError(
            f"{at_hz:g} Hz",
            expected="a frequency above 0 Hz",
            where="at_hz",
            advice="choose the frequency at which the damping matters most, that of the main resonance",
        )
    inputs = structure.names if inputs is None else tuple(inputs)
    outputs = structure.names if outputs is None else tuple(outputs)
    n, stiffness, mass = len(structure.members), stiffness_matrix(structure), np.diag(mass_matrix(structure))
    a = np.zeros((2 * n, 2 * n))
    a[:n, n:] = np.eye(n)
    a[n:, :n] = -stiffness.real / mass[:, None]
    a[n:, n:] = -stiffness.imag / (2.0 * math.pi * at_hz) / mass[:, None]
    b, c = np.zeros((2 * n, len(inputs))), np.zeros((len(outputs), 2 * n))
    for column, name in enumerate(inputs):
        b[n:, column] = unit_force(structure, name) / mass
    for row, name in enumerate(outputs):
        c[row, known_place(structure, name, "outputs")] = 1.0
    names = structure.names
    return StateSpace(
        A=a,
        B=b,
        C=c,
        D=np.zeros((len(outputs), len(inputs))),
        states=(*(f"displacement of {name}" for name in names), *(f"speed of {name}" for name in names)),
        inputs=inputs,
        outputs=outputs,
        places=names,
    )


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
