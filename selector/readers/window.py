"""Long records by window and rate: of each file only the window is kept, and it is thinned before the next is read."""

import datetime
import re
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from selector.errors import OptionError, ReadError
from selector.findings import Finding, Where
from selector.readers.finding_table import CLOCK_BACK, CLOCK_FORWARD, FINDINGS
from selector.readers.runs import TimedRun, averaged
from selector.readers.tables import Overrides, listed
from selector.types import Mask, Vector

WINDOW = "--since and --until"  #: Where errors of the window are.
_DAY = re.compile(r"\d{4}-\d\d-\d\d")
_BEGIN, _END = datetime.datetime.min, datetime.datetime.max


def files_within(files: Sequence[Path], overrides: Overrides) -> list[Path]:
    """The files that may hold something of the window: those of a lake are called by their day.

    Raises OptionError: the window is none.
    """
    since, until = _window(overrides)
    kept = []
    for path in files:
        begins = _day_of(path)
        if begins is None or (begins < until and begins.date() >= since.date()):
            kept.append(path)
    if files and not kept:
        raise _nothing(overrides, f"{len(files)} files of other days, {files[0].name} to {files[-1].name}")
    return kept


def within(run: TimedRun, overrides: Overrides) -> TimedRun | None:
    """What a run has of the window, as means where these are asked for; None: fewer than two samples.

    A mean stands in the middle of its samples. The first sample stays what it is: from there rises and the gauge count.

    Raises OptionError: the run has no date to compare the window with.
    """
    if overrides.has_window:
        run = _cut(run, *_window(overrides))
    if overrides.mean_s is not None and len(run.time_s):
        groups = np.floor(run.time_s / overrides.mean_s + 1e-9).astype(np.int64) + 1
        if groups[-1] == 1:
            return None
        groups[0] = 0
        count = len(np.unique(groups))

        def means(values: Vector) -> Vector:
            return averaged(values[:, None], groups, count)[:, 0]

        columns = [replace(column, values=means(column.values)) for column in run.columns]
        # the table, of which nothing is read any more, would keep all samples in memory
        table = replace(run.table, columns=())
        run = replace(run, time_s=means(run.time_s), columns=tuple(columns), table=table)
    return run if len(run.time_s) > 1 else None


def require_some(runs: Sequence[TimedRun], overrides: Overrides) -> None:
    """Ends with an error where nothing is left of any run. Raises ReadError: so it is."""
    if not runs and not overrides.has_window:
        found, expected = f"runs that are no longer than {overrides.mean_s:g} s", "at least two means of a run"
        raise ReadError(found, expected=expected, where="--mean-s", advice="take means over fewer seconds")
    if not runs:
        raise _nothing(overrides, "fewer than two samples, or means, in each of these recordings")


def thinning(rows: int, runs: Sequence[TimedRun], outside: Sequence[str], overrides: Overrides) -> Iterator[Finding]:
    """That means stand in place of samples, of which `rows` were read, and which runs have next to none."""
    if outside:
        told = f"{'Run' if len(outside) == 1 else 'Runs'} {listed(list(outside), 8)} with fewer than two samples, or "
        told += "means, in the window: left out."
        yield FINDINGS.finding("run-outside-window", told, evidence={"runs": list(outside)[:100]})
    if overrides.mean_s is not None:
        left = sum(len(run.time_s) for run in runs)
        told = f"Means over {overrides.mean_s:g} s were taken: {rows} rows were read, and {left} means are in the "
        told += "window."
        evidence = {"mean_s": overrides.mean_s, "rows": rows, "means": left}
        yield FINDINGS.finding("means-taken", told, evidence=evidence)


def _cut(run: TimedRun, since: datetime.datetime, until: datetime.datetime) -> TimedRun:
    if run.start is None:
        expected = "recordings with date and time"
        advice = "leave the two options out, or name the column with the date (--time-column)"
        raise OptionError(f"run {run.name}, whose clock has no date", expected=expected, where=WINDOW, advice=advice)
    begins = datetime.datetime.fromisoformat(run.start).replace(tzinfo=None)
    low, high = ((end - begins).total_seconds() for end in (since, until))
    shown = own_clock_s(run.time_s, run.findings, run.period_s)
    inside = (shown >= low) & (shown < high)
    if inside.all() or not inside.any():
        return run if inside.all() else replace(run, time_s=run.time_s[:0])
    found = part_of(run, inside)
    begun = [_begun(run.name, found.skipped_s - run.skipped_s)] if found.skipped_s > run.skipped_s else []
    return replace(found, findings=(*begun, *found.findings))


def part_of(run: TimedRun, inside: Mask) -> TimedRun:
    """The rows of a run that are `inside`, from the first of them on; one at least is."""
    zero = float(run.time_s[inside][0])
    length = float(run.time_s[inside][-1]) - zero
    start = run.start
    if start is not None:
        begins_s = float(own_clock_s(run.time_s, run.findings, run.period_s)[inside][0])
        begins = datetime.datetime.fromisoformat(start) + datetime.timedelta(seconds=begins_s)
        start = begins.isoformat(timespec="seconds" if begins.microsecond == 0 else "milliseconds")
    return replace(
        run,
        time_s=run.time_s[inside] - zero,
        columns=tuple(replace(column, values=column.values[inside]) for column in run.columns),
        first_s=run.first_s + (zero if start is None else 0.0),
        start=start,
        findings=tuple(moved for one in run.findings if (moved := told_from(one, zero, length)) is not None),
        skipped_s=run.skipped_s + zero,
    )


def own_clock_s(time_s: Vector, findings: Iterable[Finding], period_s: float) -> Vector:
    """Times of a run by the clock of its file [s]: with the hours of summer time and the jumps that were taken out."""
    shown = time_s.copy()
    for finding in findings:
        if finding.id in (CLOCK_FORWARD, CLOCK_BACK) and finding.where.from_s is not None:
            jump_s = float(finding.evidence["jump_s"])
            shown[time_s >= finding.where.from_s] += jump_s - (0.0 if jump_s > 0 else period_s)
    return shown


def _begun(name: str, zero: float) -> Finding:
    told = (
        f"The window begins {zero / 3600.0:.3g} h after the start of run {name}: what counts from the start of a run, "
    )
    told += "rises and zeros, counts from there, where the machine may be warm."
    return FINDINGS.finding("window-begins-in-run", told, evidence={"skipped_s": zero})


def told_from(finding: Finding, zero: float, length: float) -> Finding | None:
    """A finding with its place counted from another start; None: it lies outside."""
    where = finding.where
    if where.from_s is None:
        return finding
    begin, end = where.from_s - zero, (where.from_s if where.to_s is None else where.to_s) - zero
    if end < 0.0 or begin > length:
        return None
    last = None if where.to_s is None else min(end, length)
    return replace(finding, where=Where(where.channel, where.run, max(begin, 0.0), last, where.file))


def _day_of(path: Path) -> datetime.datetime | None:
    named = _DAY.match(path.name) if path.parent.name.startswith("month=") else None
    try:
        return None if named is None else datetime.datetime.fromisoformat(named[0])
    except ValueError:
        return None


def _window(overrides: Overrides) -> tuple[datetime.datetime, datetime.datetime]:
    since = _BEGIN if overrides.since is None else _moment(overrides.since, "--since")
    until = _END if overrides.until is None else _moment(overrides.until, "--until")
    if not since < until:
        found = f"a window from {overrides.since} to {overrides.until}"
        advice = "the end itself is not in the window: --since 2026-03-01 --until 2026-04-01 is all of March"
        raise OptionError(found, expected="an end after the beginning", where=WINDOW, advice=advice)
    return since, until


def _moment(text: str, where: str) -> datetime.datetime:
    try:
        moment = datetime.datetime.fromisoformat(text)
    except ValueError:
        moment = None
    if moment is None or moment.tzinfo is not None:
        expected = "a date, or date and time, by the clock of the recordings"
        raise OptionError(repr(text), expected=expected, where=where, advice="e.g. 2026-03-01 or 2026-03-01T06:00")
    return moment


def _nothing(overrides: Overrides, found: str) -> ReadError:
    return ReadError(
        found,
        expected=f"samples from {overrides.since or 'the beginning'} to {overrides.until or 'the end'}",
        where=WINDOW,
        advice="widen the window; `selector describe` without it shows when the runs begin, and whether the order of "
        "day and month was guessed (--date-order)",
    )
