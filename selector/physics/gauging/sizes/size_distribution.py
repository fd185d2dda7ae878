"""Which sizes come out, by formula; how capable that makes the process (ISO 22514-2), and which filter is best.

A quick filter lets noise through, a slow one turns the feed's spread into size. With the threshold of eq. 23, meant for
the mean feed, noise that reaches it early makes parts too large: a bias that falls with T_Φ. Noise falls with it as
well, D_x/(1 + β·T_Φ); what differs from part to part, (T_Φ + delay + lag)·(a − a_i), grows: the sum has a least value.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import special
from scipy.interpolate import CubicSpline
from scipy.special import ndtr, ndtri

from selector.physics.gauging.gauge.transducer import voltage_variance_v2, wear_share
from selector.physics.gauging.grinding._part_kernel import LEAST_FEED
from selector.physics.gauging.grinding.gauged_grinding import GaugedGrinding
from selector.physics.gauging.process import Tolerance, mean_surface_um, smoothed_surface, surface_um
from selector.physics.gauging.sizes.first_passage import (
    is_settled,
    masses,
    on_line,
    passage_law,
    relay_law,
    stage_courses,
    threshold_readings_um,
    weighted_quantiles,
)
from selector.types import Vector

_TURNS, _HALVINGS = 61, 50
_DELAYS, _NOISES = np.polynomial.laguerre.laggauss(12), np.polynomial.hermite_e.hermegauss(9)


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
    met = surface_um(setup.surface, np.arange(_TURNS) / _TURNS)
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
    by_line = threshold_readings_um(setup)[-1] - ahead - mean_surface_um(on_line(setup).surface)
    return 0.5 * (low + high) - by_line


Method = Literal["linear", "first-passage"]

_PACES, _PARTS, _LATTICE, _STILL_LATTICE = 9, 12, 64, 256
_GOLDEN, _PLASTIC = (math.sqrt(5.0) - 1.0) / 2.0, 0.7548776662466927
_PROBABILITY, _SHOWN = ndtr(np.linspace(-3.9, 3.9, 131)), ndtr(np.linspace(-3.6, 3.6, 289))
_FEEDS, _RELAYS = np.linspace(-3.5, 3.5, 21), np.linspace(-3.5, 3.5, 15)
_MOMENT_FEEDS, _MOMENT_PARTS, _MOST_SIGMAS = np.polynomial.hermite_e.hermegauss(15), 600, 4.0
_SAME_PACE = 1e-9
#: The linear formula holds within this share of the spread, and a nanometre.
_SLOW_RIPPLE, _OFF_SHARE, _NOTHING_UM = 1.0, 0.05, 1e-3
_MEMORIES, _SETTLED, _SIGMAS = 8.0, 5.0, 3.0


@dataclass(frozen=True)
class SizeDistribution:
    """Finished sizes by formula."""

    method: Method  #: {"linear", "first-passage"}
    #: mean_um and sd_um: [µm]
    mean_um: float
    sd_um: float
    #: within_um and between_um: Standard deviation of one part ground again and again; of what differs from part to
    #: part [µm]
    within_um: float
    between_um: float
    #: probability and size_um: (n,): Quantiles: the share of the parts that is smaller; their size [µm]
    probability: Vector
    size_um: Vector
    restlessness: float  #: σ_ẏ/(|K|·a) of noise in the last stage; far below 1 the linear formula holds
    #: Largest rate of the smoothed surface over a: from 1 on the reading falls to the threshold and rises again
    ripple_rate: float
    #: By how much the curve of the characteristic would move the mean size, which is not in it: the gauge is a line
    #: here, but for grooves, of which it shows no more than the free swing [µm]
    curvature_um: float
    #: Whether mean and spread by the linear formula are within a twentieth of the spread of those by first passage with
    #: the curvature, and those may be trusted
    linear_holds: bool
    passage_holds: bool  #: Whether those by first passage may be trusted: see `_passage_holds`


def size_distribution(setup: GaugedGrinding, *, method: Method = "first-passage", parts: int = 1) -> SizeDistribution:
    """Finished sizes by formula, of a batch of `parts` with its wear (1: as at the first part).

    The gauge is its line, the noise stationary. The linear method also takes the last stage to be long against T_Φ and
    lag; the other has the mean transient.
    """
    line = on_line(setup)
    lot, early, white, relay_um = _lot(line, method, parts), *_of_relay(setup, method)
    at, weight = lot.sizes()
    if white > 0:
        at = at[:, None] + np.interp(ndtr(_RELAYS), _PROBABILITY, relay_um)
        weight = weight[:, None] * masses(ndtr(_RELAYS))
    sizes = weighted_quantiles(at.ravel(), weight.ravel(), _SHOWN)
    # where the table ends there is a little less spread than there is
    middle = float(np.average(at, weights=weight))
    spread = math.sqrt(float(np.average((at - middle) ** 2, weights=weight)))
    within, mean = math.sqrt(lot.within_um2 + white), lot.mean_um + early
    trusted, moved, ripple_rate = _passage_holds(line), curvature_um(setup), _ripple_rate(line)
    sd = math.hypot(within, math.sqrt(lot.between_um2))
    sizes = mean + (sizes - middle) * (sd / spread if spread > 0 else 0.0)
    return SizeDistribution(
        method, mean, sd, within, math.sqrt(lot.between_um2), _SHOWN, sizes,
        setup.restlessness, ripple_rate, moved,
        trusted and ripple_rate < _SLOW_RIPPLE and _linear_holds(line, parts, moved), trusted,
    )  # fmt: skip


def _moments_um(line: GaugedGrinding, method: Method, parts: int) -> tuple[float, float]:
    """Mean and standard deviation without the quantiles: quicker, where many are wanted [µm]."""
    lot = _lot(line, method, parts)
    early, white, _ = _of_relay(line, method)
    return lot.mean_um + early, math.sqrt(lot.within_um2 + lot.between_um2 + white)


def _linear_holds(line: GaugedGrinding, parts: int, curvature: float) -> bool:
    mean, sd = _moments_um(line, "first-passage", parts)
    linear_mean, linear_sd = _moments_um(line, "linear", parts)
    most = _OFF_SHARE * sd + _NOTHING_UM
    return abs(mean + curvature - linear_mean) <= most and abs(sd - linear_sd) <= most


def _passage_holds(line: GaugedGrinding) -> bool:
    """Whether nothing happens that the formula by first passage leaves out.

    Not so where noise of the relay, whose shift is that of a reading that falls straight, trips it before it does;
    where the last stage begins otherwise from part to part, because of noise that is still remembered when parts trip,
    or of allowances that differ and a first stage too short for filter and lag.
    """
    courses, levels = stage_courses(line), threshold_readings_um(line)
    filter_s, lag_s = line.gauge.time_constant_s, line.grinding.lag_s
    last, level = courses[-1], levels[-1]
    sd = math.sqrt(voltage_variance_v2(line.gauge, line.noise)) / abs(line.gauge.gain_v_per_um)
    if line.relay.noise_v > 0:
        law = relay_law(line, np.array([0.5]))
        spread = math.sqrt(law.variance_um2)
        first_s = last.time_of(level + law.mean_um + _SIGMAS * (spread + sd))
        steady = float(last.allowance(first_s)) + last.rate_um_per_s * filter_s
        if first_s == 0.0 or abs(float(last.reading(first_s)) - steady) > _OFF_SHARE * spread:
            return False
        if abs(float(last.removal(first_s)) - last.rate_um_per_s) > _OFF_SHARE * last.rate_um_per_s:
            return False
    if line.grinding.allowance_sd_um > 0 and courses[0].time_of(levels[0]) < _SETTLED * (filter_s + lag_s):
        return False
    if len(courses) == 1 or sd == 0 or is_settled(last, level, sd):
        return True
    return last.time_of(level) > _MEMORIES * (filter_s + 1.0 / line.noise.rate_per_s)


@dataclass(frozen=True)
class _Lot:
    """Parts without noise of the relay: mean, variances within and between them, sizes with weights when asked for."""

    mean_um: float
    within_um2: float
    between_um2: float
    sizes: Callable[[], tuple[Vector, Vector]]


def _lot(line: GaugedGrinding, method: Method, parts: int) -> _Lot:
    smooth = method == "linear" or stage_courses(line)[-1].is_whole
    return _smooth_lot(line, method, parts) if smooth else _rippled_lot(line, parts)


def _smooth_lot(line: GaugedGrinding, method: Method, parts: int) -> _Lot:
    """Nothing but noise within a part: its law changes smoothly with the pace."""
    numbers, few = _some_parts(parts, _MOMENT_PARTS), _some_parts(parts, _PARTS)
    spread = line.grinding.feed_sd > 0
    nodes, weights = _MOMENT_FEEDS if spread else (np.zeros(1), np.ones(1))
    weights = weights / weights.sum()
    paces = _fed(line, nodes)[:, None] * _slowed(line, numbers)
    law = (_linear_law if method == "linear" else _passage_law)(line, float(paces.min()), float(paces.max()))
    each = law.mean(paces) + _worn_um(line, numbers)
    mean = float(np.sum(weights * each.mean(axis=1)))

    def sizes() -> tuple[Vector, Vector]:
        feeds = _FEEDS if spread else np.zeros(1)
        at = law.quantiles(_fed(line, feeds)[:, None] * _slowed(line, few)) + _worn_um(line, few)[:, None]
        share = masses(ndtr(feeds))[:, None, None] * masses(_PROBABILITY)
        return at.ravel(), np.broadcast_to(share, at.shape).ravel()

    return _Lot(
        mean,
        max(float(np.sum(weights * law.variance(paces).mean(axis=1))), 0.0),
        max(float(np.sum(weights * ((each - mean) ** 2).mean(axis=1))), 0.0),
        sizes,
    )


def _rippled_lot(line: GaugedGrinding, parts: int) -> _Lot:
    """Grooves or run-out: where a part begins on its turn, its feed and its number lie evenly in all they can be."""
    count = _LATTICE if line.noise.sd_um > 0 else _STILL_LATTICE
    index = np.arange(count)
    turns = np.mod(index * _GOLDEN, 1.0)
    feeds = ndtri((index + 0.5) / count)
    numbers = np.floor(parts * np.mod(index * _PLASTIC, 1.0)).astype(np.int64)
    paces = _fed(line, feeds / feeds.std()) * _slowed(line, numbers)
    worn = _worn_um(line, numbers)
    laws = [passage_law(line, _PROBABILITY, *at) for at in zip(paces.tolist(), turns.tolist(), strict=True)]
    means = np.array([law.mean_um for law in laws]) + worn
    variance = float(np.mean([law.variance_um2 for law in laws]) + means.var())
    # what feed and wear alone would make, as if the surface were whole
    between = min(float((line.rates_um_per_s[-1] * line.ahead_s * paces - worn).var()), variance)
    at = np.stack([law.size_um for law in laws]) + worn[:, None]
    share = np.broadcast_to(masses(_PROBABILITY) / count, at.shape)
    return _Lot(float(means.mean()), variance - between, between, lambda: (at.ravel(), share.ravel()))


@dataclass(frozen=True)
class _Laws:
    """Moments and quantiles against the pace of the removal; shapes as of the paces, quantiles with one axis more."""

    mean: Callable[[Vector], Vector]
    variance: Callable[[Vector], Vector]
    quantiles: Callable[[Vector], Vector]


def _linear_law(line: GaugedGrinding, low: float, high: float) -> _Laws:
    variance = voltage_variance_v2(line.gauge, line.noise) / line.gauge.gain_v_per_um**2
    level = threshold_readings_um(line)[-1] - mean_surface_um(line.surface)
    fall = line.rates_um_per_s[-1] * line.ahead_s

    def mean(pace: Vector) -> Vector:
        return level - fall * pace

    return _Laws(
        mean,
        lambda pace: np.full_like(pace, variance),
        lambda pace: mean(pace)[..., None] + math.sqrt(variance) * ndtri(_PROBABILITY),
    )


def _passage_law(line: GaugedGrinding, low: float, high: float) -> _Laws:
    """By first passage at a few paces, and polynomials through them."""
    count = _PACES if high - low > _SAME_PACE * high else 1
    angle = (np.arange(count) + 0.5) * math.pi / count
    at = 0.5 * (low + high) - 0.5 * (high - low) * np.cos(angle)
    weight = np.sin(angle) * (-1.0) ** np.arange(count)
    found = [passage_law(line, _PROBABILITY, float(pace)) for pace in at]

    def through(values: list[Vector]) -> Callable[[Vector], Vector]:
        table = np.stack(values)
        if count == 1:
            return lambda pace: np.broadcast_to(table[0], (*pace.shape, *table[0].shape))
        return lambda pace: _polynomial(at, weight, table, pace)

    return _Laws(
        through([np.array(one.mean_um) for one in found]),
        through([np.array(one.variance_um2) for one in found]),
        through([one.size_um for one in found]),
    )


def _polynomial(at: Vector, weight: Vector, table: Vector, pace: Vector) -> Vector:
    """The polynomial through a table at Chebyshev's nodes, by its barycentric form; shape of `pace`, then of a row."""
    distance = pace[..., None] - at
    met = distance == 0.0
    share = np.where(met.any(axis=-1, keepdims=True), met, weight / np.where(met, 1.0, distance))
    share = share / share.sum(axis=-1, keepdims=True)
    # summed node by node: a matrix product may round otherwise from call to call
    found = np.zeros((*pace.shape, *table.shape[1:]))
    for node, row in enumerate(table):
        found += share[..., node].reshape(*pace.shape, *(1,) * row.ndim) * row
    return found


def _of_relay(setup: GaugedGrinding, method: Method) -> tuple[float, float, Vector]:
    """What noise of the relay adds: mean [µm], variance [µm²], quantiles [µm]."""
    if method == "linear":
        white = setup.relay.noise_v / abs(setup.gauge.gain_v_per_um)
        return 0.0, white**2, white * ndtri(_PROBABILITY)
    law = relay_law(setup, _PROBABILITY)
    return law.mean_um, law.variance_um2, law.size_um


def _fed(setup: GaugedGrinding, feeds: Vector) -> Vector:
    """Feed over the mean feed; `feeds` in standard deviations."""
    scale = 1.0 + setup.grinding.feed_sd * np.clip(feeds, -_MOST_SIGMAS, _MOST_SIGMAS)
    return np.asarray(np.maximum(scale, LEAST_FEED))


def _slowed(setup: GaugedGrinding, numbers: NDArray[np.int64]) -> Vector:
    """Removal at these parts over that with a fresh wheel."""
    fresh = 1.0 + wear_share(setup.grinding)
    return np.array([fresh / (1.0 + wear_share(setup.grinding, int(number))) for number in numbers])


def _worn_um(setup: GaugedGrinding, numbers: NDArray[np.int64]) -> Vector:
    """How much larger these parts grow with the worn probe [µm]."""
    return np.asarray(setup.grinding.probe_wear_um_per_part * numbers, dtype=np.float64)


def _some_parts(parts: int, most: int) -> NDArray[np.int64]:
    """All numbers of a batch, or some that lie evenly in it and in any period of dressing."""
    if parts <= most:
        return np.arange(parts)
    return np.floor(parts * np.mod(np.arange(most) * _GOLDEN, 1.0)).astype(np.int64)


def _ripple_rate(line: GaugedGrinding) -> float:
    _, rate = smoothed_surface(line.surface, line.gauge.time_constant_s, np.arange(4096) / 4096.0)
    return float(np.abs(rate).max()) / line.rates_um_per_s[-1]


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
    #: cp, cp_low and cp_high: (U − L)/6·sd; its interval is that of the standard deviation of normal sizes (chi-square)
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


def capability(size_um: ArrayLike, tolerance: Tolerance) -> Capability | None:
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
    chi_low, chi_high = (float(special.chdtri(count - 1, above)) for above in (1 - alpha / 2, alpha / 2))
    half = float(special.ndtri(1 - alpha / 2)) * math.sqrt(1.0 / (9.0 * count) + cpk**2 / (2.0 * (count - 1)))
    outside = int(np.count_nonzero((sizes < tolerance.lower_um) | (sizes > tolerance.upper_um)))
    low = float(special.betaincinv(outside, count - outside + 1, alpha / 2)) if outside > 0 else 0.0
    high = float(special.betaincinv(outside + 1, count - outside, 1 - alpha / 2)) if outside < count else 1.0
    by_quantiles = _by_quantiles(sizes, tolerance)
    return Capability(
        count, mean, sd,
        cp, cp * math.sqrt(chi_low / (count - 1)), cp * math.sqrt(chi_high / (count - 1)),
        cpk, cpk - half, cpk + half,
        by_quantiles[0], by_quantiles[1],
        float(special.ndtr((tolerance.lower_um - mean) / sd)), float(special.ndtr((mean - tolerance.upper_um) / sd)),
        outside / count, low, high,
    )  # fmt: skip


def _by_quantiles(
    sizes: np.ndarray[tuple[int], np.dtype[np.float64]], tolerance: Tolerance
) -> tuple[float | None, ...]:
    if len(sizes) < LEAST_PARTS_OF_QUANTILES:
        return None, None
    low, middle, high = (float(value) for value in np.quantile(sizes, [LOW_SHARE, 0.5, HIGH_SHARE]))
    if not low < middle < high:
        return None, None
    cp = (tolerance.upper_um - tolerance.lower_um) / (high - low)
    return cp, min((tolerance.upper_um - middle) / (high - middle), (middle - tolerance.lower_um) / (middle - low))


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
        mean, sd_um = _moments_um(on_line(other), "first-passage", parts)
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
