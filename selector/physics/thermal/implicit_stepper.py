"""How a large body warms: an implicit method of second order, one factorisation for all steps of equal length.

The L-stable, stiffly accurate diagonally implicit Runge–Kutta method of two stages (Alexander 1977, γ = 1 − 1/√2):
steps much longer than the quickest time constants do no harm. With M = K + Σ h_f·A_f and g = all heat,

    (C + γ·h·M)·Y1 = C·r0 + γ·h·g(Y1)
    (C + γ·h·M)·Y2 = C·r0 + (1 − γ)/γ·C·(Y1 − r0) + γ·h·g(Y2),

and Y2 is the state after the step. Where heat depends on the temperatures of a few lubricants, their equations are
all that is non-linear; they are solved apart. Summed with `uniform`, the stages are the energy balance of the step:
it closes to what the solver leaves.
"""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import linalg, sparse

from selector.physics.thermal.heat_system import Matrix
from selector.physics.thermal.stepping import Advance, Body, Interval

Vector = NDArray[np.float64]
Array = NDArray[np.float64]
Solve = Callable[[Vector], Vector]

GAMMA = 1.0 - np.sqrt(0.5)

_CACHE_BYTES = 1e9
"""Memory for factorisations. One of 20 000 finite-element nodes takes some 200 MB; at least two are kept."""
_MOST = 64


class ImplicitStepper:
    """Equal steps of at most `step_s` [s] in every interval."""

    def __init__(self, body: Body, step_s: float) -> None:
        self._body = body
        self._step_s = step_s
        self._solvers: OrderedDict[tuple[float, bytes], tuple[Solve, Array]] = OrderedDict()
        self._room = 2

    def advance(self, rise: Vector, held: Interval, read_s: Vector, keep_s: Vector) -> Advance:
        """See `Stepper.advance`; between steps the parabola through start, first stage and end is read."""
        body, capacity = self._body, self._body.system.capacity
        steps = max(1, int(np.ceil(held.duration_s / self._step_s * (1 - 1e-12))))
        # steps that differ by rounding share a factorisation
        step = float(f"{held.duration_s / steps:.13g}")
        ends = step * np.arange(1, steps + 1)
        read_until, keep_until = np.searchsorted(read_s, ends, "right"), np.searchsorted(keep_s, ends, "right")
        read_until[-1], keep_until[-1] = len(read_s), len(keep_s)
        solve, per_watt = self._solver(held, step)
        lubricants, soft = body.lubricants, body.soft
        lubricant_per_watt = lubricants.rows @ per_watt
        nominal = held.lubricant_w[soft]
        depends = bool(np.any(nominal))
        steady = body.steady_heat_w(held)
        load = GAMMA * step * (body.film_loads @ (held.film_w_per_m2_k * held.fluid_rise) + body.heat_loads @ steady)
        film, heat = np.zeros(len(body.film_rows)), step * steps * steady
        read, kept = [np.zeros((0, len(body.rows)))], [np.zeros((0, len(rise)))]
        first_read = first_keep = 0
        stored = capacity @ rise

        def stage(right: Vector, weight: float) -> Vector:
            state = solve(right)
            if depends:
                given = lubricants.settled_heat_w(nominal, lubricants.rows @ state, lubricant_per_watt)
                heat[soft] += weight * step * given
                state = state + per_watt @ given
            return state

        for k in range(steps):
            inner = stage(stored + load, 1.0 - GAMMA)
            gained = capacity @ inner - stored
            ahead = stage(stored + (1.0 - GAMMA) / GAMMA * gained + load, GAMMA)
            if read_until[k] > first_read:
                at = (read_s[first_read : read_until[k]] - step * k) / step
                read.append(_parabola(at) @ (np.array([rise, inner, ahead]) @ body.rows.T))
                first_read = read_until[k]
            if keep_until[k] > first_keep:
                at = (keep_s[first_keep : keep_until[k]] - step * k) / step
                kept.append(_parabola(at) @ np.array([rise, inner, ahead]))
                first_keep = keep_until[k]
            film += body.film_rows @ (step * ((1.0 - GAMMA) * inner + GAMMA * ahead))
            rise, stored = ahead, capacity @ ahead
        return Advance(rise, np.concatenate(read), np.concatenate(kept), film, heat)

    def _solver(self, held: Interval, step: float) -> tuple[Solve, Array]:
        """Solver of a stage, and the rise that 1 W of every lubricant adds to the stage's state."""
        key = (step, held.film_w_per_m2_k.tobytes())
        if key in self._solvers:
            self._solvers.move_to_end(key)
            return self._solvers[key]
        # room is made before the next one is built
        while len(self._solvers) >= self._room:
            self._solvers.popitem(last=False)
        solver = factorised(self._body.system.capacity + GAMMA * step * self._body.conductance(held))
        self._room = int(np.clip(_CACHE_BYTES // solver.n_bytes, 2, _MOST))
        loads = GAMMA * step * self._body.heat_loads[:, self._body.soft]
        per_watt = np.array([solver.solve(column) for column in loads.T]).reshape(loads.T.shape).T
        self._solvers[key] = solver.solve, per_watt
        return self._solvers[key]


@dataclass(frozen=True)
class Solver:
    """A factorised system of equations.

    Attributes
    ----------
    solve : callable
        Right-hand side → solution.
    n_bytes : int
        Memory that the factors take.
    """

    solve: Solve
    n_bytes: int


def factorised(matrix: Matrix) -> Solver:
    """Solver of a symmetric, positive definite system of equations, dense or sparse."""
    if sparse.issparse(matrix):
        from scipy.sparse.linalg import splu

        options = {"SymmetricMode": True}
        lu = splu(sparse.csc_array(matrix), permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options=options)
        return Solver(lu.solve, 12 * int(lu.nnz))
    factor = linalg.cho_factor(matrix)
    return Solver(lambda load: linalg.cho_solve(factor, load, check_finite=False), matrix.nbytes)


def _parabola(at: Vector) -> Array:
    """Weights of the values at 0, γ and 1 at places between, shape (n_at, 3)."""
    return np.column_stack(
        [
            (at - GAMMA) * (at - 1.0) / GAMMA,
            at * (at - 1.0) / (GAMMA * (GAMMA - 1.0)),
            at * (at - GAMMA) / (1.0 - GAMMA),
        ]
    )
