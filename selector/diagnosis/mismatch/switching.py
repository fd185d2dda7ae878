"""Whether what is left is what an unrecorded switch does: at which moments, how quickly the response follows."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import fft
from scipy.linalg import orth

from selector.diagnosis.comparison import Comparison
from selector.diagnosis.finding_table import FINDINGS, UNRECORDED_SWITCH
from selector.diagnosis.mismatch.background import seen_rows
from selector.diagnosis.mismatch.location import LARGE, in_words
from selector.diagnosis.shapes.residual import least_squares
from selector.diagnosis.wording import amount, duration_words, listed
from selector.findings import Finding, Where
from selector.types import Matrix, Vector

Lags = tuple[float, ...]  #: Time constants in a row [s]

_READINGS = 2000  #: Of a response that are searched; of longer records means of neighbours.
_MOST, _MOST_TRIED = 120, 30  #: Changes of all runs together, and while time constants are compared.
_SHORTEST = 5  #: Readings between two changes: what is shorter is a stray.
_LAGS, _FINER = 6, 3  #: Time constants that are tried beside none, and how often between them.
_MEMORY = 12  #: Readings of the noise's past.
_PRICE = 1.5  #: Of a change, in ln(readings) nats: its moment, and its size by Bayes' criterion.
_SURE, _EACH = 12.0, 3.0  #: Nats beyond the price, and for each change: with fewer it is no switch.
_LEFT = 0.25  #: Of what recalibration leaves above the noise: with more it is not what a switch does.
_OWN = 1e-6  #: Of a change's sum of squares: with less beside the others it says nothing.
_TELLS = 2.0  #: Nats by which the ends of the interval of a moment are less likely: two standard errors.
_COMMANDED = ("spindle_speed", "feed_rate", "flow", "state", "load")
#: Of the changes that stand beside those of a command: from here on they are the command's, if by chance fewer would.
_COINCIDENT, _BY_CHANCE = 0.5, 0.25
_STEPS = 2.0  #: Of the readings: smaller changes may be rounding.
_LISTED = 4


@dataclass(frozen=True, eq=False)
class Switched:
    """What something does to one response that changes its level at some moments and that is not recorded."""

    channel: str
    lags_s: Lags  #: Time constants with which the response follows [s]; none: at once
    #: (row, half width of its interval [s], change of the level [unit of the response]) of every large change, by time
    changes: tuple[tuple[int, float, float], ...]
    course: Vector  #: (n_rows,): What it does, from the level that holds longest [unit of the response]
    gain: float  #: Nats beyond noise of any memory, the price of the changes paid


@dataclass(frozen=True, eq=False)
class _Record:
    """Readings of one response, runs in a row: what is to be explained, and what recalibration may take."""

    target: Vector  #: (n,)
    base: Matrix  #: (n, p)
    runs: tuple[tuple[int, int], ...]  #: First reading of every run and the one after its last
    period_s: float

    def lagged(self, n: int, lags_s: Lags) -> Vector:
        """What n readings are after a change of 1 at the first."""
        if not lags_s:
            return np.ones(n)
        slow = np.exp(-self.period_s * np.arange(1, n + 1) / lags_s[0])
        if len(lags_s) == 1:
            return np.asarray(1.0 - slow)
        quick = np.exp(-self.period_s * np.arange(1, n + 1) / lags_s[1])
        return np.asarray(1.0 - (lags_s[0] * slow - lags_s[1] * quick) / (lags_s[0] - lags_s[1]))

    def step(self, reading: int, lags_s: Lags) -> Vector:
        """A change of 1 at a reading, to the end of its run."""
        result, end = np.zeros(len(self.target)), next(b for _, b in self.runs if reading < b)
        result[reading:end] = self.lagged(end - reading, lags_s)
        return result

    def columns(self, lags_s: Lags, changes: Sequence[int] = ()) -> Matrix:
        """Recalibration, for every run its level and what is left of an earlier one, and changes."""
        firsts = [a for a, _ in self.runs]
        levels = [self.step(a, ()) for a in firsts]
        return np.column_stack(
            [self.base, *levels, *(self.step(k, lags_s) for k in (*(firsts if lags_s else ()), *changes))]
        )

    def left(self, lags_s: Lags, changes: Sequence[int] = ()) -> Vector:
        """What is left beside changes."""
        columns = self.columns(lags_s, changes)
        return np.asarray(self.target - columns @ least_squares(columns, self.target))


def switched(
    comparison: Comparison, channel: str, target: Vector, base: Matrix, resolution: float = 0.0
) -> Switched | None:
    """What a switch that nobody recorded does to a response; None if noise of any memory explains it as well.

    Constant levels that the response follows at once or with one time constant are fitted beside recalibration: changes
    are added while each gains more than its price (orthogonal matching pursuit). Then the innovations of two
    autoregressions are compared, of what that leaves and of what recalibration alone leaves.

    Parameters
    ----------
    comparison : Comparison
    channel : str
        The response.
    target : ndarray of shape (n_rows,)
        Recorded − simulated [unit of the response]; NaN where one is missing.
    base : ndarray of shape (n_rows, p)
        What recalibration may add.
    resolution : float
        Step of the readings [unit of the response]: a slow course that is rounded changes by one step at a time.
    """
    rows = [here for here in seen_rows(comparison, target) if len(here)]
    if not rows:
        return None
    width = -(-sum(len(here) for here in rows) // _READINGS)
    record = _means(target, base, rows, width, comparison.period_s)
    longest_s = record.period_s * max(b - a for a, b in record.runs)
    quiet = _variance_of_changes(record)
    lags_s = _likeliest_lags(record, longest_s / 3.0, quiet)
    if lags_s and lags_s[0] > longest_s / 5.0:
        return None
    changes, left, gain = _chosen(record, lags_s, quiet)
    alone, rest = (float(np.mean(of**2)) - quiet for of in (record.left(lags_s), left))
    if gain < _SURE or rest > _LEFT * alone:
        return None
    follows = float(np.clip(np.sum(left[1:] * left[:-1]) / max(float(np.sum(left**2)), 1e-300), 0.0, 0.999))
    variance = float(np.mean(left**2)) * (1.0 + follows) / (1.0 - follows)
    every = _means(target, base, rows, 1, comparison.period_s)
    first = {a: b for (a, _), (b, _) in zip(record.runs, every.runs, strict=True)}
    starts = [max(a for a in first if a <= k) for k in changes]
    placed = [first[a] + width * (k - a) for k, a in zip(changes, starts, strict=True)]
    moments = _placed(every, lags_s, placed, width, variance * width)
    found = _told(comparison, channel, every, np.concatenate(rows), lags_s, moments, gain)
    is_rounding = found and np.median([abs(size) for _, _, size in found.changes]) < _STEPS * resolution
    return None if is_rounding else found


def gain_beside(
    comparison: Comparison, target: Vector, base: Matrix, columns: Matrix, other: Vector | None = None
) -> float:
    """Nats that columns (n_rows, p) gain beside recalibration and another course, less Bayes' price for them."""
    rows = [here for here in seen_rows(comparison, target) if len(here)]
    whole = base if other is None else np.column_stack([base, other])
    width = -(-sum(len(here) for here in rows) // _READINGS)
    small, large = (
        _means(target, of, rows, width, comparison.period_s) for of in (whole, np.column_stack([whole, columns]))
    )
    n = len(small.target)
    gain = n * np.log(_innovation(small, small.left(())) / _innovation(large, large.left(())))
    return float(gain - 0.5 * columns.shape[1] * np.log(n))


def _means(target: Vector, base: Matrix, rows: Sequence[NDArray[np.intp]], width: int, period_s: float) -> _Record:
    """Means of `width` neighbours, run by run, the last of fewer."""
    columns = np.column_stack([target, base])
    parts, runs, first = [], [], 0
    for here in rows:
        starts = np.arange(0, len(here), width)
        counts = np.diff(np.append(starts, len(here)))
        parts.append(np.add.reduceat(columns[here], starts) / counts[:, None])
        runs.append((first, first + len(starts)))
        first += len(starts)
    values = np.concatenate(parts)
    return _Record(values[:, 0], values[:, 1:], tuple(runs), width * period_s)


def _variance_of_changes(record: _Record) -> float:
    """Variance of noise, from its changes from reading to reading, of which a switch makes few."""
    changes = np.concatenate([np.diff(record.target[a:b]) for a, b in record.runs])
    return max(0.5 * (1.4826 * float(np.median(np.abs(changes)))) ** 2, 1e-300)


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
    """(changes, what they leave, nats that they gain beyond their price): of the ones in a row that gain most."""
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
    columns = record.columns(lags_s)
    base = orth(columns / np.maximum(np.linalg.norm(columns, axis=0), 1e-300), rcond=1e-9)
    left = [record.target - base @ (base.T @ record.target)]
    free = np.concatenate([np.cumsum(record.lagged(b - a, lags_s) ** 2)[::-1] for a, b in record.runs])
    beside = free - np.sum(_along(record, lags_s, base) ** 2, axis=1)
    possible = np.ones(n, dtype=np.bool_)
    for a, b in record.runs:
        possible[a : a + _SHORTEST] = possible[max(a, b - _SHORTEST) : b] = False
    changes: list[int] = []
    while len(changes) < most:
        shown = _along(record, lags_s, left[-1][:, None])[:, 0]
        gains = np.where(possible & (beside > _OWN * free), shown**2 / np.maximum(beside, 1e-300), 0.0)
        best = int(np.argmax(gains))
        if gains[best] < price:
            break
        column = record.step(best, lags_s)
        for _ in range(2):  # once more for what rounding leaves
            column = column - base @ (base.T @ column)
        column /= np.linalg.norm(column)
        base = np.column_stack([base, column])
        left.append(left[-1] - column * (column @ left[-1]))
        beside = beside - _along(record, lags_s, column[:, None])[:, 0] ** 2
        possible[max(0, best - _SHORTEST + 1) : best + _SHORTEST] = False
        changes.append(best)
    return changes, left


def _along(record: _Record, lags_s: Lags, courses: Matrix) -> Matrix:
    """Products of courses with a change of 1 at every reading, by Fourier transforms; shape as `courses`."""
    parts = []
    for a, b in record.runs:
        n = fft.next_fast_len(2 * (b - a), real=True)
        step = np.conj(fft.rfft(record.lagged(b - a, lags_s), n))[:, None]
        parts.append(fft.irfft(fft.rfft(courses[a:b], n, axis=0) * step, n, axis=0)[: b - a])
    return np.concatenate(parts)


def _innovation(record: _Record, left: Vector) -> float:
    """Standard deviation of what each reading brings that the twelve before it do not say."""
    long_enough = [(a, b) for a, b in record.runs if b - a > 3 * _MEMORY]
    if not long_enough:
        return float(np.std(left)) or 1e-300
    now = np.concatenate([left[a + _MEMORY : b] for a, b in long_enough])
    past = np.column_stack(
        [np.concatenate([left[a + _MEMORY - k : b - k] for a, b in long_enough]) for k in range(1, _MEMORY + 1)]
    )
    return max(float(np.sqrt(np.mean((now - past @ least_squares(past, now)) ** 2))), 1e-300)


def _placed(
    record: _Record, lags_s: Lags, changes: Sequence[int], width: int, variance: float
) -> list[tuple[int, float]]:
    """(reading, half width of its interval [s]) of every change, each moved while the others stand."""
    reach, placed = max(2 * width, _SHORTEST - 1), list(changes)
    halves = [0.0] * len(placed)
    for _ in range(2):
        left, sizes = record.left(lags_s, placed), least_squares(record.columns(lags_s, placed), record.target)
        for k, size in enumerate(sizes[len(sizes) - len(placed) :]):
            a, b = next(run for run in record.runs if placed[k] < run[1])
            tried = np.arange(max(a + 1, placed[k] - reach), min(b - 1, placed[k] + reach + 1))
            here = left[a:b] + size * record.step(placed[k], lags_s)[a:b]
            steps = [record.step(int(at), lags_s)[a:b] for at in tried]
            gains = np.array([(here @ step) ** 2 / (step @ step) for step in steps])
            likely = tried[gains >= gains.max() - 2.0 * _TELLS * variance]
            placed[k], halves[k] = int(tried[np.argmax(gains)]), 0.5 * record.period_s * float(np.ptp(likely) + 1)
    return sorted(zip(placed, halves, strict=True))


def _told(
    comparison: Comparison,
    channel: str,
    record: _Record,
    rows: NDArray[np.intp],
    lags_s: Lags,
    moments: Sequence[tuple[int, float]],
    gain: float,
) -> Switched | None:
    """The switch in the rows of the comparison; None where a channel tells when it acts."""
    changes = [reading for reading, _ in moments]
    columns = record.columns(lags_s, changes)
    sizes = least_squares(columns, record.target)
    own = columns.shape[1] - len(changes)
    course, level = np.zeros(len(comparison.time_s)), np.zeros(len(comparison.time_s))
    for k, (a, b) in enumerate(record.runs):
        inside = [own + j for j, at in enumerate(changes) if a <= at < b]
        started = [own - len(record.runs) + k] if lags_s else []
        held = np.zeros(b - a)
        for j in inside:
            held[changes[j - own] - a :] += sizes[j]
        usual = _longest(held)
        moved = columns[a:b, [*started, *inside]] @ sizes[[*started, *inside]]
        if lags_s:
            usual += sizes[started[0]]
        course[rows[a:b]], level[rows[a:b]] = moved - usual, held - _longest(held)
    active = np.abs(level) >= LARGE * np.abs(level).max()
    if in_words(comparison, active) or _is_commanded(comparison, rows[changes]):
        return None
    least = LARGE * float(np.abs(sizes[own:]).max())  # smaller ones make up for a shape that is not quite right
    told = [(int(rows[at]), half, float(size)) for (at, half), size in zip(moments, sizes[own:], strict=True)]
    return Switched(channel, lags_s, tuple(one for one in told if abs(one[2]) >= least), course, gain)


def _longest(levels: Vector) -> float:
    """The level that holds longest, those within a tenth of the span counted together."""
    near = np.abs(levels[:, None] - np.unique(levels)) <= 0.1 * float(np.ptp(levels))
    return float(np.mean(levels[near[:, int(np.argmax(near.sum(axis=0)))]]))


def _is_commanded(comparison: Comparison, changes: NDArray[np.intp]) -> bool:
    """Whether half of the changes stand beside those of a recorded command, which does not change all the time."""
    for channel in comparison.channels:
        if channel.role not in _COMMANDED or channel.name in comparison.responses:
            continue
        values = comparison.recorded[channel.name]
        moved = np.abs(np.diff(values, prepend=values[0])) > 0.02 * float(np.nanmax(values) - np.nanmin(values))
        near = np.convolve(moved, np.ones(2 * _SHORTEST + 1), "same") > 0.0
        if near.mean() < _BY_CHANCE and near[changes].mean() >= _COINCIDENT:
            return True
    return False


def told_of_switches(comparison: Comparison, switches: Mapping[str, Switched]) -> tuple[Finding, ...]:
    """A finding for the response in which a switch is surest, with the moments; the other responses are listed."""
    if not switches:
        return ()
    one = max(switches.values(), key=lambda found: found.gain)
    unit, also = comparison.channel(one.channel).unit, sorted(switches.keys() - {one.channel})
    runs = [str(comparison.runs[comparison.run_index[row]]) for row, _, _ in one.changes]
    times = [float(comparison.time_s[row]) for row, _, _ in one.changes]
    moments = [f"{run} at {duration_words(time)}" for run, time in zip(runs, times, strict=True)]
    more = f" and {len(moments) - _LISTED} more" if len(moments) > _LISTED else ""
    within = float(np.median([half for _, half, _ in one.changes]))
    size = float(np.median([abs(change) for _, _, change in one.changes]))
    follows = f"with a time constant of {duration_words(one.lags_s[0])}" if one.lags_s else "at once"
    statement = (
        f"{one.channel} behaves as if something were switched that nobody recorded: "
        f"{', '.join(moments[:_LISTED])}{more}, known to about ±{duration_words(within)}. "
        f"It follows {follows}; half of the changes are larger than {amount(size, unit)}."
    )
    statement += f" {listed(also)} shows it, too." if also else ""
    changes = [
        {"run": run, "at_s": time, "within_s": half, "change": change}
        for run, time, (_, half, change) in zip(runs, times, one.changes, strict=True)
    ]
    evidence = {"changes": changes, "lags_s": list(one.lags_s), "unit": unit, "also_in": also}
    return (FINDINGS.finding(UNRECORDED_SWITCH, statement, Where(channel=one.channel), evidence),)
