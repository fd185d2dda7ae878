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
        shared, score = rest.T @ columns, columns.T @ left
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
    spacing = 1.0 / (8.0 * pair.radius_um)
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
    longest = pair.radius_um / 2.0
    samples = 8.0 * np.pi * pair.radius_um / (len(pair.angle_rad) / len(pair.parts))
    shortest = min(max(SHORTEST_WAVE_UM, samples), longest / 2.0)
    bins = np.floor((pair.angle_rad % (2.0 * np.pi)) / (2.0 * np.pi) * _BINS).astype(np.int64) % _BINS
    weight = np.bincount(bins, minlength=_BINS).astype(np.float64)
    mean = np.divide(np.bincount(bins, residual, _BINS), weight, out=np.zeros(_BINS), where=weight > 0)
    angle = (np.arange(_BINS) + 0.5) * 2.0 * np.pi / _BINS
    along = np.cos(angle) if axis == 0 else np.sin(angle)
    place, size = pair.radius_um * along, weight * along

    def power(per_um: float) -> float:
        wave = np.exp(2j * np.pi * per_um * place)
        # amplitude² times what carries it: the drop of the sum of squares by cosine and sine
        a = np.array([along * wave.real, along * wave.imag])
        gram, score = (a * weight) @ a.T, a @ (weight * mean)
        return float(score @ np.linalg.solve(gram, score))

    spacing = 1.0 / (8.0 * pair.radius_um)
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
