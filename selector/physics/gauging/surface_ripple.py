"""What grooves and run-out do to the allowance that the gauge sees, before its filter and behind it."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

from selector.physics.gauging.process import Surface

Vector = NDArray[np.float64]


def surface_um(surface: Surface, turn: ArrayLike) -> Vector:
    """What is seen besides the allowance after so many turns: −depth in grooves, and a sine of the run-out [µm]."""
    at = np.asarray(turn, dtype=np.float64)
    seen = surface.runout_um * np.sin(2 * math.pi * at)
    if surface.grooves:
        seen = seen - surface.groove_depth_um * (np.mod(surface.grooves * at, 1.0) < surface.groove_share)
    return np.asarray(seen)


def mean_surface_um(surface: Surface) -> float:
    """Mean of `surface_um` over a turn: a linear gauge sees so much less allowance than there is [µm]."""
    return -surface.groove_depth_um * surface.groove_share if surface.grooves else 0.0


def smoothed_surface(surface: Surface, time_constant_s: float, turn: ArrayLike) -> tuple[Vector, Vector]:
    """`surface_um` behind a filter of T_Φ when it has settled, and its rate; shapes of `turn` [µm], [µm/s].

    Sine by its amplitude and phase; grooves exactly, as pieces of exponentials that repeat.
    """
    at = np.asarray(turn, dtype=np.float64)
    value, rate = np.zeros_like(at), np.zeros_like(at)
    per_s = surface.workpiece_rpm / 60.0
    if surface.runout_um > 0:
        omega = 2 * math.pi * per_s
        size, behind = surface.runout_um / math.hypot(1.0, omega * time_constant_s), math.atan(omega * time_constant_s)
        value = value + size * np.sin(2 * math.pi * at - behind)
        rate = rate + size * omega * np.cos(2 * math.pi * at - behind)
    if surface.grooves and surface.groove_depth_um > 0:
        pitch = 1.0 / (surface.grooves * per_s) / time_constant_s
        share = surface.groove_share
        # from 0 towards 1 within a groove, and back to 0 until the next; in the unit −depth
        deepest = -math.expm1(-share * pitch) / -math.expm1(-pitch)
        least = deepest * math.exp(-(1.0 - share) * pitch)
        within = np.mod(surface.grooves * at, 1.0)
        inside = within < share
        filled = np.where(
            inside, 1.0 - (1.0 - least) * np.exp(-within * pitch), deepest * np.exp(-(within - share) * pitch)
        )
        value = value - surface.groove_depth_um * filled
        rate = rate - surface.groove_depth_um * (inside - filled) / time_constant_s
    return value, rate


def ripple_bound_um(surface: Surface, time_constant_s: float) -> float:
    """What the smoothed surface never exceeds in size [µm]."""
    per_s = surface.workpiece_rpm / 60.0
    bound = surface.runout_um / math.hypot(1.0, 2 * math.pi * per_s * time_constant_s)
    if surface.grooves and surface.groove_depth_um > 0:
        pitch = 1.0 / (surface.grooves * per_s) / time_constant_s
        bound += surface.groove_depth_um * -math.expm1(-surface.groove_share * pitch) / -math.expm1(-pitch)
    return bound
