"""Duty cycles as a process plan is written."""

import numpy as np

from selector.physics.thermal.modes.modes import Cyclogram


def of_segments(*segments: tuple[float, float]) -> Cyclogram:
    """From (minutes, r/min) pairs."""
    ends = np.cumsum([minutes * 60.0 for minutes, _ in segments])
    return Cyclogram(
        np.r_[0.0, ends[:-1]], np.array([speed for _, speed in segments], dtype=np.float64), float(ends[-1])
    )
