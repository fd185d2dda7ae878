"""What a closed loop does when its force has a limit: the force that lacks, and the way that the axis falls behind.

With A(s) = s³ + α₂s² + α₁s + α₀ of the loop, and force and mass in units of each other, the way y behind obeys
y'' = clip(F − α₂y' − α₁y − α₀∫y) − F, F being what the simulation asks for.
"""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from selector.diagnosis.comparison import Comparison
from selector.diagnosis.shapes.force_response import ClosedLoop

Vector = NDArray[np.float64]

_SUBSTEPS_PER_POLE = 0.2


def held_back(
    comparison: Comparison, loop: ClosedLoop, force: Vector, limit: float, *, winds_up: bool
) -> tuple[Vector, Vector]:
    """Force that lacks [unit of the force] and way behind [the same · s²], shape (n_rows,), from rest in every run.

    With `winds_up` the integral part of the control runs on while the force is at its limit, else it waits.
    """
    # a loop without an integral part has no α₀
    alpha = np.array([*loop.polynomial[1:], *[0.0] * (3 - loop.order)])
    fastest = float(np.max(np.abs(np.roots(loop.polynomial))))
    substeps = max(1, int(np.ceil(fastest * comparison.period_s / _SUBSTEPS_PER_POLE)))
    lacking, behind = np.zeros(len(force)), np.zeros(len(force))
    for _, rows in comparison.rows_of_runs():
        _stepped(force[rows], comparison.time_s[rows], alpha, limit, winds_up, substeps, lacking[rows], behind[rows])
    return lacking, behind


@njit(cache=True, nogil=True)
def _stepped(force, time_s, alpha, limit, winds_up, substeps, lacking, behind):  # type: ignore[no-untyped-def]
    way = speed = integral = 0.0
    for k in range(1, len(force)):
        step = (time_s[k] - time_s[k - 1]) / substeps
        for j in range(substeps):
            asked = force[k - 1] + (force[k] - force[k - 1]) * (j + 1.0) / substeps
            wanted = asked - alpha[0] * speed - alpha[1] * way - alpha[2] * integral
            given = min(max(wanted, -limit), limit)
            if winds_up or given == wanted:
                integral += way * step
            speed += (given - asked) * step
            way += speed * step
            lacking[k] = given - asked
        behind[k] = way
