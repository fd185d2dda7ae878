"""How far the travel is from lead × turns at a position of the screw."""

from __future__ import annotations

import math

import numpy as np

from selector.physics.drive.axis import Axis
from selector.physics.drive.mechanics import RigidMechanics


def pitch_error_m(axis: Axis, screw: float) -> tuple[float, float]:
    """Pitch error [m] at a position of the screw (of a rigid axis: of its mass), and its slope per unit of position."""
    pitch, travel = axis.transmission, axis.mechanics.travel_per_motion
    rate = 2.0 * math.pi / axis.ripple_period if isinstance(axis.mechanics, RigidMechanics) else 1.0
    angle = rate * screw + pitch.pitch_phase_rad
    error = pitch.pitch_amplitude_m * math.sin(angle) + pitch.pitch_slope * travel * screw
    slope = pitch.pitch_amplitude_m * rate * math.cos(angle) + pitch.pitch_slope * travel
    places, errors = np.array(pitch.pitch_position_m), np.array(pitch.pitch_error_m)
    if len(places):
        error += float(np.interp(travel * screw, places, errors))
        if places[0] < travel * screw < places[-1]:
            at = int(np.searchsorted(places, travel * screw, side="right")) - 1
            slope += float((errors[at + 1] - errors[at]) / (places[at + 1] - places[at])) * travel
    return error, slope
