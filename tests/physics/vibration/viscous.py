"""A structure in time: with the viscous dampers c = η·j/ω that take the same energy at one frequency."""

from __future__ import annotations

import math

import numpy as np

from selector.physics.drive.closed_loop import StateSpace
from selector.physics.vibration.structure import Structure, known_place, masses_kg, stiffness_matrix, unit_force


def state_space(structure: Structure, at_hz: float, *, inputs=None, outputs=None) -> StateSpace:
    """Forces on members [N] to displacements of members [m], by default of all; right at `at_hz`."""
    names = structure.names
    inputs, outputs = tuple(inputs or names), tuple(outputs or names)
    n, stiffness, mass = len(names), stiffness_matrix(structure), masses_kg(structure)
    a = np.zeros((2 * n, 2 * n))
    a[:n, n:] = np.eye(n)
    a[n:, :n] = -stiffness.real / mass[:, None]
    a[n:, n:] = -stiffness.imag / (2.0 * math.pi * at_hz) / mass[:, None]
    b, c = np.zeros((2 * n, len(inputs))), np.zeros((len(outputs), 2 * n))
    for column, name in enumerate(inputs):
        b[n:, column] = unit_force(structure, name) / mass
    for row, name in enumerate(outputs):
        c[row, known_place(structure, name, "outputs")] = 1.0
    return StateSpace(a, b, c, np.zeros((len(outputs), len(inputs))))
