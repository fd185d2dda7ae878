"""Which sizes come out by eq. 25, and how capable sizes make a process (ISO 22514-2)."""

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike
from scipy import special

from selector.physics.gauging import transducer
from selector.physics.gauging.gauged_grinding import GaugedGrinding, spread_freedoms, worth

_TURNS, _HALVINGS, _DEPTHS, _WAVE = 61, 50, 4, 4096
_DELAYS, _NOISES = np.polynomial.laguerre.laggauss(12), np.polynomial.hermite_e.hermegauss(9)


@dataclass(frozen=True)
class SizesByFormula:
    """Finished sizes by eq. 25: the reading passes its threshold once, and the last stage is long against T_Φ and lag.

    Noise of the relay is new at every comparison, and of many one is early: neither that nor a restless reading is in
    it. What parts ground step by step have beside it shows whether it holds.
    """

    #: mean_um and sd_um: Of the line; the curve of a characteristic moves the mean by `curvature_um` [µm]
    mean_um: float
    sd_um: float
    #: within_um and between_um: Standard deviation of one part ground again and again; of what differs from part to
    #: part [µm]
    within_um: float
    between_um: float
    restlessness: float  #: σ_ẏ/(|K|·a) of noise in the last stage; far below 1 the formula holds
    #: Largest rate of the smoothed surface over a: from 1 on the reading falls to the threshold and rises again
    ripple_rate: float
    curvature_um: float  #: As `curvature_um` has it [µm]


def sizes_by_formula(setup: GaugedGrinding, *, parts: int = 1) -> SizesByFormula:
    """Finished sizes by G eq. 25, of a batch of `parts` with its wear (1: as at the first part)."""
    line, grinding = on_line(setup), setup.grinding
    fresh = 1.0 + transducer.wear_share(grinding)
    paces = np.array([fresh / (1.0 + transducer.wear_share(grinding, number)) for number in range(parts)])
    fall = line.rates_um_per_s[-1] * line.ahead_s
    each = _met_um(line) - transducer.mean_surface_um(line.surface) - fall * paces
    each += grinding.probe_wear_um_per_part * np.arange(parts)
    gain = abs(line.gauge.gain_v_per_um)
    within = math.hypot(math.sqrt(transducer.voltage_variance_v2(line.gauge, line.noise)), line.relay.noise_v) / gain
    feeds = fall * grinding.feed_sd * math.sqrt(float(np.mean(paces**2)))
    if setup.correction is not None:
        beside = curvature_um(setup) - setup.wanted_um
        each = setup.correction.followed_um(each + beside) - beside
        # one disturbed part acts on those behind it, and so does the error of its measurement
        alone = np.arange(parts) == 0
        answer = setup.correction.followed_um(alone.astype(np.float64))
        own, of_gauge = (math.sqrt(float(np.cumsum(one**2).mean())) for one in (answer, answer - alone))
        within, feeds = math.hypot(within * own, setup.correction.gauge_sd_um * of_gauge), feeds * own
    between = math.hypot(float(each.std()), feeds)
    _, rate = transducer.smoothed_surface(line.surface, line.gauge.time_constant_s, np.arange(_WAVE) / _WAVE)
    spread, ripple = math.hypot(within, between), float(np.abs(rate).max()) / line.rates_um_per_s[-1]
    curvature = curvature_um(setup)
    return SizesByFormula(float(each.mean()), spread, within, between, setup.restlessness, ripple, curvature)


def _met_um(setup: GaugedGrinding) -> float:
    """Mean reading at which the relay ends the last stage, peaks of a ripple being at its threshold [µm]."""
    return (setup.mean_thresholds_v[-1] - setup.gauge.bias_v) / setup.gauge.gain_v_per_um


def on_line(setup: GaugedGrinding) -> GaugedGrinding:
    """The same without its characteristic; grooves are as deep as the line makes of the voltage in them at the stop.

    Where grooves are deeper than the probe swings the characteristic stays at the voltage of its free swing.
    """
    surface, curve = setup.surface, setup.characteristic
    if curve is None or surface.grooves == 0 or surface.groove_depth_um == 0:
        return replace(setup, characteristic=None)
    gain, depth = setup.gauge.gain_v_per_um, surface.groove_depth_um
    wanted = setup.wanted_um + setup.rates_um_per_s[-1] * setup.ahead_s
    seen = depth
    for _ in range(_DEPTHS):
        # what is left when the relay is tripped early by what the grooves take off the mean
        around = wanted + surface.groove_share * seen
        ends = curve.voltage_at(np.array([around, around - depth]))
        seen = min(max(float(ends[0] - ends[1]) / gain, 0.0), depth)
    return replace(setup, characteristic=None, surface=replace(surface, groove_depth_um=seen))


def curvature_um(setup: GaugedGrinding) -> float:
    """Finished size where the mean voltage meets the last threshold, minus the same by the line; 0 for a line [µm].

    The mean is taken over what the filter remembers of the falling allowance (exponential with T_Φ), over noise and
    surface. For a weak curve −S''/S'·(a²·T_Φ² + D_x/2). Positive: parts are larger than the line has it. Of a threshold
    that the characteristic does not show, the distance to its nearer end.
    """
    curve = setup.characteristic
    if curve is None:
        return 0.0
    (lag, share), (noise, weight) = _DELAYS, _NOISES
    ahead = setup.rates_um_per_s[-1] * setup.gauge.time_constant_s
    met = transducer.surface_um(setup.surface, np.arange(_TURNS) / _TURNS)
    offsets = (ahead * lag)[:, None, None] + (setup.noise.sd_um * noise)[:, None] + met
    weights = share[:, None, None] * (weight / weight.sum())[:, None] * np.full(_TURNS, 1.0 / _TURNS)
    threshold = setup.mean_thresholds_v[-1]
    rising = setup.gauge.gain_v_per_um > 0

    def above(allowance_um: float) -> bool:
        """Whether at this allowance the mean voltage is not yet at the threshold."""
        mean_v = float(np.sum(weights * curve.voltage_at(allowance_um + offsets)))
        return (mean_v > threshold) == rising

    low, high = float(curve.allowance_um[0]), float(curve.allowance_um[-1])
    for _ in range(_HALVINGS):
        middle = 0.5 * (low + high)
        low, high = (low, middle) if above(middle) else (middle, high)
    by_line = _met_um(setup) - ahead - transducer.mean_surface_um(on_line(setup).surface)
    return 0.5 * (low + high) - by_line


#: Quantiles of a normal distribution at ± 3 standard deviations, by which ISO 22514-2 measures any other.
LOW_SHARE, HIGH_SHARE = 0.00135, 0.99865
CONFIDENCE = 0.95  #: Of the intervals, two-sided.
LEAST_PARTS = 2
LEAST_PARTS_OF_QUANTILES = math.ceil(1.0 / LOW_SHARE)  #: Fewer have no quantile of 0.135 %.


@dataclass(frozen=True)
class Capability:
    """Capability of a process from a sample of its sizes."""

    count: int  #: Parts
    #: mean_um and sd_um: [µm]
    mean_um: float
    sd_um: float
    #: cp, cp_low and cp_high: (U − L)/6·sd; its interval is that of the standard deviation (chi-square), which of 200
    #: parts and more allows for sizes that follow one another or are not normal (`spread_freedoms`)
    cp: float
    cp_low: float
    cp_high: float
    #: cpk, cpk_low and cpk_high: Distance of the mean to the nearer limit over 3·sd; interval by Bissell (1990),
    #: Applied Statistics 39, 331–340
    cpk: float
    cpk_low: float
    cpk_high: float
    #: cp_quantiles and cpk_quantiles: The same with the distances of the 0.135 % and 99.865 % quantiles from the median
    #: in place of 3·sd, for sizes of any distribution; None of fewer than 741 parts, and where one of them is 0
    cp_quantiles: float | None
    cpk_quantiles: float | None
    #: share_below and share_above: Expected out of tolerance, of normal sizes
    share_below: float
    share_above: float
    #: share_outside, share_outside_low and share_outside_high: Counted out of tolerance, whatever the distribution;
    #: interval by Clopper and Pearson
    share_outside: float
    share_outside_low: float
    share_outside_high: float


def capability(size_um: ArrayLike, tolerance: transducer.Tolerance) -> Capability | None:
    """Capability from finished sizes, shape (n_parts,) [µm]; None where they do not differ, or are fewer than two."""
    sizes = np.asarray(size_um, dtype=np.float64).ravel()
    count = len(sizes)
    mean, sd = (float(sizes.mean()), float(sizes.std(ddof=1))) if count >= LEAST_PARTS else (0.0, 0.0)
    # the rounding of equal sizes is no spread
    if sd <= 1e-12 * max(abs(mean), tolerance.upper_um - tolerance.lower_um):
        return None
    width = tolerance.upper_um - tolerance.lower_um
    cp = width / (6.0 * sd)
    cpk = min(tolerance.upper_um - mean, mean - tolerance.lower_um) / (3.0 * sd)
    alpha = 1.0 - CONFIDENCE
    freedoms = spread_freedoms(sizes)
    chi_low, chi_high = (float(special.chdtri(freedoms, above)) for above in (1 - alpha / 2, alpha / 2))
    of_mean = 1.0 / (9.0 * worth(sizes))
    half = float(special.ndtri(1 - alpha / 2)) * math.sqrt(of_mean + cpk**2 / (2.0 * freedoms))
    is_outside = (sizes < tolerance.lower_um) | (sizes > tolerance.upper_um)
    outside = int(np.count_nonzero(is_outside))
    trials = worth(is_outside.astype(np.float64))
    hits = outside / count * trials
    low = float(special.betaincinv(hits, trials - hits + 1, alpha / 2)) if outside > 0 else 0.0
    high = float(special.betaincinv(hits + 1, trials - hits, 1 - alpha / 2)) if outside < count else 1.0
    by_quantiles = _by_quantiles(sizes, tolerance)
    return Capability(
        count, mean, sd,
        cp, cp * math.sqrt(chi_low / freedoms), cp * math.sqrt(chi_high / freedoms),
        cpk, cpk - half, cpk + half,
        by_quantiles[0], by_quantiles[1],
        float(special.ndtr((tolerance.lower_um - mean) / sd)), float(special.ndtr((mean - tolerance.upper_um) / sd)),
        outside / count, low, high,
    )  # fmt: skip


def _by_quantiles(
    sizes: np.ndarray[tuple[int], np.dtype[np.float64]], tolerance: transducer.Tolerance
) -> tuple[float | None, ...]:
    if len(sizes) < LEAST_PARTS_OF_QUANTILES:
        return None, None
    low, middle, high = (float(value) for value in np.quantile(sizes, [LOW_SHARE, 0.5, HIGH_SHARE]))
    if not low < middle < high:
        return None, None
    cp = (tolerance.upper_um - tolerance.lower_um) / (high - low)
    return cp, min((tolerance.upper_um - middle) / (high - middle), (middle - tolerance.lower_um) / (middle - low))
