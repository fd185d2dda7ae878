"""How much of every cause a pair of circles holds: least squares on named columns, their shapes searched."""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np
from scipy import fft, optimize, stats

from selector.physics.drive.ball_bar.basis import CirclePair, backlash_columns, cyclic_columns, spike_columns
from selector.types import Matrix, Vector

Two = tuple[float, float]

WIDEST_SPIKE_RAD = np.radians(15.0)  #: A longer course after a reversal is no spike.
SHORTEST_WAVE_UM = 1000.0
WIDTHS = 24
STEEPNESSES = (0.15, 0.3, 0.6, 1.0, 2.0, 4.0, 8.0)
_FLATTEST, _STEEPEST = 0.05, 16.0
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
    """Two columns → how much of the sum of squares they take beside `rest`."""
    inverse = inverse_gram(rest)
    left = pair.deviation_um - rest @ (inverse @ (rest.T @ pair.deviation_um))

    def gain(columns: Matrix) -> float:
        # spikes are 0 nearly everywhere
        near = np.flatnonzero(np.logical_or(*columns.T))
        is_narrow = len(near) < len(columns)
        beside, own, aim = (one.take(near, axis=0) if is_narrow else one for one in (rest, columns, left))
        shared, score = beside.T @ own, own.T @ aim
        gram = own.T @ own - shared.T @ inverse @ shared
        (a, b), (_, c) = gram.tolist()
        first, second = score.tolist()
        if a * c - b * b <= 1e-8 * (a + c) ** 2:
            return float(score @ np.linalg.lstsq(gram, score, rcond=1e-9)[0])
        return float((c * first**2 - 2.0 * b * first * second + a * second**2) / (a * c - b * b))

    return gain


def nearest_spike(pair: CirclePair, rest: Matrix, axis: int, last: Two, anywhere: bool) -> Two:
    """Width [s] and steepness of the spikes of an axis that leave the least of the deviation beside `rest`."""
    gain, widths = _gain(pair, rest), spike_widths_s(pair)

    def shape(logs: Vector) -> Two:
        # flanks of two samples at least: less is a stray sample, not a spike
        width = math.exp(logs[0])
        wide = width / widths[0]
        return width, min(max(math.exp(logs[1]), (1.0 + wide) ** -0.5), max(1.0, wide**2))

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
        bounds=[(math.log(widths[0]), math.log(widths[-1])), (math.log(_FLATTEST), math.log(_STEEPEST))],
        options={"xatol": 1e-3, "fatol": 1e-9 * float(pair.deviation_um @ pair.deviation_um), "maxfev": 60},
    )
    return shape(found.x)


def nearer_wavelength(pair: CirclePair, rest: Matrix, axis: int, last_um: float) -> float:
    """A wavelength [µm] searched again near the last one, beside `rest`."""
    gain = _gain(pair, rest)
    last = 1.0 / last_um
    low, high = pair.courses[axis].ends
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
    low, high = pair.courses[axis].ends
    half_um = pair.radius_um * (high - low) / 2.0
    longest = half_um / 2.0
    samples = 8.0 * np.pi * half_um / (len(pair.angle_rad) / len(pair.parts))
    shortest = min(max(SHORTEST_WAVE_UM, samples), longest / 2.0)
    # of directions that lead through other places each has bins of its own
    bins = np.floor((pair.turned_rad % (2.0 * np.pi)) / (2.0 * np.pi) * _BINS).astype(np.int64) % _BINS
    turned = (np.arange(_BINS) + 0.5) * 2.0 * np.pi / _BINS
    if pair.table_ball is not None and not float(pair.table_ball.ratio).is_integer():
        bins, turned = bins + _BINS * (pair.direction < 0), np.concatenate([turned, turned - 2.0 * np.pi])
    weight = np.bincount(bins, minlength=len(turned)).astype(np.float64)
    summed = np.bincount(bins, residual, len(turned))
    mean = np.divide(summed, weight, out=np.zeros(len(turned)), where=weight > 0)
    bar = pair.start_angle_rad + turned
    along = np.cos(bar) if axis == 0 else np.sin(bar)
    place, size = pair.radius_um * pair.places_at(turned)[axis], weight * along

    def power(per_um: float) -> float:
        phase = 2.0 * np.pi * per_um * place
        # amplitude² times what carries it: the drop of the sum of squares by cosine and sine
        a = np.array([along * np.cos(phase), along * np.sin(phase)])
        gram, score = (a * weight) @ a.T, a @ (weight * mean)
        return float(score @ np.linalg.solve(gram, score))

    spacing = 1.0 / (8.0 * half_um)
    asked = np.arange(1.0 / longest, 1.0 / shortest, spacing)
    # each wave along the places from the one before: an exponential costs far more than a product
    wave, step, rough = size * mean * np.exp(2j * np.pi * asked[0] * place), np.exp(2j * np.pi * spacing * place), []
    for _ in asked:
        rough.append(abs(wave.sum()))
        wave = wave * step
    best = asked[int(np.argmax(rough))]
    found = optimize.minimize_scalar(
        lambda one: -power(one),
        bounds=(best - spacing, best + spacing),
        method="bounded",
        options={"xatol": 1e-3 * spacing},
    )
    return 1.0 / float(found.x), max(1, len(asked) // 2)


T = TypeVar("T", int, float, Two)

#: Chance of a searched shape by noise below which its columns are taken in: a twelfth of 1 %, of twelve causes.
ALARM = 0.01 / 12
#: Block of columns whose shape is searched → its columns.
SEARCHED = {f"{kind} {axis}": ends for kind, ends in (("spike", "+-"), ("cyclic", "cs")) for axis in (0, 1)}
_ROUNDS = 4
_CLEAR = 5.0
_ARCS = 72
_WINDOWS_RAD = tuple(np.radians([5.0, 10.0, 20.0, 40.0]))
_SHIFT = 1e-3


@dataclass(frozen=True)
class Shapes:
    """What the columns depend on, axis by axis."""

    gap_um: tuple[Two, Two] = ((0.0, 0.0), (0.0, 0.0))  #: Lost motion at the positive and the negative end [µm]
    #: Time from a reversal to the top of its spike [s] and steepness of its flanks [–]
    spike: tuple[Two, Two] = ((0.0, 1.0), (0.0, 1.0))
    wavelength_um: Two = (0.0, 0.0)  #: Of the cyclic error [µm]
    #: spikes_tried and wavelengths_tried: Values that a search chose from; 1: it was given
    spikes_tried: int = WIDTHS * len(STEEPNESSES)
    wavelengths_tried: tuple[int, int] = (1, 1)


@dataclass(frozen=True, eq=False)
class CircleFit:
    """A fitted pair of circles."""

    names: tuple[str, ...]  #: Of the columns, then of the shapes whose errors widen theirs
    #: columns, coefficients and covariance: Columns, their amounts [µm], and the covariance of the amounts: from the
    #: residual, widened by how much neighbours in it resemble each other
    columns: Matrix
    coefficients: Vector
    covariance: Matrix
    residual_um: Vector  #: (n_samples,): What remains [µm]
    resemblance: float  #: Factor of that widening, 1: neighbours are independent
    shapes: Shapes  #: What the columns were made with
    #: Block of `SEARCHED` that does not stand out of the noise and is not among the columns → what it would be
    set_aside: Mapping[str, tuple[Vector, Matrix]]

    def amounts(self, *names: str) -> tuple[Vector, Matrix]:
        """Amounts of these columns and their covariance."""
        block = names[0][:-1]
        if block in self.set_aside:
            values, covariance = self.set_aside[block]
            own = [SEARCHED[block].index(name[-1]) for name in names]
            return values[own], covariance[np.ix_(own, own)]
        at = [self.names.index(name) for name in names]
        return self.coefficients[at], self.covariance[np.ix_(at, at)]

    def part_um(self, *names: str) -> Vector:
        """Part of the deviation that these columns make, shape (n_samples,) [µm]; nothing if they are left out."""
        at = [self.names.index(name) for name in names if name in self.names]
        return np.asarray(self.columns[:, at] @ self.coefficients[at])


def circle_fit(pair: CirclePair, wavelengths_um: Mapping[int, float] | None = None) -> CircleFit:
    """The fit of one pair; `wavelengths_um`: axis (0, 1) → wavelength of its cyclic error, where it is known [µm].

    First with all shapes, searched in turn until nothing changes: amounts, gaps, spikes, wavelengths. Then without
    those that do not stand out of the noise, the least one first (why: docs/explanation/ball-bar.md).
    """
    known = dict(wavelengths_um or {})
    widths = spike_widths_s(pair)
    middle = (float(widths[WIDTHS // 2]), 2.0)
    shapes, kept = Shapes(spike=(middle, middle)), tuple(SEARCHED)
    for number in range(_ROUNDS):
        before = shapes
        shapes = _searched(pair, shapes, kept, known, number)
        gaps = np.abs(np.subtract(before.gap_um, shapes.gap_um)).max() <= 1e-3 * max(1.0, float(np.max(shapes.gap_um)))
        if number > 0 and gaps:
            old, new = ([*one.spike, one.wavelength_um] for one in (before, shapes))
            if np.abs(np.log(np.divide(old, new))).max() <= 1e-3:
                break
    while True:
        fit = _solved(pair, shapes, kept)
        chances = {block: block_probability(fit, block) for block in kept}
        weakest = max(chances, key=lambda block: chances[block], default="")
        if not kept or chances[weakest] < ALARM:
            return _solved(pair, shapes, kept, aside=True)
        kept = tuple(block for block in kept if block != weakest)
        for number in (_ROUNDS, _ROUNDS + 1):
            shapes = _searched(pair, shapes, kept, known, number)


def block_probability(fit: CircleFit, block: str) -> float:
    """Chance of amounts like those of a block of `SEARCHED` by noise, the best of all shapes that were tried taken."""
    kind, axis = block.split()
    tried = fit.shapes.spikes_tried if kind == "spike" else fit.shapes.wavelengths_tried[int(axis)]
    return amounts_probability(*fit.amounts(*(block + end for end in SEARCHED[block])), tried)


def amounts_probability(values: Vector, covariance: Matrix, tried: int = 1) -> float:
    """Chance of such amounts by noise, the best of `tried` shapes taken."""
    if not values.any():
        return 1.0
    try:
        distance = float(values @ np.linalg.solve(covariance, values))
    except np.linalg.LinAlgError:  # nothing remains, so nothing is uncertain
        return 0.0
    return min(1.0, tried * float(stats.chi2.sf(distance, len(values))))


def _searched(
    pair: CirclePair, shapes: Shapes, kept: tuple[str, ...], known: Mapping[int, float], number: int
) -> Shapes:
    """The shapes after one more round; in the first rounds spikes and waves are searched everywhere."""
    for axis in (0, 1):
        if f"spike {axis}" in kept:
            rest = _columns(pair, shapes, kept, f"spike {axis}")
            spike = nearest_spike(pair, rest, axis, shapes.spike[axis], number < 2)
            shapes = replace(shapes, spike=_with(shapes.spike, axis, spike))
    columns = _columns(pair, shapes, kept)
    amounts = np.linalg.lstsq(columns, pair.deviation_um, rcond=None)[0]
    gaps = [float(abs(one)) for one in amounts[len(pair.smooth) : len(pair.smooth) + 4]]
    shapes = replace(shapes, gap_um=((gaps[0], gaps[1]), (gaps[2], gaps[3])))
    residual = pair.deviation_um - columns @ amounts
    for axis in (0, 1):
        if f"cyclic {axis}" not in kept:
            continue
        if axis in known:
            wave, tried = known[axis], 1
        elif number == 0:
            wave, tried = likeliest_wavelength(pair, axis, residual)
            found = cyclic_columns(pair, axis, wave)
            residual = residual - found @ np.linalg.lstsq(found, residual, rcond=None)[0]
        else:
            rest = _columns(pair, shapes, kept, f"cyclic {axis}")
            wave = nearer_wavelength(pair, rest, axis, shapes.wavelength_um[axis])
            tried = shapes.wavelengths_tried[axis]
        waves, tries = _with(shapes.wavelength_um, axis, wave), _with(shapes.wavelengths_tried, axis, tried)
        shapes = replace(shapes, wavelength_um=waves, wavelengths_tried=tries)
    return shapes


def _with(two: tuple[T, T], axis: int, value: T) -> tuple[T, T]:
    return (value, two[1]) if axis == 0 else (two[0], value)


def _block_columns(pair: CirclePair, shapes: Shapes, block: str) -> Matrix:
    kind, axis = block.split()[0], int(block.split()[1])
    if kind == "spike":
        return spike_columns(pair, axis, shapes.spike[axis])
    return cyclic_columns(pair, axis, shapes.wavelength_um[axis])


def _columns(pair: CirclePair, shapes: Shapes, kept: tuple[str, ...], without: str = "") -> Matrix:
    """Smooth columns, backlash, and the blocks that are kept; waves that have no wavelength yet are left out."""
    parts = [*pair.smooth.values(), *(backlash_columns(pair, axis, shapes.gap_um[axis]) for axis in (0, 1))]
    parts += [
        _block_columns(pair, shapes, block)
        for block in kept
        if block != without and (block.startswith("spike") or shapes.wavelength_um[int(block[-1])] > 0)
    ]
    return np.column_stack(parts)


def _solved(pair: CirclePair, shapes: Shapes, kept: tuple[str, ...], *, aside: bool = False) -> CircleFit:
    """Amounts and their errors; with `aside` also those of the blocks that are not kept, each beside the others."""
    columns = _columns(pair, shapes, kept)
    names = _names(pair, kept)
    amounts = np.asarray(np.linalg.lstsq(columns, pair.deviation_um, rcond=None)[0], dtype=np.float64)
    residual = np.asarray(pair.deviation_um - columns @ amounts)
    resemblance = float(np.mean([_resemblance(residual[part]) for part in pair.parts]))
    variance = float(residual @ residual) / (len(residual) - columns.shape[1]) * resemblance
    inverse = inverse_gram(columns)
    errors = np.asarray(np.sqrt(variance * np.diag(inverse)))
    searched, shape_names = _slopes(
        pair, shapes, kept, dict(zip(names, zip(amounts, errors, strict=True), strict=True))
    )
    every = np.column_stack([columns, searched])
    every_inverse = inverse_gram(every)
    wider = _widened(pair, every, residual, every_inverse, variance)
    wider *= _mistaken(pair, kept, columns, residual, variance, np.diag(every_inverse) * wider**2) if aside else 1.0
    covariance = variance * every_inverse * np.outer(wider, wider)
    set_aside = {}
    for block in SEARCHED if aside else ():
        if block not in kept:
            own = _block_columns(pair, shapes, block)
            own = own - columns @ (inverse @ (columns.T @ own))
            gram = inverse_gram(own)
            set_aside[block] = (np.asarray(gram @ (own.T @ residual)), variance * gram)
    return CircleFit((*names, *shape_names), columns, amounts, covariance, residual, resemblance, shapes, set_aside)


def _widened(pair: CirclePair, columns: Matrix, residual: Vector, inverse: Matrix, variance: float) -> Vector:
    """Factor by which the error of each amount grows where the residual is larger just where its column is.

    From the scores of arcs of 5°, each an independent piece; never below 1, since few arcs hold a spike.
    """
    arcs = np.floor((pair.angle_rad % (2.0 * np.pi)) / (2.0 * np.pi) * _ARCS).astype(np.int64) % _ARCS
    pieces = arcs + _ARCS * (pair.direction < 0)
    moved = (columns @ inverse) * residual[:, None]
    summed = np.array([np.bincount(pieces, column, 2 * _ARCS) for column in moved.T])
    return np.asarray(np.sqrt(np.maximum((summed**2).sum(axis=1) / (variance * np.diag(inverse)), 1.0)))


def _mistaken(
    pair: CirclePair, kept: tuple[str, ...], columns: Matrix, residual: Vector, variance: float, spread: Vector
) -> Vector:
    """Factor by which errors grow since a spike is not of the shape fitted: the amounts without arcs after reversals.

    What moves more than noise moves it (two standard deviations) when the arcs are left out is uncertain by that, and
    a spike by what remains where it is, beyond what remains elsewhere. `spread`: variances of the amounts and of the
    shapes over `variance`.
    """
    axes = [axis for axis in (0, 1) if f"spike {axis}" in kept]
    moved = np.zeros(len(spread))
    for number, name in enumerate(_names(pair, kept)):
        if name.startswith("spike"):
            share = columns[:, number] ** 2
            elsewhere = float(np.mean(residual[share < 1e-4] ** 2))
            moved[number] = max(float(share @ residual**2 / share.sum()) - elsewhere, 0.0)
    linear = columns[:, [not name.startswith("spike") for name in _names(pair, kept)]]
    at = np.flatnonzero([not name.startswith("spike") for name in _names(pair, kept)])
    plain = np.diag(inverse_gram(linear))
    for window in _WINDOWS_RAD if axes else ():
        away = np.min([arc for axis in axes for arc in pair.courses[axis].since_reversal_rad], axis=0) > window
        inverse = inverse_gram(linear[away])
        change = inverse @ (linear[away].T @ residual[away])
        noise = 4.0 * variance * np.maximum(np.diag(inverse) - plain, 0.0)
        moved[at] = np.maximum(moved[at], change**2 - noise)
    return np.asarray(np.sqrt(1.0 + moved / np.maximum(variance * spread, 1e-300)))


def _names(pair: CirclePair, kept: tuple[str, ...]) -> tuple[str, ...]:
    return (
        *pair.smooth,
        *(f"backlash {axis}{end}" for axis in (0, 1) for end in "+-"),
        *(block + end for block in kept for end in SEARCHED[block]),
    )


def _slopes(
    pair: CirclePair, shapes: Shapes, kept: tuple[str, ...], known: Mapping[str, tuple[float, float]]
) -> tuple[Matrix, tuple[str, ...]]:
    """How the fit moves with the logarithm of the shapes that stand out of the noise: their errors widen the others.

    `known`: column → its amount and error.
    """
    slopes, names = [np.empty((len(pair.angle_rad), 0))], []
    for block in kept:
        amounts, errors = np.array([known[block + end] for end in SEARCHED[block]]).T
        if not (np.abs(amounts) > _CLEAR * errors).any():
            continue
        for shape in ("wavelength",) if block.startswith("cyclic") else ("width", "steepness"):
            moved = [_block_columns(pair, _moved(shapes, block, shape, by), block) for by in (_SHIFT, -_SHIFT)]
            slopes.append(((moved[0] - moved[1]) @ amounts / (2.0 * _SHIFT))[:, None])
            names.append(f"{block} {shape}")
    return np.column_stack(slopes), tuple(names)


def _moved(shapes: Shapes, block: str, shape: str, by: float) -> Shapes:
    axis, factor = int(block[-1]), math.exp(by)
    if shape == "wavelength":
        waves = _with(shapes.wavelength_um, axis, shapes.wavelength_um[axis] * factor)
        return replace(shapes, wavelength_um=waves)
    width, steepness = shapes.spike[axis]
    spike = (width * factor, steepness) if shape == "width" else (width, steepness * factor)
    return replace(shapes, spike=_with(shapes.spike, axis, spike))


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
