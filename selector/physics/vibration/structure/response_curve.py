"""How does a response go over a range of frequencies, as a curve that is as good as solving at every frequency.

A run-up needs the response at each of its samples. It is solved where it bends, and between these frequencies a cubic
spline stands for it, checked at every midpoint.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicSpline

from selector.errors import InputError
from selector.physics.vibration.rounding import SAME, above
from selector.types import ComplexMatrix, Vector

TOLERANCE = 1e-6
"""Largest difference between curve and response, as a share of the largest response in the range."""
_MOST_POINTS = 50_000
_LEAST_POINTS = 9
_LEAST_SHARE = 1e-4
_LEAST_STEP = 1e-8
_WIDTHS = (1e-3, 0.05)


@dataclass(frozen=True, eq=False)
class ResponseCurve:
    """A complex response of several outputs from one frequency to another."""

    #: lowest_hz and highest_hz: Range of the curve [Hz]
    lowest_hz: float
    highest_hz: float
    #: By frequency; a frequency belongs to the first piece that reaches it
    pieces: tuple[CubicSpline[np.complex128], ...]
    ends_hz: Vector  #: (n_pieces,): Highest frequency of every piece [Hz]
    points: int  #: Frequencies at which the response was solved and kept

    def at(self, frequency_hz: Vector, *, derivative: int = 0) -> ComplexMatrix:
        """The response, or its derivative by the frequency [1/Hz, 1/Hz²], shape (n_outputs, n_freq)."""
        piece = np.minimum(np.searchsorted(self.ends_hz, frequency_hz), len(self.pieces) - 1)
        parts = [np.flatnonzero(piece == number) for number in range(len(self.pieces))]
        found = np.concatenate(
            [spline(frequency_hz[rows], nu=derivative) for spline, rows in zip(self.pieces, parts, strict=True)],
            axis=1,
        )
        if len(parts) == 1:
            return np.asarray(found, dtype=np.complex128)
        sorted_back = np.empty_like(found)
        sorted_back[:, np.concatenate(parts)] = found
        return np.asarray(sorted_back, dtype=np.complex128)


def response_curve(
    solved: Callable[[Vector], ComplexMatrix],
    lowest_hz: float,
    highest_hz: float,
    *,
    loss_factor: float,
    jump_hz: float | None = None,
) -> ResponseCurve:
    """The curve of a response between two frequencies, within `TOLERANCE` of it at every midpoint.

    `solved` is frequencies of shape (n_freq,) [Hz] → responses of shape (n_outputs, n_freq). `loss_factor` is the
    smallest η of a resonance: no peak is narrower than its share η of its frequency, so none is stepped over. Above
    `jump_hz` another response holds.

    InputError: the response has a peak without end in the range, or that of `solved`.
    """
    ranges = [(lowest_hz, highest_hz)]
    if jump_hz is not None and not above(lowest_hz, jump_hz) and above(highest_hz, jump_hz):
        # what is at the jump but for rounding is not above it
        ranges = [
            (lowest_hz, max(jump_hz, lowest_hz)),
            (float(np.nextafter(jump_hz * (1.0 + SAME), np.inf)), highest_hz),
        ]
    pieces = [_piece(solved, begin, end, loss_factor) for begin, end in ranges]
    ends = [*(float(np.nextafter(begin, 0.0)) for begin, _ in ranges[1:]), highest_hz]
    return ResponseCurve(lowest_hz, highest_hz, tuple(pieces), np.array(ends), sum(len(one.x) for one in pieces))


def _piece(
    solved: Callable[[Vector], ComplexMatrix], low: float, high: float, loss_factor: float
) -> CubicSpline[np.complex128]:
    if high - low <= 1e-9 * high:
        # one frequency, but for rounding
        level: ComplexMatrix = np.repeat(solved(np.array([high])), 2, axis=1)
        return CubicSpline(np.array([low, low + max(high, 1.0)]), level, axis=1)
    frequency = _starting_grid(low, high, loss_factor)
    value = solved(frequency)
    doubtful = np.ones(len(frequency) - 1, dtype=np.bool_)
    while doubtful.any():
        steps = np.diff(frequency)[doubtful]
        if len(frequency) > _MOST_POINTS or (steps <= _LEAST_STEP * frequency[1:][doubtful]).any():
            raise InputError(
                f"a response without end near {frequency[1:][doubtful][np.argmin(steps)]:.6g} Hz",
                expected="joints with dissipation wherever a run-up goes through a resonance",
                where="joints",
                advice="give the dissipation of every joint, or keep the speed away from this frequency",
            )
        spline = CubicSpline(frequency, value, axis=1)
        middle = 0.5 * (frequency[:-1] + frequency[1:])[doubtful]
        exact = solved(middle)
        largest = np.maximum(np.abs(value).max(axis=1), np.abs(exact).max(axis=1))[:, None]
        bad = (np.abs(spline(middle) - exact) > TOLERANCE * largest).any(axis=0)
        frequency = np.concatenate((frequency, middle))
        value = np.concatenate((value, exact), axis=1)
        order = np.argsort(frequency, kind="stable")
        # both halves of an interval that was off, and what lies beside it
        near = np.concatenate((np.zeros(len(frequency) - len(middle), dtype=np.bool_), bad))[order]
        frequency, value = frequency[order], value[:, order]
        doubtful = near[:-1] | near[1:]
    return CubicSpline(frequency, value, axis=1)


def _starting_grid(low: float, high: float, loss_factor: float) -> Vector:
    """Steps in proportion to the frequency, so that every resonance has a point within its width."""
    width = min(max(loss_factor, _WIDTHS[0]), _WIDTHS[1])
    begin = max(low, high * _LEAST_SHARE)
    count = max(_LEAST_POINTS, int(np.ceil(np.log(high / begin) / width)) + 1)
    grid = np.geomspace(begin, high, count)
    grid[-1] = high
    if low < begin:
        return np.concatenate((np.linspace(low, begin, 5)[:-1], grid))
    grid[0] = low
    return grid
