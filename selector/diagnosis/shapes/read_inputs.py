"""What a simulation makes of the readings it was computed from, and what it would make of others."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from selector.diagnosis.comparison import Comparison
from selector.diagnosis.shapes.leftover import least_squares
from selector.diagnosis.shapes.signals import course, excited, filled, rise

Vector = NDArray[np.float64]
_ROLES = ("temperature", "ambient")
_EXACT = 0.02
"""Misfit over the spread of the simulated course, below which it is a sum of the readings."""
_NOTICED = 0.05
"""Of what the reading does that does most: a weight that makes less may be none."""
_MOST = 40
"""So many readings are not told apart by a few runs."""


def weights_of_readings(comparison: Comparison, response: str) -> Mapping[str, float]:
    """By how much the simulated response follows each temperature, at once [unit/K]; empty if it is no such sum.

    The rise of the response since the start of every run is compared with the rises of the temperatures.
    """
    names = [name for name in comparison.with_role(*_ROLES) if name != response and name in comparison.recorded]
    rises = {name: rise(comparison, course(comparison, name)) for name in names}
    rises = {name: values for name, values in rises.items() if excited(values)}
    simulated = rise(comparison, filled(comparison, comparison.simulated[response]))
    if not 2 <= len(rises) <= _MOST or not excited(simulated):
        return {}
    columns = np.column_stack([*rises.values(), *np.eye(len(comparison.runs))[:, comparison.run_index]])
    weights = least_squares(columns[:, np.any(columns, axis=0)], simulated)
    left = simulated - columns[:, np.any(columns, axis=0)] @ weights
    if float(np.std(left)) > _EXACT * float(np.std(simulated)):
        return {}
    return {name: float(weight) for name, weight in zip(rises, weights, strict=False)}


def exchanged(comparison: Comparison, weights: Mapping[str, float], one: str, other: str) -> Vector:
    """What the response would have more, had these two readings not changed places [its unit], from every start."""
    apart = rise(comparison, course(comparison, other)) - rise(comparison, course(comparison, one))
    return np.asarray((weights[one] - weights[other]) * apart)


def read_by(comparison: Comparison, response: str) -> tuple[str, ...]:
    """The temperatures that a simulated response is computed from, those that move it most first; none if unknown."""
    moves = {
        name: abs(weight) * float(np.std(course(comparison, name)))
        for name, weight in weights_of_readings(comparison, response).items()
    }
    told = [name for name, size in moves.items() if size > _NOTICED * max(moves.values())]
    return tuple(sorted(told, key=lambda name: -moves[name]))
