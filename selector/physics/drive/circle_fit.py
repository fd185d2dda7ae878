"""How much of every cause a pair of circles holds: least squares on named columns, their shapes searched."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray
from scipy import fft, optimize

from selector.physics.drive.circle_basis import (
    SMOOTH,
    CirclePair,
    backlash_columns,
    cyclic_columns,
    smooth_columns,
    spike_columns,
)

Vector = NDArray[np.float64]
Matrix = NDArray[np.float64]
Two = tuple[float, float]
T = TypeVar("T", int, float, Two)

WIDEST_SPIKE_RAD = np.radians(15.0)
"""A longer course after a reversal is no spike."""

SHORTEST_WAVE_UM = 1000.0
_ROUNDS = 4
_WIDTHS = 24
_STEEPNESSES = (1.0, 2.0, 4.0, 8.0)
_STEEPEST = 16.0
_BINS = 3600
_CLEAR = 5.0
_ARCS = 72
_SHIFT = 1e-3


@dataclass(frozen=True)
class Shapes:
    """What the columns depend on, axis by axis.

    Attributes
    ----------
    gap_um : tuple of pairs
        Lost motion at the positive and the negative end [µm].
    spike : pairs of two floats
        Time from a reversal to the top of its spike [s] and steepness of its flanks [–].
    wavelength_um : tuple of two floats
        Of the cyclic error [µm].
    spikes_tried, wavelengths_tried : int, tuple of two ints
        Values that a search chose from; 1: it was given.
    """

    gap_um: tuple[Two, Two] = ((0.0, 0.0), (0.0, 0.0))
    spike: tuple[Two, Two] = ((0.0, 1.0), (0.0, 1.0))
    wavelength_um: Two = (0.0, 0.0)
    spikes_tried: int = _WIDTHS * len(_STEEPNESSES)
    wavelengths_tried: tuple[int, int] = (1, 1)


@dataclass(frozen=True, eq=False)
class CircleFit:
    """A fitted pair of circles.

    Attributes
    ----------
    names : tuple of str
        Of the columns.
    columns, coefficients, covariance : ndarrays of shapes (n_samples, n), (n,), (n, n)
        Columns, their amounts [µm], and the covariance of the amounts: from the residual, widened by how much
        neighbours in it resemble each other.
    residual_um : ndarray of shape (n_samples,)
        What remains [µm].
    resemblance : float
        Factor of that widening, 1: neighbours are independent.
    shapes : Shapes
        What the columns were made with.
    """

    names: tuple[str, ...]
    columns: Matrix
    coefficients: Vector
    covariance: Matrix
    residual_um: Vector
    resemblance: float
    shapes: Shapes

    def amounts(self, *names: str) -> tuple[Vector, Matrix]:
        """Amounts of these columns and their covariance."""
        at = [self.names.index(name) for name in names]
        return self.coefficients[at], self.covariance[np.ix_(at, at)]

    def part_um(self, *names: str) -> Vector:
        """Part of the deviation that these columns make, shape (n_samples,) [µm]."""
        at = [self.names.index(name) for name in names]
        return np.asarray(self.columns[:, at] @ self.coefficients[at])


NAMES = (
    *SMOOTH,
    *(f"backlash {axis}{end}" for axis in (0, 1) for end in "+-"),
    *(f"spike {axis}{end}" for axis in (0, 1) for end in "+-"),
    *(f"cyclic {axis}{part}" for axis in (0, 1) for part in "cs"),
)


def circle_fit(pair: CirclePair, wavelengths_um: Mapping[int, float] | None = None) -> CircleFit:
    """The fit of one pair; `wavelengths_um`: axis (0, 1) → wavelength of its cyclic error, where it is known [µm].

    In turn, until nothing changes: amounts, width of the gaps, widths of the spikes, wavelengths.
    """
    known = dict(wavelengths_um or {})
    samples = len(pair.angle_rad) / len(pair.parts)
    turn_s = 2.0 * np.pi * pair.radius_um / pair.speed_um_per_s
    narrowest = 2.0 * turn_s / samples
    widths = np.geomspace(narrowest, max(WIDEST_SPIKE_RAD / (2.0 * np.pi) * turn_s, 2.0 * narrowest), _WIDTHS)
    middle = (float(widths[_WIDTHS // 2]), _STEEPNESSES[1])
    shapes = Shapes(spike=(middle, middle))
    for number in range(_ROUNDS):
        before = shapes
        for axis in (0, 1):
            shapes = replace(shapes, spike=_with(shapes.spike, axis, _spike(pair, shapes, axis, widths, number < 2)))
        columns = _columns(pair, shapes)
        amounts = np.linalg.lstsq(columns, pair.deviation_um, rcond=None)[0]
        gaps = [float(abs(one)) for one in amounts[len(SMOOTH) : len(SMOOTH) + 4]]
        shapes = replace(shapes, gap_um=((gaps[0], gaps[1]), (gaps[2], gaps[3])))
        residual = pair.deviation_um - columns @ amounts
        for axis in (0, 1):
            if axis in known:
                wave, tried = known[axis], 1
            elif number == 0:
                wave, tried = _wavelength(pair, axis, residual)
                found = cyclic_columns(pair, axis, wave)
                residual = residual - found @ np.linalg.lstsq(found, residual, rcond=None)[0]
            else:
                wave, tried = _nearer_wavelength(pair, shapes, axis), shapes.wavelengths_tried[axis]
            waves, tries = _with(shapes.wavelength_um, axis, wave), _with(shapes.wavelengths_tried, axis, tried)
            shapes = replace(shapes, wavelength_um=waves, wavelengths_tried=tries)
        if number > 0 and _alike(before, shapes):
            break
    return _solved(pair, shapes)


def _with(two: tuple[T, T], axis: int, value: T) -> tuple[T, T]:
    return (value, two[1]) if axis == 0 else (two[0], value)


def _alike(one: Shapes, other: Shapes) -> bool:
    gaps = np.abs(np.subtract(one.gap_um, other.gap_um)).max()
    ratios = np.log(np.divide([*one.spike, one.wavelength_um], [*other.spike, other.wavelength_um]))
    return bool(gaps <= 1e-3 * max(1.0, float(np.max(other.gap_um))) and np.abs(ratios).max() <= 1e-3)


def _columns(pair: CirclePair, shapes: Shapes, without: str = "") -> Matrix:
    """The columns of `NAMES`; waves without a wavelength, and those whose name begins with `without`, are left out."""
    parts = [("smooth", smooth_columns(pair))]
    parts += [(f"backlash {axis}", backlash_columns(pair, axis, shapes.gap_um[axis])) for axis in (0, 1)]
    parts += [(f"spike {axis}", spike_columns(pair, axis, shapes.spike[axis])) for axis in (0, 1)]
    parts += [
        (f"cyclic {axis}", cyclic_columns(pair, axis, shapes.wavelength_um[axis]))
        for axis in (0, 1)
        if shapes.wavelength_um[axis] > 0
    ]
    return np.column_stack([columns for name, columns in parts if name != without])


def _solved(pair: CirclePair, shapes: Shapes) -> CircleFit:
    columns = _columns(pair, shapes)
    amounts = np.asarray(np.linalg.lstsq(columns, pair.deviation_um, rcond=None)[0], dtype=np.float64)
    residual = np.asarray(pair.deviation_um - columns @ amounts)
    resemblance = float(np.mean([_resemblance(residual[part]) for part in pair.parts]))
    variance = float(residual @ residual) / (len(residual) - columns.shape[1]) * resemblance
    inverse = _inverse(columns)
    searched, names = _slopes(pair, shapes, columns, amounts, np.asarray(np.sqrt(variance * np.diag(inverse))))
    every = np.column_stack([columns, searched])
    inverse = _inverse(every)
    wider = _widened(pair, every, residual, inverse, variance)
    covariance = variance * inverse * np.outer(wider, wider)
    return CircleFit((*NAMES, *names), columns, amounts, covariance, residual, resemblance, shapes)


def _widened(pair: CirclePair, columns: Matrix, residual: Vector, inverse: Matrix, variance: float) -> Vector:
    """Factor by which the error of each amount grows where the residual is larger just where its column is.

    From the scores of arcs of 5°, each an independent piece; never below 1, since few arcs hold a spike.
    """
    arcs = np.floor((pair.angle_rad % (2.0 * np.pi)) / (2.0 * np.pi) * _ARCS).astype(np.int64) % _ARCS
    pieces = arcs + _ARCS * (pair.direction < 0)
    moved = (columns @ inverse) * residual[:, None]
    summed = np.array([np.bincount(pieces, column, 2 * _ARCS) for column in moved.T])
    return np.sqrt(np.maximum((summed**2).sum(axis=1) / (variance * np.diag(inverse)), 1.0))


def _inverse(columns: Matrix) -> Matrix:
    """(XᵀX)⁻¹."""
    scale = np.linalg.norm(columns, axis=0)
    scaled = columns / scale
    return np.asarray(np.linalg.pinv(scaled.T @ scaled, hermitian=True) / np.outer(scale, scale))


def _slopes(
    pair: CirclePair, shapes: Shapes, columns: Matrix, amounts: Vector, errors: Vector
) -> tuple[Matrix, tuple[str, ...]]:
    """How the fit moves with the logarithm of the shapes that stand out of the noise: their errors widen the others."""
    slopes, names = [np.empty((len(columns), 0))], []
    for axis in (0, 1):
        wave, (width, steepness) = shapes.wavelength_um[axis], shapes.spike[axis]

        def wavy(by: float, axis: int = axis, wave: float = wave) -> Matrix:
            return cyclic_columns(pair, axis, wave * by)

        def wide(by: float, axis: int = axis, width: float = width, steepness: float = steepness) -> Matrix:
            return spike_columns(pair, axis, (width * by, steepness))

        def steep(by: float, axis: int = axis, width: float = width, steepness: float = steepness) -> Matrix:
            return spike_columns(pair, axis, (width, steepness * by))

        for kind, ends, made in (
            ("cyclic", "cs", {"wavelength": wavy}),
            ("spike", "+-", {"width": wide, "steepness": steep}),
        ):
            at = [NAMES.index(f"{kind} {axis}{end}") for end in ends]
            if (np.abs(amounts[at]) > _CLEAR * errors[at]).any():
                for shape, make in made.items():
                    moved = make(math.exp(_SHIFT)) - make(math.exp(-_SHIFT))
                    slopes.append((moved @ amounts[at] / (2.0 * _SHIFT))[:, None])
                    names.append(f"{kind} {axis} {shape}")
    return np.column_stack(slopes), tuple(names)


def _gain(pair: CirclePair, rest: Matrix) -> Callable[[Matrix], float]:
    """Columns → how much of the sum of squares they take beside `rest`."""
    inverse = _inverse(rest)
    left = pair.deviation_um - rest @ (inverse @ (rest.T @ pair.deviation_um))

    def gain(columns: Matrix) -> float:
        shared, score = rest.T @ columns, columns.T @ left
        gram = columns.T @ columns - shared.T @ inverse @ shared
        return float(score @ np.linalg.lstsq(gram, score, rcond=1e-9)[0])

    return gain


def _spike(pair: CirclePair, shapes: Shapes, axis: int, widths: Vector, anywhere: bool) -> Two:
    """Width [s] and steepness of the spikes of an axis that leave the least of the deviation."""
    gain = _gain(pair, _columns(pair, shapes, f"spike {axis}"))

    def shape(logs: Vector) -> Two:
        # flanks of two samples at least: less is a stray sample, not a spike
        width = math.exp(logs[0])
        return width, min(math.exp(logs[1]), max(1.0, (width / widths[0]) ** 2))

    def lost(logs: Vector) -> float:
        return -gain(spike_columns(pair, axis, shape(logs)))

    begin = np.log(shapes.spike[axis])
    if anywhere:
        asked = [np.log([width, steepness]) for steepness in _STEEPNESSES for width in widths]
        begin = min(asked, key=lost)
    found = optimize.minimize(
        lost,
        begin,
        method="Nelder-Mead",
        bounds=[(math.log(widths[0]), math.log(widths[-1])), (0.0, math.log(_STEEPEST))],
        options={"xatol": 1e-3, "fatol": 1e-9 * float(pair.deviation_um @ pair.deviation_um), "maxfev": 60},
    )
    return shape(found.x)


def _nearer_wavelength(pair: CirclePair, shapes: Shapes, axis: int) -> float:
    """A wavelength [µm] searched again near the last one, beside all other columns."""
    gain = _gain(pair, _columns(pair, shapes, f"cyclic {axis}"))
    last = 1.0 / shapes.wavelength_um[axis]
    spacing = 1.0 / (8.0 * pair.radius_um)
    found = optimize.minimize_scalar(
        lambda per_um: -gain(cyclic_columns(pair, axis, 1.0 / per_um)),
        bounds=(last - spacing, last + spacing),
        method="bounded",
        options={"xatol": 1e-3 * spacing},
    )
    return 1.0 / float(found.x)


def _wavelength(pair: CirclePair, axis: int, residual: Vector) -> tuple[float, int]:
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


def _resemblance(residual: Vector) -> float:
    """1 + 2·Σ autocorrelations up to the first that is not positive: how many samples count as one."""
    n = len(residual)
    spectrum = np.abs(fft.rfft(residual - residual.mean(), n=n)) ** 2
    covariance = fft.irfft(spectrum, n=n)
    if covariance[0] <= 0.0:
        return 1.0
    share = covariance[1 : n // 2] / covariance[0]
    # a chance correlation of 2/√n or less counts as none
    ends = np.flatnonzero(share < 2.0 / np.sqrt(n))
    return float(1.0 + 2.0 * share[: ends[0] if len(ends) else len(share)].sum())
