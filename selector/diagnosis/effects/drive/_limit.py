"""What a closed loop does when its force has a limit: the force that lacks, and the way that the axis falls behind.

Where the simulation tells its control and the lag τ behind it (`simulated_axis`), the limit is one of the force that
the control asks for, F + τF', and the integral part follows what the limit lets through, as usual controls have it
(K. J. Åström, L. Rundqwist 1989, Integrator windup and how to avoid it, American Control Conference). Where it tells
no more than the poles of its loop, A(s) = s³ + α₂s² + α₁s + α₀, and force and mass in units of each other, the way y
behind obeys y'' = clip(F − α₂y' − α₁y − α₀∫y) − F, F being what the simulation asks for.
"""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from selector.diagnosis.comparison import Comparison
from selector.diagnosis.shapes.force_response import ClosedLoop
from selector.diagnosis.shapes.signals import rate
from selector.diagnosis.shapes.simulated_axis import MOST_SUBSTEPS, SimulatedAxis, pieces

Vector = NDArray[np.float64]

_SUBSTEPS_PER_POLE = 0.2


def held_back(
    comparison: Comparison, loop: ClosedLoop, force: Vector, limit: float, *, winds_up: bool
) -> tuple[Vector, Vector]:
    """Force that lacks [unit of the force] and way behind [the same · s²], shape (n_rows,), from rest in every run.

    With `winds_up` the integral part of the control runs on while the force is at its limit, else it waits.
    """
    # what is over long before the next sample may as well take a part of that time
    quickest = MOST_SUBSTEPS * _SUBSTEPS_PER_POLE / comparison.period_s
    poles = np.roots(loop.polynomial)
    poles = poles * np.minimum(1.0, quickest / np.maximum(np.abs(poles), 1e-300))
    # a loop without an integral part has no α₀
    alpha = np.array([*np.real(np.poly(poles))[1:], *[0.0] * (3 - loop.order)])
    fastest = float(np.max(np.abs(poles)))
    substeps = int(np.clip(np.ceil(fastest * comparison.period_s / _SUBSTEPS_PER_POLE), 1, MOST_SUBSTEPS))
    lacking, behind = np.zeros(len(force)), np.zeros(len(force))
    for _, rows in comparison.rows_of_runs():
        state = np.zeros(3)
        for part in pieces(rows):
            _stepped(
                force[part], comparison.time_s[part], alpha, limit, winds_up, substeps, state, lacking[part],
                behind[part],
            )  # fmt: skip
    return lacking, behind


def asked_for(comparison: Comparison, axis: SimulatedAxis, force: Vector) -> Vector:
    """What the control asked for, so that the force came, F + τF' [unit of the force]."""
    return force + axis.lag_s * rate(comparison, force)


def held_back_axis(
    comparison: Comparison, axis: SimulatedAxis, asked: Vector, limit: float, *, winds_up: bool
) -> tuple[Vector, Vector]:
    """As `held_back`, with a limit on what the control asks for (`asked`), its lag, and the axis' dry friction."""
    c2, c1, c0 = axis.control
    # position gain and reset: c₁ = c₂·(p + r), c₀ = c₂·p·r; the position loop is the slower one
    half = 0.5 * c1 / c2
    position_gain = half - float(np.sqrt(max(half**2 - c0 / c2, 0.0)))
    reset = c1 / c2 - position_gain
    control = np.array([c2, position_gain, reset, axis.lag_s, axis.viscous_per_s, axis.dry_m_per_s2])
    lacking, behind = np.zeros(len(asked)), np.zeros(len(asked))
    for _, rows in comparison.rows_of_runs():
        state = np.zeros(5)
        for part in pieces(rows):
            _held(
                asked[part], comparison.time_s[part], control, axis.stiffens_per_m[part], axis.forgets_per_s[part],
                limit, winds_up, axis.substeps(comparison.period_s), state, lacking[part], behind[part],
            )  # fmt: skip
    return lacking, behind


@njit(cache=True, nogil=True)
def _held(  # type: ignore[no-untyped-def]
    asked, time_s, control, stiffens, forgets, limit, winds_up, substeps, state, lacking, behind
):
    gain, position_gain, reset, lag, viscous, dry = control
    way, speed, integral, given, bent = state
    for k in range(1, len(asked)):
        step = (time_s[k] - time_s[k - 1]) / substeps
        quick = step / (lag + step)
        for j in range(substeps):
            share = (j + 1.0) / substeps
            simulated = asked[k - 1] + (asked[k] - asked[k - 1]) * share
            wanted = simulated - gain * (speed + position_gain * way) - integral
            let = min(max(wanted, -limit), limit)
            integral += reset * step * gain * (speed + position_gain * way)
            if not winds_up:
                integral -= reset * step * (let - wanted)
            # what is given beyond the simulation
            given += quick * (let - simulated - given)
            turned = bent + step * (stiffens[k] * speed - forgets[k] * bent)
            if forgets[k] * step > 0.5:
                turned = (bent + step * stiffens[k] * speed) / (1.0 + step * forgets[k])
            spring = dry * stiffens[k] * step**2
            if spring > 0.25:
                # stiffer than the steps can follow: taken at the end of the step, where it holds
                soft = 1.0 / (1.0 + step * forgets[k])
                pushed = speed + step * (given - viscous * speed - dry * soft * bent)
                speed = pushed / (1.0 + soft * spring)
                bent = soft * (bent + step * stiffens[k] * speed)
            else:
                bent = turned
                speed += step * (given - viscous * speed - dry * bent)
            way += step * speed
        lacking[k] = given
        behind[k] = way
    state[:] = way, speed, integral, given, bent


@njit(cache=True, nogil=True)
def _stepped(force, time_s, alpha, limit, winds_up, substeps, state, lacking, behind):  # type: ignore[no-untyped-def]
    way, speed, integral = state
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
    state[:] = way, speed, integral
