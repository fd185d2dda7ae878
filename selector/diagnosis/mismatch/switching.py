"""Whether an unrecorded switch did what is left, when and how quickly; when and where all that is told acts."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import timedelta
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy import fft, optimize

from selector.diagnosis.answer import NamedEffect, Place
from selector.diagnosis.comparison import Comparison
from selector.diagnosis.finding_table import FINDINGS, UNRECORDED_SWITCH
from selector.diagnosis.mismatch.background import seen_rows
from selector.diagnosis.mismatch.location import LARGE, active_windows, in_words
from selector.diagnosis.mismatch.omnibus import Structure, of_whole_record
from selector.diagnosis.shapes.residual import basis, least_squares, off
from selector.diagnosis.shapes.signals import course
from selector.diagnosis.wording import amount
from selector.findings import Finding, Where
from selector.number_text import listed, span_text
from selector.types import Matrix, Vector

Lags = tuple[float, ...]  #: Time constants in a row [s]
Moment = tuple[int, float]  #: Number of the run, time from its start [s]

_READINGS = 2000  #: Of a response that are searched; of longer records means of neighbours.
_MOST, _MOST_TRIED = 120, 30  #: Changes of all runs together, and while time constants are compared.
_REACH = 20  #: Readings by which a moment is moved at least, to find its interval.
_SHORTEST = 5  #: Readings between two changes: what is shorter is a stray, or one change between two readings.
_LAGS, _FINER = 6, 3  #: Time constants that are tried beside none, and how often between them.
_MEMORY = 12  #: Readings of the noise's past.
_PRICE = 1.5  #: Of a change, in ln(readings) nats: its moment, and its size by Bayes' criterion.
_SURE, _EACH = 20.0, 3.0  #: Nats beyond the price, and for each change: with fewer it is no switch.
_LEFT = 0.25  #: Of what recalibration leaves above the noise: with more it is not what a switch does.
_OWN = 1e-6  #: Of a change's sum of squares: with less beside the others it says nothing.
_TELLS = 2.0  #: Standard errors in half an interval.
_PART = 0.4  #: Of the way to the next change that one may be moved.
_RATIOS = (1e-3, 0.1, 0.2, 1.0 / 3.0, 0.6)  #: Of the second time constant to the first; the first is none.
_UNKNOWN = 0.3  #: Of the time constants: half an interval at least, since no response is exactly of this shape.
_FURTHER = 1e-6  #: Of the scale of a value: the step of its slopes.
_FITS = 30  #: Times that moments and time constants are fitted at most.
_COMMANDED = ("spindle_speed", "feed_rate", "flow", "state", "load")
#: Of the changes that stand beside those of a command: from here on they are the command's, if by chance fewer would.
_COINCIDENT, _BY_CHANCE = 0.5, 0.25
_STEPS = 2.0  #: Of the readings: smaller changes may be rounding.
_OF_SPAN = 1.5  #: Of what recalibration leaves: larger changes only make up a smooth course together.
_ONE_SIDED = 0.9  #: Of what a level is away: on one side of the level that holds longest.
_LISTED, _LONG_S = 12, 120.0  #: Moments that are listed; runs from which on a clock tells them.


@dataclass(frozen=True)
class Change:
    """A moment at which the level changes."""

    run: str
    at_s: float  #: From the start of the run [s]
    within_s: float  #: Half width of its interval [s]
    size: float  #: [unit of the response]


@dataclass(frozen=True, eq=False)
class Switched:
    """What something does to one response that changes its level at some moments and that is not recorded."""

    channel: str
    lags_s: Lags  #: Time constants with which the response follows [s]; none: at once
    changes: tuple[Change, ...]  #: The large ones, by time
    course: Vector  #: (n_rows,): What it does, from the level that holds longest [unit of the response]
    gain: float  #: Nats beyond noise of any memory, the price of the changes paid

    def structure(self, comparison: Comparison) -> Structure:
        """The same among all that is left."""
        size, p_value = float(np.std(self.course)), float(np.exp(-self.gain))
        return of_whole_record("switched", comparison, self.channel, size, p_value)


@dataclass(frozen=True, eq=False)
class _Record:
    """Readings of one response, runs in a row: what is to be explained, and what recalibration may take."""

    target: Vector  #: (n,)
    base: Matrix  #: (n, p)
    time_s: Vector  #: (n,): From the start of the run
    runs: tuple[slice, ...]
    period_s: float

    def moment(self, reading: int, before: float) -> Moment:
        """The moment so many periods before a reading."""
        run = next(k for k, part in enumerate(self.runs) if reading < part.stop)
        return run, float(self.time_s[reading]) - before * self.period_s

    def columns(self, lags_s: Lags, moments: Sequence[Moment] = ()) -> Matrix:
        """Recalibration, for every run its level and what is left of an earlier one, and changes of 1 at moments."""
        starts = [self.moment(part.start, 1.0) for part in self.runs]
        columns = [self.base, np.zeros((len(self.target), (2 if lags_s else 1) * len(starts) + len(moments)))]
        of = [*((start, ()) for start in starts), *((m, lags_s) for m in (*(starts if lags_s else ()), *moments))]
        for column, ((run, at_s), lags) in zip(columns[1].T, of, strict=True):
            column[self.runs[run]] = _risen(self.time_s[self.runs[run]] - at_s, lags)
        return np.column_stack(columns)

    @cached_property
    def grid(self) -> tuple[NDArray[np.intp], tuple[slice, ...]]:
        """Places of the readings on an even grid of periods, runs in a row, and those of the runs."""
        places, spans, first = [], list[slice](), 0
        for part in self.runs:
            time = self.time_s[part]
            near, order = np.rint((time - time[0]) / self.period_s).astype(np.intp), np.arange(len(time))
            places.append(first + np.maximum.accumulate(near - order) + order)
            spans.append(slice(first, first := int(places[-1][-1]) + 1))
        return np.concatenate(places), tuple(spans)

    def left(self, lags_s: Lags, moments: Sequence[Moment] = ()) -> Vector:
        """What is left beside changes."""
        columns = self.columns(lags_s, moments)
        return np.asarray(self.target - columns @ least_squares(columns, self.target))


def _risen(since_s: Vector, lags_s: Lags) -> Vector:
    """What a change of 1 has done after these times [s]."""
    since = np.maximum(since_s, 0.0)
    if not lags_s:
        return (since > 0.0).astype(np.float64)
    if len(lags_s) == 1:
        return np.asarray(-np.expm1(-since / lags_s[0]))
    slow, quick = lags_s
    return np.asarray(1.0 - (slow * np.exp(-since / slow) - quick * np.exp(-since / quick)) / (slow - quick))


def switched(
    comparison: Comparison, channel: str, target: Vector, base: Matrix, resolution: float = 0.0
) -> Switched | None:
    """What a switch that nobody recorded does to a response; None if noise of any memory explains it as well.

    How it is found: docs/explanation/how-the-evidence-is-weighed.md, *A switch that nobody recorded*.

    `target` is recorded − simulated of the response `channel`, shape (n_rows,) [its unit], NaN where one is missing;
    `base` what recalibration may add, shape (n_rows, p); `resolution` the step of the readings [the same unit]: a slow
    course that is rounded changes by one step at a time.
    """
    rows = [here for here in seen_rows(comparison, target) if len(here)]
    if not rows:
        return None
    record = _means(comparison, target, base, rows, most=_READINGS)
    longest_s = record.period_s * max(part.stop - part.start for part in record.runs)
    # variance of noise, from its changes from reading to reading, of which a switch makes few
    changes = np.concatenate([np.diff(record.target[part]) for part in record.runs])
    quiet = max(0.5 * (1.4826 * float(np.median(np.abs(changes)))) ** 2, 1e-300)
    lags_s = _likeliest_lags(record, longest_s / 3.0, quiet)
    if lags_s and lags_s[0] > longest_s / 5.0:
        return None
    readings, left, gain = _chosen(record, lags_s, quiet)
    alone, rest = (float(np.mean(of**2)) - quiet for of in (record.left(lags_s), left))
    if gain < _SURE or rest > _LEFT * alone:
        return None
    every = _means(comparison, target, base, rows)
    if lags_s:
        lags_s, placed = _fitted(record, lags_s, [record.moment(k, 1.0) for k in readings])
    else:
        placed = _placed(every, [record.moment(k, 0.5) for k in readings], record.period_s, _noise(left))
    found = _told(comparison, channel, every, rows, lags_s, placed, gain)
    sizes = [abs(change.size) for change in found.changes] if found else [0.0]
    is_real = np.median(sizes) >= _STEPS * resolution and max(sizes) <= _OF_SPAN * float(np.ptp(record.left(())))
    return found if is_real else None


def gain_beside(comparison: Comparison, target: Vector, base: Matrix, columns: Matrix) -> float:
    """Nats that columns (n_rows, p) gain beside others in `base`, less Bayes' price for them."""
    rows = [here for here in seen_rows(comparison, target) if len(here)]
    without, beside = (
        _means(comparison, target, of, rows, most=_READINGS) for of in (base, np.column_stack([base, columns]))
    )
    n = len(without.target)
    gain = n * np.log(_innovation(without, without.left(())) / _innovation(beside, beside.left(())))
    return float(gain - 0.5 * columns.shape[1] * np.log(n))


def _means(
    comparison: Comparison, target: Vector, base: Matrix, rows: Sequence[NDArray[np.intp]], most: int | None = None
) -> _Record:
    """The readings, or means of neighbours so that there are at most about so many, the last of a run of fewer."""
    width = 1 if most is None else -(-sum(len(here) for here in rows) // most)
    columns = np.column_stack([target, comparison.time_s, base])
    parts, runs = [], []
    for here in rows:
        starts = np.arange(0, len(here), width)
        counts = np.diff(np.append(starts, len(here)))
        parts.append(np.add.reduceat(columns[here], starts) / counts[:, None])
        runs.append(len(starts))
    ends, values = np.cumsum(runs).tolist(), np.concatenate(parts)
    slices = tuple(slice(end - n, end) for n, end in zip(runs, ends, strict=True))
    return _Record(values[:, 0], values[:, 2:], values[:, 1], slices, width * comparison.period_s)


def _likeliest_lags(record: _Record, longest_s: float, variance: float) -> Lags:
    """None, one, or two in a row of which one is a third of the other: those with which changes explain most."""
    times = np.geomspace(2.0 * record.period_s, longest_s, _LAGS).tolist()
    cost = {
        lags: _cost(record, lags, variance) for lags in ((), *((t,) for t in times), *((t, t / 3.0) for t in times))
    }
    step = (times[1] / times[0]) ** 0.5
    for _ in range(_FINER):
        best = min(cost, key=lambda lags: cost[lags])
        for factor in (step, 1.0 / step) if best else ():
            lags = tuple(factor * lag for lag in best)
            cost[lags] = _cost(record, lags, variance)
        step **= 0.5
    return min(cost, key=lambda lags: cost[lags])


def _cost(record: _Record, lags_s: Lags, variance: float) -> float:
    changes, left = _pursued(record, lags_s, variance, _MOST_TRIED)
    return float(np.sum(left[-1] ** 2)) / variance + 2.0 * _PRICE * np.log(len(record.target)) * len(changes)


def _chosen(record: _Record, lags_s: Lags, variance: float) -> tuple[list[int], Vector, float]:
    """(readings with a change, what is left, nats gained beyond the price): of the ones in a row that gain most."""
    n = len(record.target)
    changes, left = _pursued(record, lags_s, variance, _MOST)
    alone = np.log(_innovation(record, left[0]))
    price = _PRICE * np.log(n) + _EACH
    gains = [n * (alone - np.log(_innovation(record, rest))) - price * k for k, rest in enumerate(left)]
    best = int(np.argmax(gains))
    return sorted(changes[:best]), left[best], float(gains[best])


def _pursued(record: _Record, lags_s: Lags, variance: float, most: int) -> tuple[list[int], list[Vector]]:
    """(readings with a change, what is left before and after every one): the best next one while it gains its price."""
    n = len(record.target)
    price = 2.0 * _PRICE * np.log(n) * variance
    base = basis(record.columns(lags_s))
    left: list[Vector] = [off(base, record.target)]
    # on an even grid, on which readings that lack are 0
    at, spans = record.grid
    reading = np.full(spans[-1].stop, -1)
    reading[at] = np.arange(n)
    seen, step = reading >= 0, _risen(record.period_s * np.arange(1, spans[-1].stop + 1), lags_s)
    products = _along(spans, step)

    def along(*courses: Vector) -> Matrix:
        grid = np.zeros((len(reading), len(courses)))
        grid[at] = np.column_stack(courses)
        return products(grid)

    possible = seen.copy()
    for part in record.runs:
        places = at[part]
        possible[np.r_[places[:_SHORTEST], places[-_SHORTEST:]]] = False
    free = _along(spans, step**2)(seen.astype(np.float64)[:, None])[:, 0]
    beside = free - np.sum(along(*base.T) ** 2, axis=1)
    shown = along(left[0])[:, 0]
    changes: list[int] = []
    while len(changes) < most:
        gains = np.where(possible & (beside > _OWN * free), shown**2 / np.maximum(beside, 1e-300), 0.0)
        best = int(np.argmax(gains))
        if gains[best] < price:
            break
        end = next(span.stop for span in spans if best < span.stop)
        whole = np.zeros(len(reading))
        whole[best:end] = step[: end - best]
        column = whole[at]
        for _ in range(2):  # once more for what rounding leaves
            column = off(base, column)
        column /= np.linalg.norm(column)
        base = np.column_stack([base, column])
        left.append(left[-1] - column * (column @ left[-1]))
        taken, shown = along(column, left[-1]).T
        beside = beside - taken**2
        possible[max(0, best - _SHORTEST + 1) : best + _SHORTEST] = False
        changes.append(int(reading[best]))
    return changes, left


def _along(spans: Sequence[slice], step: Vector) -> Callable[[Matrix], Matrix]:
    """Courses (n_places, k) → their products with a change of 1 at every place, by Fourier transforms."""
    sizes = [(n := span.stop - span.start, fft.next_fast_len(2 * n, real=True)) for span in spans]
    turned = [np.conj(fft.rfft(step[:n], width))[:, None] for n, width in sizes]

    def products(courses: Matrix) -> Matrix:
        bins = [fft.rfft(courses[span], width, axis=0) for span, (_, width) in zip(spans, sizes, strict=True)]
        parts = zip(bins, turned, sizes, strict=True)
        return np.concatenate([fft.irfft(one * change, width, axis=0)[:n] for one, change, (n, width) in parts])

    return products


def _innovation(record: _Record, left: Vector) -> float:
    """Standard deviation of what each reading brings that the twelve before it do not say."""
    parts = [left[part] for part in record.runs if part.stop - part.start > 3 * _MEMORY]
    if not parts:
        return float(np.std(left)) or 1e-300
    past = [np.lib.stride_tricks.sliding_window_view(part[:-1], _MEMORY) for part in parts]
    now, before = np.concatenate([part[_MEMORY:] for part in parts]), np.concatenate(past)
    return max(float(np.sqrt(np.mean((now - before @ least_squares(before, now)) ** 2))), 1e-300)


def _noise(left: Vector) -> float:
    """Variance of noise with the memory of what is left, as it counts in a mean of many readings."""
    follows = float(np.clip(np.sum(left[1:] * left[:-1]) / max(float(np.sum(left**2)), 1e-300), 0.0, 0.99))
    return float(np.mean(left**2)) * (1.0 + follows) / (1.0 - follows)


def _placed(record: _Record, moments: Sequence[Moment], coarse_s: float, variance: float) -> list[tuple[Moment, float]]:
    """Moments midway between two readings, and half widths [s]: each moved while the others stand; it acts at once."""
    sizes, left = least_squares(record.columns((), moments), record.target), record.left((), moments)
    reach, placed = max(_REACH, int(2.0 * coarse_s / record.period_s)), []
    for (run, at_s), size in zip(moments, sizes[len(sizes) - len(moments) :], strict=True):
        time, here = record.time_s[record.runs[run]], left[record.runs[run]]
        at = int(np.searchsorted(time, at_s))
        here = here + size * (np.arange(len(here)) >= at)
        others = [int(np.searchsorted(time, other_s)) for other, other_s in moments if other == run and other_s != at_s]
        way = min([reach, *(abs(other - at) // 2 for other in others)])  # two that meet would be one of any size
        tried = np.arange(max(1, at - way), min(len(here) - 1, at + way + 1))
        gains = np.cumsum(here[::-1])[::-1][tried] ** 2 / (len(here) - tried)
        best, likely = int(tried[np.argmax(gains)]), tried[gains >= gains.max() - _TELLS**2 * variance]
        middle_s = 0.5 * float(time[best - 1] + time[best])
        placed.append(((run, middle_s), float(max(middle_s - time[likely[0] - 1], time[likely[-1]] - middle_s))))
    return placed


def _fitted(record: _Record, lags_s: Lags, moments: Sequence[Moment]) -> tuple[Lags, list[tuple[Moment, float]]]:
    """Two time constants in a row, moments and half widths [s], all together by least squares.

    Changes of one sign beside each other are one between two readings. A second time constant is first of all a delay:
    for each ratio of the two the others are fitted anew, and the intervals are those of all ratios that are likely.
    Sizes are fitted inside; of slopes, what they change is left out (L. Kaufman, BIT Numer. Math. 15, 1975).
    """
    runs, low_s, high_s = _joined(record, lags_s, moments)
    scale = np.array([0.1, *[record.period_s] * len(runs)])
    bounds = np.array([-1.0, *low_s]) / scale, np.array([1.0, *high_s]) / scale

    def of(values: Vector, ratio: float) -> tuple[Lags, list[Moment]]:
        factor, *times = (values * scale).tolist()
        slow = lags_s[0] * float(np.exp(factor))
        return (slow, slow * ratio), list(zip(runs, times, strict=True))

    fits: list[tuple[float, Lags, list[Moment], Vector, float]] = []
    begin = np.mean(bounds, axis=0)
    for ratio in _RATIOS:

        def left(values: Vector, ratio: float = ratio) -> Vector:
            return record.left(*of(values, ratio))

        def slopes(values: Vector, ratio: float = ratio) -> Matrix:
            columns, first = record.columns(*of(values, ratio)), np.arange(len(values)) == 0
            sizes = least_squares(columns, record.target)
            by_lag, by_time = (record.columns(*of(values + _FURTHER * w, ratio)) - columns for w in (first, ~first))
            moved = np.column_stack([by_lag @ sizes, (by_time * sizes)[:, -len(runs) :]]) / _FURTHER
            return np.asarray(-off(basis(columns), moved))

        fit = optimize.least_squares(left, begin, slopes, bounds, max_nfev=_FITS)
        jacobian, noise = np.asarray(fit.jac), _noise(np.asarray(fit.fun))
        halves = _TELLS * record.period_s * np.sqrt(np.diag(np.linalg.pinv(jacobian.T @ jacobian) * noise))[1:]
        fits.append((float(fit.cost), *of(fit.x, ratio), halves, noise))
    cost, lags, best, halves, noise = min(fits, key=lambda one: one[0])
    for other, _, placed, half, _ in fits:
        if other - cost <= 0.5 * _TELLS**2 * noise:
            away = np.array([abs(at_s - here_s) for (_, at_s), (_, here_s) in zip(placed, best, strict=True)])
            halves = np.maximum(halves, away + half)
    return lags, list(zip(best, np.maximum(halves, _UNKNOWN * sum(lags)).tolist(), strict=True))


def _joined(record: _Record, lags_s: Lags, moments: Sequence[Moment]) -> tuple[list[int], list[float], list[float]]:
    """Runs of the moments, those of one sign beside each other as one, and between what each may lie [s]."""
    sizes = least_squares(record.columns(lags_s, moments), record.target)[-len(moments) :]
    joined: list[tuple[int, float, float]] = []
    for (run, at_s), size in zip(moments, sizes.tolist(), strict=True):
        same, last_s, weight = joined[-1] if joined else (-1, 0.0, 0.0)
        time = record.time_s[record.runs[run]]
        between = np.count_nonzero((time > last_s) & (time <= at_s))  # readings, of which a gap has none
        if run == same and between <= _SHORTEST and size * weight > 0.0:
            joined[-1] = (run, (last_s * weight + at_s * size) / (weight + size), weight + size)
        else:
            joined.append((run, at_s, size))
    low_s, high_s = [], []
    for k, (run, at_s, _) in enumerate(joined):
        # two that meet would be one of any size
        apart = [abs(at_s - other_s) for j, (same, other_s, _) in enumerate(joined) if same == run and j != k]
        inside = record.time_s[record.runs[run]]
        k = int(np.clip(np.searchsorted(inside, at_s), 1, len(inside) - 1))
        reach = _SHORTEST * record.period_s + inside[k] - inside[k - 1]
        way = min([float(reach), *(_PART * distance for distance in apart)])
        low_s.append(max(at_s - way, float(inside[0]) - record.period_s))
        high_s.append(min(at_s + way, float(inside[-2])))
    return [run for run, _, _ in joined], low_s, high_s


def _told(
    comparison: Comparison,
    channel: str,
    record: _Record,
    rows: Sequence[NDArray[np.intp]],
    lags_s: Lags,
    placed: Sequence[tuple[Moment, float]],
    gain: float,
) -> Switched | None:
    """The switch in the rows of the comparison; None where a channel tells when it acts."""
    moments = [moment for moment, _ in placed]
    columns, at_once = record.columns(lags_s, moments), record.columns((), moments)[:, -len(moments) :]
    sizes = least_squares(columns, record.target)
    of_changes, own = sizes[-len(moments) :], columns.shape[1] - len(moments)
    inside = [[k for k, moment in enumerate(moments) if moment[0] == run] for run in range(len(rows))]
    held = [at_once[part][:, of] @ of_changes[of] for part, of in zip(record.runs, inside, strict=True)]
    usual = _usual(held)
    acts, level, first = np.zeros(len(comparison.time_s)), np.zeros(len(comparison.time_s)), []
    for run, (here, part) in enumerate(zip(rows, record.runs, strict=True)):
        start = [own - len(record.runs) + run] if lags_s else []
        behind = [*start, *(own + k for k in inside[run])]
        level[here] = held[run] - usual[run]
        acts[here] = columns[part][:, behind] @ sizes[behind] - usual[run] - float(np.sum(sizes[start]))
        first += [int(here[np.searchsorted(record.time_s[part], moments[k][1])]) for k in inside[run]]
    if in_words(comparison, np.abs(level) >= LARGE * np.abs(level).max()) or _is_commanded(comparison, first):
        return None
    changes = [
        Change(str(comparison.runs[comparison.run_index[rows[run][0]]]), at_s, half, float(size))
        for ((run, at_s), half), size in zip(placed, of_changes, strict=True)
        # smaller ones make up for a shape that is not quite right
        if abs(size) >= LARGE * np.abs(of_changes).max()
    ]
    return Switched(channel, lags_s, tuple(changes), acts, gain)


def _usual(held: Sequence[Vector]) -> list[float]:
    """Of the levels of every run the one that holds longest; where all others lie on one side, the same in all runs."""
    usual = [_longest(levels) for levels in held]
    away = [levels - here for levels, here in zip(held, usual, strict=True)]
    sides = [float(np.sum(of)) / max(float(np.sum(np.abs(of))), 1e-300) for of in away]
    if any(0.0 < abs(side) < _ONE_SIDED for side in sides):
        return usual
    # on for longer than off in one run is still on
    low = sum(float(np.sum(levels - levels.min())) for levels in held)
    high = sum(float(np.sum(levels.max() - levels)) for levels in held)
    return [float(levels.min() if low <= high else levels.max()) for levels in held]


def _longest(levels: Vector) -> float:
    """The level that holds longest, those within a tenth of the span counted together."""
    near = np.abs(levels[:, None] - np.unique(levels)) <= 0.1 * float(np.ptp(levels))
    return float(np.mean(levels[near[:, int(np.argmax(near.sum(axis=0)))]]))


def _is_commanded(comparison: Comparison, changes: Sequence[int]) -> bool:
    """Whether half of the changes stand beside those of a recorded command, which does not change all the time."""
    for channel in comparison.channels:
        if channel.role not in _COMMANDED or channel.name in comparison.responses:
            continue
        values = course(comparison, channel.name)
        moved = np.abs(np.diff(values, prepend=values[0])) > 0.02 * float(np.ptp(values))
        near = np.convolve(moved, np.ones(2 * _SHORTEST + 1), "same") > 0.0
        if near.mean() < _BY_CHANCE and near[list(changes)].mean() >= _COINCIDENT:
            return True
    return False


def told_of_switches(comparison: Comparison, switches: Mapping[str, Switched]) -> tuple[Finding, ...]:
    """A finding for the response in which a switch is surest, with the moments; the other responses are listed."""
    if not switches:
        return ()
    one = max(switches.values(), key=lambda found: found.gain)
    unit, also = comparison.channel(one.channel).unit, sorted(switches.keys() - {one.channel})
    is_long = comparison.longest_s >= _LONG_S
    clock = (lambda at_s: str(timedelta(seconds=round(at_s)))) if is_long else span_text
    moments = [f"{change.run} {clock(change.at_s)}" for change in one.changes]
    more = f" and {len(moments) - _LISTED} more" if len(moments) > _LISTED else ""
    within = float(np.median([change.within_s for change in one.changes]))
    size = float(np.median([abs(change.size) for change in one.changes]))
    follows = f"with time constants of {span_text(sum(one.lags_s))} together" if one.lags_s else "at once"
    statement = (
        f"Something that nobody recorded was switched, by what {one.channel} shows, at {', '.join(moments[:_LISTED])}"
        f"{more} ({'h:min:s ' * is_long}from the start of the run, ±{span_text(within)}): {one.channel} follows "
        f"{follows}, by about {amount(size, unit)}.{f' It shows in {listed(also)}, too.' if also else ''}"
    )
    evidence = {"changes": [vars(change) for change in one.changes], "lags_s": list(one.lags_s), "unit": unit}
    return (FINDINGS.finding(UNRECORDED_SWITCH, statement, Where(channel=one.channel), {**evidence, "also_in": also}),)


def places(
    comparison: Comparison,
    named: Sequence[NamedEffect],
    structures: Sequence[Structure],
    switches: Mapping[str, Switched],
    residuals: Mapping[str, Vector],
) -> tuple[Place, ...]:
    """Windows in which the named effects act, or in which what nothing explains is large.

    `switches` and `residuals` (n_rows,) are by response: what nobody recorded does there, and what is left.
    """
    found: list[Place] = []
    for effect in named:
        if effect.acts is not None:
            run, first, last = effect.acts
            rows = comparison.time_s[comparison.run_index == comparison.runs.index(run)]
            window = float(rows[0] if first is None else first), float(rows[-1] if last is None else last)
            found += [Place(name, effect.place, run, *window, None, effect.share) for name in effect.channels]
            continue
        for channel in effect.channels:
            windows = active_windows(comparison, channel, effect.courses[channel])
            found += [replace(place, place=effect.place, share=place.share * effect.share) for place in windows]
    if not named and structures:
        surest = structures[0]
        regime = surest.regime or surest.band_words
        for channel in switches or [surest.channel]:
            acts = switches[channel].course if switches else residuals[channel]
            windows = active_windows(comparison, channel, acts)
            found += [replace(place, regime=place.regime or regime, p_value=surest.p_value) for place in windows]
    return tuple(found)
