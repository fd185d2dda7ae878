"""How a linear system with states follows its inputs."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import linalg

from selector.types import Matrix


@dataclass(frozen=True)
class StateSpace:
    """The linear system x' = A·x + B·u, y = C·x + D·u.

    Raises ValueError if the shapes do not fit together.
    """

    #: A, B, C and D: (n, n): Its matrices
    A: Matrix
    B: Matrix
    C: Matrix
    D: Matrix
    #: states, inputs and outputs: Its names
    states: tuple[str, ...]
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]

    def __post_init__(self) -> None:
        n, m, p = len(self.states), len(self.inputs), len(self.outputs)
        for name, shape in {"A": (n, n), "B": (n, m), "C": (p, n), "D": (p, m)}.items():
            matrix = np.array(getattr(self, name), dtype=np.float64)
            if matrix.shape != shape:
                raise ValueError(f"{name} has the shape {matrix.shape}, the names ask for {shape}")
            matrix.setflags(write=False)
            object.__setattr__(self, name, matrix)

    @property
    def poles(self) -> NDArray[np.complex128]:
        """Eigenvalues of A [1/s], the slowest (real part nearest to 0 from below, or above it) first."""
        poles = np.asarray(linalg.eigvals(self.A), dtype=np.complex128)
        return poles[np.argsort(-poles.real, kind="stable")]

    def step_matrices(self, step_s: float) -> tuple[Matrix, Matrix]:
        """E and F of x(t + step) = E·x(t) + F·u for inputs held over the step; no approximation (`expm`)."""
        n, m = self.B.shape
        block = np.zeros((n + m, n + m))
        block[:n, :n], block[:n, n:] = self.A, self.B
        powers = linalg.expm(block * step_s)
        return powers[:n, :n], powers[:n, n:]
