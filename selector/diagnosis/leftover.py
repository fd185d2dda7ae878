"""What offset, gain and delay of a simulation leave of the difference, fitted to the rows that may be fitted to."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from selector.diagnosis.comparison import Comparison
from selector.diagnosis.signals import filled, rate

Vector = NDArray[np.float64]
Matrix = NDArray[np.float64]


def leftover(comparison: Comparison, response: str) -> Vector:
    """Recorded − simulated [unit of the response] less offset, gain and delay; 0 where either is missing."""
    difference = comparison.difference(response)
    simulated = filled(comparison, comparison.simulated[response])
    columns = np.column_stack([np.ones(len(simulated)), simulated, rate(comparison, simulated)])
    seen = np.isfinite(difference)
    left = np.where(seen, difference, 0.0)
    fitted = seen & ~comparison.held_out
    if not fitted.any():
        return left
    return np.where(seen, left - columns @ least_squares(columns[fitted], left[fitted]), 0.0)


def projected_off(values: Vector, others: Matrix, fitted: NDArray[np.bool_]) -> Vector:
    """The course less what the other courses explain of it in the fitted rows."""
    return np.asarray(values - others @ least_squares(others[fitted], values[fitted]))


def least_squares(columns: Matrix, values: Vector) -> Vector:
    """Coefficients by least squares, columns brought to one size first."""
    size = np.sqrt(np.mean(columns**2, axis=0))
    size = np.where(size > 0.0, size, 1.0)
    return np.asarray(np.linalg.lstsq(columns / size, values, rcond=1e-12)[0] / size)
