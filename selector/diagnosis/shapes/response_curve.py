"""What an effect does to a response curve taken step by step: amplitude over frequency, no course in time."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from selector.diagnosis.comparison import Comparison
from selector.diagnosis.shapes.signals import filled

Vector = NDArray[np.float64]
Matrix = NDArray[np.float64]


def slope(comparison: Comparison, response: str, swept_hz: Vector) -> Vector:
    """f·dA/df of the simulated curve, run by run [unit of the response]: what a shift of all resonances adds."""
    amplitude = filled(comparison, comparison.simulated[response])
    result = np.zeros(len(amplitude))
    for _, rows in comparison.rows_of_runs():
        f, a = swept_hz[rows], amplitude[rows]
        levels, which = np.unique(f, return_inverse=True)
        if len(levels) < 3:
            continue
        mean = np.bincount(which, a) / np.bincount(which)
        result[rows] = (levels * np.gradient(mean, levels))[which]
    return result


def resonance(swept_hz: Vector, frequency_hz: float, damping: float) -> Matrix:
    """Real and imaginary part of 1/(1 − r² + 2iζr), r = f/f₀, shape (n_rows, 2)."""
    r = swept_hz / frequency_hz
    h = 1.0 / (1.0 - r * r + 2j * damping * r)
    return np.column_stack([h.real, h.imag])
