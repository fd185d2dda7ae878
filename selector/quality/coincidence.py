"""What else on the machine changes at the moment in which a channel jumps."""

from __future__ import annotations

from statistics import NormalDist

import numpy as np

from selector.quality.survey import COMMAND_ROLES, MEASURED_ROLES, Floats, Survey

_NEAR_PERIODS = 2.5
"""A cause and its effect are this close [sampling periods]."""
_KINK_PERIODS = 1.2
"""So close to a jump two lines must meet to be bent by the same event; kinks are frequent."""
_REACH, _SEARCHED = 20, 6
"""Samples on each side from which the slopes beside a kink are taken, and among which it is placed."""
_BY_CHANCE = 1e-3
"""How often noise alone may look like a kink in any of the other channels."""
_CARRIED, _OF_JUMP = 2.0, 1.0 / 3.0
"""A kink explains a jump when it amounts to this share of it after so many sampling periods."""
_FOLLOWED = 0.2
"""Share of a command's changes that a channel must follow at once for the command to be a cause, ..."""
_MUCH = 0.35
"""... by this share of the jump in question."""


def commanded(survey: Survey, column: int, run: str, moment_s: tuple[float, float], height: float) -> str:
    """Which command or state of the machine causes a jump of this height, in words; empty if none does.

    One that changes at this moment, and either has changed so much at most twice in the recording, or is followed by
    the channel at once at a fifth of these changes at least: a change that is close by chance is no cause. A change of
    speed always is one for a displacement.
    """
    first, last = _rows_near(survey, run, moment_s, _NEAR_PERIODS)
    for other in survey.columns(*COMMAND_ROLES):
        if other == column or not _changes(survey.values[run][other], first, last):
            continue
        speeding = survey.channels[column].role == "displacement" and survey.channels[other].role == "spindle_speed"
        if speeding:
            return f"{survey.channels[other].name} changes at that moment"
        changes = followed = 0
        piece = survey.values[run][other][first:last]
        size = 0.7 * float(np.nanmax(np.abs(np.diff(piece))))
        for each in survey.runs:
            changed = _change_times(survey, each, other, size)
            changes += changed.size
            x = survey.values[each][column]
            for at in np.searchsorted(survey.time[each], changed).tolist():
                moved = _level(x[at + 2 : at + 6]) - _level(x[max(0, at - 5) : max(0, at - 1)])
                followed += bool(abs(moved) > _MUCH * abs(height))
        if changes <= 2 or followed >= max(2.0, _FOLLOWED * changes):
            return f"{survey.channels[other].name} changes at that moment"
    return ""


def jumping_with(survey: Survey, column: int, run: str, moment_s: tuple[float, float]) -> list[str]:
    """Names of the other measured channels that jump at this moment."""
    first, last = _rows_near(survey, run, moment_s, _NEAR_PERIODS)
    return [
        survey.channels[other].name
        for other in survey.columns(*MEASURED_ROLES)
        if other != column and _jumps(survey.values[run][other], first, last, survey.scale(run, other).floor)
    ]


def pulsing_with(survey: Survey, column: int, run: str, window_s: tuple[float, float]) -> tuple[list[str], list[str]]:
    """Names of the commands, and of the other measured channels, that leave their level and return in a window."""
    first, last = _rows_near(survey, run, window_s, 0.5)
    pulsing: dict[bool, list[str]] = {True: [], False: []}
    for roles, measured in ((COMMAND_ROLES, False), (MEASURED_ROLES, True)):
        for other in survey.columns(*roles):
            x = survey.values[run][other]
            inside, before, after = x[first:last], x[max(0, first - 3) : first], x[last : last + 3]
            if other == column or not (inside.size and before.size and after.size):
                continue
            off = float(np.median(inside) - 0.5 * (np.median(before) + np.median(after)))
            limit = max(8.0 * survey.scale(run, other).floor, 2.0 * abs(float(np.median(after) - np.median(before))))
            if abs(off) > max(limit, 1e-300):
                pulsing[measured].append(survey.channels[other].name)
    return pulsing[False], pulsing[True]


def kink_elsewhere(survey: Survey, column: int, run: str, moment_s: tuple[float, float], height: float) -> str:
    """Which other measured channel changes its course at this moment as much as the jump asks for; empty if none.

    A kink is what a cubic cannot follow: a smooth bend is none. It explains a jump only when the turn, carried on for
    two sampling periods, is a third of the jump, each as a share of its own channel's span. A displacement needs a
    change of speed to jump, so beside a recorded speed that does not change a kink explains nothing.
    """
    first, last = _rows_near(survey, run, moment_s, _NEAR_PERIODS)
    if survey.channels[column].role == "displacement":
        speeds = [survey.values[run][other] for other in survey.columns("spindle_speed")]
        if any(np.isfinite(x[first:last]).any() and not _changes(x, first, last) for x in speeds):
            return ""
    others = [other for other in survey.columns(*MEASURED_ROLES) if other != column]
    asked = _OF_JUMP * abs(height) / max(survey.scale(run, column).span, abs(height))
    carried = _CARRIED * _period(survey, run)
    for other, turn in _kinks(survey, run, others, 0.5 * sum(moment_s)):
        if abs(turn) * carried >= asked * survey.scale(run, other).span:
            return f"{survey.channels[other].name} changes its course at that moment"
    return ""


def _rows_near(survey: Survey, run: str, moment_s: tuple[float, float], periods: float) -> tuple[int, int]:
    time, near = survey.time[run], periods * _period(survey, run)
    return (
        int(np.searchsorted(time, moment_s[0] - near, "left")),
        int(np.searchsorted(time, moment_s[1] + near, "right")),
    )


def _period(survey: Survey, run: str) -> float:
    time = survey.time[run]
    return float(np.median(np.diff(time))) if time.size > 1 else 0.0


def _change_times(survey: Survey, run: str, column: int, size: float) -> Floats:
    """When a command changes by so much [s]: differences far above its usual ones, those in a row counted once."""
    series = survey.series(run, column)
    if series.x.size < 2:
        return np.empty(0)
    differences = np.abs(np.diff(series.x))
    least = max(6.0 * float(np.median(differences)), 0.02 * float(np.ptp(series.x)), size, 1e-300)
    at = np.flatnonzero(differences > least)
    at = at[np.diff(at, prepend=-10) > 2]
    return np.asarray(series.time_s[at + 1], dtype=np.float64)


def _level(x: Floats) -> float:
    """Median of what is there; NaN, which is never much, if nothing is."""
    x = x[np.isfinite(x)]
    return float(np.median(x)) if x.size else float("nan")


def _changes(x: Floats, first: int, last: int) -> bool:
    """Whether a command moves in the window by more than it usually does between two samples."""
    piece = x[first:last]
    piece = piece[np.isfinite(piece)]
    if piece.size < 2 or np.ptp(piece) == 0.0:
        return False
    whole = float(np.nanmax(x) - np.nanmin(x))
    reach = 10 * (last - first)
    wide = np.diff(x[max(0, first - reach) : last + reach])
    wide = np.abs(wide[np.isfinite(wide)])
    least = max(6.0 * float(np.median(wide)) if wide.size else 0.0, 0.02 * whole)
    return bool(np.abs(np.diff(piece)).max() > least)


def _jumps(x: Floats, first: int, last: int, floor: float) -> bool:
    """Whether a channel jumps in the window: beyond its noise, and sharper than its differences around."""
    differences = np.abs(np.diff(x[max(0, first - _REACH) : last + _REACH]))
    inside = np.abs(np.diff(x[first:last]))
    inside, differences = inside[np.isfinite(inside)], differences[np.isfinite(differences)]
    if inside.size == 0 or differences.size < 8:
        return False
    usual = float(np.quantile(differences, 0.75))
    return bool(inside.max() > max(6.0 * floor, 3.0 * usual))


def _kinks(survey: Survey, run: str, columns: list[int], at: float) -> list[tuple[int, float]]:
    """(column, change of slope [unit/s]) of the channels that have a kink at this moment; O(channels)."""
    time, period = survey.time[run], _period(survey, run)
    middle = int(np.searchsorted(time, at))
    rows = slice(max(0, middle - _REACH), middle + _REACH)
    columns = [column for column in columns if np.isfinite(survey.values[run][column, rows]).all()]
    dt = (time[rows] - at) / max(period, 1e-300)
    if min(middle, time.size - middle) < 8 or not columns:
        return []
    x = survey.values[run][columns, rows]
    smooth, _ = np.linalg.qr(np.vander(dt, 4))
    rest = x - (x @ smooth) @ smooth.T
    explained, turns = [], []
    for shift in range(-_SEARCHED, _SEARCHED + 1):
        bent = 0.5 * np.abs(dt - shift)
        bent -= smooth @ (smooth.T @ bent)
        size = float(bent @ bent)
        turns.append(rest @ bent / size)
        explained.append(turns[-1] ** 2 * size)
    best = np.argmax(explained, axis=0)
    each = np.arange(len(columns))
    gained, turn = np.array(explained)[best, each], np.array(turns)[best, each]
    sigma2 = np.maximum((rest * rest).sum(axis=1) - gained, 0.0) / (dt.size - 5)
    # by chance one of so many channels gets this far once in a thousand
    clear = NormalDist().inv_cdf(1.0 - _BY_CHANCE / len(columns))
    here = np.abs(best - len(turns) // 2) <= _KINK_PERIODS
    found = here & (gained > clear**2 * np.maximum(sigma2, 1e-300))
    return [(columns[k], float(turn[k]) / period) for k in np.flatnonzero(found)]
