"""Which leads the residuals of an axis repeat with along its position."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy.signal import medfilt

from selector.diagnosis.comparison import Comparison
from selector.diagnosis.effects.drive._forces import PLACES
from selector.diagnosis.shapes.motion import motion
from selector.diagnosis.shapes.signals import excited, filled
from selector.diagnosis.shapes.simulated_axis import FORCE_ROLES

Vector = NDArray[np.float64]

SHORTEST_M = 5e-4
FEWEST_TURNS = 3.0
N_PEAKS = 6
_FINER = 6
_BINS = 2**13


@lru_cache(maxsize=8)
def leads(comparison: Comparison, axis: str | None) -> tuple[float, ...]:
    """Leads [m] of the highest peaks of the residuals of an axis over its position, longest first; fitted rows only."""
    moving = motion(comparison, axis)
    if moving is None:
        return ()
    used = (moving.sense != 0.0) & ~comparison.held_out
    place = moving.position_m[used]
    if len(place) < 50 or np.ptp(place) < FEWEST_TURNS * SHORTEST_M:
        return ()
    regressors = np.column_stack([
        moving.velocity_m_per_s, moving.acceleration_m_per_s2, moving.sense, moving.position_m, moving.position_m**2,
        *(np.equal(comparison.run_index, k) for k in range(len(comparison.runs))),
    ])  # fmt: skip
    found: list[float] = []
    for name in comparison.responses:
        channel = comparison.channel(name)
        if channel.role not in FORCE_ROLES + PLACES or (axis is not None and channel.axis not in (None, axis)):
            continue
        own = np.column_stack([regressors, filled(comparison, comparison.simulated[name])])[used]
        size = np.sqrt(np.mean(own**2, axis=0))
        own = own[:, size > 0.0] / size[size > 0.0]
        left = filled(comparison, comparison.difference(name))[used]
        left = left - own @ np.linalg.lstsq(own, left, rcond=None)[0]
        if excited(left):
            found += _peaks(place, left, comparison, np.abs(moving.velocity_m_per_s[used]))
    distinct: list[float] = []
    way = float(np.ptp(place))
    for lead in found:
        # closer than half a line width of the whole way: the same line
        if all(abs(1.0 / lead - 1.0 / other) > 0.5 / way for other in distinct):
            distinct.append(lead)
    return tuple(sorted(distinct, reverse=True))


def _peaks(place: Vector, left: Vector, comparison: Comparison, speed: Vector) -> list[float]:
    way = float(np.ptp(place))
    width = way * _FINER / _BINS
    number = np.minimum(((place - place.min()) / way * _FINER**-1 * _BINS).astype(np.intp), _BINS - 1)
    sums = np.bincount(number, weights=left, minlength=_BINS)
    power = np.abs(np.fft.rfft(sums)) ** 2
    frequency = np.fft.rfftfreq(_BINS, width)
    # at least four samples a turn at the usual speed
    travel = float(np.median(speed)) * comparison.period_s
    shortest = max(SHORTEST_M, 4.0 * travel, 4.0 * width)
    inside = (frequency >= FEWEST_TURNS / way) & (frequency <= 1.0 / shortest)
    if inside.sum() < 5:
        return []
    background = medfilt(power[inside], min(15 * _FINER | 1, (int(inside.sum()) - 1) | 1))
    height = power[inside] / np.maximum(background, 1e-300 + 1e-6 * float(power[inside].max()))
    order = [k for k in range(1, len(height) - 1) if height[k] >= max(height[k - 1], height[k + 1])]
    order.sort(key=lambda k: -height[k])
    taken: list[int] = []
    for k in order:
        if all(abs(k - other) > _FINER for other in taken):
            taken.append(k)
        if len(taken) == N_PEAKS:
            break
    return [float(1.0 / frequency[inside][k]) for k in taken]
