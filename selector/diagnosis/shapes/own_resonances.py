"""Resonances that the simulation has, moved to where the recording has them: stiffness, mass or damping a little off.

A pair of poles p is exchanged for another one p' by a filter, A(z; p)/A(z; p'), behind the simulated course. What else
the simulation has in it, its zeros and what drives it, stays, and need not be known.
"""

from collections.abc import Sequence
from dataclasses import replace
from functools import partial

import numpy as np
from scipy.optimize import minimize
from scipy.signal import lfilter

from selector.diagnosis.comparison import Comparison, read_only
from selector.diagnosis.effects.effect import Quantity
from selector.diagnosis.shapes.linear_response import resonances_of, resonator
from selector.diagnosis.shapes.residual import least_squares
from selector.diagnosis.shapes.signals import no_vibration, of_a_drive, on_even_clock, swept_hz
from selector.types import Matrix, Vector

#: Logarithms by which frequency and damping may be off, beyond which it is physics; steps to begin with.
_MOST, _FIRST = (0.03, 0.5), (0.01, 0.1)
_TRIED, _NEAR = 120, 1e-4  #: Shapes tried for every resonance; logarithms that each is told to.
_MATTERS = 0.95  #: Of the mean square of fitted rows: less has to be left, and no more of the others.

Resonances = Sequence[tuple[float, float]]


def with_moved_resonances(comparison: Comparison) -> tuple[Comparison, dict[str, Quantity], float] | None:
    """The comparison with what moved resonances change among its tangents, by how much each moves [%], and the gain.

    That is the share of what offset and gain leave of the fitted rows. Frequencies may move by 3 %, damping by a half.
    None where that gains nothing, and if the simulation can be run again, where its own parameters do this.
    """
    tangents: dict[str, dict[str, Vector]] = {}
    quantities: dict[str, Quantity] = {}
    share = 0.0
    for name in comparison.responses if not comparison.tangents else ():
        why_not = no_vibration(comparison, name) or of_a_drive(comparison, name)
        if why_not or swept_hz(comparison, name) is not None or not (own := resonances_of(comparison, name)):
            continue
        by, simulated = _best(comparison, name, own), comparison.simulated_course(name)
        fitted, unseen = _left(comparison, name, simulated)
        now_fitted, now_unseen = _left(comparison, name, _passed(comparison, simulated, own, by))
        if now_fitted >= _MATTERS * fitted or now_unseen > unseen:
            continue
        share, tangents[name] = max(share, 1.0 - now_fitted / fitted), {}
        for one, off in zip(own, by, strict=True):
            words = f"resonance of {one[0]:.4g} Hz moved by"
            tangents[name][words] = read_only(_passed(comparison, simulated, [one], off[None]) - simulated)
            quantities[words] = Quantity(100.0 * float(np.expm1(off[0])), "%")
    return (replace(comparison, tangents=tangents), quantities, share) if tangents else None


def _best(comparison: Comparison, response: str, own: Resonances) -> Matrix:
    """Logarithms by which frequency and damping of every resonance are off, (n, 2), by least squares."""
    simulated = comparison.simulated_course(response)
    before = max(_left(comparison, response, simulated)[0], 1e-300)

    def misfit(values: Vector) -> float:
        by = values.reshape(-1, 2)
        if np.any(np.abs(by) > _MOST):
            return np.inf
        return _left(comparison, response, _passed(comparison, simulated, own, by))[0] / before

    start = np.zeros(2 * len(own))
    simplex = np.vstack([start, np.diag(np.tile(_FIRST, len(own)))])
    options = {"initial_simplex": simplex, "maxfev": _TRIED * len(own), "xatol": _NEAR, "fatol": _NEAR}
    return np.asarray(minimize(misfit, start, method="Nelder-Mead", options=options).x.reshape(-1, 2))  # type: ignore[call-overload]


def _passed(comparison: Comparison, course: Vector, own: Resonances, by: Matrix) -> Vector:
    """The course with these resonances moved; the answer to a steady force stays."""
    for (frequency_hz, damping), (times_f, times_z) in zip(own, np.exp(by), strict=True):
        here = resonator(frequency_hz, damping, comparison.period_s)[1]
        there = resonator(frequency_hz * times_f, damping * times_z, comparison.period_s)[1]
        course = on_even_clock(comparison, partial(lfilter, here * (there.sum() / here.sum()), there), course)
    return course


def _left(comparison: Comparison, response: str, course: Vector) -> tuple[float, float]:
    """Mean square that offset and gain of a course leave of the fitted rows, and of the others; NaN without any."""
    recorded = comparison.recorded[response]
    seen = np.isfinite(recorded) & np.isfinite(comparison.simulated[response])
    columns = np.column_stack([np.ones(len(course)), course])
    rows, held = seen & ~comparison.held_out, seen & comparison.held_out
    left = recorded - columns @ least_squares(columns[rows], recorded[rows])
    return float(np.mean(left[rows] ** 2)), float(np.mean(left[held] ** 2)) if held.any() else float("nan")
