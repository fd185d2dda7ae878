"""Between which numbers lie the keys of a feed drive's model file: what no machine has is a wrong power of ten."""

from __future__ import annotations

from selector.physics.model_values import LARGEST

MOST_WAITING = 300
"""Samples of the control that a command may wait, and that a measured speed may reach over."""

MOST_POSITION_M, MOST_ACTING = 1e4, 1e9
"""In recordings and columns: positions [m; rad], and what acts on an axis [N; unit of the control]."""

_OF_KEY = {
    "sample_s": (1e-6, 100.0),
    "delay_s": (0.0, 100.0),
    "position_gain_per_s": (1e-9, 1e9),
    "velocity_gain": (1e-12, 1e12),
    "actuator_gain": (1e-9, 1e9),
    "command_limit": (1e-9, 1e9),
    "speed_limit": (1e-9, 1e9),
    "velocity_feedforward": (0.0, 10.0),
    "acceleration_feedforward": (0.0, 10.0),
    "current_noise": (0.0, 1e6),
    "motor_resolution": (1e-15, 1e3),
    "scale_resolution_m": (1e-15, 1e3),
    "speed_samples": (1, MOST_WAITING),
    "harmonic": (1e-6, 1e6),
    "cogging": (0.0, 1e9),
    "share": (0.0, 100.0),
    "stribeck_speed_m_per_s": (1e-9, 1e3),
    "stribeck_exponent": (1e-3, 100.0),
    "pitch_slope": (0.0, 0.1),
    "lead_m": (1e-6, 10.0),
    "lead_mm": (1e-3, 1e4),
    "preload_n": (0.0, 1e7),
    "rigidity_preload_n": (1e-3, 1e7),
    "balls": (1, 10_000),
    "carriages": (0, 1000),
    "per_direction": (1, 100),
}
_OF_UNIT = (
    ("_kg_per_m3", 1e-3, 1e6), ("_kg_m2", 1e-12, 1e6), ("_kg", 1e-9, 1e9), ("_nm_per_rad", 1e-6, 1e12),
    ("_nms_per_rad", 0.0, 1e6), ("_ns_per_m", 0.0, 1e9), ("_n_per_m", 1e-3, 1e13), ("_n_per_um", 1e-6, 1e7),
    ("_nm_per_a", 1e-9, 1e6), ("_m_per_s", 0.0, 1e3), ("_nm", 0.0, 1e9), ("_n", 0.0, 1e9), ("_mm", 1e-6, 1e6),
    ("_m", 0.0, 1e4), ("_gpa", 1e-3, 1e12), ("_rpm", 1e-6, 1e7), ("_deg", 0.0, 360.0), ("_rad", 0.0, 1e6),
)  # fmt: skip


def limits_of_key(key: str) -> tuple[float, float]:
    """Least size of what is not 0, and most, of the number of a key; by its name, else by the unit in it."""
    if key in _OF_KEY:
        return _OF_KEY[key]
    return next(((least, most) for end, least, most in _OF_UNIT if key.endswith(end)), (0.0, LARGEST))
