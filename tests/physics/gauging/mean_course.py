"""The mean course of allowance and voltage in closed form, G eq. 1 and 21: what parts without noise have to follow."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike
from scipy.special import exprel

from selector.physics.gauging.transducer import LinearGauge
from selector.types import Vector

_NO_LAG, _DIED = 1e-9, 700.0


def mean_allowance_um(
    time_s: ArrayLike, allowance_um: float, rate_um_per_s: float, *, lag_s: float = 0.0, start_rate: float | None = None
) -> Vector:
    """Mean allowance after `time_s` at one feed (G eq. 1), shape of `time_s` [µm].

    `start_rate` is the removal at the beginning [µm/s]; None: already that of this feed. Without lag it is at once.
    """
    t = np.asarray(time_s, dtype=np.float64)
    fallen = rate_um_per_s * t
    if lag_s > 0 and start_rate is not None:
        # where a tiny lag has long died the quotient need not be known
        died = np.minimum(t, _DIED * lag_s) / lag_s
        fallen = fallen - (start_rate - rate_um_per_s) * lag_s * np.expm1(-died)
    return np.asarray(allowance_um - fallen)


def mean_voltage_v(
    gauge: LinearGauge,
    time_s: ArrayLike,
    allowance_um: float,
    rate_um_per_s: float,
    *,
    start_v: float | None = None,
    lag_s: float = 0.0,
    start_rate: float | None = None,
) -> Vector:
    """Mean smoothed voltage while the allowance falls at one feed: G eq. 21 with the transient it leaves out [V].

    Exact for T_Φ·S' + S = K·x(t) + bias from S(0) = `start_v` and the allowance of `mean_allowance_um`; shape of
    `time_s`. `start_v` None: that of an allowance that has stood still. Once exp(−t/T_Φ) has died the voltage is that
    of the allowance a time T_Φ ago, K·(x + a·T_Φ) + bias.
    """
    t, filter_s = np.asarray(time_s, dtype=np.float64), gauge.time_constant_s
    start = gauge.gain_v_per_um * allowance_um if start_v is None else start_v - gauge.bias_v
    left = np.exp(-t / filter_s)
    ramp = t + filter_s * np.expm1(-t / filter_s)
    response = allowance_um * -np.expm1(-t / filter_s) - rate_um_per_s * ramp
    if lag_s > _NO_LAG * filter_s and start_rate is not None:
        more = (start_rate - rate_um_per_s) * lag_s
        # exp(−t/lag_s) through the filter from 0; both forms of it are one, and this one does not overflow
        z = np.abs(t / filter_s - t / lag_s)
        behind = t / filter_s * np.exp(-np.minimum(t / filter_s, t / lag_s)) * exprel(-z)
        response = response + more * (np.expm1(-t / filter_s) + behind)
    return np.asarray(gauge.bias_v + start * left + gauge.gain_v_per_um * response)
