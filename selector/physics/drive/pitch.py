"""How far the travel is from lead × turns at a position of the screw."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

from selector.physics.drive.axis import Axis
from selector.physics.drive.mechanics import RigidMechanics

Vector = NDArray[np.float64]


def pitch_error_m(axis: Axis, screw: ArrayLike) -> tuple[Vector, Vector]:
    """Pitch error [m] at positions of the screw (of a rigid axis: of its mass), and its slope per unit of position."""
    pitch, travel = axis.transmission, axis.mechanics.travel_per_motion
    rate = 2.0 * math.pi / axis.ripple_period if isinstance(axis.mechanics, RigidMechanics) else 1.0
    nominal = travel * np.asarray(screw, dtype=np.float64)
    angle = rate * np.asarray(screw, dtype=np.float64) + pitch.pitch_phase_rad
    error = pitch.pitch_amplitude_m * np.sin(angle) + pitch.pitch_slope * nominal
    slope = pitch.pitch_amplitude_m * rate * np.cos(angle) + pitch.pitch_slope * travel
    if len(pitch.pitch_position_m) > 1:
        places, errors = np.array(pitch.pitch_position_m), np.array(pitch.pitch_error_m)
        rise = np.concatenate([[0.0], np.diff(errors) / np.diff(places), [0.0]])
        slope = slope + travel * rise[np.searchsorted(places, nominal, side="right")]
        error = error + np.interp(nominal, places, errors)
    elif len(pitch.pitch_position_m) == 1:
        error = error + pitch.pitch_error_m[0]
    return error, slope
