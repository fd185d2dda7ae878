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
from selector.diagnosis.shapes.linear_response import resonances_of
from selector.diagnosis.shapes.residual import least_squares
from selector.diagnosis.shapes.signals import no_vibration, of_a_drive, on_even_clock, swept_hz
from selector.types import Vector

_SAME = 0.03  #: Of a frequency, by which that of one resonance differs in two responses.
_MOST_MOVED, _MOST_DAMPED = (
    0.25,
    1.6,
)  #: Logarithms by which frequency and damping may be off: beyond it is another one.
_FIRST_STEP = 0.03, 0.3
_TRIED, _NEAR = 120, 1e-4  #: Shapes tried for every resonance; logarithms that each is told to.
_MATTERS = (
    0.95  #: Of the mean square that offset and gain leave: less has to be left of fitted rows, no more of others.
)
_MOST_DAMPING = 0.9


@dataclass(frozen=True)
class Moved:
    """A simulation with resonances of its own moved."""

    comparison: Comparison  #: With what every move changes among its tangents
    resonances: Mapping[str, Quantity]  #: ``resonance of 56.4 Hz at`` → where the recording has it [Hz]
    share: float  #: Of the mean square that offset and gain leave of the fitted rows, what the moves explain


def with_moved_resonances(comparison: Comparison) -> Moved | None:
    """The comparison with its resonances free to move, those of all responses alike; None where that gains nothing.

    Frequencies may move by 3 %, damping by a half. None as well if the simulation can be run again, where its own
    parameters do this.
    """
    own = {name: resonances_of(comparison, name) for name in comparison.responses if _is_vibration(comparison, name)}
    shared = _shared([one for of in own.values() for one in of])
    if not shared or comparison.tangents:
        return None
    by = _best(comparison, own, shared)
    tangents: dict[str, dict[str, Vector]] = {}
    quantities, share = {}, 0.0
    for name, of in own.items():
        simulated = comparison.simulated_course(name)
        fitted, unseen = _left(comparison, name, simulated)
        now_fitted, now_unseen = _left(comparison, name, _passed(comparison, name, of, shared, by))
        if now_fitted >= _MATTERS * fitted or now_unseen > unseen:
            continue
        share, tangents[name] = max(share, 1.0 - now_fitted / fitted), {}
        for one in of:
            number = _number(one, shared)
            words = f"resonance of {shared[number][0]:.4g} Hz at"
            tangents[name][words] = read_only(_passed(comparison, name, (one,), shared, by) - simulated)
            quantities[words] = Quantity(shared[number][0] * float(np.exp(by[2 * number])), "Hz")
    return Moved(replace(comparison, tangents=tangents), quantities, share) if tangents else None


def _is_vibration(comparison: Comparison, response: str) -> bool:
    why_not = no_vibration(comparison, response) or of_a_drive(comparison, response)
    return why_not is None and swept_hz(comparison, response) is None


def _shared(own: Sequence[tuple[float, float]]) -> list[tuple[float, float]]:
    """(frequency [Hz], damping) of the resonances that the responses have, each once."""
    found: list[tuple[float, float]] = []
    for one in sorted(own):
        if not found or abs(np.log(one[0] / found[-1][0])) > _SAME:
            found.append(one)
    return found


def _number(one: tuple[float, float], shared: Sequence[tuple[float, float]]) -> int:
    return int(np.argmin([abs(np.log(one[0] / other[0])) for other in shared]))


def _best(
    comparison: Comparison, own: Mapping[str, Sequence[tuple[float, float]]], shared: Sequence[tuple[float, float]]
) -> Vector:
    """Logarithms by which frequency and damping of every resonance are off, one after the other, by least squares."""
    bounds = np.tile([_MOST_MOVED, _MOST_DAMPED], len(shared))
    given = {name: _left(comparison, name, comparison.simulated_course(name))[0] for name in own}

    def misfit(by: Vector) -> float:
        if np.any(np.abs(by) > bounds):
            return np.inf
        return sum(
            _left(comparison, name, _passed(comparison, name, of, shared, by))[0] / max(given[name], 1e-300)
            for name, of in own.items()
        )

    start = np.zeros(len(bounds))
    found = minimize(
        misfit,
        start,
        method="Nelder-Mead",
        options={
            "initial_simplex": np.vstack([start, np.diag(np.tile(_FIRST_STEP, len(shared)))]),
            "maxfev": _TRIED * len(shared),
            "xatol": _NEAR,
            "fatol": _NEAR,
        },
    )
    return np.asarray(found.x)


def _passed(
    comparison: Comparison,
    response: str,
    own: Sequence[tuple[float, float]],
    shared: Sequence[tuple[float, float]],
    by: Vector,
) -> Vector:
    """The simulated course with these resonances moved; the answer to a steady force stays."""
    course = comparison.simulated_course(response)
    for frequency_hz, damping in own:
        moved, damped = by[2 * _number((frequency_hz, damping), shared) :][:2]
        here = _poles(frequency_hz, damping, comparison.period_s)
        there = _poles(frequency_hz * np.exp(moved), min(damping * np.exp(damped), _MOST_DAMPING), comparison.period_s)
        course = on_even_clock(comparison, partial(lfilter, here * (there.sum() / here.sum()), there), course)
    return course


def _poles(frequency_hz: float, damping: float, period_s: float) -> Vector:
    """1 − 2·Re(p)·z⁻¹ + |p|²·z⁻² of a resonance."""
    pole = np.exp(2.0 * np.pi * frequency_hz * period_s * (-damping + 1j * np.sqrt(1.0 - damping**2)))
    return np.array([1.0, -2.0 * pole.real, abs(pole) ** 2])


def _left(comparison: Comparison, response: str, course: Vector) -> tuple[float, float]:
    """Mean square that offset and gain of a course leave of the fitted rows, and of the others; NaN without any."""
    recorded = comparison.recorded[response]
    seen = np.isfinite(recorded) & np.isfinite(comparison.simulated[response])
    columns = np.column_stack([np.ones(len(course)), course])
    rows = seen & ~comparison.held_out
    left = recorded - columns @ least_squares(columns[rows], recorded[rows])
    held = seen & comparison.held_out
    return float(np.mean(left[rows] ** 2)), float(np.mean(left[held] ** 2)) if held.any() else float("nan")
