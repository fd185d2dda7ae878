"""How anything with states follows its inputs: the common form of all simulations, whatever their physics."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import linalg

from selector.types import Matrix, Vector


class System(Protocol):
    """States x that follow inputs u: x' = derivative(t, x, u), y = output(t, x, u)."""

    @property
    def states(self) -> tuple[str, ...]:
        """Names of the states."""

    @property
    def inputs(self) -> tuple[str, ...]:
        """Names of the inputs."""

    @property
    def outputs(self) -> tuple[str, ...]:
        """Names of the outputs."""

    def derivative(self, t_s: float, x: Vector, u: Vector) -> Vector:
        """Rate of every state, shape (n_states,), at time `t_s` [s]."""

    def output(self, t_s: float, x: Vector, u: Vector) -> Vector:
        """Outputs, shape (n_outputs,), at time `t_s` [s]."""


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


def linearise(system: System, x: ArrayLike, u: ArrayLike, *, t_s: float = 0.0) -> StateSpace:
    """The linear system that small deviations from (`x`, `u`) obey at time `t_s` [s]; by central differences."""
    state, held = np.array(x, dtype=np.float64), np.array(u, dtype=np.float64)
    return StateSpace(
        A=_jacobian(lambda value: system.derivative(t_s, value, held), state, len(system.states)),
        B=_jacobian(lambda value: system.derivative(t_s, state, value), held, len(system.states)),
        C=_jacobian(lambda value: system.output(t_s, value, held), state, len(system.outputs)),
        D=_jacobian(lambda value: system.output(t_s, state, value), held, len(system.outputs)),
        states=tuple(system.states),
        inputs=tuple(system.inputs),
        outputs=tuple(system.outputs),
    )


def _jacobian(function: Callable[[Vector], Vector], at: Vector, rows: int) -> Matrix:
    found = np.empty((rows, len(at)))
    for column in range(len(at)):
        # cube root of the rounding: where truncation and rounding of a central difference meet
        step = 6e-6 * max(1.0, abs(at[column]))
        above, below = at.copy(), at.copy()
        above[column] += step
        below[column] -= step
        found[:, column] = (function(above) - function(below)) / (above[column] - below[column])
    return found
