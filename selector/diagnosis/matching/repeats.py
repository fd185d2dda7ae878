"""Runs of one programme: what differs between them is no missing physics, but how well the machine repeats."""

from __future__ import annotations

from itertools import combinations

import numpy as np

from selector.diagnosis.comparison import Comparison
from selector.types import Vector

_MOST = 15
_SAME_LENGTH = 1.05
_ALIKE = 0.1
"""Of its root mean square: by how much a simulated course or an input differs between repeats at most."""


def repeats(comparison: Comparison, response: str) -> tuple[tuple[slice, slice], ...]:
    """Rows, from the start of each, of pairs of runs that were asked the same; at most 15 pairs."""
    pairs: list[tuple[slice, slice]] = []
    inputs = [channel.name for channel in comparison.channels if channel.name not in comparison.simulated]
    for (_, one), (_, other) in combinations(comparison.rows_of_runs(), 2):
        lengths = one.stop - one.start, other.stop - other.start
        if max(lengths) > _SAME_LENGTH * min(lengths) or len(pairs) == _MOST:
            continue
        first, second = (slice(of.start, of.start + min(lengths)) for of in (one, other))
        courses = [comparison.simulated[response], *(comparison.recorded[name] for name in inputs)]
        if all(rms(of[first] - of[second]) <= _ALIKE * rms(of) for of in courses):
            pairs.append((first, second))
    return tuple(pairs)


def pure_error(comparison: Comparison, response: str) -> float | None:
    """Standard deviation of one reading between runs of one programme [unit]; None without any."""
    squares, n = 0.0, 0
    for first, second in repeats(comparison, response):
        apart = comparison.difference(response)[first] - comparison.difference(response)[second]
        apart = apart[np.isfinite(apart)]
        squares += 0.5 * float(np.sum(apart**2))
        n += len(apart)
    return float(np.sqrt(squares / n)) if n else None


def rms(values: Vector) -> float:
    """Root mean square of what is not missing; NaN where all is."""
    values = values[np.isfinite(values)]
    return float(np.sqrt(np.mean(values**2))) if len(values) else float("nan")
