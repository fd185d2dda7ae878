"""Between which numbers lie the keys of a gauging model file: what no gauge has is a wrong power of ten."""

from __future__ import annotations

from selector.physics.model_values import LARGEST

MOST_ALLOWANCE_UM = 1e6
"""In recordings: allowances and sizes [µm]."""

MOST_STAGES = 20

_OF_KEY = {
    "feed_um_per_s": (1e-6, 1e6),
    "gain_v_per_um": (1e-12, 1e6),
    "feed_sd": (0.0, 100.0),
    "wheel_wear": (0.0, 1e3),
    "wear_growth_per_part": (0.0, 10.0),
    "dress_every": (0, 10**9),
    "probe_wear_um_per_part": (0.0, 1e3),
    "grooves": (0, 10_000),
    "groove_share": (0.0, 1.0),
    "exponent": (0.5, 3.0),
    "damping_s_per_m": (0.0, 1e6),
    "stiffness": (1e-3, 1e15),
    "turns": (1e-3, 1e7),
    "rate_per_s": (1e-6, 1e7),
    "force_n_per_a2": (1e-9, 1e9),
}
_OF_UNIT = (
    ("_ns_per_m", 1e-9, 1e9), ("_n_per_m", 1e-3, 1e13), ("_kg", 1e-9, 1e3), ("_rpm", 0.0, 1e6), ("_ohm", 1e-6, 1e9),
    ("_hz", 1e-3, 1e6), ("_wb", 1e-15, 1e3), ("_um", 0.0, MOST_ALLOWANCE_UM), ("_v", 0.0, 1e9), ("_h", 0.0, 1e6),
    ("_s", 1e-9, 1e4), ("_m", 1e-9, 1.0),
)  # fmt: skip


def limits_of_key(key: str) -> tuple[float, float]:
    """Least size of what is not 0, and most, of the number of a key; by its name, else by the unit in it."""
    if key in _OF_KEY:
        return _OF_KEY[key]
    return next(((least, most) for end, least, most in _OF_UNIT if key.endswith(end)), (0.0, LARGEST))
