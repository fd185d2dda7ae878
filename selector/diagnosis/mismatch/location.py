"""When something acts: windows of time in every run, and the state of the machine that tells them apart."""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numba import njit
from numpy.typing import NDArray

from selector.diagnosis.answer import Place
from selector.diagnosis.comparison import Comparison
from selector.diagnosis.mismatch.background import background, seen_rows, spectrum
from selector.diagnosis.shapes.signals import course, excited, rate
from selector.physics.ranges import true_stretches
from selector.types import Mask, Vector

_MOVING = ("velocity", "feed_rate")
_PLACES = ("position_command", "position")
_LEVELS = ("spindle_speed", "temperature", "ambient", "flow", "force", "current", "voltage", "acceleration")


@dataclass(frozen=True, eq=False)
class Variable:
    """One reading of the machine's state."""

    words: str  #: As it stands in a sentence, e.g. ``"spindle_speed"`` or ``"rate of temperature T2"``.
    unit: str
    values: Vector  #: (n_rows,)
    sources: tuple[str, ...]  #: Channels that it was made of

    def bins(self, n: int) -> NDArray[np.intp]:
        """Number of the bin that every row falls in: its few levels where it has few, else about equally full bins."""
        levels = np.unique(self.values[np.linspace(0, len(self.values) - 1, 4000).astype(int)])
        if len(levels) <= n:
            return np.asarray(np.abs(self.values[:, None] - levels[None, :]).argmin(axis=1))
        edges = np.unique(np.quantile(self.values, np.arange(1, n) / n))
        return np.asarray(np.searchsorted(edges, self.values, side="right"))


def variables(comparison: Comparison) -> tuple[Variable, ...]:
    """Every state of the machine that its channels tell: levels, rates of heating, sense and size of motion."""
    return tuple(v for v in _all(comparison) if excited(v.values))


def _all(comparison: Comparison) -> Iterator[Variable]:
    roles = [channel.role for channel in comparison.channels if channel.name not in comparison.responses]
    for channel in comparison.channels:
        name, role, unit = channel.name, channel.role, channel.unit
        if name in comparison.responses or not np.isfinite(comparison.recorded[name]).any():
            continue
        words = role if roles.count(role) == 1 and role not in ("temperature", "state") else f"{role} {name}"
        values = course(comparison, name)
        if role in _LEVELS or role == "state" or role in _PLACES:
            yield Variable(words, unit, values, (name,))
        if role in ("temperature", "ambient"):
            per_minute = 60.0 * rate(comparison, values, over_samples=21)
            yield Variable(f"rate of {words}", f"{unit}/min", per_minute, (name,))
        if role in _MOVING:
            yield Variable(words, unit, values, (name,))
            yield Variable(f"size of {words}", unit, np.abs(values), (name,))
        if role in _PLACES:
            speed = rate(comparison, values, over_samples=5)
            if not any(channel.role in _MOVING for channel in comparison.channels):
                yield Variable(f"rate of {words}", f"{unit}/s", speed, (name,))
            yield Variable(f"acceleration of {words}", f"{unit}/s²", rate(comparison, speed, over_samples=9), (name,))
            yield Variable(f"distance of {words} since reversal", unit, _since_reversal(comparison, values), (name,))


def _since_reversal(comparison: Comparison, position: Vector) -> Vector:
    """How far the axis has gone since it last turned round; wobble below 1 % of the stroke is no reversal."""
    result = np.zeros(len(position))
    for _, rows in comparison.rows_of_runs():
        part = position[rows]
        wobble = 0.01 * float(np.ptp(part))
        turn = extreme = part[0]
        sense = 0.0
        for k, here in enumerate(part):
            if sense * (here - extreme) >= 0.0 and (sense != 0.0 or abs(here - extreme) > wobble):
                sense, extreme = sense or float(np.sign(here - extreme)), here
            elif sense * (extreme - here) > wobble:
                turn, extreme, sense = extreme, here, -sense
            result[rows.start + k] = abs(here - turn)
    return result


#: Least overlap (rows in both / rows in either) of a state of the machine and what is active.
_AGREEMENT = 0.75


def in_words(comparison: Comparison, active: Mask) -> str | None:
    """The state of the machine that tells best when something acts, in words; None if none tells it well enough."""
    if active.all() or not active.any():
        return None
    best, words = _AGREEMENT, None
    for variable in variables(comparison):
        order = np.argsort(variable.values, kind="stable")
        sorted_values, here = variable.values[order], active[order].astype(np.float64)
        cut = np.flatnonzero(np.diff(sorted_values) > 0)
        if len(cut) == 0:
            continue
        inside = np.cumsum(here)
        total, n = inside[-1], len(here)
        high = (total - inside[cut]) / (n - cut - 1 + inside[cut])
        low = inside[cut] / (cut + 1 + total - inside[cut])
        for scores, sign in ((high, ">"), (low, "<")):
            k = int(np.argmax(scores))
            if scores[k] > best:
                best, limit = float(scores[k]), float(0.5 * (sorted_values[cut[k]] + sorted_values[cut[k] + 1]))
                words = f"{variable.words} {sign} {limit:.4g}{' ' if variable.unit else ''}{variable.unit}"
    return words


Rows = NDArray[np.intp]
LARGE = 0.25  #: A course acts where it is at least this part of its largest amount.
_LARGE_IN_NOISE = 0.3  #: The same in a residual, of what nine tenths of its active rows stay below.
_GAP = 0.025  #: Gaps shorter than this part of the run are no gaps.
_ALWAYS = 0.85  #: Something that acts in more than this part of a run acts in all of it.
_SCALES = (1, 4, 16, 64)
#: Mean squares that a state may have, in those of quiet noise; the first is quiet.
_POWERS = np.array([1.0, 2.5, 6.0, 16.0, 40.0, 120.0, 400.0, 2000.0])
#: What it costs to begin or end, and to change the size of what acts [logarithm of a probability].
_SWITCH, _CHANGE = 4.0, 1.5
_ROUNDS = 5
_FEWEST = 40


def noisy_rows(comparison: Comparison, residual: Vector) -> Mask:
    """Rows in which a residual is more than its quiet noise; none if it is the same throughout.

    Every row is quiet or active with one of several sizes; the likeliest course of these states (Viterbi 1967) for
    normal values, whose likelihood counts the less the longer the noise remembers. What is quiet, its mean and its
    memory are estimated anew with the states. Of the residual smoothed over 1 to 64 samples that one is taken in which
    the states explain most. Rows that are small beside the rest of what acts are then left out.
    """
    parts = [here for here in seen_rows(comparison, residual) if len(here) >= _FEWEST]
    if not parts:
        return np.zeros(len(residual), dtype=np.bool_)
    memory = _memory(residual, parts)
    best, active, course = -np.inf, np.zeros(len(residual), dtype=np.bool_), np.zeros(len(residual))
    for scale in _SCALES:
        if min(len(part) for part in parts) < 8 * scale:
            continue
        smooth = np.zeros(len(residual))
        for part in parts:
            smooth[part] = _smoothed(residual[part] - np.median(residual[part]), scale)
        least = max(0.5 * memory, 2.0 * scale / 3.0 + (0.5 * memory if memory > 4.0 else 0.0))
        found, centred, gain = _states(smooth, parts, least)
        if gain > best:
            best, active, course = gain, found, _amount(centred, parts, scale)
    if not active.any():
        return active
    return _without_gaps(comparison, active & (course >= _LARGE_IN_NOISE * float(np.quantile(course[active], 0.9))))


def _states(values: Vector, parts: list[Rows], memory: float) -> tuple[Mask, Vector, float]:
    """(active rows, values about the mean of the quiet ones, logarithm of the likelihood gained by switching)."""
    values = values.copy()
    seen = np.concatenate(parts)
    active = np.zeros(len(values), dtype=np.bool_)
    blocks = [
        float(np.mean(block**2))
        for part in parts
        for block in np.array_split(values[part], max(4, min(40, int(len(part) / max(10.0, 2.0 * memory)))))
    ]
    quiet, least, gain = max(float(np.quantile(blocks, 0.3)), 1e-300), memory, -np.inf
    for _ in range(_ROUNDS):
        likely = 0.0
        for part in parts:
            logs = -0.5 * (np.log(_POWERS) + values[part, None] ** 2 / quiet / _POWERS) / memory
            states = _viterbi(logs, _SWITCH, _CHANGE)
            active[part] = states > 0
            switches = int(np.sum(np.diff((states > 0).astype(np.int8)) != 0))
            likely += float(logs[np.arange(len(part)), states].sum()) - _SWITCH * switches
        power = max(float(np.mean(values[seen] ** 2)) / quiet, 1e-300)
        gain = likely + 0.5 * (np.log(power) + 1.0) * len(seen) / memory
        rest = seen[~active[seen]]
        if len(rest) < 0.1 * len(seen):
            break
        for part in parts:
            still = part[~active[part]]
            if len(still) > _FEWEST // 2:
                values[part] -= values[still].mean()
        quiet = max(float(np.mean(values[rest] ** 2)), 1e-300)
        beside = np.diff(rest) == 1
        follows = float(np.mean(values[rest][1:][beside] * values[rest][:-1][beside])) / quiet if beside.any() else 0.0
        follows = float(np.clip(follows, 0.0, 0.98))
        memory = max(least, (1.0 + follows**2) / (1.0 - follows**2))
    return active, values, float(gain)


@njit(cache=True, nogil=True)
def _viterbi(logs, switch, change):  # type: ignore[no-untyped-def]
    n, count = logs.shape
    origin = np.empty((n, count), np.int64)
    score, following = logs[0].copy(), np.empty(count)
    for t in range(1, n):
        for k in range(count):
            best, at = -np.inf, 0
            for j in range(count):
                cost = 0.0 if j == k else (switch if j == 0 or k == 0 else change)
                if score[j] - cost > best:
                    best, at = score[j] - cost, j
            following[k], origin[t, k] = best + logs[t, k], at
        score, following = following, score
    states = np.empty(n, np.int64)
    states[n - 1] = np.argmax(score)
    for t in range(n - 1, 0, -1):
        states[t - 1] = origin[t, states[t]]
    return states


def _memory(residual: Vector, parts: list[Rows]) -> float:
    """Samples after which squares of the noise say something new, from its spectrum at short scales."""
    values = np.where(np.isfinite(residual), residual, 0.0)[None, :]
    levels = background(spectrum(values, parts), wanders=False).levels[0]
    ends = np.ones(len(levels))
    ends[[0, -1]] = 0.5
    lags = np.cos(np.outer(np.arange(60), np.linspace(0.0, np.pi, len(levels)))) @ (levels * ends)
    return float(1.0 + 2.0 * np.sum((lags[1:] / max(lags[0], 1e-300)) ** 2))


def _smoothed(values: Vector, width: int) -> Vector:
    kernel = np.ones(width)
    return np.asarray(np.convolve(values, kernel, "same") / np.convolve(np.ones(len(values)), kernel, "same"))


def _amount(values: Vector, parts: list[Rows], scale: int) -> Vector:
    result = np.zeros(len(values))
    for part in parts:
        result[part] = _smoothed(np.abs(values[part]), max(5, scale))
    return result


def _without_gaps(comparison: Comparison, active: Mask) -> Mask:
    """Active rows with short gaps filled; a run that is active nearly throughout is so as a whole."""
    active = active.copy()
    for _, rows in comparison.rows_of_runs():
        part, time = active[rows], comparison.time_s[rows]
        longest = _GAP * float(time[-1] - time[0])
        for last, first in pairwise(np.flatnonzero(part)):
            if first - last > 1 and time[first] - time[last] <= longest:
                part[last:first] = True
        if part.mean() > _ALWAYS:
            part[:] = True
    return active


_TRIFLE = 0.002  #: Windows with a smaller share of a course are not worth a word.


def active_windows(comparison: Comparison, response: str, course: Vector) -> tuple[Place, ...]:
    """Windows in which something acts, with the state of the machine that tells when; `share` is of the sum of squares.

    `course` is an effect's fitted course, which acts where it is at least a quarter of its largest amount, or a
    residual, in which it acts where that is more than quiet noise. What acts in most of a run acts in all of it.
    """
    clean = np.nan_to_num(course)
    if _is_clean(comparison, course):
        largest = float(np.abs(clean).max(initial=0.0))
        active = _without_gaps(comparison, np.abs(clean) >= LARGE * largest) & (largest > 0.0)
    else:
        active = noisy_rows(comparison, course)
        if not active.any():
            active = np.isfinite(course)
    regime = in_words(comparison, active)
    total = float(np.sum(clean[active] ** 2)) or 1.0
    places = []
    for run, rows in comparison.rows_of_runs():
        for first, end in true_stretches(active[rows]):
            window = slice(rows.start + first, rows.start + end)
            share = float(np.sum(clean[window] ** 2)) / total
            if share < _TRIFLE:
                continue
            start, stop = float(comparison.time_s[window][0]), float(comparison.time_s[window][-1])
            places.append(Place(response, comparison.channel(response).place, run, start, stop, regime, share))
    return tuple(places)


def _is_clean(comparison: Comparison, course: Vector) -> bool:
    """Whether a course has no noise: complete, and its innovations are a small part of it."""
    if not np.isfinite(course).all():
        return False
    rows = seen_rows(comparison, course)
    if sum(len(here) for here in rows) == 0 or not np.any(course):
        return True
    # A noisy course changes its sense of motion at every other sample.
    turns = [np.mean(np.diff(np.sign(np.diff(course[here]))) != 0.0) for here in rows if len(here)]
    return float(np.mean(turns)) < 0.35
