"""How tool and workpiece answer to a recorded force: where its samples lie on an even grid, and what was elsewhere."""

import itertools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy import fft, signal
from scipy.interpolate import CubicSpline
from scipy.signal import windows

from selector.physics.vibration.final_motion import ChainMethod, source_curve
from selector.physics.vibration.structure import Source, Structure, structure_modes
from selector.types import Indices, Matrix, Vector

STRAY = 0.25  #: Share of a step by which the stamps of an even clock may stray.
GAP = 3.0  #: Usual steps from one stamp to the next beyond which it is a gap, and no lost row or two.
_FINER = 4  #: Steps of the finer grid in a usual step of an uneven clock.
_MOST_PLACES = 1 << 23
_FEWEST = 8


@dataclass(frozen=True, eq=False)
class Stretch:
    """Rows of a run that are answered together, and their even grid."""

    #: first and end: Rows of the run, `end` the one behind the last
    first: int
    end: int
    step_s: float  #: Of the grid [s]
    at: Vector  #: (n_rows,): Place of every row on the grid; whole numbers if `even`
    count: int  #: Places of the grid
    even: bool  #: Whether the clock is even but for lost rows and stray stamps
    stray: float  #: Largest distance of a stamp from its place, as a share of the step; 0 if uneven

    def on_grid(self, values: Vector) -> Vector:
        """Values on the grid by cubic splines, straight where more than two samples lack; `values` may hold NaN."""
        seen = np.isfinite(values)
        at, kept, places = self.at[seen], values[seen], np.arange(self.count)
        if len(at) < 4:
            return np.interp(places, at, kept)
        straight = np.interp(places, at, kept)
        beside = np.clip(np.searchsorted(at, places), 1, len(at) - 1)
        hole = (at[beside] - at[beside - 1] > GAP * np.median(np.diff(at))) | (places < at[0]) | (places > at[-1])
        return np.where(hole, straight, CubicSpline(at, kept)(places))

    def at_rows(self, grid: Vector) -> Vector:
        """Course on the grid, shape (…, count), at the rows, shape (…, n_rows)."""
        if self.even or self.count < 4:
            return grid[..., np.rint(self.at).astype(np.int64)]
        return np.asarray(CubicSpline(np.arange(self.count), grid, axis=-1)(self.at))


def stretches(time_s: Vector, part_s: float) -> tuple[Stretch, ...]:
    """The stretches of a run with these increasing stamps [s], parted at gaps that are longer than `part_s` [s]."""
    steps = np.diff(time_s)
    usual_s = _usual_step_s(steps)
    part_s = min(max(part_s, GAP * usual_s), 0.25 * _MOST_PLACES * usual_s)
    edges = [0, *(np.flatnonzero(steps > part_s) + 1).tolist(), len(time_s)]
    return tuple(_stretch(time_s[first:end], first, usual_s) for first, end in itertools.pairwise(edges))


def gaps(time_s: Vector) -> Vector:
    """First and last moment of every gap between stamps, shape (n_gaps, 2) [s]."""
    steps = np.diff(time_s)
    rows = np.flatnonzero(steps > GAP * _usual_step_s(steps))
    return np.column_stack((time_s[rows], time_s[rows + 1]))


def _stretch(time_s: Vector, first: int, usual_s: float) -> Stretch:
    end, since_s = first + len(time_s), time_s - time_s[0]
    if len(time_s) >= _FEWEST:
        usual_s = _usual_step_s(np.diff(time_s))
    grid = _even_grid(time_s, usual_s)
    if grid is not None:
        step_s, places, stray = grid
        return Stretch(first, end, step_s, places.astype(np.float64), int(places[-1]) + 1, True, stray)
    step_s = max(usual_s / _FINER, float(since_s[-1]) / _MOST_PLACES)
    return Stretch(first, end, step_s, since_s / step_s, math.floor(since_s[-1] / step_s + 1e-9) + 2, False, 0.0)


def _even_grid(time_s: Vector, step_s: float) -> tuple[float, Indices, float] | None:
    """Step, places of the stamps and how far one strays at most, of the even clock that fits them; None: there is none.

    Places by the usual step lead astray in long runs: the step is then that of the line through places and stamps.
    """
    if len(time_s) == 1:
        return step_s, np.zeros(1, dtype=np.int64), 0.0
    places = np.concatenate(([0.0], np.cumsum(np.maximum(np.rint(np.diff(time_s) / step_s), 1.0))))
    begin_s = float(time_s[0])
    for _ in range(3):
        if len(time_s) >= _FEWEST:
            step_s, middle_s = np.polyfit(places - places.mean(), time_s, 1).tolist()
            begin_s = middle_s - step_s * float(places.mean())
        places = np.rint((time_s - begin_s) / step_s)
        places -= places[0]
        if (np.diff(places) < 1).any() or places[-1] >= _MOST_PLACES:
            return None
    off = (time_s - step_s * places) / step_s
    stray = float(np.abs(off - off.mean()).max())
    return (step_s, places.astype(np.int64), stray) if stray <= STRAY else None


def _usual_step_s(steps: Vector) -> float:
    """Mean of the steps that are no more than one: of rounded stamps the median is none of the clock."""
    median_s = float(np.median(steps))
    return float(steps[steps < 1.5 * median_s].mean())


_NEAR = 16384  #: Samples from which an end is continued.
_ORDER = 256
_NOTHING = 1e-26


def autoregression(values: Vector, order: int) -> Vector:
    """Coefficients a of Σ a_k·x_(n−k) = e_n, a_0 = 1, of at most this order; stable."""
    forward = backward = np.asarray(values, dtype=np.float64)
    found = np.ones(1)
    power = float(forward @ forward)
    for _ in range(min(order, len(values) - 1)):
        ahead, behind = forward[1:], backward[:-1]
        both = float(ahead @ ahead + behind @ behind)
        if both <= _NOTHING * power:
            break
        reflected = -2.0 * float(ahead @ behind) / both
        forward, backward = ahead + reflected * behind, behind + reflected * ahead
        longer = np.append(found, 0.0)
        found = longer + reflected * longer[::-1]
    return found


def continued(values: Vector, count: int, proved: int = 0) -> Vector:
    """The next `count` samples of a course without a mean, as it went on at its end.

    As far as that would have foretold its last `proved` samples: wholly, if half their power and more, else in part.
    A single blow is not repeated.
    """
    near = values[-_NEAR:]
    model = autoregression(near, min(_ORDER, len(near) // 3))
    if len(model) == 1 or count == 0:
        return np.zeros(count)
    next_ones = _next(near, model, count)
    proved = min(proved, len(near) // 4)
    if proved == 0:
        return next_ones
    last = near[-proved:]
    missed = last - _next(near[:-proved], model, proved)
    power = float(last @ last)
    return next_ones * min(max(2.0 - 2.0 * float(missed @ missed) / power, 0.0), 1.0) if power > 0.0 else next_ones


def _next(values: Vector, model: Vector, count: int) -> Vector:
    state = signal.lfiltic([1.0], model, values[: -len(model) : -1])
    return np.asarray(signal.lfilter([1.0], model, np.zeros(count), zi=state)[0])


MOST_SILENT = 1 << 21  #: Samples of the silence behind the force.
FADED = 1e-3  #: Share of a free vibration that counts as none.
#: Samples at either end whose weighted mean is the level of the force there; no more than a quarter of all.
_LEVEL = 16384
_OUTLIER = 4.0  #: Standard deviations from which on a value is no part of the level.


def ring_time_s(structure: Structure) -> float:
    """Time in which every free vibration fades to `FADED` [s]; infinite if nothing damps one."""
    decay = float(np.sqrt(structure_modes(structure).eigenvalues_per_s2).imag.min())
    return -math.log(FADED) / decay if decay > 0 else math.inf


def force_answer(
    structure: Structure,
    source: Source,
    force_n: Vector,
    step_s: float,
    finals: Mapping[str, str],
    chains: ChainMethod | None = None,
) -> Matrix:
    """Motion of the finals by one recorded force, shape (n_finals, n_samples) [m].

    By a force [N] of shape (n_samples,), one every `step_s` [s], that acts where the source does.

    For `finals` and `chains` see `final_motions`.

    InputError: a resonance that nothing damps, or the errors of `final_motions`.
    """
    ring = math.ceil(min(ring_time_s(structure) / step_s, MOST_SILENT / 5))
    line = _static_n(force_n)
    moving = force_n - line
    # twice the ring: half of it steady, half of it to come up from nothing
    outside = 2 * ring
    rising = 0.5 - 0.5 * np.cos(np.pi * np.minimum(np.arange(1, outside + 1) / max(outside / 2, 1.0), 1.0))
    proved = max(ring // 4, 16)  # longer than a blow, short enough for a course that slowly changes
    before = rising * continued(moving[::-1], outside, proved)[::-1]
    behind = rising[::-1] * continued(moving, outside, proved)
    padded = fft.next_fast_len(len(moving) + 2 * outside + ring, real=True)
    curve = source_curve(structure, source, 0.0, 0.5 / step_s, finals, chains)
    spectrum = curve.at(fft.rfftfreq(padded, step_s))
    # of what lasts, the part in step with the force counts: irfft takes the real part there
    static = np.outer(spectrum[:, 0].real, line)
    course = np.concatenate((before, moving, behind, np.zeros(padded - len(moving) - 2 * outside)))
    return np.asarray(static + fft.irfft(spectrum * fft.rfft(course), padded)[:, outside : outside + len(moving)])


def _static_n(force_n: Vector) -> Vector:
    """The straight line through the levels at both ends: of a step that from what was before to what is behind it."""
    count = len(force_n)
    near = min(_LEVEL, count // 4)
    if near < 1:
        return np.full(count, force_n.mean())
    begin, end = _level_n(force_n[:near]), _level_n(force_n[-near:])
    slope = (end - begin) / (count - near)
    return np.asarray(begin + slope * (np.arange(count) - 0.5 * (near - 1)))


def _level_n(force_n: Vector) -> float:
    """Mean with weights that fade to both sides: parts of a period count for nothing, and single blows little."""
    middle = float(np.median(force_n))
    usual = 1.4826 * float(np.median(np.abs(force_n - middle)))  # of noise: its standard deviation
    weight = windows.hann(len(force_n) + 2)[1:-1]
    clipped = np.clip(force_n, middle - _OUTLIER * usual, middle + _OUTLIER * usual)
    return float(weight @ clipped / weight.sum())


def stamped_answer(
    structure: Structure,
    source: Source,
    force_n: Vector,
    parts: Sequence[Stretch],
    finals: Mapping[str, str],
    chains: ChainMethod | None = None,
) -> tuple[Matrix, Vector]:
    """Motion of the finals, shape (n_finals, n_rows) [m], and the force as it acted, shape (n_rows,) [N].

    By a force [N] of shape (n_rows,), NaN where it lacks; each stretch for itself, see `force_answer`. `parts` are the
    `stretches` of the stamps; for `finals` and `chains` see `final_motions`.

    InputError: those of `force_answer`.
    """
    motion, acted = np.zeros((len(finals), len(force_n))), np.zeros(len(force_n))
    for part in parts:
        rows = slice(part.first, part.end)
        known = np.isfinite(force_n[rows]).any()
        # a stretch of which nothing is known has the mean of the others
        even = part.on_grid(force_n[rows]) if known else np.full(part.count, np.nanmean(force_n))
        motion[:, rows] = part.at_rows(force_answer(structure, source, even, part.step_s, finals, chains))
        acted[rows] = np.where(np.isfinite(force_n[rows]), force_n[rows], part.at_rows(even))
    return motion, acted
