"""How well the shape of a named effect is known: the gain of its neighbours, and between them, as a profile."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from selector.diagnosis.effects.effect import Quantity, Variant
from selector.diagnosis.evidence.bench import Bench
from selector.diagnosis.evidence.moments import solved

_FALL = 3.84
"""Of the gain, at the ends of a 95 % interval: χ² of one parameter."""
_OF_A_STEP = 0.25
"""Of the grid: how far off the top of a parabola through three of its points may be, in logarithms."""
_LAG = "tau_s"
"""Ends the names of parameters that stand on a grid of time constants, even in its logarithm."""


@dataclass(frozen=True)
class _Point:
    """A shape of the same kind: value of one parameter, and its gain."""

    value: float
    gain: float


def shape_intervals(
    bench: Bench, named: Sequence[int], v: int
) -> tuple[Mapping[str, Quantity], dict[str, tuple[float, float]]]:
    """Shape parameters of the named candidate `v`, and the 95 % interval of each where it is known.

    Between grid points of a time constant the gain is a parabola in its logarithm; its top is the value. Where the best
    shape stands at the end of the grid, or has no neighbours to be weighed by, the interval reaches to the next point
    of the grid, and beyond the last one it is open: 0 or infinity.
    """
    others = [other for other in named if other != v]
    gains = solved(bench.moments(bench.base(others))).gain
    own = bench.candidates[v]
    family = [
        (candidate.variant, float(gains[k]))
        for k, candidate in enumerate(bench.candidates)
        if candidate.effect.id == own.effect.id and _is_alike(candidate.variant, own.variant)
    ]
    tried = [
        candidate.variant.shape
        for candidate in bench.candidates
        if candidate.effect.id == own.effect.id and candidate.variant.sources == own.variant.sources
    ]
    shape, intervals = dict(own.variant.shape), {}
    for key, quantity in own.variant.shape.items():
        near = [_Point(one.shape[key].value, gain) for one, gain in family]
        inside = [point.value for point in near if point.gain >= gains[v] - _FALL]
        intervals[key] = (min(inside), max(inside))
        if not key.endswith(_LAG) or quantity.value <= 0.0:
            continue
        grid = sorted({one.value for of in tried for name, one in of.items() if name.endswith(_LAG)})
        top = _top(_profile(near), quantity.value, grid) if len(own.variant.shape) == 1 else None
        if top is None:
            intervals[key] = (_next(grid, intervals[key][0], -1), _next(grid, intervals[key][1], 1))
            continue
        shape[key] = Quantity(top[0], quantity.unit)
        intervals[key] = (min(intervals[key][0], top[1]), max(intervals[key][1], top[2]))
    return shape, intervals


def _is_alike(one: Variant, own: Variant) -> bool:
    same = one.sources == own.sources and one.regime == own.regime and one.run == own.run
    return same and one.shape.keys() == own.shape.keys()


def _profile(points: Sequence[_Point]) -> list[_Point]:
    """The best gain at every value."""
    best: dict[float, float] = {}
    for point in points:
        best[point.value] = max(point.gain, best.get(point.value, -np.inf))
    return [_Point(value, best[value]) for value in sorted(best)]


def _top(points: Sequence[_Point], value: float, grid: Sequence[float]) -> tuple[float, float, float] | None:
    """Top of the parabola through a value and its neighbours, and where the gain has fallen; None without a top."""
    number = next((k for k, point in enumerate(points) if point.value == value), 0)
    if not 0 < number < len(points) - 1 or points[number - 1].value <= 0.0:
        return None
    three = points[number - 1 : number + 2]
    x, y = np.log([point.value for point in three]), np.array([point.gain for point in three])
    curve, slope, _ = np.polyfit(x - x[1], y - y[1], 2)
    if curve >= 0.0 or y[1] < max(y[0], y[2]):
        return None
    top = float(np.clip(-0.5 * slope / curve, x[0] - x[1], x[2] - x[1]))
    step = 0.5 * float(x[2] - x[0])
    half = float(np.hypot(np.sqrt(_FALL / -curve), _OF_A_STEP * step))
    low, high = (float(value * np.exp(top + side * half)) for side in (-1.0, 1.0))
    return (
        float(f"{value * np.exp(top):.6g}"),
        low if low >= grid[0] else 0.0,
        high if high <= grid[-1] else float("inf"),
    )


def _next(grid: Sequence[float], value: float, step: int) -> float:
    """The neighbour of a value on the grid; beyond its ends 0 or infinity."""
    number = int(np.argmin(np.abs(np.array(grid) - value))) + step
    if number < 0:
        return 0.0
    return float(grid[number]) if number < len(grid) else float("inf")
