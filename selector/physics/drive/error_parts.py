"""What does the tracking error go with: the speed, the acceleration, the direction of travel, or nothing of these."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from selector.physics.drive.motion import Motion

Vector = NDArray[np.float64]

PARTS = ("speed", "acceleration", "direction", "constant", "rest")
_STANDSTILL = 1e-6
"""Share of the largest speed below which an axis is said to stand: its direction is that of its last motion."""


@dataclass(frozen=True)
class ErrorParts:
    """A tracking error split by least squares into what goes with the commanded motion, and what is left.

    The parts describe, they do not prove: a lag through a loop of gain Kp goes with the speed, inertia and springs
    go with the acceleration, friction and lost motion with the direction, weight and scales with nothing.

    Attributes
    ----------
    lag_s : float
        Error per commanded speed [s].
    per_acceleration_s2 : float
        Error per commanded acceleration [s²].
    reversal_m : float
        Half the difference between the two directions of travel [m].
    constant_m : float
        What is always there [m].
    rms_m : dict of str to float
        Root mean square of each part, ``speed``, ``acceleration``, ``direction``, ``constant``, ``rest`` [m].
    """

    lag_s: float
    per_acceleration_s2: float
    reversal_m: float
    constant_m: float
    rms_m: dict[str, float]

    @property
    def largest(self) -> str:
        """Name of the part with the largest root mean square."""
        return max(self.rms_m, key=lambda name: self.rms_m[name])


def error_parts(motion: Motion) -> ErrorParts:
    """The parts of the tracking error of a motion; one that the command does not tell from the others is zero."""
    error = motion.tracking_error_m
    speed = np.gradient(motion.reference_m, motion.time_s)
    rows = {
        "speed": speed,
        "acceleration": np.gradient(speed, motion.time_s),
        "direction": direction_of_travel(speed),
        "constant": np.ones_like(error),
    }
    if np.unique(rows["direction"][rows["direction"] != 0]).size < 2:
        # one direction of travel is as good as a constant
        del rows["direction"]
    scales = {name: float(np.abs(row).max()) or 1.0 for name, row in rows.items()}
    design = np.column_stack([row / scales[name] for name, row in rows.items()])
    found, *_ = np.linalg.lstsq(design, error, rcond=1e-9)
    weights = {name: float(weight) / scales[name] for name, weight in zip(rows, found, strict=True)}
    parts = {name: weights[name] * row for name, row in rows.items()}
    parts["rest"] = error - design @ found
    return ErrorParts(
        lag_s=weights["speed"],
        per_acceleration_s2=weights["acceleration"],
        reversal_m=weights.get("direction", 0.0),
        constant_m=weights["constant"],
        rms_m={name: float(np.sqrt(np.mean(parts[name] ** 2))) if name in parts else 0.0 for name in PARTS},
    )


def direction_of_travel(speed_m_per_s: Vector) -> Vector:
    """+1 or −1; while the axis stands that of its last motion, before the first motion 0."""
    least = _STANDSTILL * float(np.abs(speed_m_per_s).max())
    sign = np.where(np.abs(speed_m_per_s) > least, np.sign(speed_m_per_s), 0.0)
    last = np.maximum.accumulate(np.where(sign != 0, np.arange(len(sign)), 0))
    return np.asarray(sign[last], dtype=np.float64)
