"""Which clock numbers belong to: a unit of time, a spreadsheet's days, an epoch."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from selector.readers.stamps import epoch_s
from selector.units import convert, parse_unit, same_dimension

_EXCEL_DAY_ZERO_S = -25569 * 86400.0
_MATLAB_DAY_ZERO_S = -719529 * 86400.0
_LABVIEW_ZERO_S = -2082844800.0
_FILETIME_ZERO_S = -11644473600.0
_DOTNET_ZERO_S = -62135596800.0


@dataclass(frozen=True)
class NumericClock:
    """Seconds since `base_s` [s since 1970-01-01], or of a relative clock when `base_s` is None."""

    seconds: NDArray[np.float64]
    base_s: float | None
    unit: str
    sure: bool


def time_unit(text: str | None) -> str | None:
    """The pint name of a unit of time, or None."""
    known = parse_unit(text) if text else None
    return known if known is not None and same_dimension(known, "s") else None


def numeric_clock(values: NDArray[np.float64], unit: str | None) -> NumericClock:
    """Numbers of a time column in seconds.

    Without a unit, ranges tell the absolute clocks apart (epoch in s, ms, µs, ns; FILETIME; .NET ticks; LabVIEW's 1904;
    days of Excel and MATLAB; 20261120080000); anything else is taken for seconds, and `sure` is False.
    """
    if unit is not None:
        return NumericClock(convert(values, unit, "s"), None, unit, True)
    known = values[np.isfinite(values)]
    if len(known) == 0:
        return NumericClock(values, None, "s", False)
    absolute = _absolute(values, known)
    if absolute is not None:
        return absolute
    if _is_day_fraction(known):
        return NumericClock(np.round(values * 86400.0, 4), None, "day", False)
    return NumericClock(values, None, "s", False)


def _absolute(values: NDArray[np.float64], known: NDArray[np.float64]) -> NumericClock | None:
    low, high = float(known.min()), float(known.max())

    def within(a: float, b: float) -> bool:
        return a <= low and high <= b

    def scaled(per_second: float, zero_s: float, unit: str) -> NumericClock:
        # the first stamp is taken off in the file's own unit, where it is exact
        return NumericClock((values - known[0]) / per_second, float(known[0]) / per_second + zero_s, unit, True)

    if within(5e8, 3.3e9):
        return scaled(1.0, 0.0, "epoch s")
    if within(3.3e9, 4.3e9):
        return scaled(1.0, _LABVIEW_ZERO_S, "LabVIEW s since 1904")
    if within(5e11, 4.2e12):
        return scaled(1e3, 0.0, "epoch ms")
    if within(1.95e13, 2.2e13):
        return _digits(values)
    if within(5e14, 4.2e15):
        return scaled(1e6, 0.0, "epoch us")
    if within(1.15e17, 1.65e17):
        return scaled(1e7, _FILETIME_ZERO_S, "FILETIME")
    if within(6.2e17, 6.7e17):
        return scaled(1e7, _DOTNET_ZERO_S, ".NET ticks")
    if within(5e17, 4.2e18):
        return scaled(1e9, 0.0, "epoch ns")
    fractional = bool(np.any(known != np.round(known)))
    if within(25_000, 75_000) and fractional and high - low < 400 and _small_steps(known, 0.5):
        return _days(values, known, _EXCEL_DAY_ZERO_S, "Excel days")
    if within(690_000, 780_000) and fractional and high - low < 400:
        return _days(values, known, _MATLAB_DAY_ZERO_S, "MATLAB days")
    return None


def _small_steps(known: NDArray[np.float64], limit: float) -> bool:
    return len(known) > 1 and float(np.median(np.abs(np.diff(known)))) < limit


def _days(values: NDArray[np.float64], known: NDArray[np.float64], zero_s: float, unit: str) -> NumericClock:
    # days as float64 resolve about 1 µs; writers round to a millisecond at best
    first = float(np.floor(known[0]))
    return NumericClock(np.round((values - first) * 86400.0, 4), first * 86400.0 + zero_s, unit, True)


def _digits(values: NDArray[np.float64]) -> NumericClock | None:
    """20261120080000 = 2026-11-20 08:00:00."""
    date, time = values // 1_000_000, values % 1_000_000
    midnight = epoch_s(date // 10000, date // 100 % 100, date % 100)
    seconds = midnight + time // 10000 * 3600 + time // 100 % 100 * 60 + time % 100
    finite = np.isfinite(seconds)
    if finite.sum() < 0.9 * np.isfinite(values).sum():
        return None
    base_s = float(midnight[finite][0])
    return NumericClock(seconds - base_s, base_s, "yyyymmddhhmmss", True)


def _is_day_fraction(known: NDArray[np.float64]) -> bool:
    """Times of day as a spreadsheet holds them: below 1, in steps of whole seconds that are no round numbers."""
    if len(known) < 3 or known.min() < 0 or known.max() >= 1.0:
        return False
    steps = np.abs(np.diff(known))
    step = float(np.median(steps[steps > 0])) if np.any(steps > 0) else 0.0
    seconds = step * 86400.0
    whole = seconds >= 0.5 and abs(seconds - round(seconds)) < 1e-3 * max(1.0, seconds) and round(seconds) > 0
    return whole and abs(step * 1e5 - round(step * 1e5)) > 1e-3
