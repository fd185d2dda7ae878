"""Tables with a clock → runs: samples in order of time, and what was noticed, each with its place in the run."""

import datetime
import re
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import numpy as np
import pandas as pd

from selector.errors import ReadError
from selector.findings import Finding, Where
from selector.readers.cells import is_time, is_time_name
from selector.readers.clock.clock import Clock, TimeOptions, clock
from selector.readers.clock.ticking import ticks
from selector.readers.finding_table import DUPLICATE_HEADER, FINDINGS, UNREADABLE_CELLS
from selector.readers.roles.names import folded_name, name_and_unit, printable_name
from selector.readers.tables import BreakWord, Column, Table, listed, unique_headers
from selector.types import Array, Indices

_SENSOR_WORDS = {"id", "nid", "sensor", "node", "probe", "channel", "sonde", "fühler", "kanal", "knoten"}
#: The fewest rows of a sensor, the most sensors, how often it changes from row to row where they take turns, and how
#: many times as many rows one may have as another.
_LEAST_ROWS, _MOST_SENSORS, _TURNS, _ALIKE = 8, 64, 0.5, 3.0
_RUN_COLUMNS = frozenset({"run", "runid", "runno", "runname", "lauf"})


@dataclass(frozen=True)
class TimedRun:
    """One run before roles and units."""

    #: name, file and sha256: Name of the run, where it was read, and the hash of that file
    name: str
    file: Path
    sha256: str
    time_s: Array  #: (n_samples,): Strictly increasing, 0 at the first sample
    columns: tuple[Column, ...]  #: Those with numbers, on these samples; without `breaks`
    texts: tuple[str, ...]  #: Headers of the columns without numbers
    clock: Clock  #: Where the time came from
    first_s: float  #: The file's own relative clock at the first sample [s]
    start: str | None  #: Absolute start, ISO 8601
    table: Table
    findings: tuple[Finding, ...]
    skipped_s: float = 0.0  #: What the window cut off at the beginning of the recorded run [s]
    beside: tuple["Beside", ...] = ()  #: What other loggers recorded of it

    @cached_property
    def by_header(self) -> dict[str, Column]:
        """The columns by their header."""
        return {column.header: column for column in self.columns}

    @property
    def period_s(self) -> float:
        """Median step of time [s]."""
        return float(np.median(np.diff(self.time_s)))


@dataclass(frozen=True)
class Beside:
    """What another logger recorded of a run."""

    name: str  #: What it would be called as a run of its own
    file: str
    sha256: str
    begins_s: float  #: Its recorded start, from that of the run [s]


def timed_run(table: Table, sha256: str, options: TimeOptions) -> TimedRun:
    """The run of a table.

    Raises ReadError: It has fewer than two samples, or a time column that was named is missing.
    """
    if len(table) == 0:
        raise _too_short(table, 0)
    told = clock(table, options)
    seconds = np.where(np.abs(told.seconds) < 1e13, told.seconds, np.nan)
    numeric = [c for c in table.columns if c.kind == "number" and c.header not in told.columns]
    matrix = np.column_stack([c.values for c in numeric]) if numeric else np.empty((len(table), 0))
    in_words = any(c.header in told.columns and c.kind != "number" for c in table.columns)
    local = told.base_s if told.zone_s is None and in_words else None
    result = ticks(seconds, table, matrix, told.time_of_day, local)
    time_s = result.time_s
    if len(time_s) < 2:
        raise _too_short(table, len(time_s))
    values = averaged(matrix[result.rows], result.groups, len(time_s))
    # what is wrong with cells of the time column is told by the rows that have no time
    own = [f for f in table.findings if not (f.id == UNREADABLE_CELLS and f.where.channel in told.columns)]
    findings = [*own, *told.findings, *result.findings]
    sample_of_row = np.full(len(table), -1, dtype=np.int64)
    sample_of_row[result.rows] = result.groups
    columns: list[Column] = []
    for k, column in enumerate(numeric):
        columns.append(Column(column.header, values[:, k], column.unit, (), column.description))
        findings += _breaks(column, sample_of_row, time_s, table)
    first_s = result.first_s
    start = None
    if told.base_s is not None:
        start, first_s = _iso(told.base_s + first_s, told.zone_s), 0.0
    texts = tuple(c.header for c in table.columns if c.kind != "number" and c.header not in told.columns)
    return TimedRun(
        table.name, table.file, sha256, time_s, tuple(columns), texts, told, first_s, start, table, tuple(findings)
    )


def averaged(values: Array, groups: Indices, n_samples: int) -> Array:
    """One row per group: the mean of the values that are there; equal values stay bit for bit what they are."""
    if len(values) == n_samples:
        return values
    starts = np.flatnonzero(np.r_[True, np.diff(groups) > 0])
    known = np.isfinite(values)
    counts = np.add.reduceat(known.astype(np.int64), starts, axis=0)
    low = np.minimum.reduceat(np.where(known, values, np.inf), starts, axis=0)
    high = np.maximum.reduceat(np.where(known, values, -np.inf), starts, axis=0)
    sums = np.add.reduceat(np.where(known, values, 0.0), starts, axis=0)
    mean = np.where(low == high, low, sums / np.maximum(counts, 1))
    out: Array = np.where(counts > 0, mean, np.nan)
    return out


def _breaks(column: Column, sample_of_row: Indices, time_s: Array, table: Table) -> Iterator[Finding]:
    for broken in column.breaks:
        samples = sample_of_row[broken.rows]
        samples = samples[samples >= 0]
        if len(samples) == 0:
            continue
        first, last = int(samples.min()), int(samples.max())
        until = f", last at {time_s[last]:g} s"
        if last == len(time_s) - 1 and len(samples) > 1:
            until = ", up to the end of the run"
        told = f"Column {column.header!r} of {table.file.name} says {broken.word!r} {len(samples)} time(s), first at "
        told += f"{time_s[first]:g} s ({table.line(int(broken.rows[0]))}){until}; these samples are missing values."
        where = Where(channel=column.header, from_s=float(time_s[first]), to_s=float(time_s[last]))
        evidence = {"word": broken.word, "count": len(samples), "share": len(samples) / len(time_s)}
        advice = "check the sensor and its cable; leave the channel out if it is broken for long"
        yield FINDINGS.finding("sensor-break", told, where, evidence, advice, "leave-out-stretch", level="warning")


def _too_short(table: Table, n_samples: int) -> ReadError:
    return ReadError(
        f"{'one sample' if n_samples == 1 else 'no samples'} with a time",
        expected="at least two rows of numbers with different times",
        where=table.file.name,
        advice="check the time column, the order of its dates (--date-order) and decimal mark, or leave this file out",
    )


def _iso(seconds: float, zone_s: float | None) -> str | None:
    try:
        moment = datetime.datetime(1970, 1, 1) + datetime.timedelta(seconds=round(seconds + (zone_s or 0.0), 6))
        zone = None if zone_s is None else datetime.timezone(datetime.timedelta(seconds=zone_s))
    except (OverflowError, ValueError):
        return None
    whole = moment.microsecond == 0
    return moment.replace(tzinfo=zone).isoformat(timespec="seconds" if whole else "milliseconds")


def split_runs(table: Table, declared: Sequence[str]) -> list[Table]:
    """One table per value of a column called "run" whose equal values stand together; otherwise the table itself."""
    column = next(
        (c for c in table.columns if folded_name(c.header) in _RUN_COLUMNS and c.header not in declared), None
    )
    if column is None or column.kind == "datetime" or len(table) < 4 or table.time_s is not None:
        return [table]
    labels = [_label(value) for value in column.values]
    if any(label is None for label in labels):
        return [table]
    array = np.array(labels, dtype=object)
    starts = np.flatnonzero(np.r_[True, array[1:] != array[:-1]])
    names = [str(array[i]) for i in starts]
    stops = [*starts[1:], len(array)]
    if len(set(names)) != len(names) or any(b - a < 2 for a, b in zip(starts, stops, strict=True)):
        return [table]
    told = f"Column {column.header!r} of {table.file.name} tells {len(names)} runs apart: {listed(names, 8)}."
    findings = (*table.findings, FINDINGS.finding("run-column", told, evidence={"runs": names[:100]}))
    tables = []
    for i, (name, a, b) in enumerate(zip(names, starts, stops, strict=True)):
        run_name = name if column.kind == "text" else f"{table.name}_{name}"
        rest = [one for one in table.columns if one is not column]
        tables.append(_part(table, rest, np.arange(a, b), run_name, findings if i == 0 else ()))
    return tables


def _part(
    table: Table, columns: Sequence[Column], rows: Indices, name: str, findings: tuple[Finding, ...] = ()
) -> Table:
    """Some rows of some columns."""
    kept = []
    for one in columns:
        inside = (BreakWord(word.word, np.flatnonzero(np.isin(rows, word.rows))) for word in one.breaks)
        kept.append(replace(one, values=one.values[rows], breaks=tuple(inside)))
    lines = None if table.lines is None else table.lines[rows]
    return replace(table, name=name, columns=tuple(kept), lines=lines, findings=findings)


def split_clocks(table: Table, declared: Sequence[str]) -> tuple[list[Table], bool]:
    """One table for each time column of one heading, with the columns up to the next; and whether each is a run.

    Tables with the same headings are runs side by side; channels that have a clock each are one run.
    """
    headings = [one.header for one in table.columns]
    # "T1.2" is the second column called T1
    own = [bare if (bare := re.sub(r"\.\d+$", "", one)) in headings else one for one in headings]
    names = {one: name_and_unit(one, time=True)[0] for one in own}
    first = next((k for k, one in enumerate(own) if own.count(one) > 1 and is_time_name(names[one])), None)
    if first is None or table.time_s is not None:
        return [table], True
    starts = [k - first for k, one in enumerate(own) if one == own[first]]
    blocks = [range(a, b) for a, b in zip(starts, [*starts[1:], len(own)], strict=True)]
    told = [np.flatnonzero(pd.notna(table.columns[k + first].values)) for k in starts]
    clocks = [table.columns[k + first].values[rows] for k, rows in zip(starts, told, strict=True)]
    is_clock = all(len(one) > 1 and (one.dtype.kind != "f" or (np.diff(one) >= 0).all()) for one in clocks)
    is_alike = {own[k] for k in starts} == {own[0]} and all(len(block) > first + 1 for block in blocks)
    if not is_clock or not is_alike or any(one in declared for one in headings[starts[1] :] if one not in own):
        return [table], True
    tables = []
    for number, (block, rows) in enumerate(zip(blocks, told, strict=True), start=1):
        unique, _ = unique_headers([own[k] for k in block], table.file.name)
        columns = [replace(table.columns[k], header=header) for k, header in zip(block, unique, strict=True)]
        tables.append(_part(table, columns, rows, f"{table.name}_{number}"))
    channels = [one.header for part in tables for one in part.columns if one.header != own[first]]
    are_runs = len(set(channels)) < len(channels)
    kept = tuple(one for one in table.findings if one.id != DUPLICATE_HEADER)
    shown = f"{len(tables)} time columns {own[first]!r}"
    if are_runs:
        said = f"{table.file.name} has {shown}: tables side by side, of which each became a run."
        finding = FINDINGS.finding("runs-side-by-side", said, evidence={"runs": [one.name for one in tables]})
    else:
        said = f"{table.file.name} has {shown}; its channels were brought onto the slowest of these clocks."
        finding = FINDINGS.finding("several-clocks", said, evidence={"clocks": len(tables), "channels": channels})
        tables = [replace(one, name=table.name) for one in tables]
    return [replace(tables[0], findings=(*kept, finding)), *tables[1:]], are_runs


def split_sensors(table: Table, declared: Sequence[str]) -> dict[str, Table]:
    """Name → table of one sensor, where a column says for each row which sensor it is of; empty otherwise.

    Such sensors take turns, or follow each other with the clock going back in between. Of words, and of numbers under a
    heading that says so: what changes as often might be a state.
    """
    for column in table.columns:
        words = re.split(r"[^a-z]+", re.sub(r"([a-z])([A-Z])", r"\1 \2", column.header).lower())
        if column.header in declared or not (column.kind == "text" or _SENSOR_WORDS & set(words)):
            continue
        if len({_label(value) for value in column.values[: _LEAST_ROWS * _MOST_SENSORS]}) > _MOST_SENSORS:
            continue
        labels = [_label(value) for value in column.values]
        names = sorted({label for label in labels if label is not None})
        if None in labels or not 2 <= len(names) <= _MOST_SENSORS or any(is_time(name) for name in names):
            continue
        of_row = np.searchsorted(names, np.array(labels, dtype=object).astype(str))
        counts, changed = np.bincount(of_row), np.flatnonzero(np.diff(of_row))
        rest = [one for one in table.columns if one is not column]
        takes_turns = len(changed) > _TURNS * len(table)
        is_even = counts.min() >= _LEAST_ROWS and counts.max() <= _ALIKE * counts.min()
        follows = len(changed) + 1 == len(names) and any(_begins_anew(one, changed) for one in rest)
        if not is_even or not (takes_turns or follows):
            continue
        told = f"Column {column.header!r} of {table.file.name} tells {len(names)} sensors apart: {listed(names, 8)}."
        findings = (*table.findings, FINDINGS.finding("sensor-column", told, evidence={"sensors": names}))
        of_sensor = [np.flatnonzero(of_row == k) for k in range(len(names))]
        parts = [_part(table, rest, rows, table.name, () if k else findings) for k, rows in enumerate(of_sensor)]
        return dict(zip(names, parts, strict=True))
    return {}


def _begins_anew(column: Column, changed: Indices) -> bool:
    """Whether it goes on like a clock and back where the sensor changes, not like a speed that falls with a state."""
    values = column.values.astype(str if column.kind == "text" else np.float64)
    goes_back = np.flatnonzero(values[1:] < values[:-1])
    steps = [np.count_nonzero(part[1:] > part[:-1]) for part in np.split(values, changed + 1)]
    return bool(np.array_equal(goes_back, changed) and min(steps) >= _LEAST_ROWS - 1)


def tables_of_runs(table: Table, declared: Sequence[str]) -> Iterator[list[tuple[str, Table]]]:
    """For each run of a table its parts with a clock of their own; of a sensor of a long table with its name."""
    for one in split_runs(table, declared):
        parts, are_runs = split_clocks(one, declared)
        if not are_runs:
            yield [("", part) for part in parts]
            continue
        for part in parts:
            yield [*split_sensors(part, declared).items()] or [("", part)]


def _label(value: object) -> str | None:
    if isinstance(value, str):
        return value.strip() or None
    number = float(value) if isinstance(value, (float, np.floating)) else np.nan
    return str(int(number)) if np.isfinite(number) and number == int(number) else None


def uniquely_named(runs: Sequence[TimedRun]) -> tuple[list[TimedRun], list[Finding]]:
    """The runs with printable names that differ: file stem, or with the folder where two files have the same stem."""
    names = [printable_name(run.name) for run in runs]
    counts = Counter(names)
    out: list[TimedRun] = []
    taken: set[str] = set()
    for run, own in zip(runs, names, strict=True):
        name = own
        if counts[name] > 1 and run.file.parent.name:
            name = printable_name(f"{run.file.parent.name}_{name}")
        base, count = name, 1
        while name in taken:
            count += 1
            name = f"{base[: 99 - len(str(count))]}_{count}"
        taken.add(name)
        out.append(replace(run, name=name))
    return out, list(_renamed(runs, names, [run.name for run in out]))


def _renamed(runs: Sequence[TimedRun], printable: list[str], called: list[str]) -> Iterator[Finding]:
    if called != printable:
        told = f"Several files have the same name; the runs are called {', '.join(called[:8])}."
        yield FINDINGS.finding("runs-renamed", told, evidence={"runs": called})
    changed = [name for run, shown, name in zip(runs, printable, called, strict=True) if shown != run.name]
    if changed:
        told = f"{len(changed)} name(s) of runs are too long or have characters that cannot be shown; these runs are "
        told += f"called {', '.join(repr(name) for name in changed[:8])}."
        yield FINDINGS.finding("run-name-changed", told, evidence={"runs": changed})
