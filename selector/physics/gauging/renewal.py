"""How many parts have not yet tripped, noise taken as it is: crossings that come in clumps count once.

Whoever is below the threshold at t fell through it for the first time at some s before: B(t) = ∫ f(s)·K(t, s) ds, with
B the share of noise that is below and K the share that is below at t of what fell through at s (R. Fortet, Journal de
Mathématiques Pures et Appliquées 22, 1943; J. Durbin, Journal of Applied Probability 22, 1985). Noise and filter are a
Gauss–Markov pair, so K follows from the reading, which is at the threshold, and its speed. Of the speed at the first
passage the law of all passages is taken, v·φ((v − μ)/σ') after Rice; what that costs is a few hundredths of the spread.
A filter that hardly smooths, whose crossings after Rice would be without number, is no difficulty.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray
from scipy.special import log_ndtr, ndtr

from selector.physics.gauging._renewal_kernel import passed_shares
from selector.physics.gauging.mean_course import MeanCourse
from selector.physics.gauging.process import Noise

Vector = NDArray[np.float64]
Matrix = NDArray[np.float64]

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
