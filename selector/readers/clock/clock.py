"""Which columns hold the time, and what time they tell."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TypeAlias

import numpy as np

from selector.errors import ReadError
from selector.findings import Finding, Where
from selector.readers.cells import is_counter_name, is_time_name, time_part
from selector.readers.clock.stamps import Stamps, epoch_s, numeric_clock, stamps, time_unit
from selector.readers.finding_table import AMBIGUOUS_TIME, FINDINGS, TIME_UNIT_GUESSED
from selector.readers.roles.names import closest, found_column, known_unit, name_and_unit, role_guess
from selector.readers.tables import Column, Table, listed
from selector.types import Vector

_MILLISECOND_NAME = re.compile(r"^(ms|msec|millis(ec(ond)?s?)?|millisekunden?|毫秒|ミリ秒|мс)$", re.IGNORECASE)

_EARLIEST_EPOCH = 5e8  #: In seconds, 1985; fewer in another unit could be anything.

#: Stamps of the columns of one table that have been read already, by header.
_Known: TypeAlias = dict[str, Stamps | None]


@dataclass(frozen=True)
class TimeOptions:
    """What the machine file or the user says about the time; None = find out."""

    columns: tuple[str, ...] = ()
    unit: str | None = None
    period_s: float | None = None
    date_order: str | None = None


@dataclass(frozen=True)
class Clock:
    """Stamps of a table."""

    seconds: Vector  #: (n_rows,): Since `base_s`; NaN = no readable stamp
    base_s: float | None  #: Absolute time of ``seconds == 0`` [s since 1970-01-01], None for a clock without a date
    zone_s: float | None  #: Offset of the file's zone from UTC [s]; then `base_s` is UTC, otherwise local time
    columns: tuple[str, ...]  #: Headers of the time columns; empty for a clock outside of the columns or none at all
    unit: str  #: A unit of time, or "datetime", or "sample" when there is no clock
    time_of_day: bool  #: Whether it starts anew at midnight
    guessed: tuple[str, ...]  #: Which of "column", "unit" were guessed
    findings: tuple[Finding, ...]


def clock(table: Table, options: TimeOptions) -> Clock:
    """The clock of a table."""
    known: _Known = {}
    if options.columns:
        columns = [_named(table, name) for name in options.columns]
        result = _told_by(table, columns, options, known)
        if result is None:
            raise ReadError(
                f"no times in column {columns[0].header!r} (first cell: {str(columns[0].values[0])[:40]!r})",
                expected="a number in a unit of time, or a date and time",
                where=table.file.name,
                advice="correct [time] column and unit in the machine file, or the time column (--time-column)",
            )
        return result
    if options.period_s is not None:
        return _sample_clock(table, options.period_s, None, named=True)
    if table.time_s is not None:
        base_s = None if table.start is None else float(table.start.astype("datetime64[us]").astype(np.int64)) / 1e6
        return Clock(table.time_s, base_s, None, (), "datetime" if base_s is not None else "s", False, (), ())
    for columns in _candidates(table, options, known):
        result = _told_by(table, columns, options, known)
        known_s = np.empty(0) if result is None else result.seconds[np.isfinite(result.seconds)]
        # a clock that was never set stands still
        if result is not None and len(known_s) >= 0.5 * len(table) and (len(table) < 3 or np.ptp(known_s) > 0.0):
            return replace(result, guessed=("column", *result.guessed))
    column, how = _unnamed_clock(table)
    found = None if column is None else _told_by(table, [column], options, known)
    if column is not None and found is not None:
        told = f"No column of {table.file.name} is called a time; column {column.header!r} {how} and was taken for the "
        told += f"time, in {'dates' if found.unit == 'datetime' else found.unit}."
        evidence = {"column": column.header, "unit": found.unit}
        finding = FINDINGS.finding("time-column-guessed", told, Where(channel=column.header), evidence)
        return replace(found, guessed=("column", *found.guessed), findings=(finding,))
    return _sample_clock(table, table.reading.get("stated_period_s"), options.date_order, named=False)


def _sample_clock(table: Table, period_s: float | None, date_order: str | None, *, named: bool) -> Clock:
    findings: tuple[Finding, ...] = ()
    if period_s is not None and not named:
        told = f"{table.file.name} has no time column; one row every {period_s:g} s was taken, as its heading states."
        findings = (FINDINGS.finding("stated-period", told, evidence={"period_s": period_s}),)
    is_known = named or period_s is not None
    if period_s is None:
        period_s = 1.0
        unread = [c.header for c in table.columns if c.kind == "text" and is_time_name(name_and_unit(c.header)[0])]
        order = f" in the order {date_order}" if date_order and unread else ""
        cells = f" (the cells of {unread[0]!r} are no times{order})" if unread else ""
        told = f"{table.file.name} has no time column{cells}; one row per second is assumed, so times and time "
        told += "constants are counted in samples."
        advice = "correct --date-order, or date_order under [time] in the machine file" if order else None
        findings = (FINDINGS.finding("no-clock", told, evidence={"period_s": period_s}, suggestion=advice),)
    seconds = np.arange(len(table), dtype=np.float64) * period_s
    return Clock(seconds, None, None, (), "sample", False, () if is_known else ("unit",), findings)


def _named(table: Table, name: str) -> Column:
    column = found_column(table.columns, name)
    if column is None:
        headers = [c.header for c in table.columns]
        near = closest(name, headers)
        raise ReadError(
            f"no time column {name!r}; the columns are {listed(headers, 20)}",
            expected=f"a column called {name!r}" + (f" (nearest: {near!r})" if near else ""),
            where=table.file.name,
            advice="correct [time] column in the machine file, or leave it out to have it found",
        )
    return column


def _candidates(table: Table, options: TimeOptions, known: _Known) -> list[list[Column]]:
    """Sets of columns that may hold the time, the likeliest first."""
    named = [c for c in table.columns if is_time_name(name_and_unit(c.header)[0]) or is_time_name(c.header)]
    texts = [c for c in table.columns if c.kind in ("text", "datetime")]
    read = {id(c): _text_stamps(c, table, options, known) for c in texts}
    full = [c for c in texts if _kind(c, read[id(c)]) == "datetime"]
    dates = [c for c in texts if _kind(c, read[id(c)]) == "date"]
    times = [c for c in texts if _kind(c, read[id(c)]) == "time"]
    fractions = [c for c in named if c.kind == "number" and _fraction_of_day(c)]
    sets: list[list[Column]] = []
    sets += [[c] for c in full if c in named] + [[c] for c in full if c not in named]
    if dates and (times or fractions):
        sets.append([dates[0], (times or fractions)[0]])
    parts = _parts(table.columns)
    of_day = [parts[part] for part in (3, 4, 5) if part in parts]
    if dates and 3 in parts and not times:
        sets.append([dates[0], *of_day])
    if parts.keys() >= {0, 1, 2, 3}:
        sets.append([parts[part] for part in (0, 1, 2)] + of_day)
    if parts.keys() >= {3, 4} and not times:
        sets.append(of_day)
    numbers = [c for c in named if c.kind == "number" and c not in dates]
    united = [
        c
        for c in table.columns
        if c.kind == "number" and c not in numbers and _unit_of(c) and _rises(c, 1.0 if c in parts.values() else 0.9)
    ]
    alone = [c for c in times if c in named] + [c for c in numbers if _rises(c)]
    alone += [c for c in times if c not in named] + united + [c for c in numbers if not _rises(c)] + dates
    return sets + [[c] for c in alone]


def _parts(columns: Sequence[Column]) -> dict[int, Column]:
    """Columns of numbers that hold one part of the time each, see `time_part`."""
    found: dict[int, Column] = {}
    for column in columns:
        part = time_part(name_and_unit(column.header)[0])
        if part is not None and column.kind == "number":
            found.setdefault(part, column)
    return found


def _unit_of(column: Column) -> str | None:
    """The unit of time that a column is in, by its own words; the heading may be nothing but the unit."""
    name, unit = name_and_unit(column.header, time=True)
    return time_unit(column.unit) or time_unit(unit) or (time_unit(name) if len(name) > 3 else None)


def _kind(column: Column, read: Stamps | None) -> str:
    if column.kind == "datetime":
        whole = column.values[~np.isnat(column.values)]
        midnights = whole.astype("datetime64[D]").astype(whole.dtype) == whole
        return "date" if len(whole) and bool(midnights.all()) else "datetime"
    return "" if read is None else read.kind


def _fraction_of_day(column: Column) -> bool:
    known = column.values[np.isfinite(column.values)]
    return bool(len(known) > 1 and known.min() >= 0 and known.max() < 1 and np.any(known > 0))


def _rises(column: Column, share: float = 0.9) -> bool:
    known = column.values[np.isfinite(column.values)]
    return len(known) > 1 and float(np.mean(np.diff(known) >= 0)) >= share and known[-1] != known[0]


def _unnamed_clock(table: Table) -> tuple[Column | None, str]:
    """A column without a telling name that can only be a clock, as seconds since 1970 are, and why."""
    numbers = [one for one in table.columns if one.kind == "number" and len(table) > 1]
    for column in numbers:
        if np.nanmin(column.values, initial=np.inf) >= _EARLIEST_EPOCH and _rises(column) and _says_nothing(column):
            read = numeric_clock(column.values, None)
            if read.base_s is not None and read.sure:
                return column, "counts from a known date"
    is_first = bool(numbers) and numbers[0] is table.columns[0] and len(table.columns) > 1
    if is_first and len(table) > 4 and _says_nothing(numbers[0]):
        steps = np.diff(numbers[0].values)
        usual = float(np.median(steps))
        if (steps > 0).all() and float(np.mean(np.abs(steps - usual) <= 0.4 * usual)) >= 0.9:
            return numbers[0], "rises steadily"
    return None, ""


def _says_nothing(column: Column) -> bool:
    """Whether the heading of a column tells neither what it measures nor that it numbers the rows."""
    name, unit = name_and_unit(column.header)
    return not is_counter_name(name) and role_guess(name, known_unit(unit), column.values).role is None


def _text_stamps(column: Column, table: Table, options: TimeOptions, known: _Known) -> Stamps | None:
    if column.kind != "text":
        return None
    if column.header not in known:
        known[column.header] = stamps(
            column.values, column.header, table.file.name, options.date_order, table.reading.get("decimal") == ","
        )
    return known[column.header]


def _told_by(table: Table, columns: Sequence[Column], options: TimeOptions, known: _Known) -> Clock | None:
    parts = _parts(columns)
    if len(columns) > 1 and len(parts) == len(columns):
        return _of_parts(table, parts)
    if len(columns) > 1:
        return _date_and_time(table, columns, options, known)
    column = columns[0]
    headers = (column.header,)
    conflict: tuple[Finding, ...] = ()
    wanted = options.unit
    minutes = wanted == "min" and column.kind == "text"
    if column.kind != "number" and wanted not in (None, "datetime") and not minutes:
        conflict = (_unit_conflict(table, column, f"{wanted!r}", "dates or times of day"),)
    if column.kind == "datetime":
        told = ~np.isnat(column.values)
        if not told.any():
            return None
        base = column.values[told][0]
        seconds = np.where(told, (column.values - base).astype("timedelta64[ns]").astype(np.int64) / 1e9, np.nan)
        base_s = int(base.astype("datetime64[ns]").astype(np.int64)) / 1e9
        zone_s = 0.0 if table.reading.get("utc_columns") and column.header in table.reading["utc_columns"] else None
        return Clock(seconds, base_s, zone_s, headers, "datetime", False, (), conflict)
    if column.kind == "text":
        read = _text_stamps(column, table, options, known)
        if read is None:
            return None
        seconds = read.seconds + _milliseconds(table, read.seconds)
        if read.two_parts and minutes:
            return Clock(seconds / 60.0, None, None, headers, "min", False, (), ())
        if minutes:
            conflict = (_unit_conflict(table, column, "'min'", "dates or times of day"),)
        known_s = seconds[np.isfinite(seconds)]
        guessed: tuple[str, ...] = ()
        if read.two_parts and wanted is None and len(known_s) and known_s[0] < 3600:
            guessed, example = ("unit",), next((str(v) for v in column.values if v), "")
            told_as = f"Times such as {example!r} in column {column.header!r} of {table.file.name} were read as "
            told_as += "hours:minutes; they could be minutes:seconds."
            evidence = {"read_as": "hh:mm", "alternative": "mm:ss"}
            conflict = (FINDINGS.finding(AMBIGUOUS_TIME, told_as, Where(channel=column.header), evidence),)
        findings = (*read.findings, *conflict)
        zero_s = None if read.kind == "time" else read.base_s
        return Clock(seconds, zero_s, read.zone_s, headers, "datetime", read.kind == "time", guessed, findings)
    return _numeric(table, column, wanted)


def _numeric(table: Table, column: Column, wanted: str | None) -> Clock | None:
    in_file = _unit_of(column)
    named = None if wanted in (None, "datetime") else time_unit(wanted)
    findings: list[Finding] = []
    if named is not None and in_file is not None and named != in_file:
        findings.append(_unit_conflict(table, column, f"{named!r}", f"{in_file!r}"))
    read = numeric_clock(column.values, named or in_file)
    absolute = numeric_clock(column.values, None) if in_file in ("s", "ms", "us", "ns") and named is None else None
    if absolute is not None and absolute.base_s is not None:
        read = absolute
    if wanted == "datetime" and read.base_s is None:
        return None
    guessed: tuple[str, ...] = ()
    if named is None and in_file is None and not (read.base_s is not None and read.sure):
        guessed = ("unit",)
        other, alternative = ("min", "min or h") if read.unit == "s" else ("s", "s")
        told = f"The unit of time column {column.header!r} of {table.file.name} is not written; it was read as "
        told += f"{read.unit}{' (fractions of a day, as spreadsheets hold times)' if read.unit == 'day' else ''}."
        evidence = {"column": column.header, "unit": read.unit, "alternative": alternative}
        advice = f'name it: unit = "{other}" under [time] in the machine file (or --time-unit)'
        where = Where(channel=column.header)
        findings.append(FINDINGS.finding("time-unit-guessed", told, where, evidence, advice))
    elif read.base_s is not None and named is None and in_file is None:
        guessed = ("unit",)
        told = f"Time column {column.header!r} of {table.file.name} counts {read.unit}: the run starts at "
        told += f"{np.datetime64(round(read.base_s + np.nanmin(read.seconds)), 's')}."
        findings.append(FINDINGS.finding("absolute-clock", told, Where(channel=column.header), {"unit": read.unit}))
    unit = "datetime" if read.base_s is not None else read.unit
    return Clock(read.seconds, read.base_s, None, (column.header,), unit, read.unit == "day", guessed, tuple(findings))


def _unit_conflict(table: Table, column: Column, wanted: str, found: str) -> Finding:
    told = f"The machine file (or the option) says that time column {column.header!r} is in {wanted}, but "
    told += f"{table.file.name} says {found}. "
    told += "The dates and times were read." if "dates" in found else f"It was read in {wanted}."
    evidence = {"asked": wanted, "in_file": found}
    return FINDINGS.finding("time-unit-conflict", told, Where(channel=column.header), evidence)


def _date_and_time(table: Table, columns: Sequence[Column], options: TimeOptions, known: _Known) -> Clock | None:
    day = _told_by(table, columns[:1], replace(options, columns=(), unit=None), known)
    time = _told_by(table, columns[1:], replace(options, columns=(), unit=None), known)
    if day is None or time is None or day.base_s is None:
        return None
    settled = (TIME_UNIT_GUESSED, AMBIGUOUS_TIME)
    findings = tuple(f for f in (*day.findings, *time.findings) if f.id not in settled)
    seconds = day.seconds + time.seconds
    headers = (*day.columns, *time.columns)
    return Clock(seconds, day.base_s, day.zone_s, headers, "datetime", False, (), findings)


def _of_parts(table: Table, parts: Mapping[int, Column]) -> Clock:
    """The clock of year, month, day, hour, minute and second in columns of their own; without a date a time of day."""
    nothing = np.zeros(len(table))
    year, month, day, hour, minute, second = (parts[k].values if k in parts else nothing for k in range(6))
    is_daily = not parts.keys() >= {0, 1, 2}
    midnight = nothing if is_daily else epoch_s(year, month, day)
    base_s = float(midnight[np.isfinite(midnight)][0]) if np.isfinite(midnight).any() else 0.0
    seconds = midnight - base_s + 3600.0 * hour + 60.0 * minute + second
    seconds = np.where((hour <= 24) & (minute < 60) & (second < 61), seconds, np.nan)
    headers = tuple(column.header for column in parts.values())
    seconds = seconds + _milliseconds(table, seconds)
    return Clock(seconds, None if is_daily else base_s, None, headers, "datetime", is_daily, (), ())


def _milliseconds(table: Table, seconds: Vector) -> Vector | float:
    """Fractions of a second that a logger writes into a column of their own."""
    if np.any(seconds[np.isfinite(seconds)] % 1.0):
        return 0.0
    for column in table.columns:
        if column.kind == "number" and _MILLISECOND_NAME.match(column.header.strip()):
            values = column.values
            known = values[np.isfinite(values)]
            if len(known) and known.min() >= 0 and known.max() < 1000 and np.all(known == np.round(known)):
                return np.nan_to_num(values) / 1000.0
    return 0.0
