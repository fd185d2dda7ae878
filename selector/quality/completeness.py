"""Whether a recording is complete: samples, values, and time without gaps and leaps."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from selector.findings import Finding, Level, Where
from selector.number_text import span_text
from selector.quality.finding_table import FINDINGS, GAUGE_BEGINS_LATE
from selector.quality.jumps import line_at
from selector.quality.leave_out import GAP_PERIODS, WINDOWS
from selector.quality.survey import (
    MEASURED_ROLES,
    Series,
    Survey,
    difference,
    medians_of_others,
    moment,
    present_median,
    reading,
)
from selector.recording import LONG_PERIODS, pauses
from selector.types import Array, Mask

#: A channel has a start if it reads something in so many samples and so many seconds, or in three samples.
START_SAMPLES, START_S = 15, 900.0
_SHORT = 20
_FEW_LEVELS = 8
#: A resolution like this is a warning; a finer one with few values only means that the channel hardly moves.
_COARSE = {"degC": 0.5, "um": 5.0}
_WARM_K = 4.0
_WARM_UM = 10.0


def short_runs(survey: Survey) -> Iterator[Finding]:
    """Findings ``short-run``: fewer than 20 samples."""
    for run in survey.runs:
        rows = survey.time[run].size
        if rows < _SHORT:
            told = f"Run {run} has {rows} sample(s) only; fewer than {_SHORT} say little about a thermal process."
            yield FINDINGS.finding("short-run", told, Where(run=run), {"samples": rows}, level="warning")


def empty_channels(survey: Survey) -> Iterator[Finding]:
    """Findings ``empty-channel``: no value in any run. Of single runs whoever reads them tells, and why."""
    for column, channel in enumerate(survey.channels):
        if not any(np.isfinite(survey.values[run][column]).any() for run in survey.runs):
            told = f"{channel.name} has no value in any run."
            yield FINDINGS.finding("empty-channel", told, Where(channel.name), {"runs": len(survey.runs)})


def few_values(survey: Survey) -> Iterator[Finding]:
    """Findings ``constant-channel`` and ``few-values``: one value, or fewer than eight, over all runs."""
    for column, channel in enumerate(survey.channels):
        scales = [survey.scale(run, column) for run in survey.runs]
        scales = [scale for scale in scales if scale.count]
        if sum(scale.count for scale in scales) < 2:
            continue
        low, high = min(s.low for s in scales), max(s.high for s in scales)
        if high - low <= 1e-12 * max(abs(low), abs(high)):
            is_sensor = channel.role in MEASURED_ROLES
            yield FINDINGS.finding(
                "constant-channel",
                f"{channel.name} is {reading(low, channel)} in every sample of every run.",
                Where(channel.name),
                {"value": low},
                f"{'Check the sensor and its wiring. ' * is_sensor}A constant is not used.",
                level="warning" if is_sensor else "info",
            )
            continue
        if channel.role not in MEASURED_ROLES or sum(scale.count for scale in scales) < _SHORT:
            continue
        step = survey.quantum(column)
        coarse = step >= _COARSE[channel.unit]
        if max(scale.distinct for scale in scales) > _FEW_LEVELS and not (coarse and (high - low) < 12 * step):
            continue
        values = np.unique(np.concatenate([_values(survey, run, column) for run in survey.runs]))
        if values.size > _FEW_LEVELS and not coarse:
            continue
        told = f"{channel.name} takes {values.size} different values only, {difference(step, channel)} apart, over a "
        told += f"range of {difference(high - low, channel)}."
        evidence = {"distinct": int(values.size), "resolution": step, "range": high - low}
        still = "It hardly moves; its resolution limits what it can say."
        advice = "Record it with a finer resolution." if coarse else still
        level: Level = "warning" if coarse else "info"
        yield FINDINGS.finding("few-values", told, Where(channel.name), evidence, advice, level=level)


def starts(survey: Survey) -> Iterator[Finding]:
    """Findings ``run-starts-warm``: a run that starts far from where the other runs start, ambient taken off."""
    if len(survey.runs) < 3:
        return
    ambient = survey.columns("ambient")
    temperatures, displacements = survey.columns("temperature"), survey.columns("displacement")
    level = np.array([[_start(survey, run, c) for c in range(len(survey.channels))] for run in survey.runs])
    # NaN without the room's temperature: a warm day looks like a warm machine
    level[:, temperatures] -= np.array([[present_median(one) for one in of[ambient].T] for of in level])[:, None]
    off = level - np.apply_along_axis(medians_of_others, 0, level)
    # a quick machine has left its start after five samples, and a first sample may be a spike
    off = np.where(np.abs(off[:, :, 1]) < np.abs(off[:, :, 0]), off[:, :, 1], off[:, :, 0])
    for r, run in enumerate(survey.runs):
        warm = {
            survey.channels[c].name: float(off[r, c])
            for columns, limit in ((temperatures, _WARM_K), (displacements, _WARM_UM))
            for c in columns
            if abs(off[r, c]) > limit
        }
        if not warm:
            continue
        worst = max(warm, key=lambda name: abs(warm[name]))
        said = difference(warm[worst], survey.recording.channel(worst))
        told = f"Run {run} does not start like the others: {len(warm)} channel(s) are off at its start, {worst} most "
        told, begin = f"{told}({said}).", float(survey.time[run][0])
        yield FINDINGS.finding("run-starts-warm", told, Where(None, run, begin, begin), {"channels": warm})


def is_late(rows: NDArray[np.integer], seconds: Array) -> Mask:
    """Whether readings so many samples and seconds after a start are none of the start."""
    return np.asarray((rows >= START_SAMPLES) | ((rows >= 3) & (seconds > START_S)))


def late_gauges(survey: Survey) -> Iterator[Finding]:
    """Findings ``gauge-begins-late``: a displacement that has nothing to say for a while at the start of a run."""
    for run in survey.runs:
        for column in survey.columns("displacement"):
            series, start = survey.series(run, column), float(survey.time[run][0])
            if is_late(series.rows[:1], series.time_s[:1] - start).any():
                name, begin = survey.channels[column].name, float(series.time_s[0])
                told = f"{name} has no value in the first {span_text(begin - start)} of run {run}; a model of its rise "
                told += "counts the run from its first value on."
                where = Where(name, run, start, begin)
                yield FINDINGS.finding(GAUGE_BEGINS_LATE, told, where, {"begins_s": begin}, level="info")


def _start(survey: Survey, run: str, column: int) -> tuple[float, float]:
    """Median of the first samples of a run, and the first; NaN when nothing of the start is there."""
    series = survey.series(run, column)
    there = series.rows.size > 0 and series.rows[0] <= 0.02 * survey.time[run].size
    return (survey.scale(run, column).start, float(series.x[0])) if there else (np.nan, np.nan)


def _values(survey: Survey, run: str, column: int) -> np.ndarray:
    x = survey.series(run, column).x
    # a few values show in any part of a long run
    return np.unique(x) if survey.scale(run, column).distinct <= 64 else x[:64]


_CLOCK_PERIODS = 10
_REACH = 8  #: Samples on each side of a leap from which it is judged whether a channel goes on as before.


def gaps(survey: Survey) -> Iterator[Finding]:
    """Findings ``gap`` for samples of single channels that are missing; O(samples).

    Measured against the run's own sampling; a channel that is sampled more seldom than the rows is measured against
    itself.
    """
    for run in survey.runs:
        for column in sorted({*range(len(survey.channels))} - survey.whole(run)):
            series = survey.series(run, column)
            if series.rows.size == 0:
                continue
            if series.time_s.size > 3 and np.median(np.diff(series.rows)) >= 2:
                continue  # a slower channel between rows of a faster one: no sample of it is missing
            yield from _missing_of(survey, series)


def clock_jumps(survey: Survey) -> Iterator[Finding]:
    """Findings ``clock-jump``: time leaps forward while nothing on the machine moves on; else ``gap``. O(samples)."""
    for run in survey.runs:
        time = survey.time[run]
        steps = np.diff(time)
        usual, leaps, cuts = float(np.median(steps)) if steps.size else 0.0, [], pauses(time).tolist()
        for at in np.flatnonzero(steps > _CLOCK_PERIODS * usual)[:50] if steps.size >= 8 else ():
            leap = float(steps[at] - usual)
            agreeing, there, moving = _continuity(survey, run, int(at), usual)
            round_one = min(abs(leap - hours) for hours in (3600.0, 86400.0)) <= 1.5 * usual
            if agreeing < 0.7 * there or not (moving or round_one):
                continue
            leaps.append(at)
            because = "the leap is a whole hour or day"
            if moving:
                because = f"{moving} channel(s) that were moving go on as if no time had passed"
            yield FINDINGS.finding(
                "clock-jump",
                f"The clock of run {run} leaps forward by {span_text(leap)} at {moment(float(time[at]))}; {because}.",
                Where(None, run, float(time[at]), float(time[at + 1])),
                {"leap_s": leap, "period_s": usual, "channels_moving": moving, "channels_continuous": agreeing},
                f"If the clock was set, subtract {leap:g} s from the later time stamps; else split the run here. "
                f"Nothing is left out, but {'the run is cut here' if at + 1 in cuts else 'memory sees it as time'}.",
            )
        # of irregular sampling the long distances are part
        limit = max(GAP_PERIODS * usual, 2.0 * float(np.quantile(steps, 0.95)) if steps.size >= 40 else 0.0)
        long = [k for k in np.flatnonzero(steps > limit) if k not in leaps] if steps.size >= 4 else []
        if long:
            windows = [(float(time[k]), float(time[k + 1])) for k in long]
            advice = f"To all commands but diagnose and convert these are {len(cuts) + 1} runs, {run} 1 to {run} "
            advice += f"{len(cuts) + 1}, each from its own start: in an hour the gauge may have been set to zero."
            yield _gap(windows, usual, Where(None, run), "No rows are recorded", advice if cuts else None)


def _missing_of(survey: Survey, series: Series) -> Iterator[Finding]:
    """Stretches of missing samples, as windows from the first of them to the next sample that is there."""
    time = survey.time[series.run]
    # that a gauge begins late is told by itself
    is_told = series.channel.role == "displacement" and is_late(series.rows[:1], series.time_s[:1] - time[0]).any()
    begins = int(series.rows[0]) if is_told else 0
    missing, name = time.size - series.rows.size - begins, series.channel.name
    if missing == 0:
        return
    before = np.r_[begins - 1, series.rows]
    after = np.r_[series.rows, time.size]
    holes = np.flatnonzero(after - before > 1)
    ends = np.minimum(after, time.size - 1)
    windows = [(float(time[before[k] + 1]), float(time[ends[k]])) for k in holes]
    longest = int(np.max(after[holes] - before[holes]) - 1)
    if longest < 3 and missing < 0.02 * time.size:
        return  # single lost samples
    usual = float(np.median(np.diff(time))) if time.size > 1 else 0.0
    share = missing / time.size
    said = f"{name} has no value in {100 * share:.1f} % of the rows"
    yield _gap(windows, usual, Where(name, series.run), said, samples=missing)


def _gap(
    windows: list[tuple[float, float]], usual: float, of: Where, said: str, advice: str | None = None, **samples: int
) -> Finding:
    lengths = [end - begin for begin, end in windows]
    longest = int(np.argmax(lengths))
    total_s = float(np.sum(lengths))
    evidence: dict[str, object] = {"longest_s": lengths[longest], "total_s": total_s, "stretches": len(windows)}
    evidence |= {"period_s": usual, **samples}
    many = f" for {span_text(lengths[0])} from"
    if len(windows) > 1:
        evidence[WINDOWS] = [[a, b] for a, b in windows[:100]]
        many = f" in {len(windows)} stretches, the longest {span_text(lengths[longest])} from"
    told = f"{said}{many} {moment(windows[longest][0])} of run {of.run} (usual period {span_text(usual)})."
    where = replace(of, from_s=windows[0][0], to_s=windows[-1][1])
    level: Level = "warning" if lengths[longest] > LONG_PERIODS * usual else "info"
    return FINDINGS.finding("gap", told, where, evidence, advice, level=level)


def _continuity(survey: Survey, run: str, at: int, usual: float) -> tuple[int, int, int]:
    """How many channels go on where they were at a leap between rows `at` and `at` + 1, how many are known there, and
    how many would have moved meanwhile.
    """
    time = survey.time[run]
    before, after = slice(max(0, at + 1 - _REACH), at + 1), slice(at + 1, at + 1 + _REACH)
    if time[before].size < 4 or time[after].size < 4:
        return 0, 0, 0
    leap = float(time[at + 1] - time[at])
    agreeing = there = moving = 0
    for column in survey.columns(*MEASURED_ROLES):
        x = survey.values[run][column]
        left, right = x[before], x[after]
        if not (np.isfinite(left).all() and np.isfinite(right).all()):
            continue
        # the two straight lines, each at its end of the leap
        leaves, error_before, slope_before = line_at(time[before], left, float(time[at]))
        arrives, error_after, slope_after = line_at(time[after], right, float(time[at + 1]))
        floor = max(survey.scale(run, column).floor, 1e-12)
        # the slower of two agreeing slopes, over half of the leap: what it must at least have moved
        due = 0.5 * min(abs(slope_before), abs(slope_after)) * leap if slope_before * slope_after > 0 else 0.0
        there, moving = there + 1, moving + (due >= 10 * floor)
        within = usual * max(abs(slope_before), abs(slope_after)) + 3 * max(floor, error_before, error_after)
        agreeing += bool(abs(arrives - leaves) < within)
    return agreeing, there, moving
