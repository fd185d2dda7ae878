"""Which step of the calculation does an axis need."""

from __future__ import annotations

import numpy as np

from selector.physics.drive.axis import Axis
from selector.physics.drive.axis_system import largest_stable_step_s, mechanical_poles

PER_MODE = 0.2
"""Step × fastest rate of the axis. A method of order 4 then changes that vibration by less than 2e-5 of itself a
period in size (2π·0.2⁵/144) and by 1e-4 in phase (2π·0.2⁴/120)."""


def fastest_rate_per_s(axis: Axis) -> float:
    """Largest |pole| of the axis, with its control if that is continuous [rad/s]."""
    return float(np.abs(mechanical_poles(axis)).max())


def advised_step_s(axis: Axis, period_s: float) -> float:
    """Step that resolves the fastest vibration of an axis, at most the period of the samples [s]."""
    rate = fastest_rate_per_s(axis)
    return min(period_s, PER_MODE / rate) if rate > 0 else period_s


def circle_step_s(axis: Axis, period_s: float) -> float:
    """Step for circles: half of what is stable, at most the period of the samples [s].

    Nothing on a circle excites the fastest vibration, which this step damps.
    """
    return min(period_s, largest_stable_step_s(axis) / 2.0)
