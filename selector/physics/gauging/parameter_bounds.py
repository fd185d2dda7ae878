"""Between which bounds may a fit look for a number of a gauging model, and in which unit is it."""

from __future__ import annotations

from selector.physics.model_text import Key

_UNITS = (
    ("_um_per_s", "µm/s"), ("_um_per_part", "µm/part"), ("_v_per_um", "V/µm"), ("_n_per_a2", "N/A²"),
    ("_ns_per_m", "N·s/m"), ("_n_per_m", "N/m"), ("_s_per_m", "s/m"), ("growth_per_part", "1/part"), ("_per_s", "1/s"),
    ("_ohm", "Ω"), ("_hz", "Hz"), ("_rpm", "r/min"), ("_wb", "Wb"), ("_kg", "kg"), ("_um", "µm"), ("_v", "V"),
    ("volts", "V"), ("_h", "H"), ("_s", "s"), ("_m", "m"),
)  # fmt: skip
_BY_KEY = {"stiffness": "N/m^p"}
_TIMES = 10.0
_OFF = {
    "allowance_sd_um": 50.0,
    "feed_sd": 0.2,
    "lag_s": 5.0,
    "wheel_wear": 0.5,
    "wear_growth_per_part": 0.1,
    "groove_depth_um": 1000.0,
    "runout_um": 20.0,
    "sd_um": 5.0,
    "delay_s": 0.2,
    "noise_v": 0.1,
    "inductance_h": 1.0,
    "damping_s_per_m": 2.0,
}
"""Keys that may be 0, which switches something off, and how far at least they may go up."""

_EITHER_SIGN = {"until_um": 50.0, "probe_wear_um_per_part": 0.1, "rest_gap_m": 1e-3, "bias_v": 1.0}
_BETWEEN = {"exponent": (1.0, 2.0), "groove_share": (0.0, 0.95)}


def parameter_bounds(path: Key, value: float) -> tuple[float, float]:
    """Lower and upper bound of the parameter at a path: a tenth and ten times the value, always around it.

    From 0 where 0 switches something off, and then up to what a grinding machine could have: 20 µm of run-out, 5 s of
    lag, 5 µm of noise, 0.2 s of delay. What has a sign may have the other one, but for the gain of a gauge.
    """
    key = str(path[-1])
    low, high = sorted((value / _TIMES, value * _TIMES))
    if key in _BETWEEN:
        low, high = _BETWEEN[key]
    elif key in _EITHER_SIGN:
        high = max(_EITHER_SIGN[key], _TIMES * abs(value))
        low = -high
    elif key in _OFF:
        low, high = 0.0, max(_OFF[key], _TIMES * value)
    return min(low, value), max(high, value)


def unit_of_key(key: str) -> str:
    """The unit that the name of a key carries; "1" if none.

    >>> unit_of_key("feed_um_per_s"), unit_of_key("grooves")
    ('µm/s', '1')
    """
    return _BY_KEY.get(key) or next((unit for end, unit in _UNITS if key.endswith(end)), "1")
