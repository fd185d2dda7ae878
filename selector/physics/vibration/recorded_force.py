"""How tool and workpiece answer to a recorded force: where its samples lie on an even grid, and what was elsewhere."""

import itertools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import fft, linalg, signal
from scipy.interpolate import CubicSpline
from scipy.signal import windows

from selector.physics.vibration.motion.final_motion import ChainMethod, source_curve
from selector.physics.vibration.structure.source import Source
from selector.physics.vibration.structure.structure import Structure, structure_modes
from selector.types import Mask, Matrix, Vector

STRAY = 0.25  #: Share of a step by which the stamps of an even clock may stray.
GAP = 3.0  #: Usual steps from one stamp to the next beyond which it is a gap, and no lost row or two.
_EVEN = 1e-3
_CERTAIN = 4.0  #: Standard errors from which on stray stamps are believed.
_FINER = 4  #: Steps of the finer grid in a usual step of an uneven clock.
_MOST_PLACES = 1 << 23
_FEWEST = 8
#: Steps in a period up to which a cubic spline is within 1 % of a sine: 5/384·(ω·h)⁴ (C. A. Hall, W. W. Meyer 1976).
_WITHIN_1_PERCENT = (0.01 * 384.0 / 5.0) ** 0.25 / (2.0 * math.pi)


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
    #: stray and stray_rms: Largest and root mean square distance of a stamp from its place, as a share of the step; 0
    #: if uneven
    stray: float
    stray_rms: float
    widest_s: float  #: Largest step between stamps that is no gap [s]

    @property
    def good_to_hz(self) -> float:
        """Frequency up to which the values on the grid are within 1 % of an even sine's [Hz].

        Of stray stamps: if the samples were taken when the stamps say, not when the clock ticked.
        """
        half_hz = 0.5 / (self.step_s if self.even else self.widest_s)
        if self.even:
            return min(half_hz, 0.01 / (2.0 * math.pi * max(self.stray_rms, 1e-300) * self.step_s))
        return min(half_hz, _WITHIN_1_PERCENT / self.widest_s)

    def on_grid(self, values: Vector) -> tuple[Vector, Mask]:
        """Values on the grid, and where they are known; `values` of shape (n_rows,) may hold NaN."""
        grid, known = np.zeros(self.count), np.zeros(self.count, dtype=np.bool_)
        seen = np.isfinite(values)
        at, kept = self.at[seen], values[seen]
        if self.even or len(at) < 4:
            places = np.rint(at).astype(np.int64)
            grid[places], known[places] = kept, True
            return grid, known
        widest = self.widest_s / self.step_s * (1.0 + 1e-9)
        for piece in np.split(np.arange(len(at)), np.flatnonzero(np.diff(at) > widest) + 1):
            places = np.arange(math.ceil(at[piece[0]] - 1e-9), math.floor(at[piece[-1]] + 1e-9) + 1)
            if len(piece) < 4:
                places = np.unique(np.rint(at[piece]).astype(np.int64))
                grid[places] = np.interp(places, at[piece], kept[piece])
            else:
                grid[places] = CubicSpline(at[piece], kept[piece])(places)
            known[places] = True
        return grid, known

    def at_rows(self, grid: Vector) -> Vector:
        """Course on the grid, shape (…, count), at the rows, shape (…, n_rows)."""
        if self.even or self.count < 4:
            return grid[..., np.rint(self.at).astype(np.int64)]
        return np.asarray(CubicSpline(np.arange(self.count), grid, axis=-1)(self.at))


def stretches(time_s: Vector, part_s: float, values: Sequence[Vector] = ()) -> tuple[Stretch, ...]:
    """The stretches of a run with these increasing stamps [s], parted at gaps that are longer than `part_s` [s].

    `values`, courses of shape (n_rows,) that were recorded, tell whether stray stamps are true.
    """
    steps = np.diff(time_s)
    usual_s = _usual_step_s(steps)
    part_s = min(max(part_s, GAP * usual_s), 0.25 * _MOST_PLACES * usual_s)
    edges = [0, *(np.flatnonzero(steps > part_s) + 1).tolist(), len(time_s)]
    return tuple(
        _stretch(time_s[first:end], first, usual_s, [one[first:end] for one in values])
        for first, end in itertools.pairwise(edges)
    )


def gaps(time_s: Vector) -> Vector:
    """First and last moment of every gap between stamps, shape (n_gaps, 2) [s]."""
    steps = np.diff(time_s)
    rows = np.flatnonzero(steps > GAP * _wide_step_s(steps, _usual_step_s(steps)))
    return np.column_stack((time_s[rows], time_s[rows + 1]))


def _stretch(time_s: Vector, first: int, usual_s: float, values: Sequence[Vector]) -> Stretch:
    end, steps = first + len(time_s), np.diff(time_s)
    if len(steps) and len(time_s) >= _FEWEST:
        usual_s = _usual_step_s(steps)
    grid = _even_grid(time_s, usual_s)
    if grid is not None and not any(_went_along(one, grid[1], grid[2]) for one in values):
        step_s, places, stray = grid
        at = places.astype(np.float64)
        rms = float(np.sqrt(np.mean(stray**2)))
        return Stretch(first, end, step_s, at, int(places[-1]) + 1, True, float(np.abs(stray).max()), rms, step_s)
    duration_s = float(time_s[-1] - time_s[0])
    step_s = max(usual_s / _FINER, duration_s / _MOST_PLACES)
    at = (time_s - time_s[0]) / step_s
    near = steps[steps <= GAP * _wide_step_s(steps, usual_s)]
    return Stretch(first, end, step_s, at, math.ceil(at[-1]) + 1, False, 0.0, 0.0, float(near.max()))


def _even_grid(time_s: Vector, step_s: float) -> tuple[float, NDArray[np.int64], Vector] | None:
    """Step, places and strays of the grid that the stamps lie on; None if there is none."""
    if len(time_s) == 1:
        return step_s, np.zeros(1, dtype=np.int64), np.zeros(1)
    places = np.concatenate(([0], np.cumsum(np.maximum(np.rint(np.diff(time_s) / step_s), 1.0)))).astype(np.int64)
    begin_s = float(time_s[0])
    for _ in range(3):
        if len(time_s) >= _FEWEST:
            centre, mean_s = places.mean(), float(time_s.mean())
            step_s = float((places - centre) @ (time_s - mean_s) / ((places - centre) @ (places - centre)))
            begin_s = mean_s - step_s * float(centre)
        places = np.rint((time_s - begin_s) / step_s).astype(np.int64)
        places -= places[0]
        if (np.diff(places) < 1).any() or places[-1] >= _MOST_PLACES:
            return None
    off = time_s - step_s * places
    stray = (off - off.mean()) / step_s
    return (step_s, places, stray) if np.abs(stray).max() <= STRAY else None


def _went_along(values: Vector, places: NDArray[np.int64], stray: Vector) -> bool:
    """Whether samples lie beside those around them as slope times stray: so they were taken when the stamps say.

    Not if they change so quickly that a spline would be worse than the wrong times.
    """
    if len(values) < 8 * _FEWEST or np.abs(stray).max() <= _EVEN:
        return False
    middle = np.arange(2, len(values) - 2)
    middle = middle[places[middle + 2] - places[middle - 2] == 4]
    beside = (
        values[middle] - (4 * (values[middle - 1] + values[middle + 1]) - values[middle - 2] - values[middle + 2]) / 6
    )
    expected = (values[middle + 1] - values[middle - 1]) / 2 * stray[middle]
    seen = np.isfinite(beside)  # NaN where a value lacks
    beside, expected, course = beside[seen], expected[seen], values[middle][seen]
    power, size = float(expected @ expected), float(np.sum((course - course.mean()) ** 2)) if len(course) else 0.0
    if power == 0.0 or size == 0.0:
        return False
    quick = values[middle + 1][seen] - course
    turn = math.sqrt(float(quick @ quick) / size)  # 2·sin ½ω·h
    if 5.0 / 384.0 * turn**3 > math.sqrt(float(np.mean(stray**2))):
        return False
    slope, scatter = float(beside @ expected) / power, float(np.sqrt(np.sum((beside * expected) ** 2))) / power
    return slope > 0.5 and slope > _CERTAIN * scatter


def _usual_step_s(steps: Vector) -> float:
    """Mean of the steps that are no more than one: of rounded stamps the median is none of the clock."""
    median_s = float(np.median(steps))
    return float(steps[steps < 1.5 * median_s].mean())


def _wide_step_s(steps: Vector, usual_s: float) -> float:
    """Step that an uneven clock may well have: the usual one of an even clock."""
    return usual_s if np.mean(np.abs(steps / usual_s - 1.0) < 2.0 * STRAY) > 0.8 else float(np.quantile(steps, 0.9))


_NEAR = 16384  #: Samples from which an end is continued.
_ORDER = 256
_AROUND = 4096  #: Samples on either side of what is lost from which it is told.
_BRIDGE_ORDER = 96
_MOST_ENTRIES = 20_000_000
_NOTHING = 1e-26
_RIDGE = 1e-13


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


def bridged(values: Vector, known: NDArray[np.bool_]) -> Vector:
    """A course with the samples that are not `known` as those around foretell them; at least one must be."""
    if known.all():
        return values
    seen = np.flatnonzero(known)
    places = np.arange(len(values))
    filled = np.interp(places, seen, values[seen])  # straight where nothing better is known
    within = slice(int(seen[0]), int(seen[-1]) + 1)
    there = filled[within]
    _bridge(there, known[within])
    level = there[:_NEAR].mean(), there[-_NEAR:].mean()
    filled[: seen[0]] = level[0] + continued(there[_NEAR::-1] - level[0], int(seen[0]))[::-1]
    filled[seen[-1] + 1 :] = level[1] + continued(there - level[1], len(values) - 1 - int(seen[-1]))
    return filled


def _bridge(filled: Vector, known: NDArray[np.bool_]) -> None:
    lost = np.flatnonzero(~known)
    while len(lost):
        # those within reach of the same neighbourhood together
        group = lost[: np.searchsorted(lost, lost[0] + _AROUND)]
        while len(group) < len(lost) and lost[len(group)] == group[-1] + 1:
            more = np.flatnonzero(np.diff(lost[len(group) - 1 :]) > 1)
            group = lost[: len(group) + int(more[0]) if len(more) else len(lost)]
        low, high = max(int(group[0]) - _AROUND, 0), int(group[-1]) + _AROUND + 1
        filled[group] = _foretold(filled[low:high], known[low:high])[group - low]
        lost = lost[len(group) :]


def _foretold(values: Vector, known: NDArray[np.bool_]) -> Vector:
    lost, level = np.flatnonzero(~known), float(values[known].mean())
    course = values - level
    model = _model_of_known(course, known, max(2, min(_BRIDGE_ORDER, _MOST_ENTRIES // len(lost))))
    if model is not None:
        _put_in(course, model, lost)
    return course + level


def _model_of_known(course: Vector, known: NDArray[np.bool_], most: int) -> Vector | None:
    """Coefficients with the least sum of squares forward and backward, by the known samples; None if too few are."""
    order = min(most, len(known) // 3)
    while order >= 1:
        whole = np.lib.stride_tricks.sliding_window_view(known, order + 1).all(axis=1)
        if whole.sum() >= 2 * order:
            row = np.lib.stride_tricks.sliding_window_view(course, order + 1)[whole]
            product = row.T @ row
            product += product[::-1, ::-1]  # the same backward
            inner = product[1:, 1:] + _RIDGE * max(np.trace(product), 1e-300) * np.eye(order)
            return np.concatenate(([1.0], -linalg.solve(inner, product[1:, 0], assume_a="pos")))
        order //= 2
    return None


def _put_in(course: Vector, model: Vector, lost: NDArray[np.int64]) -> None:
    """The lost samples with the least sum of squares of what the model foretells wrongly, forward and backward."""
    order, count = len(model) - 1, len(course)
    weight = 2.0 * np.correlate(model, model, "full")[order:]
    # sums that would reach beyond the ends are none
    beyond = linalg.toeplitz(model[:-1], np.zeros(order)).T @ linalg.toeplitz(model[:-1], np.zeros(order))
    beyond += linalg.hankel(model[1:]).T @ linalg.hankel(model[1:])
    course[lost] = 0.0
    load = signal.oaconvolve(course, np.concatenate((weight[:0:-1], weight)), "same")
    load[:order] -= beyond @ course[:order]
    load[-order:] -= (beyond @ course[: -order - 1 : -1])[::-1]
    band = np.zeros((min(order, len(lost) - 1) + 1, len(lost)))
    for beside in range(len(band)):
        first, second = lost[: len(lost) - beside], lost[beside:]
        near = second - first <= order
        entry = np.where(near, weight[np.minimum(second - first, order)], 0.0)
        entry[second < order] -= beyond[first[second < order], second[second < order]]
        last = first >= count - order
        entry[last] -= beyond[count - 1 - first[last], count - 1 - second[last]]
        band[beside, : len(entry)] = entry
    band[0] += _RIDGE * weight[0]
    course[lost] = linalg.solveh_banded(band, -load[lost], lower=True)


MOST_SILENT = 1 << 21  #: Samples of the silence behind the force.
FADED = 1e-3  #: Share of a free vibration that counts as none.
#: Samples at either end whose weighted mean is the level of the force there; no more than a quarter of all.
_LEVEL = 16384
_OUTLIER = 4.0  #: Standard deviations from which on a value is no part of the level.


@dataclass(frozen=True, eq=False)
class ForceAnswer:
    """Motion of the finals by one recorded force."""

    motion_m: Matrix  #: (n_finals, n_samples): [m]
    #: begin_m and end_m: (n_finals,): By how much the motion may differ in the time `ring_s` after the first sample,
    #: and at the last one, because it is not known what acted before and what acts then [m]
    begin_m: Vector
    end_m: Vector
    ring_s: float  #: Time in which a free vibration fades to `FADED` [s]; infinite if nothing damps it
    #: Share of a free vibration that is left where the calculation begins anew: what laps over from its end
    left: float


def ring_time_s(structure: Structure) -> float:
    """Time in which every free vibration fades to `FADED` [s]; infinite if nothing damps one."""
    decay = _decay_per_s(structure)
    return -math.log(FADED) / decay if decay > 0 else math.inf


def force_answer(
    structure: Structure,
    source: Source,
    force_n: Vector,
    step_s: float,
    finals: Mapping[str, str],
    chains: ChainMethod | None = None,
) -> ForceAnswer:
    """Motion by a force [N] of shape (n_samples,), one every `step_s` [s], that acts where the source does.

    For `finals` and `chains` see `final_motions`.

    InputError: a resonance that nothing damps, or the errors of `final_motions`.
    """
    ring_s = ring_time_s(structure)
    ring = math.ceil(min(ring_s / step_s, MOST_SILENT / 5))
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
    here = slice(outside, outside + len(moving))
    courses = np.zeros((2, padded))
    courses[0, here] = moving
    courses[1, :outside], courses[1, here.stop : here.stop + outside] = before, behind
    own, others = (fft.irfft(spectrum * fft.rfft(course), padded) for course in courses)
    near = min(ring, len(moving))
    # by what was added outside, and by what this force would leave behind itself, or sends ahead
    begin = np.maximum(_largest(others[:, here][:, :near]), _largest(own[:, here.stop : here.stop + outside]))
    end = np.maximum(_largest(others[:, here][:, -1:]), _largest(own[:, here.start - 1 : here.start]))
    silent = padded - len(moving) - 2 * outside
    left = math.exp(-_decay_per_s(structure) * silent * step_s)
    return ForceAnswer(static + (own + others)[:, here], begin, end, ring_s, left)


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


def _largest(motion: Matrix) -> Vector:
    return np.asarray(np.abs(motion).max(axis=1, initial=0.0))


def _decay_per_s(structure: Structure) -> float:
    return float(np.sqrt(structure_modes(structure).eigenvalues_per_s2).imag.min())


@dataclass(frozen=True, eq=False)
class StampedAnswer:
    """Motion of the finals by one recorded force, at the stamps of the recording."""

    motion_m: Matrix  #: (n_finals, n_rows): [m]
    force_n: Vector  #: (n_rows,): The force as it acted, without what lacked [N]
    #: begin_m and end_m: (n_stretches, n_finals): See `ForceAnswer`, for every stretch [m]
    begin_m: Matrix
    end_m: Matrix
    left: float  #: See `ForceAnswer`; the largest


def stamped_answer(
    structure: Structure,
    source: Source,
    force_n: Vector,
    parts: Sequence[Stretch],
    finals: Mapping[str, str],
    chains: ChainMethod | None = None,
) -> StampedAnswer:
    """Motion by a force [N] of shape (n_rows,), NaN where it lacks; each stretch for itself, see `force_answer`.

    `parts` are the `stretches` of the stamps; for `finals` and `chains` see `final_motions`.

    InputError: those of `force_answer`.
    """
    motion, acted = np.zeros((len(finals), len(force_n))), np.zeros(len(force_n))
    begin, end, left = [], [], 0.0
    for part in parts:
        rows = slice(part.first, part.end)
        grid, known = part.on_grid(force_n[rows])
        # a stretch of which nothing is known has the mean of the others
        even = bridged(grid, known) if known.any() else np.full(part.count, np.nanmean(force_n))
        found = force_answer(structure, source, even, part.step_s, finals, chains)
        motion[:, rows] = part.at_rows(found.motion_m)
        acted[rows] = np.where(np.isfinite(force_n[rows]), force_n[rows], part.at_rows(even))
        begin.append(found.begin_m)
        end.append(found.end_m)
        left = max(left, found.left)
    return StampedAnswer(motion, acted, np.array(begin), np.array(end), left)
