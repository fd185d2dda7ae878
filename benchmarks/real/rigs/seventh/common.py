"""What several rigs of the seventh set share: a resonance behind an input, and how quickly an angle changes."""

from __future__ import annotations

import numpy as np
from scipy.signal import cont2discrete, lfilter, savgol_filter

from benchmarks.real.case import Vector


def resonance(course: Vector, hz: float, damping: float, step_s: float) -> tuple[Vector, Vector]:
    """Deflection by a course as force, of one mode from rest, and its rate [1/s]."""
    turn = 2.0 * np.pi * hz
    below = np.array([1.0, 2.0 * damping * turn, turn * turn])

    def passed(above: Vector) -> Vector:
        over, under, _ = cont2discrete((above, below), step_s, "bilinear")
        return np.asarray(lfilter(over.ravel(), under, course))

    return passed(np.array([turn * turn])), passed(np.array([1.0, 0.0]))


def rate(course: Vector, step_s: float, rows: int, order: int = 1) -> Vector:
    """Derivative of a course by parabolas or cubics over so many rows."""
    return np.asarray(savgol_filter(course, rows, 3, deriv=order, delta=step_s))
