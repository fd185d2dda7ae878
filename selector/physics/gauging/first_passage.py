"""Which sizes are left when a restless reading first falls to its threshold.

Of smoothed noise of standard deviation σ, whose rate has σ', on a mean course m(t) the reading falls through the
threshold z at the rate ν = φ(q)/σ·(σ'·φ(μ/σ') + μ·Φ(μ/σ')), q = (m − z)/σ, μ = −m' (S. O. Rice, Bell System Technical
Journal 24, 1945). The share F = Φ(q) is above it; of parts that are still ground the share ν/F falls through per
second: exact where the course passes so quickly that there is one crossing, and where crossings are so rare that each
comes by itself. Between the two they come in clumps, and only the first of a clump counts: `renewal` has that, for
whole surfaces. With grooves and run-out it is left out, and the size comes out up to some tenths of its spread too
large where the noise is restless.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import integrate
from scipy.special import log_ndtr, ndtr

from selector.physics.gauging.gauged_grinding import GaugedGrinding
from selector.physics.gauging.mean_course import MeanCourse, stage_courses, threshold_readings_um
from selector.physics.gauging.process import Noise
from selector.physics.gauging.renewal import clump_survival, renewal_survival, steps_needed
from selector.physics.gauging.threshold import voltage_rate_sd_v_per_s, voltage_variance_v2

Vector = NDArray[np.float64]

_SIGMAS, _POINTS, _MOST_POINTS, _PER_WAVE, _PER_SIGMA = 9.0, 600, 6000, 12, 12
NO_NOISE_UM = 1e-9
"""Noise that is less than this moves no size."""

_FAR = -30.0
_FEW_SIGMAS, _SETTLED = 5.0, 5.0
_STARTS = np.polynomial.hermite_e.hermegauss(5)
_FEW, _LONG_GONE = 1e-7, 1e-30
_RELAY_POINTS, _RELAY_PHASES, _FINE = 2001, 16, 20.0


@dataclass(frozen=True)
class PassageLaw:
    """Finished sizes of parts that are all fed alike.

    Attributes
    ----------
    mean_um, variance_um2 : float
        [µm], [µm²].
    size_um : ndarray of shape (n_probabilities,)
        Quantiles [µm].
    """

    mean_um: float
    variance_um2: float
    size_um: Vector


def passage_law(setup: GaugedGrinding, probability: Vector, pace: float = 1.0, turn: float = 0.0) -> PassageLaw:
    """Sizes of parts whose allowance falls `pace` times as fast as with the mean feed, the workpiece begun at `turn`.

    The last stage on its mean course, the gauge a line, its noise stationary, the relay's own noise left out. Where it
    is so short that it matters when it begins, noise also ends the stage before early; those before that end when they
    do without noise. Quantiles at `probability`, shape (n_probabilities,).
    """
    level, delay_s = threshold_readings_um(setup)[-1], setup.relay.delay_s
    courses = stage_courses(setup, pace, turn)
    sd, _ = _reading_sds(setup)
    if sd <= NO_NOISE_UM:
        still = float(courses[-1].size(courses[-1].time_of(level), delay_s))
        return PassageLaw(still, 0.0, np.full(len(probability), still))
    if len(courses) == 1 or is_settled(courses[-1], level, sd):
        time, survival = _still_ground(setup, courses[-1], level)
        return _law_of(survival, courses[-1].size(time, delay_s), probability)
    laws, weights = [], []
    for share, course in _starts(setup, courses):
        time, survival = _still_ground(setup, course, level)
        laws.append(_law_of(survival, course.size(time, delay_s), probability))
        weights.append(share)
    return _mixture(laws, np.array(weights), probability)


def _starts(setup: GaugedGrinding, courses: list[MeanCourse]) -> Iterator[tuple[float, MeanCourse]]:
    """Last stages that begin when noise has ended the one before, and their shares."""
    before, rate = courses[-2], courses[-1].rate_um_per_s
    time, survival = _still_ground(setup, before, threshold_readings_um(setup)[-2])
    ended = _law_of(survival, -time, np.array([0.5]))
    noise = relay_law(setup, np.array([0.5]), before.rate_um_per_s)
    mean_s = -ended.mean_um - noise.mean_um / before.rate_um_per_s
    sd_s = math.hypot(math.sqrt(ended.variance_um2), math.sqrt(noise.variance_um2) / before.rate_um_per_s)
    for node, weight in zip(*_STARTS, strict=True):
        yield weight, before.next_stage(max(mean_s + node * sd_s, 0.0) + setup.relay.delay_s, rate)


def is_settled(course: MeanCourse, reading_um: float, sd_um: float) -> bool:
    """Whether nothing of how a stage began is left when noise of this size first takes the reading to this level."""
    begin, _ = course.window_s(reading_um, _FEW_SIGMAS * sd_um)
    return begin > _SETTLED * (course.unit.time_constant_s + course.lag_s)


def _mixture(laws: Sequence[PassageLaw], weights: Vector, probability: Vector) -> PassageLaw:
    weights = weights / weights.sum()
    means = np.array([law.mean_um for law in laws])
    mean = float(np.sum(weights * means))
    square = float(np.sum(weights * (np.array([law.variance_um2 for law in laws]) + means**2)))
    sizes = np.stack([law.size_um for law in laws])
    shares = weights[:, None] * masses(probability)
    return PassageLaw(mean, max(square - mean**2, 0.0), weighted_quantiles(sizes.ravel(), shares.ravel(), probability))


def _reading_sds(setup: GaugedGrinding) -> tuple[float, float]:
    """Standard deviations of the smoothed noise [µm] and of its rate [µm/s]."""
    gain = abs(setup.gauge.gain_v_per_um)
    return (
        math.sqrt(voltage_variance_v2(setup.gauge, setup.noise)) / gain,
        voltage_rate_sd_v_per_s(setup.gauge, setup.noise) / gain,
    )


def _still_ground(setup: GaugedGrinding, course: MeanCourse, level: float) -> tuple[Vector, Vector]:
    """Times of a stage [s], and the share of the parts whose reading has not come down to the level by then."""
    sd, rate_sd = _reading_sds(setup)
    begin, end = course.window_s(level, _SIGMAS * sd)
    # a step is a small part of a wave of the surface, and of the time in which the reading falls by the noise
    shortest = min(course.shortest_s() / _PER_WAVE, sd / course.rate_um_per_s / _PER_SIGMA)
    end = max(end, begin + shortest)
    time = np.linspace(begin, end, int(np.clip((end - begin) / shortest, _POINTS, _MOST_POINTS)))
    ripple, slope = course.ripple(time)
    reading = course.reading(time)
    approach = (reading - course.allowance(time)) / course.unit.time_constant_s - slope
    q = (reading + ripple - level) / sd
    survival = _survival(time, q, approach, sd, rate_sd)
    if course.is_whole:
        time, survival = _without_clumps(course, level, setup.noise, time, q, survival)
    return time, survival


def _without_clumps(
    course: MeanCourse, level: float, noise: Noise, time: Vector, q: Vector, survival: Vector
) -> tuple[Vector, Vector]:
    """Times and survival by the equation of first passage, while parts trip: a little after Rice they all have."""
    first = max(int(np.argmax(survival < survival[0] - _FEW)) - 1, 0)
    gone = survival < _LONG_GONE
    last = int(np.argmax(gone)) if gone.any() else len(time) - 1
    median = float(np.interp(0.5, survival[::-1], q[::-1]))
    steps = steps_needed(noise, course.unit.time_constant_s, median, float(time[last] - time[first]))
    if steps is None:
        kept = time[first : last + 1]
        return kept, clump_survival(course, level, noise, kept)
    even = np.linspace(time[first], time[last], steps + 1)
    return even, renewal_survival(course, level, noise, even)


def masses(probability: Vector) -> Vector:
    """Share of all that each of these increasing quantiles stands for."""
    between = (probability[1:] + probability[:-1]) / 2.0
    return np.diff(np.concatenate([[0.0], between, [1.0]]))


def weighted_quantiles(values: Vector, weights: Vector, probability: Vector) -> Vector:
    """Values below which these shares of the weights lie."""
    order = np.argsort(values)
    share = np.cumsum(weights[order])
    middle = (share - 0.5 * weights[order]) / share[-1]
    return np.interp(probability, middle, values[order])


def relay_law(setup: GaugedGrinding, probability: Vector, rate_um_per_s: float | None = None) -> PassageLaw:
    """By how much larger parts grow because noise of the relay, new every `noise_hold_s`, trips it early [µm].

    Of a reading that falls straight at this rate (None: that of the last stage): sample by sample the share that is not
    tripped, averaged over where the samples lie; where they are many, by the integral of its logarithm.
    """
    sd = setup.relay.noise_v / abs(setup.gauge.gain_v_per_um)
    if sd <= NO_NOISE_UM:
        return PassageLaw(0.0, 0.0, np.zeros(len(probability)))
    rate = setup.rates_um_per_s[-1] if rate_um_per_s is None else rate_um_per_s
    step = rate * setup.relay.noise_hold_s
    # so many samples can trip it before the reading is near that the window has to begin earlier than _SIGMAS only
    # where nobody would use the gauge any more
    height = np.linspace(_SIGMAS * sd, -_SIGMAS * sd, _RELAY_POINTS)
    if step * _FINE < sd:
        logs = log_ndtr(height / sd)
        # the samples that are over, and the one that lasts
        over = integrate.cumulative_trapezoid(logs, -height, initial=0) / step
        survival = np.asarray(np.exp(over + logs))
    else:
        survival = np.zeros(_RELAY_POINTS)
        for phase in (np.arange(_RELAY_PHASES) + 0.5) / _RELAY_PHASES:
            ends = np.arange(height[0] + phase * step, height[-1] - step, -step)
            passed = np.concatenate([[0.0], np.cumsum(log_ndtr(ends / sd))])
            survival += _passed_share(height, ends, passed) * ndtr(height / sd) / _RELAY_PHASES
    return _law_of(survival, height, probability)


def _law_of(survival: Vector, size: Vector, probability: Vector) -> PassageLaw:
    """From the share of parts that are still ground when they would be left with these falling sizes."""
    distance = size - size[0]
    mean = float(integrate.trapezoid(survival, distance))
    square = float(integrate.trapezoid(2.0 * distance * survival, distance))
    sizes = np.interp(probability, survival[::-1], size[::-1])
    return PassageLaw(float(size[0]) + mean, max(square - mean**2, 0.0), sizes)


def _passed_share(height: Vector, ends: Vector, passed: Vector) -> Vector:
    """Share that has not tripped in samples that ended above each height; `ends` fall, `passed` are its logarithms."""
    return np.asarray(np.exp(passed[np.searchsorted(-ends, -height, side="left")]))


def _survival(time: Vector, q: Vector, approach: Vector, sd: float, rate_sd: float) -> Vector:
    """Share that has not yet fallen through; some have at the first time already."""
    mu = approach / rate_sd
    pace = rate_sd * (np.exp(-0.5 * mu**2) / math.sqrt(2 * math.pi) + mu * ndtr(mu))
    # φ/Φ, which far below the threshold is −q
    near = np.maximum(q, _FAR)
    share = np.exp(-0.5 * near**2 - log_ndtr(near)) / math.sqrt(2 * math.pi) * np.maximum(q / _FAR, 1.0)
    hazard = share / sd * np.maximum(pace, 0.0)
    return np.asarray(np.exp(log_ndtr(q[0]) - integrate.cumulative_trapezoid(hazard, time, initial=0)))
