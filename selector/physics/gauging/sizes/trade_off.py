"""Which filter and threshold are best: a quick filter lets noise through, a slow one turns the feed's spread into size.

With the threshold of eq. 23, meant for the mean feed, noise that reaches it early makes parts too large: a bias that
falls with T_Φ. Noise falls with it as well, D_x/(1 + β·T_Φ); what differs from part to part, (T_Φ + delay + lag)·(a −
a_i), grows. Their sum has a least value.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy.interpolate import CubicSpline

from selector.physics.gauging.grinding.gauged_grinding import GaugedGrinding
from selector.physics.gauging.sizes.size_distribution import curvature_um, size_moments_um
from selector.types import Vector

POINTS = 33
_SHARE_OF_STAGE, _DECADES, _ROUND_PRESENT = 0.3, 2.5, 3.0


@dataclass(frozen=True)
class TradeOff:
    """Error of the finished size against the time constant of the filter."""

    time_constant_s: Vector  #: (n_filters,): T_Φ, increasing [s]
    threshold_v: Vector  #: (n_filters,): Of the last stage by eq. 23, for the mean feed [V].
    #: bias_um and sd_um: (n_filters,): Mean size less the wanted one, with that threshold; standard deviation [µm]
    bias_um: Vector
    sd_um: Vector
    #: (n_filters,): Threshold of the last stage that makes the mean size the wanted one [V]
    centred_threshold_v: Vector
    #: best_s and best_rms_um: Where √(bias² + variance) is least with thresholds of eq. 23 [s], and how large it is
    #: [µm]
    best_s: float
    best_rms_um: float
    #: centred_s, centred_best_v and centred_rms_um: The same with centred thresholds: the least standard deviation
    centred_s: float
    centred_best_v: float
    centred_rms_um: float
    #: present_s, present_bias_um and present_sd_um: With the filter and the thresholds that there are [s], [µm], [µm]
    present_s: float
    present_bias_um: float
    present_sd_um: float
    at_edge: bool  #: Whether one of the two best T_Φ is an end of the range that was tried, and may lie beyond

    @property
    def present_rms_um(self) -> float:
        """√(bias² + variance) as it is [µm]."""
        return float(np.hypot(self.present_bias_um, self.present_sd_um))


def trade_off(
    setup: GaugedGrinding,
    *,
    time_constants_s: ArrayLike | None = None,
    parts: int = 1,
) -> TradeOff:
    """Error of the size with other filters, by first passage on the line; the curve of a characteristic moves the mean.

    `time_constants_s` increase [s]; None: up to a third of the last stage, which has to be long against its filter.
    `parts` is the batch whose wear counts.
    """
    filters = _default_filters(setup) if time_constants_s is None else np.array(time_constants_s, dtype=np.float64)

    def moments(filter_s: float | None) -> tuple[float, float]:
        """Bias and standard deviation; None: as it is."""
        other = setup if filter_s is None else setup.with_filter(filter_s)
        mean, sd_um = size_moments_um(other, parts=parts)
        return mean + curvature_um(other) - setup.wanted_um, sd_um

    bias, sd = np.array([moments(float(one)) for one in filters]).T.copy()
    threshold = np.array([setup.with_filter(float(one)).thresholds_v[-1] for one in filters])
    centred = threshold - setup.gauge.gain_v_per_um * bias
    best_s, steady_s = _least(filters, np.hypot(bias, sd)), _least(filters, sd)
    best, steady, present = moments(best_s), moments(steady_s), moments(None)
    for values in (filters, threshold, bias, sd, centred):
        values.flags.writeable = False
    ends = (float(filters[0]), float(filters[-1]))
    return TradeOff(
        filters, threshold, bias, sd, centred,
        best_s, math.hypot(*best),
        steady_s,
        setup.with_filter(steady_s).thresholds_v[-1] - setup.gauge.gain_v_per_um * steady[0],
        steady[1],
        setup.gauge.time_constant_s, *present,
        best_s in ends or steady_s in ends,
    )  # fmt: skip


def _default_filters(setup: GaugedGrinding) -> Vector:
    """Time constants on an even logarithmic scale, around the present one."""
    ends = [setup.grinding.allowance_um, *(stage.until_um for stage in setup.grinding.stages)]
    lasts_s = (ends[-2] - ends[-1]) / setup.rates_um_per_s[-1]
    present = setup.gauge.time_constant_s
    high = max(_SHARE_OF_STAGE * lasts_s, _ROUND_PRESENT * present)
    low = min(high * 10.0**-_DECADES, present / _ROUND_PRESENT)
    return np.geomspace(low, high, POINTS)


def _least(filters: Vector, values: Vector) -> float:
    """Time constant at which a value is least, on the cubic through those that were tried, over the logarithm [s]."""
    first = int(np.argmin(values))
    if first in (0, len(filters) - 1):
        return float(filters[first])
    curve = CubicSpline(np.log(filters), values)
    ends = np.log(filters[[first - 1, first + 1]])
    inner = [float(at) for at in curve.derivative().roots(extrapolate=False) if ends[0] <= at <= ends[1]]
    return math.exp(min(inner, key=lambda at: float(curve(at)), default=math.log(filters[first])))
