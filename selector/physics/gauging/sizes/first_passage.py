"""Which sizes are left when a restless reading first falls to its threshold; crossings in clumps count once.

All in micrometres of allowance: the voltage less its bias over the gain. First how the smoothed reading falls on
average, then what noise makes of it.
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike
from scipy import integrate
from scipy.special import log_ndtr, ndtr

from selector.errors import InputError
from selector.physics.gauging.gauge.transducer import (
    LinearGauge,
    mean_allowance_um,
    mean_voltage_v,
    voltage_rate_sd_v_per_s,
    voltage_variance_v2,
)
from selector.physics.gauging.grinding.gauged_grinding import GaugedGrinding
from selector.physics.gauging.process import Noise, Surface, ripple_bound_um, smoothed_surface
from selector.physics.gauging.sizes._renewal_kernel import passed_shares
from selector.types import Matrix, Vector

_ROUNDS, _PER_ROUND, _DEPTHS, _DIED = 3, 129, 4, 700.0
_BRACKETS = 2.0 ** np.arange(-16, 40)
_COURSE_PER_WAVE, _COURSE_POINTS, _COURSE_MOST_POINTS = 48, 200, 40_000


@dataclass(frozen=True)
class MeanCourse:
    """One feed that begins at `allowance_um` with the smoothed reading `reading_um` and the removal `start_rate`.

    The reading is that of a whole surface at its mean; what grooves and run-out add to it is `ripple`.
    """

    unit: LinearGauge  #: Of gain 1, with T_Φ
    #: allowance_um and reading_um: [µm]
    allowance_um: float
    reading_um: float
    #: rate_um_per_s, start_rate and lag_s: [µm/s], [µm/s], [s]
    rate_um_per_s: float
    start_rate: float
    lag_s: float
    surface: Surface
    turn: float  #: Turns of the workpiece when the feed begins

    @property
    def is_whole(self) -> bool:
        """Whether nothing on the surface disturbs the reading."""
        surface = self.surface
        return surface.runout_um == 0 and (surface.grooves == 0 or surface.groove_depth_um == 0)

    def allowance(self, time_s: ArrayLike) -> Vector:
        """True allowance, shape of `time_s` [µm]."""
        return mean_allowance_um(
            time_s, self.allowance_um, self.rate_um_per_s, lag_s=self.lag_s, start_rate=self.start_rate
        )

    def reading(self, time_s: ArrayLike) -> Vector:
        """Smoothed reading of a whole surface, shape of `time_s` [µm]."""
        return mean_voltage_v(
            self.unit, time_s, self.allowance_um, self.rate_um_per_s,
            start_v=self.reading_um, lag_s=self.lag_s, start_rate=self.start_rate,
        )  # fmt: skip

    def removal(self, time_s: ArrayLike) -> Vector:
        """Rate at which the allowance falls, shape of `time_s` [µm/s]."""
        t = np.asarray(time_s, dtype=np.float64)
        left = np.exp(-np.minimum(t, _DIED * self.lag_s) / self.lag_s) if self.lag_s > 0 else np.zeros_like(t)
        return np.asarray(self.rate_um_per_s + (self.start_rate - self.rate_um_per_s) * left)

    def ripple(self, time_s: ArrayLike) -> tuple[Vector, Vector]:
        """What the surface adds to the reading, and its rate, shapes of `time_s` [µm], [µm/s]."""
        per_s = self.surface.workpiece_rpm / 60.0
        turn = self.turn + per_s * np.asarray(time_s, dtype=np.float64)
        return smoothed_surface(self.surface, self.unit.time_constant_s, turn)

    def window_s(self, reading_um: float, beyond_um: float) -> tuple[float, float]:
        """From when to when the reading, ripple and `beyond_um` of noise included, can be at this level [s]."""
        room = ripple_bound_um(self.surface, self.unit.time_constant_s)
        begin = self._whole_time(reading_um + room + beyond_um)
        return begin, self._whole_time(reading_um - room - beyond_um)

    def shortest_s(self) -> float:
        """A quarter of a turn, or what is shorter of a groove and the way to the next [s]; infinite if whole."""
        if self.is_whole:
            return math.inf
        surface, per_s = self.surface, self.surface.workpiece_rpm / 60.0
        if surface.grooves == 0 or surface.groove_depth_um == 0:
            return 0.25 / per_s
        return min(surface.groove_share, 1.0 - surface.groove_share, 0.25 * surface.grooves) / (surface.grooves * per_s)

    def time_of(self, reading_um: float) -> float:
        """When the reading with its ripple first comes down to this level [s]; 0 if it begins there or below."""
        if self.is_whole:
            return self._whole_time(reading_um)
        begin, end = self.window_s(reading_um, 0.0)
        count = int(np.clip((end - begin) / self.shortest_s() * _COURSE_PER_WAVE, _COURSE_POINTS, _COURSE_MOST_POINTS))
        time = np.linspace(begin, end, count)
        above = self.reading(time) + self.ripple(time)[0] - reading_um
        first = int(np.argmax(above <= 0.0)) if (above <= 0.0).any() else count - 1
        if first == 0:
            return begin
        share = above[first - 1] / (above[first - 1] - above[first]) if above[first] < 0 else 1.0
        return float(time[first - 1] + share * (time[first] - time[first - 1]))

    def _whole_time(self, reading_um: float) -> float:
        if self.reading_um <= reading_um:
            return 0.0
        grid = self.unit.time_constant_s * _BRACKETS
        down = self.reading(grid) <= reading_um
        if not down.any():
            raise InputError(
                f"a reading that takes more than {grid[-1]:.3g} s to come down to {reading_um:g} µm",
                expected="a threshold that the mean course reaches",
                where="thresholds_v",
                advice="set the thresholds within what is ground",
            )
        first = int(np.argmax(down))
        low, high = (float(grid[first - 1]) if first else 0.0), float(grid[first])
        for _ in range(_ROUNDS):
            grid = np.linspace(low, high, _PER_ROUND)
            above = self.reading(grid) - reading_um
            first = max(int(np.argmax(above <= 0.0)), 1)
            low, high = float(grid[first - 1]), float(grid[first])
        fall = float(above[first - 1] - above[first])
        return low + (high - low) * float(above[first - 1]) / fall if fall > 0 else high

    def next_stage(self, after_s: float, rate_um_per_s: float) -> "MeanCourse":
        """The feed that follows when this one has acted for so long."""
        return replace(
            self,
            allowance_um=float(self.allowance(after_s)),
            reading_um=float(self.reading(after_s)),
            rate_um_per_s=rate_um_per_s,
            start_rate=float(self.removal(after_s)),
            turn=self.turn + after_s * self.surface.workpiece_rpm / 60.0,
        )

    def size(self, time_s: ArrayLike, delay_s: float) -> Vector:
        """What is left when the last command is given at `time_s` and the springs have relaxed, same shape [µm]."""
        stop = np.asarray(time_s, dtype=np.float64) + delay_s
        return np.asarray(self.allowance(stop) - self.lag_s * self.removal(stop))


def threshold_readings_um(setup: GaugedGrinding) -> list[float]:
    """Mean readings at which the relay acts, peaks of a ripple being at the thresholds [µm]."""
    return [(volts - setup.gauge.bias_v) / setup.gauge.gain_v_per_um for volts in setup.mean_thresholds_v]


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


def stage_courses(setup: GaugedGrinding, pace: float = 1.0, turn: float = 0.0) -> list[MeanCourse]:
    """The feeds of a part, the first one first, whose allowance falls `pace` times as with mean feed and fresh wheel.

    By the line and without noise; the workpiece begins the first stage at `turn`.
    """
    levels, rates = threshold_readings_um(setup), setup.rates_um_per_s
    unit = LinearGauge(1.0, 0.0, setup.gauge.time_constant_s)
    lag_s, x = setup.grinding.lag_s, setup.grinding.allowance_um
    first = rates[0] * pace
    courses = [MeanCourse(unit, x, x, first, 0.0 if lag_s > 0 else first, lag_s, setup.surface, turn)]
    for level, rate in zip(levels[:-1], rates[1:], strict=True):
        courses.append(courses[-1].next_stage(courses[-1].time_of(level) + setup.relay.delay_s, rate * pace))
    return courses


_SPEEDS, _SPREAD, _STEPS, _MOST_STEPS, _PER_CLUMP, _MEMORY = 10, 5.0, 150, 3000, 7.0, 10.0
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(8)
_CLUMP_TIMES, _CLUMP_LENGTH, _PLACES, _NEAR = 160, 40.0, 60, 0.5


def smoothed_decay(filter_s: float, rate_per_s: float, time_s: Vector) -> Vector:
    """exp(−β·t) through the filter from 0, shape of `time_s`."""
    slow, fast = sorted((1.0 / filter_s, rate_per_s))
    z = (fast - slow) * time_s
    ratio = np.where(z > 1e-9, -np.expm1(-z) / np.where(z > 1e-9, z, 1.0), 1.0)
    return np.asarray(time_s / filter_s * np.exp(-slow * time_s) * ratio)


def steps_needed(noise: Noise, filter_s: float, deviations: float, duration_s: float) -> int | None:
    """Steps that resolve clumps while parts trip; None: so many that they are rare, and `clump_survival` holds.

    A reading that came from so many standard `deviations` above its mean does not stay there for long.
    """
    clump_s = (1.0 / noise.rate_per_s + filter_s) / (1.0 + 0.5 * deviations**2)
    wanted = duration_s * _PER_CLUMP / clump_s
    return None if wanted > _MOST_STEPS else max(_STEPS, math.ceil(wanted))


def renewal_survival(course: MeanCourse, reading_um: float, noise: Noise, time_s: Vector) -> Vector:
    """Share that has not tripped at evenly spaced times, by the equation of first passage, shape of `time_s`.

    Times that do not differ are a moment at which all have tripped, or none may: then the share that is above.
    """
    filter_s, step = course.unit.time_constant_s, float(time_s[1] - time_s[0])
    if step <= 0:
        return np.asarray(ndtr((course.reading(time_s) - reading_um) / _smoothed_sd(noise, filter_s)))
    middle = 0.5 * (time_s[1:] + time_s[:-1])
    above = course.reading(middle) - reading_um
    approach = (course.reading(middle) - course.allowance(middle)) / filter_s
    weight, pull = _speeds(noise, filter_s, approach)
    keep, through, deviation = _spreading(noise, filter_s, middle - float(time_s[0]))
    distance = course.reading(time_s) - reading_um
    below = ndtr(-distance / _smoothed_sd(noise, filter_s))
    passed = np.zeros(len(middle))
    memory = min(math.ceil(_MEMORY * (1.0 / noise.rate_per_s + filter_s) / step), len(middle))
    passed_shares(distance, below, -above, keep, through, deviation, weight, pull, memory, passed)
    return np.asarray(np.maximum(1.0 - below[0] - np.concatenate([[0.0], np.cumsum(passed)]), 0.0))


def clump_survival(course: MeanCourse, reading_um: float, noise: Noise, time_s: Vector) -> Vector:
    """The same where the course hardly moves while a clump lasts: they come one by one, B over their mean length."""
    filter_s = course.unit.time_constant_s
    sd = _smoothed_sd(noise, filter_s)
    places = np.linspace(time_s[0], time_s[-1], _PLACES)
    distance = course.reading(places) - reading_um
    approach = (course.reading(places) - course.allowance(places)) / filter_s
    weight, pull = _speeds(noise, filter_s, approach)
    # a grid that is fine where a clump begins
    edges = _CLUMP_LENGTH * (1.0 / noise.rate_per_s + filter_s) * np.linspace(0.0, 1.0, _CLUMP_TIMES + 1) ** 3
    after, width = 0.5 * (edges[1:] + edges[:-1]), np.diff(edges)
    keep, through, deviation = _spreading(noise, filter_s, after)
    mean = distance[:, None] * (1.0 - keep - through)
    share = np.zeros_like(mean)
    for v in range(_SPEEDS):
        share += weight[:, v, None] * ndtr(-(mean + pull[:, v, None] * through) / deviation)
    below = ndtr(-distance / sd)
    length = np.sum((share - below[:, None]) * width, axis=1)
    # near the mean, where clumps do not end, nobody is left
    known = (distance > _NEAR * sd) & (length > 0.0)
    log_rate = np.log(below[known]) - log_ndtr(distance[known] / sd) - np.log(length[known])
    rate = np.exp(np.interp(time_s, places[known], log_rate))
    passed = np.concatenate([[0.0], np.cumsum(0.5 * (rate[1:] + rate[:-1]) * np.diff(time_s))])
    return np.asarray(ndtr((course.reading(time_s[0]) - reading_um) / sd) * np.exp(-passed))


def _smoothed_sd(noise: Noise, filter_s: float) -> float:
    return noise.sd_um / math.sqrt(1.0 + noise.rate_per_s * filter_s)


def _speeds(noise: Noise, filter_s: float, approach: Vector) -> tuple[Matrix, Matrix]:
    """Weights of speeds of falling through, and T_Φ times the rate of the noise then; shapes (n, n_speeds)."""
    sd = noise.sd_um * math.sqrt(noise.rate_per_s / (filter_s * (1.0 + noise.rate_per_s * filter_s)))
    nodes, shares = np.polynomial.legendre.leggauss(_SPEEDS)
    low = np.maximum(approach - _SPREAD * sd, 0.0)[:, None]
    high = np.maximum(approach, 0.0)[:, None] + _SPREAD * sd
    speed = low + (high - low) * 0.5 * (nodes + 1.0)
    weight = shares * speed * np.exp(-0.5 * ((speed - approach[:, None]) / sd) ** 2)
    return weight / weight.sum(axis=1, keepdims=True), filter_s * (approach[:, None] - speed)


def _spreading(noise: Noise, filter_s: float, time_s: Vector) -> tuple[Vector, Vector, Vector]:
    """What is left of the reading, what comes of the noise, and the standard deviation of what is new since then."""
    edges = np.concatenate([[0.0], time_s])
    at = edges[:-1, None] + np.diff(edges)[:, None] * 0.5 * (_NODES + 1.0)
    squares = (smoothed_decay(filter_s, noise.rate_per_s, at) ** 2 * _WEIGHTS).sum(axis=1) * 0.5 * np.diff(edges)
    deviation = noise.sd_um * np.sqrt(2.0 * noise.rate_per_s * np.cumsum(squares))
    return np.exp(-time_s / filter_s), smoothed_decay(filter_s, noise.rate_per_s, time_s), deviation


_SIGMAS, _POINTS, _MOST_POINTS, _PER_WAVE, _PER_SIGMA = 9.0, 600, 6000, 12, 12
NO_NOISE_UM = 1e-9  #: Noise that is less than this moves no size.
_FAR = -30.0
_FEW_SIGMAS, _SETTLED = 5.0, 5.0
_STARTS = np.polynomial.hermite_e.hermegauss(5)
_FEW, _LONG_GONE = 1e-7, 1e-30
_RELAY_POINTS, _RELAY_PHASES, _FINE = 2001, 16, 20.0


@dataclass(frozen=True)
class PassageLaw:
    """Finished sizes of parts that are all fed alike."""

    #: mean_um and variance_um2: [µm], [µm²]
    mean_um: float
    variance_um2: float
    size_um: Vector  #: (n_probabilities,): Quantiles [µm]


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
            # share that has not tripped in samples that ended above each height; `passed` are its logarithms
            share = np.exp(passed[np.searchsorted(-ends, -height, side="left")])
            survival += share * ndtr(height / sd) / _RELAY_PHASES
    return _law_of(survival, height, probability)


def _law_of(survival: Vector, size: Vector, probability: Vector) -> PassageLaw:
    """From the share of parts that are still ground when they would be left with these falling sizes."""
    distance = size - size[0]
    mean = float(integrate.trapezoid(survival, distance))
    square = float(integrate.trapezoid(2.0 * distance * survival, distance))
    sizes = np.interp(probability, survival[::-1], size[::-1])
    return PassageLaw(float(size[0]) + mean, max(square - mean**2, 0.0), sizes)


def _survival(time: Vector, q: Vector, approach: Vector, sd: float, rate_sd: float) -> Vector:
    """Share that has not yet fallen through; some have at the first time already."""
    mu = approach / rate_sd
    pace = rate_sd * (np.exp(-0.5 * mu**2) / math.sqrt(2 * math.pi) + mu * ndtr(mu))
    # φ/Φ, which far below the threshold is −q
    near = np.maximum(q, _FAR)
    share = np.exp(-0.5 * near**2 - log_ndtr(near)) / math.sqrt(2 * math.pi) * np.maximum(q / _FAR, 1.0)
    hazard = share / sd * np.maximum(pace, 0.0)
    return np.asarray(np.exp(log_ndtr(q[0]) - integrate.cumulative_trapezoid(hazard, time, initial=0)))
