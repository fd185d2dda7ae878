"""Which shapes of spikes and waves leave the least of a pair of circles: searches beside all other columns."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from scipy import optimize

from selector.physics.drive.circle_basis import CirclePair, cyclic_columns, spike_columns

Vector = NDArray[np.float64]
Matrix = NDArray[np.float64]
Two = tuple[float, float]

WIDEST_SPIKE_RAD = np.radians(15.0)
"""A longer course after a reversal is no spike."""

SHORTEST_WAVE_UM = 1000.0
WIDTHS = 24
STEEPNESSES = (1.0, 2.0, 4.0, 8.0)
_STEEPEST = 16.0
_BINS = 3600


def spike_widths_s(pair: CirclePair) -> Vector:
    """Times from a reversal to the top of its spike that are tried, from two samples on [s]."""
    samples = len(pair.angle_rad) / len(pair.parts)
    turn_s = 2.0 * np.pi * pair.radius_um / pair.speed_um_per_s
    narrowest = 2.0 * turn_s / samples
    widest = max(WIDEST_SPIKE_RAD / (2.0 * np.pi) * turn_s, 2.0 * narrowest)
    return np.asarray(np.geomspace(narrowest, widest, WIDTHS))


def inverse_gram(columns: Matrix) -> Matrix:
    """(XᵀX)⁻¹."""
    scale = np.linalg.norm(columns, axis=0)
    scaled = columns / scale
    return np.asarray(np.linalg.pinv(scaled.T @ scaled, hermitian=True) / np.outer(scale, scale))


def _gain(pair: CirclePair, rest: Matrix) -> Callable[[Matrix], float]:
    """Columns → how much of the sum of squares they take beside `rest`."""
    inverse = inverse_gram(rest)
    left = pair.deviation_um - rest @ (inverse @ (rest.T @ pair.deviation_um))

    def gain(columns: Matrix) -> float:
        # spikes are 0 nearly everywhere
        there = np.flatnonzero(columns.any(axis=1))
        shared, score = rest[there].T @ columns[there], columns[there].T @ left[there]
        gram = columns.T @ columns - shared.T @ inverse @ shared
        return float(score @ np.linalg.lstsq(gram, score, rcond=1e-9)[0])

    return gain


def nearest_spike(pair: CirclePair, rest: Matrix, axis: int, last: Two, anywhere: bool) -> Two:
    """Width [s] and steepness of the spikes of an axis that leave the least of the deviation beside `rest`."""
    gain, widths = _gain(pair, rest), spike_widths_s(pair)

    def shape(logs: Vector) -> Two:
        # flanks of two samples at least: less is a stray sample, not a spike
        width = math.exp(logs[0])
        return width, min(math.exp(logs[1]), max(1.0, (width / widths[0]) ** 2))

    def lost(logs: Vector) -> float:
        return -gain(spike_columns(pair, axis, shape(logs)))

    begin = np.log(last)
    if anywhere:
        asked = [np.log([width, steepness]) for steepness in STEEPNESSES for width in widths]
        begin = min(asked, key=lost)
    found = optimize.minimize(
        lost,
        begin,
        method="Nelder-Mead",
        bounds=[(math.log(widths[0]), math.log(widths[-1])), (0.0, math.log(_STEEPEST))],
        options={"xatol": 1e-3, "fatol": 1e-9 * float(pair.deviation_um @ pair.deviation_um), "maxfev": 60},
    )
    return shape(found.x)


def nearer_wavelength(pair: CirclePair, rest: Matrix, axis: int, last_um: float) -> float:
    """A wavelength [µm] searched again near the last one, beside `rest`."""
    gain = _gain(pair, rest)
    last = 1.0 / last_um
    low, high = pair.ends[axis]
    spacing = 1.0 / (4.0 * pair.radius_um * (high - low))
    found = optimize.minimize_scalar(
        lambda per_um: -gain(cyclic_columns(pair, axis, 1.0 / per_um)),
        bounds=(last - spacing, last + spacing),
        method="bounded",
        options={"xatol": 1e-3 * spacing},
    )
    return 1.0 / float(found.x)


def likeliest_wavelength(pair: CirclePair, axis: int, residual: Vector) -> tuple[float, int]:
    """Wavelength [µm] along an axis that takes the most out of a residual, and how many could be told apart.

    From `SHORTEST_WAVE_UM`, or four samples, to half the radius: four periods along the travel at least.
    """
    low, high = pair.ends[axis]
    half_um = pair.radius_um * (high - low) / 2.0
    longest = half_um / 2.0
    samples = 8.0 * np.pi * half_um / (len(pair.angle_rad) / len(pair.parts))
    shortest = min(max(SHORTEST_WAVE_UM, samples), longest / 2.0)
    # of directions that lead through other places each has bins of its own
    bins = np.floor((pair.turned_rad % (2.0 * np.pi)) / (2.0 * np.pi) * _BINS).astype(np.int64) % _BINS
    turned = (np.arange(_BINS) + 0.5) * 2.0 * np.pi / _BINS
    if not pair.turns_whole:
        bins, turned = bins + _BINS * (pair.direction < 0), np.concatenate([turned, turned - 2.0 * np.pi])
    weight = np.bincount(bins, minlength=len(turned)).astype(np.float64)
    summed = np.bincount(bins, residual, len(turned))
    mean = np.divide(summed, weight, out=np.zeros(len(turned)), where=weight > 0)
    bar = pair.start_angle_rad + turned
    along = np.cos(bar) if axis == 0 else np.sin(bar)
    place, size = pair.radius_um * pair.places_at(turned)[axis], weight * along

    def power(per_um: float) -> float:
        wave = np.exp(2j * np.pi * per_um * place)
        # amplitude² times what carries it: the drop of the sum of squares by cosine and sine
        a = np.array([along * wave.real, along * wave.imag])
        gram, score = (a * weight) @ a.T, a @ (weight * mean)
        return float(score @ np.linalg.solve(gram, score))

    spacing = 1.0 / (8.0 * half_um)
    asked = np.arange(1.0 / longest, 1.0 / shortest, spacing)
    rough = np.abs(np.exp(2j * np.pi * np.outer(asked, place)) @ (size * mean))
    best = asked[int(np.argmax(rough))]
    found = optimize.minimize_scalar(
        lambda one: -power(one),
        bounds=(best - spacing, best + spacing),
        method="bounded",
        options={"xatol": 1e-3 * spacing},
    )
    return 1.0 / float(found.x), max(1, len(asked) // 2)
