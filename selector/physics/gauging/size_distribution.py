"""Which sizes come out, by formula: as G eq. 25 has it, or with noise that reaches the threshold early.

*linear*: the reading passes its threshold once, at a slope that noise does not bend, so that the spread of the voltage
over the slope is a spread of size: sd² = D_x/(1 + β·T_Φ) + (σ_relay/K)². *first-passage*: see `first_passage`.
Both then take what differs from part to part: a feed that is not the mean one is compensated wrongly, by
(T_Φ + delay + lag)·(a − a_i); so is one with a wheel that has worn; a worn probe sees less allowance than there is.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.interpolate import BarycentricInterpolator
from scipy.special import ndtr, ndtri

from selector.errors import InputError
from selector.physics.gauging._part_kernel import LEAST_FEED
from selector.physics.gauging.curvature import curvature_um
from selector.physics.gauging.first_passage import GOLDEN, masses, passage_law, relay_law, weighted_quantiles
from selector.physics.gauging.gauged_grinding import GaugedGrinding
from selector.physics.gauging.mean_course import surface_on_line, threshold_readings_um
from selector.physics.gauging.part_plan import default_period_s
from selector.physics.gauging.process import Tolerance
from selector.physics.gauging.surface_ripple import mean_surface_um, smoothed_surface
from selector.physics.gauging.threshold import voltage_variance_v2, wear_share

Vector = NDArray[np.float64]
Method = Literal["linear", "first-passage"]

_PACES, _PARTS = 9, 16
_PROBABILITY, _SHOWN = ndtr(np.linspace(-3.9, 3.9, 131)), ndtr(np.linspace(-3.6, 3.6, 289))
_FEEDS, _RELAYS = np.linspace(-3.5, 3.5, 29), np.linspace(-3.5, 3.5, 29)
_MOMENT_FEEDS, _MOMENT_PARTS, _MOST_SIGMAS = 15, 600, 4.0
_SINGLE, _SLOW_RIPPLE = 0.1, 1.0


@dataclass(frozen=True)
class SizeDistribution:
    """Finished sizes by formula.

    Attributes
    ----------
    method : {"linear", "first-passage"}
    mean_um, sd_um : float
        [µm].
    within_um, between_um : float
        Standard deviation of one part ground again and again; of what differs from part to part [µm].
    probability, size_um : ndarray of shape (n,)
        Quantiles: the share of the parts that is smaller; their size [µm].
    restlessness : float
        σ_ẏ/(|K|·a) of noise in the last stage; far below 1 the linear formula holds.
    ripple_rate : float
        Largest rate of the smoothed surface over a: from 1 on the reading falls to the threshold and rises again.
    curvature_um : float
        By how much the curve of the characteristic would move the mean size, which is not in it: the gauge is a line
        here, but for grooves, of which it shows no more than the free swing [µm].
    """

    method: Method
    mean_um: float
    sd_um: float
    within_um: float
    between_um: float
    probability: Vector
    size_um: Vector
    restlessness: float
    ripple_rate: float
    curvature_um: float

    @property
    def linear_holds(self) -> bool:
        """Whether the linear formula may be trusted: noise and surface let the reading pass its threshold but once."""
        return self.restlessness <= _SINGLE and self.ripple_rate < _SLOW_RIPPLE

    def quantile_um(self, probability: ArrayLike) -> Vector:
        """Size below which this share of the parts is, shape of `probability` [µm]."""
        return np.interp(np.asarray(probability, dtype=np.float64), self.probability, self.size_um)

    def share_outside(self, tolerance: Tolerance) -> tuple[float, float]:
        """Shares of the parts below and above the tolerance; beyond the outermost quantile a normal tail."""
        return self._share_below(tolerance.lower_um), 1.0 - self._share_below(tolerance.upper_um)

    def density(self) -> tuple[Vector, Vector]:
        """Sizes and the density of the parts there, shapes (n_points,) [µm], [1/µm].

        Raises InputError if the sizes do not differ.
        """
        if self.sd_um == 0 or self.size_um[-1] <= self.size_um[0]:
            raise InputError(
                "sizes that do not differ", expected="a spread", where="sd_um", advice="draw the mean as a line"
            )
        edges = np.linspace(self.size_um[0], self.size_um[-1], 121)
        share = np.interp(edges, self.size_um, self.probability)
        return (edges[:-1] + edges[1:]) / 2.0, np.diff(share) / np.diff(edges)

    def _share_below(self, size_um: float) -> float:
        if self.sd_um == 0:
            return float(self.mean_um < size_um)
        inside = self.size_um[0] <= size_um <= self.size_um[-1]
        if inside:
            return float(np.interp(size_um, self.size_um, self.probability))
        return float(ndtr((size_um - self.mean_um) / self.sd_um))


def size_distribution(
    setup: GaugedGrinding, *, method: Method = "first-passage", parts: int = 1, period_s: float | None = None
) -> SizeDistribution:
    """Finished sizes by formula, of a batch of `parts` with its wear (1: as at the first part).

    The gauge is its line, the noise stationary; `period_s` is how often noise of the relay is new (None: T_Φ/8). The
    linear method also takes the last stage to be long against T_Φ and lag; the other has the mean transient.

    Raises InputError for a method that is none, no parts, or a wheel that wears too much before it is dressed.
    """
    if method not in ("linear", "first-passage") or parts < 1:
        raise InputError(
            f"method {method!r} and {parts} parts",
            expected="'linear' or 'first-passage', and 1 part or more",
            where="method" if parts >= 1 else "parts",
            advice="correct it",
        )
    numbers = _some_parts(parts, _MOMENT_PARTS)
    nodes, weights = np.polynomial.hermite_e.hermegauss(_MOMENT_FEEDS)
    weights = weights / weights.sum() if setup.grinding.feed_sd > 0 else np.array([1.0])
    paces = _paces(setup, nodes, numbers)
    law = (_linear_law if method == "linear" else _passage_law)(setup, float(paces.min()), float(paces.max()))
    each = law.mean(paces) + setup.grinding.probe_wear_um_per_part * numbers
    centre = float(weights @ each.mean(axis=1))
    between = math.sqrt(max(float(weights @ ((each - centre) ** 2).mean(axis=1)), 0.0))
    early, white, relay_um = _of_relay(setup, method, default_period_s(setup) if period_s is None else period_s)
    within = math.sqrt(max(float(weights @ law.variance(paces).mean(axis=1)), 0.0) + white)
    few = _some_parts(parts, _PARTS)
    at = law.quantiles(_paces(setup, _FEEDS, few)) + (setup.grinding.probe_wear_um_per_part * few)[:, None]
    weight = masses(_PROBABILITY) * (masses(ndtr(_FEEDS)) if setup.grinding.feed_sd > 0 else np.ones(1))[:, None, None]
    weight = np.broadcast_to(weight, at.shape)
    if white > 0:
        at = at[..., None] + np.interp(ndtr(_RELAYS), _PROBABILITY, relay_um)
        weight = weight[..., None] * masses(ndtr(_RELAYS))
    # where the table ends there is a little less spread than there is
    sizes = weighted_quantiles(at.ravel(), weight.ravel(), _SHOWN)
    middle = float(np.average(at, weights=weight))
    spread = math.sqrt(float(np.average((at - middle) ** 2, weights=weight)))
    sd = math.hypot(within, between)
    sizes = (sizes - middle) * (sd / spread if spread > 0 else 0.0)
    return SizeDistribution(
        method, centre + early, sd, within, between, _SHOWN, centre + early + sizes, setup.restlessness,
        _ripple_rate(setup), curvature_um(setup),
    )  # fmt: skip


@dataclass(frozen=True)
class _Laws:
    """Moments and quantiles against the pace of the removal; shapes as of the paces, quantiles with one axis more."""

    mean: Callable[[Vector], Vector]
    variance: Callable[[Vector], Vector]
    quantiles: Callable[[Vector], Vector]


def _linear_law(setup: GaugedGrinding, low: float, high: float) -> _Laws:
    variance = voltage_variance_v2(setup.gauge, setup.noise) / setup.gauge.gain_v_per_um**2
    level = threshold_readings_um(setup)[-1] - mean_surface_um(surface_on_line(setup))
    fall = setup.rates_um_per_s[-1] * setup.ahead_s

    def mean(pace: Vector) -> Vector:
        return level - fall * pace

    return _Laws(
        mean,
        lambda pace: np.full_like(pace, variance),
        lambda pace: mean(pace)[..., None] + math.sqrt(variance) * ndtri(_PROBABILITY),
    )


def _passage_law(setup: GaugedGrinding, low: float, high: float) -> _Laws:
    """By first passage at a few paces, and polynomials through them."""
    count = _PACES if high > low else 1
    at = 0.5 * (low + high) - 0.5 * (high - low) * np.cos((np.arange(count) + 0.5) * math.pi / count)
    found = [passage_law(setup, _PROBABILITY, float(pace)) for pace in at]

    def through(values: list[Vector]) -> Callable[[Vector], Vector]:
        table = np.stack(values)
        if count == 1:
            return lambda pace: np.broadcast_to(table[0], (*pace.shape, *table[0].shape))
        curve = BarycentricInterpolator(at, table)
        return lambda pace: np.asarray(curve(pace.ravel())).reshape(*pace.shape, *table.shape[1:])

    return _Laws(
        through([np.array(one.mean_um) for one in found]),
        through([np.array(one.variance_um2) for one in found]),
        through([one.size_um for one in found]),
    )


def _of_relay(setup: GaugedGrinding, method: Method, period_s: float) -> tuple[float, float, Vector]:
    """What noise of the relay adds: mean [µm], variance [µm²], quantiles [µm]."""
    if method == "linear":
        white = setup.relay.noise_v / abs(setup.gauge.gain_v_per_um)
        return 0.0, white**2, white * ndtri(_PROBABILITY)
    law = relay_law(setup, _PROBABILITY, period_s)
    return law.mean_um, law.variance_um2, law.size_um


def _paces(setup: GaugedGrinding, feeds: Vector, numbers: NDArray[np.int64]) -> NDArray[np.float64]:
    """Removal over that of a mean feed and a fresh wheel, shape (n_feeds, n_parts); feeds in standard deviations."""
    spread = setup.grinding.feed_sd
    scale = np.maximum(1.0 + spread * np.clip(feeds, -_MOST_SIGMAS, _MOST_SIGMAS), LEAST_FEED)
    fresh = 1.0 + wear_share(setup.grinding)
    slowed = np.array([fresh / (1.0 + wear_share(setup.grinding, int(number))) for number in numbers])
    return np.asarray((scale if spread > 0 else np.ones(1))[:, None] * slowed)


def _some_parts(parts: int, most: int) -> NDArray[np.int64]:
    """All numbers of a batch, or some that lie evenly in it and in any period of dressing."""
    if parts <= most:
        return np.arange(parts)
    return np.floor(parts * np.mod(np.arange(most) * GOLDEN, 1.0)).astype(np.int64)


def _ripple_rate(setup: GaugedGrinding) -> float:
    _, rate = smoothed_surface(surface_on_line(setup), setup.gauge.time_constant_s, np.arange(4096) / 4096.0)
    return float(np.abs(rate).max()) / setup.rates_um_per_s[-1]
