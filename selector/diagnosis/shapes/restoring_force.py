"""What a restoring force that the simulation lacks does to a response: the simulated motion with that force fed back.

The force φ(y) enters like the force that the response was identified with: y = y_sim − G·[k·(φ(y) − α·y − β·ẏ)]. Of
a simulation whose stiffness and damping were fitted to the real, non-linear machine, α and β are what φ looks like
to a linear model (equivalent linearisation: Worden & Tomlinson 2001, ch. 2); else they are 0.
"""

from __future__ import annotations

from typing import Literal

import numpy as np
from numba import njit
from numpy.typing import NDArray

from selector.diagnosis.comparison import Comparison
from selector.diagnosis.shapes.even_clock import even_runs
from selector.diagnosis.shapes.leftover import least_squares
from selector.diagnosis.shapes.linear_response import LinearResponse
from selector.diagnosis.shapes.signals import rate

Vector = NDArray[np.float64]
Law = Literal["cubic", "stop", "dahl"]

_NUMBER: dict[Law, int] = {"cubic": 0, "stop": 1, "dahl": 2}


def restoring(comparison: Comparison, values: Vector, law: Law, width: float = 1.0) -> Vector:
    """φ of a course, run by run from φ = 0.

    ``cubic``: y³. ``stop``: an elastic element that slips at y = `width` from its last reversal (Prandtl), −1 … 1.
    ``dahl``: dφ/dy = (1 − φ·sgn ẏ)/`width`, the Bouc–Wen law with n = 1, β = γ, −1 … 1.
    """
    result = np.zeros(len(values))
    for _, rows in comparison.rows_of_runs():
        result[rows] = _force(np.ascontiguousarray(values[rows]), _NUMBER[law], width)
    return result


def linear_part(comparison: Comparison, path: LinearResponse, values: Vector, force: Vector) -> tuple[float, float]:
    """α [force/unit] and β [force·s/unit]: what φ looks like, behind the path, to a model without it."""
    fitted = ~comparison.held_out
    columns = np.column_stack([path.passed(comparison, v) for v in (values, rate(comparison, values))])
    alpha, beta = least_squares(columns[fitted], path.passed(comparison, force)[fitted])
    return float(alpha), float(beta)


def fed_back(
    comparison: Comparison,
    path: LinearResponse,
    simulated: Vector,
    law: Law,
    k: float,
    *,
    width: float = 1.0,
    linear: tuple[float, float] = (0.0, 0.0),
) -> Vector | None:
    """What the force k·(φ(y) − α·y − β·ẏ) moves the response by [its unit], fed back; None if that diverges."""
    result = np.zeros(len(simulated))
    alpha, beta = linear
    for run in even_runs(comparison):
        part = np.ascontiguousarray(run.on(simulated))
        most = 100.0 * float(np.abs(part).max(initial=0.0))
        moved = _loop(
            part, path.numerator, path.denominator, _NUMBER[law], k, width, alpha, beta / comparison.period_s, most
        )
        if not np.all(np.isfinite(moved)):
            return None
        result[run.rows] = run.back(moved)
    return result


@njit(cache=True, nogil=True)
def _next(number, y, before, z, width):  # type: ignore[no-untyped-def]
    if number == 0:
        return y * y * y
    step = (y - before) / width
    if number == 1:
        return min(max(z + step, -1.0), 1.0)
    sign = 1.0 if step > 0.0 else -1.0
    return sign + (z - sign) * np.exp(-abs(step))


@njit(cache=True, nogil=True)
def _force(y, number, width):  # type: ignore[no-untyped-def]
    z = np.zeros(len(y))
    if number == 0:
        return y**3
    for i in range(1, len(y)):
        z[i] = _next(number, y[i], y[i - 1], z[i - 1], width)
    return z


@njit(cache=True, nogil=True)
def _loop(simulated, b, a, number, k, width, alpha, beta, most):  # type: ignore[no-untyped-def]
    n = len(simulated)
    delta = np.zeros(n)
    force = np.zeros(n)
    z = 0.0
    y_before = simulated[0]
    for i in range(n):
        known = 0.0
        for j in range(1, len(a)):
            if i - j >= 0:
                known -= a[j] * delta[i - j]
        for j in range(1, len(b)):
            if i - j >= 0:
                known -= b[j] * force[i - j]
        guess = known - (b[0] * force[i - 1] if i > 0 else 0.0)
        for _ in range(3 if b[0] != 0.0 else 1):
            y = simulated[i] + guess
            if number == 0:
                z_new = y * y * y
            elif i == 0:
                z_new = 0.0
            else:
                z_new = _next(number, y, y_before, z, width)
            force[i] = k * (z_new - alpha * y - beta * (y - y_before))
            guess = known - b[0] * force[i]
        delta[i] = guess
        z = z_new
        y_before = simulated[i] + guess
        if not abs(guess) < most:
            delta[i] = np.inf
            return delta
    return delta
