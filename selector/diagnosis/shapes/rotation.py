"""How far a shaft has turned, and the forces that turn with it."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

from selector.diagnosis.comparison import Comparison
from selector.diagnosis.shapes.even_clock import even_runs
from selector.diagnosis.shapes.signals import course, excited

Vector = NDArray[np.float64]
Matrix = NDArray[np.float64]


def is_turning(comparison: Comparison, name: str) -> bool:
    """Whether the shaft turns at all, at a steady speed or not."""
    speed = course(comparison, name)
    return excited(speed) or float(np.abs(speed).max(initial=0.0)) > 0.0


def turns_of(comparison: Comparison, rpm: Vector) -> Vector:
    """∫ n/60 dt from the start of every run [turns]."""
    turns = np.zeros(len(rpm))
    for run in even_runs(comparison):
        per_sample = run.on(rpm) / 60.0 * comparison.period_s
        summed = np.asarray(lfilter([0.5, 0.5], [1.0, -1.0], per_sample))
        turns[run.rows] = run.back(summed - summed[0])
    return turns + 1e-12 * np.arange(len(turns))


def rotating_forces(comparison: Comparison) -> Matrix:
    """n²·cos φ and n²·sin φ of every turning spindle, at most 1, shape (n_rows, 2·spindles); φ = 0 at every start.

    What an imbalance that the simulation knows pulls with is a sum of the two, another one in every run.
    """
    columns = []
    for name in comparison.with_role("spindle_speed"):
        if is_turning(comparison, name):
            rpm = np.abs(course(comparison, name))
            angle = 2.0 * np.pi * turns_of(comparison, rpm)
            square = (rpm / float(rpm.max())) ** 2
            columns += [square * np.cos(angle), square * np.sin(angle)]
    return np.column_stack(columns) if columns else np.empty((len(comparison.time_s), 0))
