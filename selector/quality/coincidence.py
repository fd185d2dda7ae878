"""What else on the machine changes at the moment in which a channel jumps."""

from __future__ import annotations

import numpy as np

from selector.quality.survey import COMMAND_ROLES, MEASURED_ROLES, Floats, Survey

_NEAR_PERIODS = 2.5
"""A cause and its effect are this close [sampling periods]."""
_KINK_PERIODS = 1.2
"""So close to a jump two lines must meet to be bent by the same event; kinks are frequent."""
_REACH = 20
"""Samples on each side from which the slopes beside a kink are taken."""
_CLEAR_KINK = 8.0
"""Standard errors by which two slopes must differ to be a kink."""
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


def kink_elsewhere(survey: Survey, column: int, run: str, moment_s: tuple[float, float]) -> str:
    """Which other measured channel changes its course at this moment, in words; empty if none does."""
    time, near = survey.time[run], _KINK_PERIODS * _period(survey, run)
    for other in survey.columns(*MEASURED_ROLES):
        floor = survey.scale(run, other).floor
        if other != column and _kinks(time, survey.values[run][other], 0.5 * sum(moment_s), near, floor):
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


def _kinks(time: Floats, x: Floats, at: float, near: float, floor: float) -> bool:
    """Whether two straight lines, one on each side, differ clearly in slope and meet at this moment."""
    middle = int(np.searchsorted(time, at))
    left, right = slice(max(0, middle - _REACH), middle), slice(middle, middle + _REACH)
    if time[left].size < 6 or time[right].size < 6:
        return False
    before, after = _line(time[left] - at, x[left]), _line(time[right] - at, x[right])
    if before is None or after is None:
        return False
    turn = after[1] - before[1]
    error = float(np.hypot(before[2], after[2]))
    spread = float(time[right][-1] - time[left][0]) / 2
    if abs(turn) < _CLEAR_KINK * max(error, 1e-300) or abs(turn) * spread < 4.0 * floor:
        return False
    return bool(abs((before[0] - after[0]) / turn) < near)


def _line(dt: Floats, x: Floats) -> tuple[float, float, float] | None:
    """(value at 0, slope, standard error of the slope) of a straight line."""
    if not np.isfinite(x).all():
        return None
    centre = float(dt.mean())
    moved = dt - centre
    spread = max(float(moved @ moved), 1e-300)
    slope = float(moved @ x) / spread
    rest = x - x.mean() - slope * moved
    sigma = float(np.sqrt(rest @ rest / (x.size - 2)))
    return float(x.mean()) - slope * centre, slope, sigma / float(np.sqrt(spread))
