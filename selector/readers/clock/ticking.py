"""Stamps as they stand in the file → strictly increasing time; channels on several clocks → one table."""

import itertools
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from selector.findings import Finding, Level, Where
from selector.readers.finding_table import FINDINGS
from selector.readers.tables import Column, Table, listed
from selector.types import Indices, Mask, Matrix, Vector

_DAY_S = 86400.0


@dataclass(frozen=True)
class Ticks:
    """Rows in order of time."""

    time_s: Vector  #: (n_kept,): Strictly increasing, 0 at the first kept row
    #: (n_rows_used,): Rows of the table in order of time; rows with the same stamp stand together
    rows: Indices
    #: (n_rows_used,): For each of `rows` the kept sample that it belongs to; several rows of one group are averaged
    groups: Indices
    first_s: float  #: The file's own clock at the first kept row [s]
    findings: tuple[Finding, ...]  #: Missing, repeated, unsorted stamps and clock jumps


def ticks(seconds: Vector, table: Table, values: Matrix, time_of_day: bool, local_base_s: float | None) -> Ticks:
    """Rows in order of time, from their stamps, shape (n_rows,), NaN = none.

    Rows with the same stamp are compared by `values`, shape (n_rows, n_columns). A clock of `time_of_day` starts anew
    at midnight; summer time is recognised by `local_base_s`, the absolute time of `seconds` = 0 in local time.

    Rows without a stamp are left out. Stamps out of order are sorted, unless sorting would put samples of two
    different times on top of each other; then the clock jumped back and the time after it is moved on so that one
    usual period passes. Rows with the same stamp that say the same are one row; when most stamps repeat, the stamps are
    too coarse and the rows are spread evenly between them; otherwise the rows of a stamp are averaged.
    """
    findings: list[Finding] = []
    rows = np.flatnonzero(np.isfinite(seconds)).astype(np.int64)
    if len(rows) < len(seconds):
        findings.append(_missing_stamps(seconds, table))
    t = seconds[rows].copy()
    if len(t) == 0:
        return Ticks(t, rows, rows, 0.0, tuple(findings))
    if time_of_day:
        findings += _unwrapped(t, rows, table)
    steps = np.diff(t)
    usual = float(np.median(np.abs(steps[steps != 0]))) if np.any(steps != 0) else 1.0
    if np.any(steps < 0):
        order, told = _in_order(t, usual, rows, values, table, local_base_s)
        t, rows = t[order], rows[order]
        findings += told
    if local_base_s is not None:
        findings += _summer_time(t, usual, rows, table, local_base_s)
    first_s = float(t[0])
    time_s, groups, told = _without_repeats(t - first_s, rows, values, table)
    return Ticks(time_s, rows, groups, first_s, tuple(findings + told))


def _missing_stamps(seconds: Vector, table: Table) -> Finding:
    missing = np.flatnonzero(~np.isfinite(seconds))
    at_end = bool(missing[0] == len(seconds) - len(missing))
    told = f"{len(missing)} row(s) of {table.file.name} have no readable time ({_places(missing, table)})"
    told += f"{', all at the end of the file (a footer?)' if at_end else ''}; they were left out."
    evidence = {"rows": [table.line(int(row)) for row in missing[:20]], "count": len(missing)}
    return FINDINGS.finding("missing-stamps", told, evidence=evidence, action="leave-out-stretch")


def _unwrapped(t: Vector, rows: Indices, table: Table) -> Iterator[Finding]:
    """Add a day (or twelve hours) from every step back over midnight on; `t` is changed in place."""
    steps = np.diff(t)
    wraps = np.flatnonzero(steps < -0.5 * _DAY_S)
    period = _DAY_S
    level: Level = "info"
    if len(wraps) == 0 and t.max() < 13 * 3600 + 3600 and np.any(steps < -11 * 3600):
        wraps, period, level = np.flatnonzero(steps < -11 * 3600), 0.5 * _DAY_S, "warning"
    for wrap in wraps:
        t[wrap + 1 :] += period
    name = "midnight" if period == _DAY_S else "12 o'clock (no AM or PM is written)"
    if len(wraps):
        told = f"The time of day in {table.file.name} passes {name} {len(wraps)} time(s) "
        told += f"({_places(rows[wraps + 1], table)}); the run goes on behind it."
        where, evidence = Where(from_s=float(t[wraps[0] + 1] - t[0])), {"count": len(wraps), "period_s": period}
        yield FINDINGS.finding("midnight-wrap", told, where, evidence, level=level)


def _in_order(
    t: Vector, usual: float, rows: Indices, values: Matrix, table: Table, local_base_s: float | None
) -> tuple[Indices, list[Finding]]:
    back = np.flatnonzero(np.diff(t) < 0) + 1
    order = np.argsort(t, kind="stable").astype(np.int64)
    ordered = np.diff(t[order])
    repeats_now = int((np.diff(t) == 0).sum())
    new_repeats = int((ordered == 0).sum()) - repeats_now
    near = int((ordered < 0.7 * usual).sum()) - int(((np.diff(t) >= 0) & (np.diff(t) < 0.7 * usual)).sum())
    # one chance neighbour is no evidence, and rows that stand in the file twice are no other time
    sorted_rows, repeated = values[rows[order]], ordered == 0
    says_the_same = bool(np.all(_same(sorted_rows[1:][repeated], sorted_rows[:-1][repeated])))
    crowded = 0 if says_the_same and new_repeats else max(new_repeats, near - 1)
    n_pieces = len(back) + 1
    # a clock that jumps leaves long stretches in order, shuffled rows do not
    few = n_pieces <= max(4, 0.002 * len(t)) and len(t) >= 4 * n_pieces
    if not (few and crowded > 0 and _overlapping(t, back)):
        close = crowded > 0 and len(back) < 0.1 * len(t) and _overlapping(t, back)
        descending = len(back) == len(t) - 1 - repeats_now
        how = "run backwards in time" if descending else f"are not in order of time at {_places(rows[back], table)}"
        told = f"The rows of {table.file.name} {how}; they were sorted by their stamps."
        told += " Some of them then lie closer together than the usual period." if close else ""
        level: Level = "warning" if close else "info"
        return order, [FINDINGS.finding("unsorted-stamps", told, evidence={"steps_back": len(back)}, level=level)]
    findings = []
    for position in back:
        size = float(t[position] - t[position - 1])
        summer = local_base_s is not None and abs(size + 3600.0 - usual) < 0.51 * max(usual, 1.0)
        restart = abs(t[position] - t[0]) <= 2 * usual and not summer
        t[position:] += usual - size
        cause = "a restart of the logger" if restart else "the clock was set back"
        cause, row = "an hour, as at the end of summer time" if summer else cause, table.line(int(rows[position]))
        told = f"The clock of {table.file.name} jumps back by {-size:g} s at {row} ({cause}). The time behind it was "
        told += f"moved on so that one usual period of {usual:g} s passes"
        told += "." if summer else "; how long the pause really was is not known."
        evidence = {"jump_s": size, "cause": cause, "row": row}
        where = Where(from_s=float(t[position] - t[0]))
        findings.append(FINDINGS.finding("clock-jump-back", told, where, evidence))
    return np.arange(len(t), dtype=np.int64), findings


def _same(here: Matrix, before: Matrix) -> Mask:
    return (here == before) | (np.isnan(here) & np.isnan(before))


def _overlapping(t: Vector, back: Indices) -> bool:
    """Whether pieces of rising stamps cover the same time: then they cannot have been recorded in it one by one."""
    bounds = np.r_[0, back, len(t)]
    spans = sorted((float(t[a]), float(t[b - 1])) for a, b in itertools.pairwise(bounds))
    return any(left[1] >= right[0] for left, right in itertools.pairwise(spans))


def _summer_time(t: Vector, usual: float, rows: Indices, table: Table, local_base_s: float) -> Iterator[Finding]:
    """A step of one hour more than usual, in the small hours of a Sunday in spring: the clock was put forward."""
    for i in np.flatnonzero(np.abs(np.diff(t) - usual - 3600.0) < 0.02 * usual + 1e-6):
        moment = np.datetime64(int(local_base_s + t[i]), "s")
        hour = int((moment - moment.astype("datetime64[D]")).astype(int)) // 3600
        sunday = (moment.astype("datetime64[D]").astype(int) + 4) % 7 == 0
        month = int(moment.astype("datetime64[M]").astype(int)) % 12 + 1
        if not (sunday and hour <= 3 and month in (3, 4, 9, 10, 11)) or usual > 900:
            continue
        t[i + 1 :] -= 3600.0
        row = table.line(int(rows[i + 1]))
        told = f"The clock of {table.file.name} jumps forward by one hour at {row}, in the night when summer time "
        told += "begins; the hour was taken out."
        where = Where(from_s=float(t[i + 1] - t[0]))
        yield FINDINGS.finding("clock-jump-forward", told, where, {"jump_s": 3600.0, "row": row})


def _without_repeats(t: Vector, rows: Indices, values: Matrix, table: Table) -> tuple[Vector, Indices, list[Finding]]:
    new = np.r_[True, np.diff(t) > 0]
    groups = np.cumsum(new) - 1
    kept = t[new]
    repeated = int((~new).sum())
    if repeated == 0:
        return kept, groups.astype(np.int64), []
    sizes = np.bincount(groups)
    same = np.all(_same(values[rows], values[rows[np.flatnonzero(new)[groups]]]), axis=1) & ~new
    differing = int((~new & ~same).sum())
    if repeated >= 0.5 * len(t) and len(kept) >= 3 and differing:
        spread = _spread(kept, sizes)
        usual_size = float(np.median(sizes[1:-1])) if len(sizes) > 2 else float(np.median(sizes))
        told = f"The stamps of {table.file.name} are coarser than its sampling: about {usual_size:g} rows share each "
        told += "of them. The rows were spread evenly between the stamps."
        coarse = FINDINGS.finding("coarse-stamps", told, evidence={"rows_per_stamp": usual_size})
        return spread, np.arange(len(t), dtype=np.int64), [coarse]
    places = _places(rows[~new], table)
    findings = []
    if equal := int(same.sum()):
        told = f"{equal} row(s) of {table.file.name} stand there more than once ({places}); each was taken once."
        findings.append(FINDINGS.finding("repeated-rows", told, evidence={"count": equal}))
    if differing:
        told = f"{differing} row(s) of {table.file.name} have the stamp of another row but other values ({places}); "
        told += "the rows of one stamp were averaged."
        where = Where(from_s=float(t[np.flatnonzero(~new & ~same)[0]]))
        findings.append(FINDINGS.finding("repeated-stamps", told, where, {"count": differing}))
    return kept, groups.astype(np.int64), findings


def _spread(kept: Vector, sizes: Indices) -> Vector:
    """Stamps with equal steps between one distinct stamp and the next; the last ones go on with the step before."""
    usual = float(np.median(np.diff(kept) / np.maximum(sizes[:-1], 1)))
    lengths = np.r_[np.diff(kept), sizes[-1] * usual]
    position = np.arange(int(sizes.sum())) - np.repeat(np.cumsum(sizes) - sizes, sizes)
    out = np.repeat(kept, sizes) + position / np.repeat(sizes, sizes) * np.repeat(lengths, sizes)
    if sizes[0] < np.median(sizes):
        # the recording began inside of its first stamp
        n = int(sizes[0])
        out[:n] = kept[1] - usual * np.arange(n, 0, -1)
    spread: Vector = out - out[0]
    return spread


def _places(rows: Indices, table: Table) -> str:
    shown = ", ".join(table.line(int(row)) for row in rows[:5])
    return shown + (f", … {table.line(int(rows[-1]))}" if len(rows) > 5 else "")


@dataclass(frozen=True)
class Rate:
    """Columns that share a clock [s]."""

    time_s: Vector
    columns: tuple[Column, ...]


def one_clock(rates: Sequence[Rate], path: Path) -> tuple[Vector, tuple[Column, ...], list[Finding]]:
    """Time, columns and findings: all come onto the clock of the most columns (in a tie the slower one).

    Columns of other clocks are interpolated linearly, not beyond their ends and not over pauses of more
    than ten of their periods; text is left out.
    """
    merged: list[Rate] = []
    for rate in rates:
        same = next((k for k, other in enumerate(merged) if np.array_equal(other.time_s, rate.time_s)), None)
        if same is None:
            merged.append(rate)
        else:
            merged[same] = Rate(rate.time_s, (*merged[same].columns, *rate.columns))
    if len(merged) == 1:
        return merged[0].time_s, merged[0].columns, []
    leading = max(merged, key=lambda rate: (len(rate.columns), -len(rate.time_s)))
    columns = list(leading.columns)
    moved: list[str] = []
    for rate in merged:
        if rate is leading:
            continue
        for column in rate.columns:
            if column.kind != "number":
                continue
            values = interpolated(rate.time_s, column.values, leading.time_s)
            columns.append(Column(column.header, values, column.unit, (), column.description))
            moved.append(column.header)
    told = f"The channels of {path.name} are recorded on {len(merged)} clocks; {len(moved)} of them "
    told += f"({listed(moved, 6)}) were interpolated onto the clock of the others."
    evidence = {"clocks": len(merged), "channels": moved}
    return leading.time_s, tuple(columns), [FINDINGS.finding("several-clocks", told, evidence=evidence)]


def interpolated(time_s: Vector, values: Vector, at_s: Vector) -> Vector:
    """Linear interpolation; NaN outside of the samples and inside long pauses."""
    known = np.isfinite(values) & np.isfinite(time_s)
    t, v = time_s[known], values[known]
    if len(t) < 2 or np.any(np.diff(t) < 0):
        order = np.argsort(t, kind="stable")
        t, v = t[order], v[order]
    if len(t) == 0:
        return np.full(len(at_s), np.nan)
    out: Vector = np.interp(at_s, t, v, left=np.nan, right=np.nan)
    if len(t) > 2:
        steps = np.diff(t)
        usual = float(np.median(steps))
        position = np.clip(np.searchsorted(t, at_s, side="left"), 1, len(t) - 1)
        exact = t[np.clip(np.searchsorted(t, at_s), 0, len(t) - 1)] == at_s
        own = max(usual, float(np.median(np.diff(at_s))) if len(at_s) > 1 else usual)
        out[(steps[position - 1] > 10 * own) & ~exact] = np.nan
    return out
