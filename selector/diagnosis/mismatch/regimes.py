"""In which states of the machine a mismatch may sit: what the recorded channels say about speed, direction, heat."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from selector.diagnosis.comparison import Comparison
from selector.diagnosis.shapes.signals import course, excited, rate

Vector = NDArray[np.float64]
Mask = NDArray[np.bool_]
_MOVING = ("velocity", "feed_rate")
_PLACES = ("position_command", "position")
_LEVELS = ("spindle_speed", "temperature", "ambient", "flow", "force", "current", "voltage", "acceleration")


@dataclass(frozen=True, eq=False)
class Variable:
    """One reading of the machine's state.

    Attributes
    ----------
    words : str
        As it stands in a sentence, e.g. ``"spindle_speed"`` or ``"rate of temperature T2"``.
    unit : str
    values : ndarray of shape (n_rows,)
    sources : tuple of str
        Channels that it was made of.
    """

    words: str
    unit: str
    values: Vector
    sources: tuple[str, ...]

    def bins(self, n: int) -> NDArray[np.intp]:
        """Number of the bin that every row falls in: its few levels where it has few, else about equally full bins."""
        levels = np.unique(self.values[np.linspace(0, len(self.values) - 1, 4000).astype(int)])
        if len(levels) <= n:
            return np.asarray(np.abs(self.values[:, None] - levels[None, :]).argmin(axis=1))
        edges = np.unique(np.quantile(self.values, np.arange(1, n) / n))
        return np.asarray(np.searchsorted(edges, self.values, side="right"))

    def above(self, limit: float) -> str:
        """In words: more than a limit."""
        return f"{self.words} > {limit:.4g}{' ' if self.unit else ''}{self.unit}"

    def below(self, limit: float) -> str:
        """In words: less than a limit."""
        return f"{self.words} < {limit:.4g}{' ' if self.unit else ''}{self.unit}"


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


def in_words(comparison: Comparison, active: Mask, *, agreement: float = 0.75) -> str | None:
    """The state of the machine that tells best when something acts, in words; None if none tells it well enough.

    `agreement` is the least overlap (rows in both / rows in either) of the state and what is `active`.
    """
    if active.all() or not active.any():
        return None
    best, words = agreement, None
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
        for scores, says in ((high, variable.above), (low, variable.below)):
            k = int(np.argmax(scores))
            if scores[k] > best:
                best = float(scores[k])
                words = says(float(0.5 * (sorted_values[cut[k]] + sorted_values[cut[k] + 1])))
    return words
