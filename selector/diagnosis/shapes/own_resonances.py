"""Resonances that the simulation has, moved to where the recording has them: stiffness, mass or damping a little off.

A pair of poles p is exchanged for another one p' by a filter, A(z; p)/A(z; p'), behind the simulated course. What else
the simulation has in it, its zeros and what drives it, stays, and need not be known.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
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

_SAME = 0.003  #: Of a frequency, by which that of one resonance differs in two responses.
#: Logarithms by which frequency and damping may be off, beyond which it is physics; steps to begin with.
_MOST, _FIRST = (0.03, 0.5), (0.01, 0.1)
_TRIED, _NEAR = 120, 1e-4  #: Shapes tried for every resonance; logarithms that each is told to.
_MATTERS = 0.95  #: Of the mean square of fitted rows: less has to be left, and no more of the others.


@dataclass(frozen=True)
class Moved:
    """A simulation with resonances of its own moved."""

    comparison: Comparison  #: With what every move changes among its tangents
    resonances: Mapping[str, Quantity]  #: ``resonance of 56.4 Hz moved by`` → by how much [%]
    share: float  #: Of the mean square that offset and gain leave of the fitted rows, what the moves explain


def with_moved_resonances(comparison: Comparison) -> Moved | None:
    """The comparison with its resonances free to move, those of all responses alike; None where that gains nothing.

    Frequencies may move by 3 %, damping by a half. None as well if the simulation can be run again, where its own
    parameters do this.
    """
    own: dict[str, list[int]] = {}
    shared: list[tuple[float, float]] = []
    for name in comparison.responses if not comparison.tangents else ():
        own[name] = []
        for one in resonances_of(comparison, name) if _is_vibration(comparison, name) else ():
            known = [k for k, other in enumerate(shared) if abs(np.log(one[0] / other[0])) < _SAME]
            shared += [] if known else [one]
            own[name].append(known[0] if known else len(shared) - 1)
    if not shared:
        return None
    by = _best(comparison, own, shared)
    tangents: dict[str, dict[str, Vector]] = {}
    quantities, share = {}, 0.0
    for name, of in own.items():
        simulated = comparison.simulated_course(name)
        fitted, unseen = _left(comparison, name, simulated)
        now_fitted, now_unseen = _left(comparison, name, _passed(comparison, simulated, of, shared, by))
        if now_fitted >= _MATTERS * fitted or now_unseen > unseen:
            continue
        share, tangents[name] = max(share, 1.0 - now_fitted / fitted), {}
        for k in of:
            words = f"resonance of {shared[k][0]:.4g} Hz moved by"
            tangents[name][words] = read_only(_passed(comparison, simulated, (k,), shared, by) - simulated)
            quantities[words] = Quantity(100.0 * float(np.expm1(by[k, 0])), "%")
    return Moved(replace(comparison, tangents=tangents), quantities, share) if tangents else None


def _is_vibration(comparison: Comparison, response: str) -> bool:
    why_not = no_vibration(comparison, response) or of_a_drive(comparison, response)
    return why_not is None and swept_hz(comparison, response) is None


def _best(comparison: Comparison, own: Mapping[str, Sequence[int]], shared: Sequence[tuple[float, float]]) -> Matrix:
    """Logarithms by which frequency and damping of every resonance are off, (n, 2), by least squares."""
    given = {name: comparison.simulated_course(name) for name in own}
    before = {name: max(_left(comparison, name, course)[0], 1e-300) for name, course in given.items()}

    def misfit(values: Vector) -> float:
        by = values.reshape(-1, 2)
        if np.any(np.abs(by) > _MOST):
            return np.inf
        passed = {name: _passed(comparison, given[name], of, shared, by) for name, of in own.items()}
        return sum(_left(comparison, name, course)[0] / before[name] for name, course in passed.items())

    start = np.zeros(2 * len(shared))
    found = minimize(
        misfit,
        start,
        method="Nelder-Mead",
        options={
            "initial_simplex": np.vstack([start, np.diag(np.tile(_FIRST, len(shared)))]),
            "maxfev": _TRIED * len(shared),
            "xatol": _NEAR,
            "fatol": _NEAR,
        },
    )
    return np.asarray(found.x.reshape(-1, 2))


def _passed(
    comparison: Comparison, course: Vector, of: Sequence[int], shared: Sequence[tuple[float, float]], by: Matrix
) -> Vector:
    """The course with these resonances moved; the answer to a steady force stays."""
    for k in of:
        (frequency_hz, damping), (times_f, times_z) = shared[k], np.exp(by[k])
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
