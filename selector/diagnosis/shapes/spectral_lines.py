"""Which sharp lines and resonances stand in what a simulation leaves: fixed, or following a shaft."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import accumulate

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_toeplitz
from scipy.ndimage import median_filter
from scipy.signal import lfilter
from scipy.stats import chi2, gamma

from selector.diagnosis.comparison import Comparison
from selector.diagnosis.shapes.residual import least_squares
from selector.diagnosis.shapes.signals import EvenRun, course, even_runs, excited, on_even_clock
from selector.physics.ranges import true_stretches
from selector.types import Matrix, Vector

_ORDER = 12
_SEGMENT = 512
_LINE_BINS = 7
_EULER = 0.5772156649015329
_LINE_BESIDE = 80


def white_filter(parts: list[Vector]) -> Vector:
    """Coefficients (1, a1 … ap) of the filter that whitens the smooth part of the spectrum of these stretches.

    The spectrum is the median over half-overlapping segments and over neighbouring frequencies, so that lines and
    bursts hardly count; the filter is the autoregression of that spectrum (Yule–Walker).
    """
    usable = [part for part in parts if len(part) >= 32 and np.any(part)]
    if not usable:
        return np.ones(1)
    size = min(_SEGMENT, max(len(part) for part in usable))
    window = np.hanning(size)
    segments = [
        np.abs(np.fft.rfft((part[k : k + size] - part[k : k + size].mean()) * window)) ** 2
        for part in usable
        for k in range(0, len(part) - size + 1, max(size // 2, 1))
    ]
    spectrum = median_filter(np.median(segments, axis=0), _LINE_BINS, mode="nearest")
    spectrum = np.maximum(spectrum, 1e-10 * float(spectrum.max()))
    covariance = np.fft.irfft(spectrum)
    order = min(_ORDER, size // 8)
    return np.asarray(np.r_[1.0, solve_toeplitz(covariance[:order], -covariance[1 : order + 1])], dtype=np.float64)


def filtered(values: Vector, whitening: Vector) -> Vector:
    """A stretch behind the filter; where the filter has no past yet, 0."""
    white: Vector = np.asarray(lfilter(whitening, [1.0], values), dtype=np.float64)
    white[: len(whitening) - 1] = 0.0
    return white


def tapered(n: int) -> Vector:
    """A window with cosine ends over a tenth of its length each, mean square 1."""
    ramp = max(n // 10, 1)
    window = np.ones(n)
    window[:ramp] = 0.5 - 0.5 * np.cos(np.pi * (np.arange(ramp) + 0.5) / ramp)
    window[n - ramp :] = window[:ramp][::-1]
    return np.asarray(window / np.sqrt(np.mean(window**2)))


def floor(power: Vector) -> Vector:
    """Mean power of the noise at every frequency, from the logarithms of the neighbours: one line hardly lifts it."""
    log = np.log(np.maximum(power, 1e-12 * float(power.max(initial=1e-300))))
    width = min(_LINE_BESIDE, max(len(log) // 4, 1))
    kernel = np.ones(2 * width + 1)
    sums = np.convolve(log, kernel, mode="same") / np.convolve(np.ones(len(log)), kernel, mode="same")
    return np.asarray(np.exp(sums + _EULER))


Pieces = NDArray[np.complex128]  #: What every piece of a run, all of one length, shows of a line.
CHANCE = 0.02  #: Chance that noise shows one line in a whole spectrum, where nothing else is said.
_COHERENT = 0.5
_PIECES = 5
_LASTING = 0.35
_UNSTEADY = 0.2
_BESIDE = 0.03
_UNLIKELY = 0.01  #: Chance that a true line is not taken for one because of noise, in one of the looks at its shape.
_STRAY = 3.0  #: Robust standard deviations of a reading that says no more than a smaller one.
#: Of a run that nothing may be fitted to only this part of the square of a line, the first one, tells its phase, as it
#: would an initial state.
_FIRST_PART = 0.2


@dataclass(frozen=True)
class Line:
    """A line: cycles per unit of the abscissa (second or turn), and for every run its phase [rad], None = not there.

    `strength` is its power over that of the noise beside it, all runs together.
    """

    cycles: float
    phases: tuple[float | None, ...]
    strength: float

    @property
    def runs(self) -> tuple[int, ...]:
        """Numbers of the runs in which it is."""
        return tuple(k for k, phase in enumerate(self.phases) if phase is not None)


def fitted_parts(comparison: Comparison) -> list[slice]:
    """Of every run the longest stretch of rows that may be fitted to; an empty slice where there is none."""
    parts = []
    for _, rows in comparison.rows_of_runs():
        free = true_stretches(~comparison.held_out[rows]).tolist()
        begin, end = max(free, key=lambda one: one[1] - one[0], default=(0, 0))
        parts.append(slice(rows.start + begin, rows.start + end))
    return parts


_NEAR_SHARE = 0.004  #: How far a line may be from where it is expected.


def lines(
    comparison: Comparison,
    left: Vector,
    abscissa: Vector,
    weight: Vector,
    *,
    near: tuple[float, ...] | None = None,
    lowest: float = 0.0,
    most: int = 4,
    chance: float = CHANCE,
) -> tuple[Line, ...]:
    """Lines of `left` over the abscissa, the strongest first.

    Of shape (n_rows,) are `left`, what is looked through, 0 where missing; `abscissa`, which grows within each run:
    time [s], or turns of the shaft; and `weight`, how the line's size goes over the rows, e.g. the square of the speed.
    It looks only within the share `_NEAR_SHARE` (or a cycle per run) of `near`, or everywhere from `lowest` on, for at
    most `most` lines. `chance` is that noise shows one of them in the whole spectrum; what is no line is not offered to
    the fit.
    """
    parts = fitted_parts(comparison)
    noise = white_filter([left[p] for p in parts])
    white = np.zeros(len(left))
    for _, rows in comparison.rows_of_runs():
        white[rows] = filtered(left[rows], noise)
    # strays of noise with heavy tails hide a line; even a strong sine stays below
    stray = _STRAY * 1.4826 * float(np.median(np.abs(np.concatenate([white[p] for p in parts]))))
    white = np.clip(white, -stray, stray) if stray > 0.0 else white
    looked = _Looked(comparison, white, noise, abscissa, weight, parts)
    spectra = [_spectrum(white[p], abscissa[p], weight[p]) for p in parts]
    usable = [k for k, s in enumerate(spectra) if s is not None]
    if not usable:
        return ()
    finest = max(usable, key=lambda k: float(np.ptp(abscissa[parts[k]])))
    grid, _ = spectra[finest]  # type: ignore[misc]
    power = np.array([np.interp(grid, *s, left=1.0, right=1.0) for s in spectra if s is not None])
    ends = min(float(s[0][-1]) for s in spectra if s is not None)
    allowed = (grid >= lowest) & (grid <= ends)
    span = float(np.ptp(abscissa[parts[finest]]))
    if near is not None:
        allowed &= np.any([np.abs(grid - o) <= max(_NEAR_SHARE * o, 1.5 / span) for o in near], axis=0)
    tried = max(int(allowed.sum()), 1)
    found: list[Line] = []
    claimed = np.zeros(len(grid), dtype=bool)
    for together in ([*range(len(usable))], *([k] for k in range(len(usable)) if len(usable) > 1)):
        strength = power[together].sum(axis=0)
        share = 1.0 if len(together) == len(usable) else 1.0 / 3.0 / len(usable)
        limit = float(gamma.isf(share * chance / tried, len(together)))
        open_ = np.where(allowed & ~claimed, strength, 0.0)
        while len(found) < 2 * most and float(open_.max()) > limit:
            top = int(np.argmax(open_))
            taken = np.abs(grid - grid[top]) <= 4.0 / span
            open_[taken] = 0.0
            runs = tuple(usable[k] for k in together)
            line = _line(looked, runs, float(grid[top]), float(strength[top]), is_near=near is not None)
            if line is not None and _sharp(grid, strength, top, span, len(together)):
                claimed |= taken
                found.append(line)
    return tuple(sorted(found, key=lambda line: -line.strength)[:most])


def aligned(
    comparison: Comparison, left: Vector, cosine: Vector, sine: Vector, line: Line, *, is_known: bool
) -> tuple[Vector, float]:
    """A line that passed through a structure, turned in every run by the angle at which that run shows it.

    `cosine` and `sine` are what the line's two quadratures became; phases come from the same rows as those of lines.
    The second value is the chance that noise shows as much. Where the structure `is_known`, an unseen run is read where
    it answers; a guess holds far below its resonance only.
    """
    parts, shown = fitted_parts(comparison), np.hypot(cosine, sine) if is_known else np.ones(len(left))
    noise = white_filter([left[part] for part in parts])
    result, explained, freedoms = np.zeros(len(left)), 0.0, 0
    for k, (_, rows) in enumerate(comparison.rows_of_runs()):
        if line.phases[k] is None:
            continue
        is_fitted = parts[k].start < parts[k].stop
        part = parts[k] if is_fitted else _first_part(rows, shown)
        columns = np.column_stack([filtered(course[part], noise) for course in (cosine, sine)])
        white = filtered(left[part], noise)
        a, b = least_squares(columns, white)
        if is_fitted:
            rest = float(np.mean((white - columns @ np.array([a, b])) ** 2))
            explained += (float(np.mean(white**2)) / max(rest, 1e-300) - 1.0) * len(white)
            freedoms += 2
        size = float(np.hypot(a, b))
        if size > 0.0:
            result[rows] = (a * cosine[rows] + b * sine[rows]) / size
    return result, float(chi2.sf(explained, freedoms)) if freedoms else 1.0


def course_of(line: Line, comparison: Comparison, abscissa: Vector, weight: Vector) -> Vector:
    """cos(2π·cycles·abscissa + phase of the run)·weight, 0 in runs without the line."""
    result = np.zeros(len(abscissa))
    for phase, (_, rows) in zip(line.phases, comparison.rows_of_runs(), strict=True):
        if phase is not None:
            result[rows] = np.cos(2.0 * np.pi * line.cycles * abscissa[rows] + phase) * weight[rows]
    return result


def _spectrum(left: Vector, abscissa: Vector, weight: Vector) -> tuple[Vector, Vector] | None:
    """Power at rising cycles per unit over that of the neighbours (1 in the mean where there is noise only)."""
    if len(left) < 48 or float(np.ptp(abscissa)) <= 0.0 or not np.any(left):
        return None
    even = np.linspace(abscissa[0], abscissa[-1], len(left))
    part = np.interp(even, abscissa, left * weight)
    n = 2 * len(part)
    power = np.abs(np.fft.rfft((part - part.mean()) * tapered(len(part)), n)) ** 2
    cycles = np.arange(len(power)) / (n * (even[1] - even[0]))
    return cycles[5:], power[5:] / floor(power[5:])


@dataclass(frozen=True, eq=False)
class _Looked:
    """What lines are looked for in: a course behind the filter, its abscissa and weights, parts of runs."""

    comparison: Comparison
    left: Vector
    noise: Vector
    abscissa: Vector
    weight: Vector
    parts: list[slice]

    def turned(self, part: slice, cycles: float) -> Pieces:
        """The course of a part turned back by a line."""
        return np.asarray(self.left[part] * self.weight[part] * np.exp(-2j * np.pi * cycles * self.abscissa[part]))

    def power(self, part: slice, cycles: Vector) -> Vector:
        """Power of a part at cycles (n,) that are equally far apart: one wave times another is the next."""
        step = np.exp(-2j * np.pi * (cycles[1] - cycles[0]) * self.abscissa[part])
        waves = accumulate(cycles[1:], lambda wave, _: wave * step, initial=self.turned(part, cycles[0]))
        return np.array([abs(wave.sum()) ** 2 for wave in waves])

    def phase(self, part: slice, cycles: float) -> float:
        """φ of cos(2π·cycles·abscissa + φ)·weight in a stretch that went through the filter, as the line did."""
        turn = 2.0 * np.pi * cycles * self.abscissa[part]
        waves = (wave * self.weight[part] for wave in (np.cos(turn), -np.sin(turn)))
        cosine, sine = least_squares(np.column_stack([filtered(wave, self.noise) for wave in waves]), self.left[part])
        return float(np.arctan2(sine, cosine))


def _line(of: _Looked, runs: tuple[int, ...], cycles: float, strength: float, *, is_near: bool) -> Line | None:
    """The line near `cycles`, refined; None if its phase does not last through the runs, as that of noise does not."""
    looked = [of.parts[k] for k in runs]
    span = max(float(np.ptp(of.abscissa[part])) for part in looked)
    tried = cycles + np.linspace(-0.6, 0.6, 13) / span
    for width in (0.1, 0.02):
        cycles = float(tried[int(np.argmax(sum(of.power(part, tried) for part in looked)))])
        tried = cycles + np.linspace(-width, width, 9) / span
    pieces = [np.array([p.sum() for p in np.array_split(of.turned(part, cycles), _PIECES)]) for part in looked]
    if not (_is_lasting(pieces) if is_near else _is_steady(pieces, strength)):
        return None
    phases: list[float | None] = [None] * len(of.parts)
    for k, (_, rows) in enumerate(of.comparison.rows_of_runs()):
        is_unfitted = of.parts[k].start == of.parts[k].stop and len(runs) == sum(p.start < p.stop for p in of.parts)
        if k in runs or is_unfitted:
            phases[k] = of.phase(of.parts[k] if k in runs else _first_part(rows, np.ones(len(of.weight))), cycles)
    return Line(cycles, tuple(phases), strength)


def _first_part(rows: slice, weight: Vector) -> slice:
    """The first part of a run: slow speeds, and those far below a resonance, hardly show the phase of what turns."""
    past = np.cumsum(weight[rows] ** 2)
    return slice(rows.start, rows.start + max(int(np.searchsorted(past, _FIRST_PART * past[-1], side="right")), 1))


def _sharp(grid: Vector, strength: Vector, top: int, span: float, n_runs: int) -> bool:
    """Whether there is hardly more than noise beside the window's own width, as beside a resonance or passing sweep."""
    apart = np.abs(grid - grid[top]) * span
    beside = strength[(apart > 2.5) & (apart < 6.0)]
    # the spectrum has two points for every one that is free
    free = n_runs * max(len(beside) // 2, 1)
    noise = n_runs * float(gamma.isf(_UNLIKELY, free)) / free
    return len(beside) == 0 or float(np.mean(beside)) < _BESIDE * float(strength[top]) + noise


def _is_lasting(pieces: list[Pieces]) -> bool:
    """Whether a line is there in all pieces of a run but one, in one phase, as a burst or a passing sweep is not."""
    if _coherence(pieces) < _COHERENT:
        return False
    along = [np.sort((piece * np.conj(piece.sum())).real) for piece in pieces]
    return all(bool(part[1] > _LASTING * float(part.mean())) for part in along)


def _coherence(pieces: list[Pieces]) -> float:
    """Power of whole runs over that of their pieces, were each in phase with itself alone; 0 … 1."""
    whole = float(sum(abs(np.sum(piece)) ** 2 for piece in pieces))
    apart = sum(len(piece) * float(np.sum(np.abs(piece) ** 2)) for piece in pieces)
    return whole / apart if apart > 0.0 else 0.0


def _is_steady(pieces: list[Pieces], strength: float) -> bool:
    """Whether size and phase of a line are the same in all pieces of a run, up to noise and a fifth of the size."""
    if _coherence(pieces) < _COHERENT:
        return False
    whole = float(sum(abs(np.sum(piece)) ** 2 for piece in pieces))
    apart = float(sum(np.sum(np.abs(piece - piece.mean()) ** 2) for piece in pieces))
    # of a whole run noise is whole/strength, in both directions together
    free = sum(2 * (len(piece) - 1) for piece in pieces)
    noise = 0.5 * whole / strength / _PIECES * float(chi2.isf(_UNLIKELY, free))
    return apart < noise + _UNSTEADY**2 * whole / _PIECES


def is_turning(comparison: Comparison, name: str) -> bool:
    """Whether the shaft turns at all, at a steady speed or not."""
    speed = course(comparison, name)
    return excited(speed) or float(np.abs(speed).max(initial=0.0)) > 0.0


def turns_of(comparison: Comparison, rpm: Vector) -> Vector:
    """∫ n/60 dt from the start of every run [turns]."""

    def summed(part: Vector) -> Vector:
        course = np.asarray(lfilter([0.5, 0.5], [1.0, -1.0], part / 60.0 * comparison.period_s))
        return course - course[0]

    return on_even_clock(comparison, summed, rpm) + 1e-12 * np.arange(len(rpm))


def rotating_forces(comparison: Comparison) -> Matrix:
    """n²·cos φ and n²·sin φ of every turning spindle, at most 1, shape (n_rows, 2·spindles); φ = 0 at every start.

    What an imbalance that the simulation knows pulls with is a sum of the two, another one in every run.
    """
    columns = []
    for name in comparison.with_role("spindle_speed"):
        if is_turning(comparison, name):
            rpm = np.abs(course(comparison, name))
            angle = 2.0 * np.pi * turns_of(comparison, rpm)
            square = (rpm / float(rpm.max())) ** 2
            columns += [square * np.cos(angle), square * np.sin(angle)]
    return np.column_stack(columns) if columns else np.empty((len(comparison.time_s), 0))


DAMPING = (0.005, 0.015, 0.04, 0.1)
_PER_HALF_WIDTH = 1.2
_NEARLY_NONE = 1e-9  #: Of a course, added to what is not in the others: it may be one of them.
_RESONANCES = 4  #: So many are looked for at most.
_SHARED = 1.12  #: By the ends of the window neighbouring frequencies share so much of their noise.


def resonances(
    comparison: Comparison, left: Vector, source: Vector, simulated: Vector, *, behind_filter: bool = True
) -> tuple[tuple[float, float], ...]:
    """(frequency [Hz], damping) of resonances that pass the source on into what is left, the clearest first.

    `left` is 0 where it is missing and in rows that may not be fitted to. Each pair explains more of the power, in
    two real coefficients (motion and its speed), than noise would anywhere in the scan with probability `CHANCE`. What
    stands `behind_filter` has white noise; but a resonance that is most of what is left is filtered away with it.
    """
    runs = even_runs(comparison)
    parts = [part for run in runs for part in _stretch(run, comparison, left)] if behind_filter else []
    noise = white_filter(parts)
    courses = (left, source, simulated)
    spectra = [s for s in (_spectra(run, comparison, courses, noise) for run in runs) if s is not None]
    if not spectra:
        return ()
    hz = np.concatenate([one for one, _ in spectra])
    courses_hz = np.concatenate([of for _, of in spectra], axis=1)
    longest = max(1.0 / float(s[0][1] - s[0][0]) for s in spectra)
    low, high = 8.0 / longest, 0.45 / comparison.period_s
    if high <= low:
        return ()
    order = np.argsort(hz)
    looked = hz[order], np.ascontiguousarray(courses_hz[:, order])
    grids = [np.exp(np.arange(np.log(low), np.log(high), damping / _PER_HALF_WIDTH)) for damping in DAMPING]
    pairs = zip(grids, DAMPING, strict=True)
    gains = [np.array([_explained(*looked, float(f), z) for f in grid]) for grid, z in pairs]
    limit = float(chi2.isf(CHANCE / len(hz), 2))
    found: list[tuple[float, float]] = []
    while len(found) < _RESONANCES:
        k = int(np.argmax([gain.max() for gain in gains]))
        top = int(np.argmax(gains[k]))
        if gains[k][top] <= limit:
            break
        f0 = float(grids[k][top])
        found.append(_refined(*looked, f0, DAMPING[k]))
        for grid, gain in zip(grids, gains, strict=True):
            gain[np.abs(np.log(grid / f0)) < 0.1] = 0.0
    return tuple(found)


def _stretch(run: EvenRun, comparison: Comparison, *courses: Vector) -> list[Vector]:
    """The courses between the first and the last row of a run that may be fitted to."""
    free = ~comparison.held_out[run.rows]
    if free.sum() < 64:
        return [np.zeros(0) for _ in courses]
    first = 0 if free[0] else int(np.searchsorted(run.clock_s, run.time_s[free][0]))
    last = len(run.clock_s) if free[-1] else int(np.searchsorted(run.clock_s, run.time_s[free][-1])) + 1
    return [run.on(course)[first:last] for course in courses]


Spectra = NDArray[np.complex128]  #: (3, n_frequencies): Of what is left, of the source, of the simulated course.


def _spectra(
    run: EvenRun, comparison: Comparison, courses: Sequence[Vector], noise: Vector
) -> tuple[Vector, Spectra] | None:
    """Frequencies [Hz], and what is left and other courses behind the filter, over the strength of the noise there."""
    parts = _stretch(run, comparison, *courses)
    n = len(parts[0])
    if n < 64 or not np.any(parts[0]):
        return None
    window = tapered(n)
    hz = np.fft.rfftfreq(n, comparison.period_s)[3:]
    spectra = np.array([np.fft.rfft(filtered(v - v.mean(), noise) * window)[3:] for v in parts])
    return np.asarray(hz, dtype=np.float64), np.asarray(spectra / np.sqrt(floor(np.abs(spectra[0]) ** 2)))


def _explained(hz: Vector, spectra: Spectra, frequency_hz: float, damping: float) -> float:
    """Twice the whitened power explained near the resonance; of noise it is chi-square with two degrees of freedom."""
    reach = min(max(12.0 * damping, 0.06), 0.8)
    a, b = np.searchsorted(hz, [frequency_hz * (1.0 - reach), frequency_hz * (1.0 + reach)])
    if b - a < 8:
        return 0.0
    r = hz[a:b] / frequency_hz
    e, u, s = spectra[:, a:b]
    h = u / (1.0 - r * r + 2j * damping * r)
    of = np.array([s, 1j * r * s, h, 1j * r * h, e]).view(np.float64)
    of /= np.maximum(np.sqrt(np.einsum("ij,ij->i", of, of)), 1e-300)[:, None]
    products = of @ of.T
    products[np.diag_indices(4)] += _NEARLY_NONE
    with_it, without_it = (float(products[4, :k] @ np.linalg.solve(products[:k, :k], products[4, :k])) for k in (4, 2))
    return 2.0 * (with_it - without_it) * float(np.vdot(e, e).real) / _SHARED


def _refined(hz: Vector, spectra: Spectra, frequency_hz: float, damping: float) -> tuple[float, float]:
    step_f, step_z = damping / _PER_HALF_WIDTH, 1.6
    for _ in range(3):
        tried = [
            (frequency_hz * float(np.exp(df)), damping * dz)
            for df in (-step_f, -step_f / 2, 0.0, step_f / 2, step_f)
            for dz in (1.0 / step_z, 1.0, step_z)
        ]
        frequency_hz, damping = max(tried, key=lambda pair: _explained(hz, spectra, *pair))
        step_f, step_z = step_f / 3.0, step_z**0.6
    return frequency_hz, float(min(max(damping, 0.001), 0.5))
