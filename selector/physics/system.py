"""How anything with states follows its inputs: the common form of all simulations, whatever their physics."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise
from typing import Literal, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import integrate, linalg

from selector.errors import InputError

Vector = NDArray[np.float64]
Matrix = NDArray[np.float64]


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

    @property
    def places(self) -> tuple[str, ...]:
        """Where an effect can act: nodes, joints, axes, channels."""

    def derivative(self, t_s: float, x: Vector, u: Vector) -> Vector:
        """Rate of every state, shape (n_states,), at time `t_s` [s]."""

    def output(self, t_s: float, x: Vector, u: Vector) -> Vector:
        """Outputs, shape (n_outputs,), at time `t_s` [s]."""


@dataclass(frozen=True)
class Trajectory:
    """Result of `simulate`.

    Attributes
    ----------
    time_s : ndarray of shape (n_times,)
        Times [s].
    states, outputs : ndarrays of shape (n_times, n_states), (n_times, n_outputs)
        States and outputs, in the order of the system's names.
    """

    time_s: Vector
    states: Matrix
    outputs: Matrix


@dataclass(frozen=True)
class StateSpace:
    """The linear system x' = A·x + B·u, y = C·x + D·u.

    Attributes
    ----------
    A, B, C, D : ndarrays of shape (n, n), (n, n_inputs), (n_outputs, n), (n_outputs, n_inputs)
        Its matrices.
    states, inputs, outputs, places : tuple of str
        Its names.

    Raises
    ------
    ValueError
        If the shapes do not fit together.
    """

    A: Matrix
    B: Matrix
    C: Matrix
    D: Matrix
    states: tuple[str, ...]
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    places: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        n, m, p = len(self.states), len(self.inputs), len(self.outputs)
        for name, shape in {"A": (n, n), "B": (n, m), "C": (p, n), "D": (p, m)}.items():
            matrix = np.array(getattr(self, name), dtype=np.float64)
            if matrix.shape != shape:
                raise ValueError(f"{name} has the shape {matrix.shape}, the names ask for {shape}")
            matrix.setflags(write=False)
            object.__setattr__(self, name, matrix)

    def derivative(self, t_s: float, x: Vector, u: Vector) -> Vector:
        """A·x + B·u; `t_s` does not matter."""
        return np.asarray(self.A @ x + self.B @ u)

    def output(self, t_s: float, x: Vector, u: Vector) -> Vector:
        """C·x + D·u; `t_s` does not matter."""
        return np.asarray(self.C @ x + self.D @ u)

    @property
    def poles(self) -> NDArray[np.complex128]:
        """Eigenvalues of A [1/s], the slowest (real part nearest to 0 from below, or above it) first."""
        poles = np.asarray(linalg.eigvals(self.A), dtype=np.complex128)
        return poles[np.argsort(-poles.real, kind="stable")]

    @property
    def time_constants_s(self) -> Vector:
        """−1 / real part of every pole [s]: negative for what grows, infinite for what neither grows nor decays."""
        real = self.poles.real
        with np.errstate(divide="ignore"):
            return np.where(real == 0.0, np.inf, -1.0 / real)

    def step_matrices(self, step_s: float) -> tuple[Matrix, Matrix]:
        """E and F of x(t + step) = E·x(t) + F·u for inputs held over the step; no approximation (`expm`)."""
        n, m = self.B.shape
        block = np.zeros((n + m, n + m))
        block[:n, :n], block[:n, n:] = self.A, self.B
        powers = linalg.expm(block * step_s)
        return powers[:n, :n], powers[:n, n:]


def simulate(
    system: System,
    time_s: ArrayLike,
    inputs: ArrayLike,
    start: ArrayLike,
    *,
    relative_tolerance: float = 1e-8,
    absolute_tolerance: float | Vector = 1e-10,
    solver: Literal["LSODA", "Radau", "BDF"] = "LSODA",
) -> Trajectory:
    """States and outputs at given times, each input held from its time to the next.

    A `StateSpace` is stepped exactly. Any other system is given to SciPy's stiff solvers, which start anew where an
    input changes, so that no step reaches over a change.

    Parameters
    ----------
    system
        What is simulated.
    time_s : array-like of shape (n_times,)
        Increasing [s].
    inputs : array-like of shape (n_times, n_inputs)
        Held from each time to the next.
    start : array-like of shape (n_states,)
        States at the first time.
    relative_tolerance, absolute_tolerance
        Local error of the solver; `absolute_tolerance` may have one value a state, in its unit.
    solver : {"LSODA", "Radau", "BDF"}
        SciPy's method.

    Raises
    ------
    InputError
        If times do not increase, a value is missing, a shape is wrong, or the solver gives up.
    """
    time, held, state = _checked(system, time_s, inputs, start)
    if isinstance(system, StateSpace):
        states = _stepped(system, time, held, state)
    else:
        states = np.empty((len(time), len(state)))
        states[0] = state
        changes = np.flatnonzero(np.r_[True, (held[1:-1] != held[:-2]).any(axis=1), True])
        for first, last in pairwise(changes):
            rate = _rate(system, held[first])
            solved = integrate.solve_ivp(
                rate,
                (time[first], time[last]),
                states[first],
                method=solver,
                t_eval=time[first + 1 : last + 1],
                rtol=relative_tolerance,
                atol=absolute_tolerance,
            )
            if not solved.success or not np.isfinite(solved.y).all():
                raise InputError(
                    f"no solution from {time[first]:g} s on: {solved.message}",
                    expected="a system whose states stay finite",
                    where="simulation",
                    advice="check the parameters of the model, or ask for a coarser tolerance",
                )
            states[first + 1 : last + 1] = solved.y.T
    outputs = [system.output(float(t), x, u) for t, x, u in zip(time, states, held, strict=True)]
    return Trajectory(time, states, np.array(outputs, dtype=np.float64).reshape(len(time), len(system.outputs)))


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
        places=tuple(system.places),
    )


def _rate(system: System, held: Vector) -> Callable[[float, Vector], Vector]:
    return lambda t, x: system.derivative(t, x, held)


def _stepped(system: StateSpace, time: Vector, held: Matrix, start: Vector) -> Matrix:
    states = np.empty((len(time), len(start)))
    states[0] = start
    matrices: dict[float, tuple[Matrix, Matrix]] = {}
    for k, step in enumerate(np.diff(time)):
        # steps that differ by the rounding of clock times share their matrices
        length = float(f"{step:.12g}")
        if length not in matrices:
            matrices[length] = system.step_matrices(length)
        decay, load = matrices[length]
        states[k + 1] = decay @ states[k] + load @ held[k]
    return states


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


def _checked(system: System, time_s: ArrayLike, inputs: ArrayLike, start: ArrayLike) -> tuple[Vector, Matrix, Vector]:
    time, held, state = (np.array(values, dtype=np.float64) for values in (time_s, inputs, start))
    if time.ndim != 1 or len(time) < 2 or not np.isfinite(time).all() or (np.diff(time) <= 0).any():
        raise InputError(
            "times that do not increase, or fewer than two",
            expected="at least two times, each after the one before",
            where="simulation",
            advice="sort the times and keep one row a time",
        )
    for name, values, shape in (
        ("inputs", held, (len(time), len(system.inputs))),
        ("start", state, (len(system.states),)),
    ):
        if values.shape != shape or not np.isfinite(values).all():
            raise InputError(
                f"{name} of shape {values.shape}" + ("" if np.isfinite(values).all() else " with missing values"),
                expected=f"numbers of shape {shape}",
                where="simulation",
                advice="give one row a time and one column an input, and one number a state at the start",
            )
    return time, held, state
