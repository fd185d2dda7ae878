"""What an axis does: position, speed, acceleration, sense of motion and way since the last reversal."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numba import njit
from numpy.typing import NDArray
from scipy.signal import savgol_filter

from selector.diagnosis.comparison import Comparison
from selector.diagnosis.shapes.signals import filled, lagged

Vector = NDArray[np.float64]

NOISE_SHARE = 0.02
"""Noise that smoothing may leave in an acceleration, as a share of its root mean square."""
LONGEST_SMOOTHING_S = 0.06
MOVING_SHARE = 0.002
"""Below this share of the largest speed an axis counts as standing, unless noise asks for more."""
UM = 1e-6


@dataclass(frozen=True, eq=False)
class Motion:
    """Motion of one axis at the rows of a comparison; arrays of shape (n_rows,).

    Attributes
    ----------
    position_m, velocity_m_per_s, acceleration_m_per_s2 : ndarray
        Where the table is [m], [m/s], [m/s²]; made of a speed only, the position counts from the start of each run.
    sense : ndarray
        +1, −1, and 0 while the axis stands.
    held_sense : ndarray
        The same, but the last sense is held while it stands; 0 before the first motion of a run.
    since_reversal_m : ndarray
        Way since the held sense last changed, or since the start of the run [m].
    rest_speed_m_per_s : float
        Below this the axis counts as standing [m/s].
    sources : tuple of str
        Channels that it was made of.
    """

    position_m: Vector
    velocity_m_per_s: Vector
    acceleration_m_per_s2: Vector
    sense: Vector
    held_sense: Vector
    since_reversal_m: Vector
    rest_speed_m_per_s: float
    sources: tuple[str, ...]
    starts: tuple[int, ...]

    def friction_state(self, presliding_m: float) -> Vector:
        """Share of the dry friction that acts, −1…1, shape (n_rows,): it turns over within a short way.

        z' = v − |v|·z per presliding distance, exact between samples. P. Dahl (1968), A solid friction model.
        """
        return np.asarray(_bristle(self.position_m, np.asarray(self.starts), presliding_m))


@lru_cache(maxsize=8)
def motion(comparison: Comparison, axis: str | None = None) -> Motion | None:
    """What the axis does, or None if no channel tells or nothing moves.

    The table is where its command and the simulated error of that axis put it, which has no noise; without such an
    error it is behind the command by what the recorded position or speed say. Without a command: the recorded
    position (of a compared channel what was simulated), else the way of the recorded speed. Channels of another axis
    are left out if this one has any.
    """
    command = _named(comparison, "position_command", axis)
    position = _named(comparison, "position", axis)
    velocity = _named(comparison, "velocity", axis)
    if command is not None:
        place, by = _followed(comparison, _values(comparison, command), position, velocity, axis)
        sources = (command, *by)
    elif position is not None:
        place, sources = _values(comparison, position), (position,)
    elif velocity is not None:
        place, sources = _way(comparison, _values(comparison, velocity)), (velocity,)
    else:
        return None
    speed, acceleration = derivatives(comparison, place)
    return _described(comparison, place, speed, acceleration, sources)


def commanded(comparison: Comparison, axis: str | None = None) -> Vector | None:
    """Commanded position [m], shape (n_rows,); None if it was not recorded."""
    name = _named(comparison, "position_command", axis)
    return None if name is None else _values(comparison, name)


def derivatives(comparison: Comparison, place: Vector) -> tuple[Vector, Vector]:
    """Speed and acceleration of a position, smoothed no more than its noise asks for."""
    n = _window(comparison, place)
    speed, acceleration = np.zeros(len(place)), np.zeros(len(place))
    for _, rows in comparison.rows_of_runs():
        part, time = place[rows], comparison.time_s[rows]
        if len(part) < 9:
            continue
        step = float(np.median(np.diff(time)))
        even = np.arange(time[0], time[-1] + 0.5 * step, step)
        uneven = np.ptp(np.diff(time)) > 0.05 * step
        values = np.interp(even, time, part) if uneven else part
        window = min(n, (len(values) - 1) | 1, len(values) - 1 + len(values) % 2)
        first = savgol_filter(values, window, 3, deriv=1, delta=step)
        second = savgol_filter(values, window, 3, deriv=2, delta=step)
        speed[rows] = np.interp(time, even, first) if uneven else first
        acceleration[rows] = np.interp(time, even, second) if uneven else second
    return speed, acceleration


def _named(comparison: Comparison, role: str, axis: str | None) -> str | None:
    seen = [c for c in comparison.channels if c.role == role and np.isfinite(comparison.recorded[c.name]).any()]
    of_axis = [c for c in seen if axis is not None and c.axis == axis]
    of_none = [c for c in seen if axis is None or c.axis is None]
    # a channel that is itself compared is the last choice
    chosen = sorted(of_axis or of_none or seen, key=lambda channel: channel.name in comparison.responses)
    return chosen[0].name if chosen else None


def _values(comparison: Comparison, name: str) -> Vector:
    simulated = comparison.simulated.get(name)
    return filled(comparison, comparison.recorded[name] if simulated is None else simulated)


def _way(comparison: Comparison, speed: Vector) -> Vector:
    way = np.zeros(len(speed))
    for _, rows in comparison.rows_of_runs():
        steps = 0.5 * (speed[rows][1:] + speed[rows][:-1]) * np.diff(comparison.time_s[rows])
        way[rows] = np.r_[0.0, np.cumsum(steps)]
    return way


def _followed(
    comparison: Comparison, command: Vector, position: str | None, velocity: str | None, axis: str | None
) -> tuple[Vector, tuple[str, ...]]:
    """Where the table is while it follows its command, and the channels that tell."""
    speed, acceleration = derivatives(comparison, command)
    errors = [c for c in comparison.channels if c.role == "displacement" and c.name in comparison.simulated]
    errors = [c for c in errors if axis is None or c.axis in (axis, None)]
    if errors:
        error = UM * filled(comparison, comparison.simulated[errors[0].name])
        # a command is followed, not led: that tells which sign the error has
        sign = -1.0 if float(error @ speed) > 0.0 else 1.0
        return command + sign * error, (errors[0].name,)
    if position is not None:
        place = _values(comparison, position)
        if position in comparison.simulated or _window(comparison, place) < _longest_window(comparison, place):
            return place, (position,)
        behind, course, by = command - _values(comparison, position), speed, position
    elif velocity is not None:
        behind, course, by = speed - _values(comparison, velocity), acceleration, velocity
    else:
        return command, ()
    power = float(course @ course)
    lag_s = min(float(course @ behind) / power, 0.2) if power > 0.0 else 0.0
    if lag_s < 0.5 * comparison.period_s:
        return command, ()
    return lagged(comparison, command, lag_s, settled=True), (by,)


def _window(comparison: Comparison, place: Vector) -> int:
    """Odd number of samples of the shortest cubic whose second derivative is quiet enough."""
    step = comparison.period_s
    third = np.diff(place, 3)[comparison.run_index[3:] == comparison.run_index[:-3]]
    longest = _longest_window(comparison, place)
    if longest <= 7:
        return 7
    # third differences of white noise have √20 times its spread; a smooth course hardly shows in their median
    noise = float(np.median(np.abs(third))) / (0.6745 * np.sqrt(20.0))
    for window in range(7, longest, 2):
        curve = savgol_filter(place, window, 3, deriv=2, delta=step)
        # the second derivative of a cubic through n points has a spread of about √720·n^(−5/2)·σ/T²
        left = noise * np.sqrt(720.0) * window**-2.5 / step**2
        if left < NOISE_SHARE * float(np.sqrt(np.median(curve**2) + np.mean(curve**2))):
            return window
    return longest


def _longest_window(comparison: Comparison, place: Vector) -> int:
    longest = max(7, round(LONGEST_SMOOTHING_S / comparison.period_s) | 1)
    return min(longest, (len(place) - 2) | 1)


def _described(
    comparison: Comparison, place: Vector, speed: Vector, acceleration: Vector, sources: tuple[str, ...]
) -> Motion | None:
    top = float(np.quantile(np.abs(speed), 0.995))
    if top <= 1e-12 or not np.isfinite(place).all():
        return None
    slow = np.abs(speed) < 0.05 * top
    # speed while standing is noise: three of its spreads are no motion
    noise = 1.4826 * float(np.median(np.abs(speed[slow]))) if slow.any() else 0.0
    rest = max(MOVING_SHARE * top, min(3.0 * noise, 0.02 * top))
    sense = np.where(np.abs(speed) > rest, np.sign(speed), 0.0)
    held, since = np.zeros(len(sense)), np.zeros(len(sense))
    for _, rows in comparison.rows_of_runs():
        held[rows] = _held(sense[rows])
        way = np.r_[0.0, np.cumsum(np.abs(np.diff(place[rows])))]
        turned = np.zeros(len(way), dtype=np.intp)
        where = np.flatnonzero(np.diff(held[rows]) != 0.0) + 1
        turned[where] = where
        since[rows] = way - way[np.maximum.accumulate(turned)]
    return Motion(place, speed, acceleration, sense, held, since, rest, sources, comparison.starts)


def _held(sense: Vector) -> Vector:
    last = np.maximum.accumulate(np.where(sense != 0.0, np.arange(len(sense)), -1))
    return np.asarray(np.where(last >= 0, sense[np.maximum(last, 0)], 0.0))


@njit(cache=True, nogil=True)
def _bristle(place, starts, distance):  # type: ignore[no-untyped-def]
    z = np.zeros(len(place))
    for run in range(len(starts) - 1):
        for k in range(starts[run] + 1, starts[run + 1]):
            way = (place[k] - place[k - 1]) / distance
            towards = 1.0 if way > 0.0 else -1.0
            z[k] = towards + (z[k - 1] - towards) * np.exp(-abs(way))
    return z
