"""Which voltage stops the feed at the wanted size: the mean course of a gauge, its lag, noise and ripple (G)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy.special import exprel

from selector.errors import InputError
from selector.physics.gauging.gauge.transducer import LinearGauge, Relay
from selector.physics.gauging.process import Grinding, Noise
from selector.types import Vector

_NO_LAG, _DIED = 1e-9, 700.0


def wear_share(grinding: Grinding, part: int = 0) -> float:
    """Radius that the wheel loses over what it removes, at this part of the batch, the first being 0.

    Raises InputError if it has grown to 1 or more: the wheel then loses more than it removes.
    """
    since = part % grinding.dress_every if grinding.dress_every > 0 else part
    exponent = since * math.log1p(grinding.wear_growth_per_part)
    share = grinding.wheel_wear * math.exp(min(exponent, 700.0)) if grinding.wheel_wear > 0 else 0.0
    if share >= 1.0:
        raise InputError(
            f"the wheel loses {share:.3g} of what it removes at part {part + 1}",
            expected="a share that stays below 1 until the wheel is dressed",
            where="wear_growth_per_part",
            advice="dress more often (dress_every), or lower wheel_wear or its growth",
        )
    return share


def removal_rate_um_per_s(feed_um_per_s: float, wear: float) -> float:
    """How fast the allowance falls, a = feed/(1 + wear) (G eq. 1) [µm/s]; `wear`: loss of the wheel over removal."""
    return feed_um_per_s / (1.0 + wear)


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


def threshold_v(gauge: LinearGauge, until_um: float, rate_um_per_s: float, delay_s: float = 0.0) -> float:
    """Voltage at which the command must be given so that the mean allowance is `until_um` when it acts (G eq. 23) [V].

    S_n = K·(x_k + a·(T_Φ + delay_s)) + bias. `delay_s` is the relay's; for the last command add lag_s, because what
    the springs still hold is taken off after the feed stands.
    """
    ahead_s = gauge.time_constant_s + delay_s
    return gauge.bias_v + gauge.gain_v_per_um * (until_um + rate_um_per_s * ahead_s)


def stage_thresholds_v(gauges: Sequence[LinearGauge], grinding: Grinding, relay: Relay) -> tuple[float, ...]:
    """Thresholds by eq. 23 for a freshly dressed wheel, relay delay and run-on of the springs included.

    `gauges` has the line of each stage. A stage that is too short for the transient of the one before ends early or
    late; `mean_voltage_v` tells by how much.
    """
    wear = wear_share(grinding)
    last = len(grinding.stages) - 1
    return tuple(
        threshold_v(
            gauge,
            stage.until_um,
            removal_rate_um_per_s(stage.feed_um_per_s, wear),
            relay.delay_s + (grinding.lag_s if number == last else 0.0),
        )
        for number, (gauge, stage) in enumerate(zip(gauges, grinding.stages, strict=True))
    )


def voltage_variance_v2(gauge: LinearGauge, noise: Noise) -> float:
    """Variance of the smoothed voltage: D_x·K²/(1 + β·T_Φ) (G eq. 25) [V²].

    A lag of the removal does not change it: the noise is in what the gauge sees, not in what the wheel removes.
    """
    return (noise.sd_um * gauge.gain_v_per_um) ** 2 / (1.0 + noise.rate_per_s * gauge.time_constant_s)


def voltage_rate_sd_v_per_s(gauge: LinearGauge, noise: Noise) -> float:
    """Standard deviation of the rate of the smoothed noise, |K|·√(D_x·β/(T_Φ·(1 + β·T_Φ))) [V/s].

    From T_Φ·ε' = K·f − ε (G eq. 24) with cov(f, ε) = K·D_x/(1 + β·T_Φ). Without the filter noise of R = D·exp(−β|τ|)
    has no rate.
    """
    filter_s, beta = gauge.time_constant_s, noise.rate_per_s
    return abs(gauge.gain_v_per_um) * noise.sd_um * math.sqrt(beta / (filter_s * (1.0 + beta * filter_s)))


@dataclass(frozen=True, eq=False)
class RippleCrest:
    """Peaks of the ripple over allowances that stay."""

    #: allowance_um and crest_v: (n_points,): Increasing [µm]; highest smoothed voltage above its mean [V]
    allowance_um: Vector
    crest_v: Vector
    time_constant_s: float  #: T_Φ of the filter behind which that is [s]
    frequency_hz: float  #: Of the rectified swing, at which the ripple is [Hz]

    def crest_at(self, allowance_um: ArrayLike, time_constant_s: float) -> Vector:
        """Peaks behind a filter of this T_Φ, shape of `allowance_um` [V]; beyond the points that of the nearest one.

        A ripple at ω passes a filter by 1/√(1 + (ω·T_Φ)²).
        """
        omega = 2 * math.pi * self.frequency_hz
        less = math.hypot(1.0, omega * self.time_constant_s) / math.hypot(1.0, omega * time_constant_s)
        return np.asarray(less * np.interp(np.asarray(allowance_um, dtype=np.float64), self.allowance_um, self.crest_v))
