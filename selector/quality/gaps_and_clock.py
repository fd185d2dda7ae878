"""Whether time is complete: missing samples, and a clock that jumps or changes its pace."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from selector.findings import Finding, Where
from selector.quality.finding_table import FINDINGS
from selector.quality.leave_out import WINDOWS
from selector.quality.survey import MEASURED_ROLES, Floats, Series, Survey, duration, moment

_GAP_PERIODS = 3.5
"""A distance of more than so many usual ones is a gap; two lost rows in a row are none."""
_LONG_PERIODS = 20
"""A gap of so many periods is a warning, a shorter one is only mentioned."""
_CLOCK_PERIODS = 10
_REACH = 8
"""Samples on each side of a leap from which it is judged whether a channel goes on as before."""
_PACE_BLOCKS = 24
_PACE_CHANGE = 1.25
"""Ratio of two sampling periods that makes them two; jitter of the middle of a block is far below."""


def gaps(survey: Survey) -> Iterator[Finding]:
    """Findings ``gap`` for rows and samples that are missing; O(samples).

    Measured against the run's own sampling; a channel that is sampled more seldom than the rows is measured against
    itself.
    """
    for run in survey.runs:
        time = survey.time[run]
        yield from _gaps_of(time, run)
        for column, channel in enumerate(survey.channels):
            series = survey.series(run, column)
            missing = time.size - series.rows.size
            if missing == 0 or series.rows.size == 0:
                continue
            if series.time_s.size > 3 and _usual(np.diff(series.rows)) >= 2:
                continue  # a slower channel between rows of a faster one: no sample of it is missing
            yield from _missing_of(survey, series, missing, channel.name)


def clock_jumps(survey: Survey) -> Iterator[Finding]:
    """Findings ``clock-jump``: time leaps forward while nothing on the machine moves on. O(samples)."""
    for run in survey.runs:
        time = survey.time[run]
        steps = np.diff(time)
        if steps.size < 8:
            continue
        usual = _usual(steps)
        for at in np.flatnonzero(steps > _CLOCK_PERIODS * usual)[:50]:
            leap = float(steps[at] - usual)
            agreeing, moving = _continuity(survey, run, int(at))
            round_one = min(abs(leap - hours) for hours in (3600.0, 86400.0)) <= 1.5 * usual
            continuous = agreeing >= 0.7 * moving
            if not continuous or not (moving or round_one):
                continue
            because = (
                f"{moving} channel(s) that were moving go on as if no time had passed"
                if moving
                else "the leap is a whole hour or day"
            )
            yield FINDINGS.finding(
                "clock-jump",
                f"The clock of run {run} leaps forward by {duration(leap)} at {moment(float(time[at]))}; {because}.",
                Where(None, run, float(time[at]), float(time[at + 1])),
                {"leap_s": leap, "period_s": usual, "channels_moving": moving, "channels_continuous": agreeing},
                f"If the clock was set, subtract {leap:g} s from the later time stamps; else split the run here. "
                "Nothing is left out, but memory models see the leap as time.",
            )


def pace_changes(survey: Survey) -> Iterator[Finding]:
    """Findings ``period-change``: the sampling period changes for good, or drifts, within a run. O(samples)."""
    for run in survey.runs:
        time = survey.time[run]
        steps = np.diff(time)
        if steps.size < 40:
            continue
        width = max(10, steps.size // _PACE_BLOCKS)
        blocks = np.median(steps[: steps.size // width * width].reshape(-1, width), axis=1)
        if blocks.size < 4:
            continue
        best = max(range(1, blocks.size), key=lambda k: _contrast(blocks, k))
        before, after = float(np.median(blocks[:best])), float(np.median(blocks[best:]))
        ratio = max(before / after, after / before)
        steady = _steady(blocks[:best]) and _steady(blocks[best:])
        at = float(time[best * width])
        if ratio > _PACE_CHANGE and steady:
            told = f"changes from {duration(before)} to {duration(after)} near {moment(at)}"
        elif blocks.size >= 8 and _drifts(blocks):
            told = f"drifts from {duration(float(blocks[0]))} to {duration(float(blocks[-1]))} over the run"
            before, after, at = float(blocks[0]), float(blocks[-1]), float(time[0])
        else:
            continue
        yield FINDINGS.finding(
            "period-change",
            f"The sampling period of run {run} {told}.",
            Where(None, run, at, None),
            {"before_s": before, "after_s": after},
        )


def _gaps_of(time: Floats, run: str) -> Iterator[Finding]:
    steps = np.diff(time)
    if steps.size < 4:
        return
    usual = _usual(steps)
    # of irregular sampling the long distances are part
    limit = max(_GAP_PERIODS * usual, 2.0 * float(np.quantile(steps, 0.95)) if steps.size >= 40 else 0.0)
    long = np.flatnonzero(steps > limit)
    if long.size == 0:
        return
    windows = [(float(time[k]), float(time[k + 1])) for k in long]
    yield _gap(windows, usual, run, None, "No rows are recorded")


def _missing_of(survey: Survey, series: Series, missing: int, name: str) -> Iterator[Finding]:
    """Stretches of missing samples, as windows between the last and the next sample that is there."""
    time = survey.time[series.run]
    before = np.r_[-1, series.rows]
    after = np.r_[series.rows, time.size]
    holes = np.flatnonzero(after - before > 1)
    windows = [(float(time[before[k] + 1]), float(time[after[k] - 1])) for k in holes]
    longest = int(np.max(after[holes] - before[holes]) - 1)
    if longest < 3 and missing < 0.02 * time.size:
        return  # single lost samples
    usual = _usual(np.diff(time)) if time.size > 1 else 0.0
    share = missing / time.size
    yield _gap(windows, usual, series.run, name, f"{name} has no value in {share:.1%} of the rows", samples=missing)


def _gap(
    windows: list[tuple[float, float]], usual: float, run: str, channel: str | None, said: str, samples: int = 0
) -> Finding:
    lengths = [end - begin for begin, end in windows]
    longest = int(np.argmax(lengths))
    evidence: dict[str, object] = {
        "longest_s": lengths[longest],
        "total_s": float(np.sum(lengths)),
        "stretches": len(windows),
        "period_s": usual,
    }
    if samples:
        evidence["samples"] = samples
    many = f" for {duration(lengths[0])} from"
    if len(windows) > 1:
        evidence[WINDOWS] = [[a, b] for a, b in windows[:100]]
        many = f" in {len(windows)} stretches, the longest {duration(lengths[longest])} from"
    return FINDINGS.finding(
        "gap",
        f"{said}{many} {moment(windows[longest][0])} of run {run} (usual period {duration(usual)}).",
        Where(channel, run, windows[0][0], windows[-1][1]),
        evidence,
        level="warning" if lengths[longest] > _LONG_PERIODS * usual else "info",
    )


def _continuity(survey: Survey, run: str, at: int) -> tuple[int, int]:
    """(channels that go on where they were, channels that were moving) at a leap between rows `at` and `at` + 1."""
    time = survey.time[run]
    before, after = slice(max(0, at + 1 - _REACH), at + 1), slice(at + 1, at + 1 + _REACH)
    if time[before].size < 4 or time[after].size < 4:
        return 0, 0
    leap = float(time[at + 1] - time[at])
    agreeing = moving = 0
    for column in survey.columns(*MEASURED_ROLES):
        x = survey.values[run][column]
        left, right = x[before], x[after]
        if not (np.isfinite(left).all() and np.isfinite(right).all()):
            continue
        slopes = [_slope(time[before], left), _slope(time[after], right)]
        # the two straight lines, each at its end of the leap
        ends = [
            x.mean() + slope * (at_s - t.mean())
            for x, slope, t, at_s in (
                (left, slopes[0], time[before], time[at]),
                (right, slopes[1], time[after], time[at + 1]),
            )
        ]
        floor = max(survey.scale(run, column).floor, 1e-12)
        # the slower of two agreeing slopes, over half of the leap: what it must at least have moved
        due = 0.5 * min(abs(slopes[0]), abs(slopes[1])) * leap if slopes[0] * slopes[1] > 0 else 0.0
        if due < 10 * floor:
            continue
        moving += 1
        agreeing += bool(abs(float(ends[1] - ends[0])) < 0.25 * due + 3 * floor)
    return agreeing, moving


def _slope(time: Floats, x: Floats) -> float:
    centred = time - time.mean()
    return float(centred @ (x - x.mean()) / max(float(centred @ centred), 1e-300))


def _usual(steps: Floats | np.ndarray) -> float:
    return float(np.median(steps))


def _contrast(blocks: Floats, k: int) -> float:
    """How well a change after k blocks explains their periods, as a two-sample t statistic does."""
    logs = np.log(blocks)
    return float(abs(logs[:k].mean() - logs[k:].mean()) * np.sqrt(k * (blocks.size - k)))


def _steady(blocks: Floats) -> bool:
    middle = float(np.median(blocks))
    return bool(np.mean(np.abs(blocks - middle) < 0.1 * middle) >= 0.8)


def _drifts(blocks: Floats) -> bool:
    """More than 3 % from the first to the last quarter, in small steps of one direction."""
    quarter = max(1, blocks.size // 4)
    change = np.log(float(np.median(blocks[-quarter:])) / float(np.median(blocks[:quarter])))
    rank = np.corrcoef(np.arange(blocks.size), blocks)[0, 1] if np.ptp(blocks) > 0 else 0.0
    return bool(abs(change) > 0.03 and abs(rank) > 0.9)
