"""Runs that two loggers recorded at the same time: their channels become one run, on the clock of the slower."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from datetime import datetime
from itertools import takewhile

import numpy as np

from selector.errors import RecordingError
from selector.findings import Finding, Level, Where
from selector.readers.finding_table import FINDINGS, TWO_LOGGERS
from selector.readers.machine_file import RunSection
from selector.readers.roles.names import one_of_words
from selector.readers.roles.plan import Plan
from selector.readers.runs import Beside, TimedRun, averaged
from selector.readers.tables import Column, listed
from selector.readers.window import part_of, told_from
from selector.types import Matrix, Vector

_FASTER = 0.75  #: Of a period: a logger with a shorter one is averaged, of any other the nearest reading is taken.
_GAP_PERIODS = 3.5  #: Samples that are farther apart have a gap between them, into which no mean reaches.
_DAY_S = 86400.0
_HALF_HOUR_S, _MOST_HALF_HOURS = 1800.0, 28  #: Time zones lie so far apart.
_SHIFT_SAMPLES = 2000.0  #: Samples at which two runs are compared, about.
#: Shares of a variance: what is left where two runs agree, how many times as much where they do not, and half an hour
#: beside.
_AGREES, _FAR_BETTER, _SHARP = 0.05, 100.0, 4.0
_LEAST_SHARED = 0.5  #: Of the shorter of two runs that may be one.


def joined(runs: Sequence[TimedRun], repairs: Mapping[str, RunSection]) -> list[TimedRun]:
    """The runs without those that stand ``beside`` another one, whose channels that one has.

    Raises RecordingError: no run of that name was read, it is beside two, or they have no time in common.
    """
    by_name = {run.name: run for run in runs}
    first_of: dict[str, str] = {}
    for name in by_name:
        for other in repairs.get(name, RunSection()).beside:
            where = f"beside in [runs.{name}] of the machine file"
            if other not in by_name or other == name:
                known = [one for one in by_name if one != name]
                raise RecordingError(
                    f"no run {other!r}" if other != name else f"run {other!r} beside itself",
                    expected=one_of_words(other, known) if known else "the file of that run, too",
                    where=where,
                    advice="correct the name of the run, or give its file to the command",
                )
            if other in first_of or repairs.get(other, RunSection()).beside:
                of = f"is part of {first_of[other]!r} already" if other in first_of else "has runs beside it itself"
                raise RecordingError(
                    f"run {other!r}, which {of}",
                    expected="every run beside one other run only",
                    where=where,
                    advice="name all runs of one time in one list",
                )
            first_of[other] = name
    for name in by_name:
        if repairs.get(name, RunSection()).late_s is not None and name not in first_of:
            raise RecordingError(
                f"late_s of run {name!r}, which stands beside no other run",
                expected="late_s of a run that `beside` of another one names",
                where=f"[runs.{name}] of the machine file",
                advice="move it to the section of the run that began later, or take it out",
            )
    others = {run.name: [by_name[one] for one in repairs.get(run.name, RunSection()).beside] for run in runs}
    kept = [run for run in runs if run.name not in first_of]
    return [_with(run, others[run.name], repairs) if others[run.name] else run for run in kept]


def _with(run: TimedRun, others: Sequence[TimedRun], repairs: Mapping[str, RunSection]) -> TimedRun:
    told, beside, parts = list(run.findings), list[Beside](), [(run, 0.0)]
    for other in others:
        said_s = repairs.get(other.name, RunSection()).late_s
        late_s = begins_after_s(run, other) if said_s is None else said_s
        parts.append((other, late_s))
        beside.append(Beside(other.name, str(other.file), other.sha256, late_s - other.skipped_s))
        told += [moved for one in other.findings if (moved := told_from(one, -late_s, np.inf)) is not None]
        if said_s is None:
            told.append(_told(run, other, late_s))
            told += _shifted(run, other, late_s)
    return _together(run, _continued(parts), told, beside)


def _continued(parts: Sequence[tuple[TimedRun, float]]) -> list[tuple[TimedRun, float]]:
    """The parts, those of one logger that began a new file as one: the same headings, one after the other."""
    found: list[tuple[TimedRun, float]] = []
    for part in parts:
        for k, known in enumerate(found):
            (first, begins_s), (other, later_s) = sorted((known, part), key=lambda one: one[1])
            if first.by_header.keys() == other.by_header.keys() and begins_s + first.time_s[-1] < later_s:
                time_s = np.r_[first.time_s, other.time_s + (later_s - begins_s)]
                rest = other.by_header
                columns = [replace(of, values=np.r_[of.values, rest[of.header].values]) for of in first.columns]
                found[k] = replace(first, time_s=time_s, columns=tuple(columns)), begins_s
                break
        else:
            found.append(part)
    return found


def _together(
    run: TimedRun, parts: Sequence[tuple[TimedRun, float]], told: Sequence[Finding], beside: Sequence[Beside]
) -> TimedRun:
    """One run of some that begin so many seconds after it [s], on the clock of the slowest: none has to be made up."""
    slowest, late_s = max(parts, key=lambda part: part[0].period_s)
    if parts[0][0].period_s > _FASTER * slowest.period_s:
        slowest, late_s = parts[0]
    clock = slowest.time_s + late_s
    columns, inside = list[Column](), np.ones(len(clock), dtype=np.bool_)
    for part, begins_s in parts:
        values = on_clock(clock, part.time_s + begins_s, _readings(part))
        known = np.flatnonzero(np.isfinite(values).any(axis=1))
        if len(known) < 2:
            raise RecordingError(
                f"{part.name!r} begins {begins_s:g} s after {run.name!r}, which lasts {run.time_s[-1]:g} s",
                expected="two recordings of one time",
                where=f"beside in [runs.{run.name}] of the machine file",
                advice=f"correct the names, or say in [runs.{part.name}] how long after it begins: late_s = 12.5",
            )
        # rises count from the start of a run: it has to be one of all
        inside[: known[0]] = inside[known[-1] + 1 :] = False
        for k, column in enumerate(part.columns):
            taken, number, header = {one.header for one in columns}, 1, column.header
            while header in taken:
                number += 1
                header = f"{column.header} ({number})"
            columns.append(Column(header, values[:, k], column.unit, (), column.description))
    if inside.sum() < 2:
        raise RecordingError(
            f"{listed([part.name for part, _ in parts], 8)}, which have no time in common",
            expected="recordings of one time",
            where=f"beside in [runs.{run.name}] of the machine file",
            advice="correct the names of the runs, or say with late_s how they lie",
        )
    found = part_of(replace(run, time_s=clock, columns=tuple(columns), findings=tuple(told)), inside)
    zero = found.skipped_s - run.skipped_s
    return replace(found, beside=tuple(replace(one, begins_s=one.begins_s - zero) for one in beside))


def _readings(of: TimedRun) -> Matrix:
    return np.column_stack([np.empty((len(of.time_s), 0)), *(column.values for column in of.columns)])


def called_after(name: str, part: TimedRun) -> TimedRun:
    """The same with the name of a sensor, where it has one, before every heading."""
    if not name:
        return part
    told = [replace(of, where=replace(of.where, channel=of.where.channel and f"{name} {of.where.channel}"))
            for of in part.findings]  # fmt: skip
    columns = tuple(replace(one, header=f"{name} {one.header}") for one in part.columns)
    return replace(part, columns=columns, findings=tuple(told))


def of_clocks(parts: Sequence[TimedRun]) -> TimedRun:
    """One run of parts of a table that have clocks of their own."""
    read = [part for part in parts if np.isfinite(_readings(part)).any(axis=1).sum() > 1]
    if not read:
        return parts[0]
    first = read[0]
    told = [finding for part in read for finding in part.findings]
    return _together(first, [(part, begins_after_s(first, part)) for part in read], told, ())


def _told(run: TimedRun, other: TimedRun, late_s: float) -> Finding:
    is_dated = _has_dates(run, other)
    how = "by the dates of both" if is_dated else "by their own clocks, which may have begun at different times"
    when = f"{late_s:g} s after {run.name!r}" if late_s else f"together with {run.name!r}"
    evidence = {"late_s": late_s, "by_dates": is_dated}
    level: Level = "info" if is_dated else "warning"
    text = f"Run {other.name!r} is taken to begin {when}, {how}."
    return FINDINGS.finding("loggers-aligned", text, Where(), evidence, level=level)


def _shifted(run: TimedRun, other: TimedRun, late_s: float) -> list[Finding]:
    """A finding if the other run agrees far better when it begins some half hours earlier or later.

    Only where clocks do not say their zone. Compared are straight lines through the channels of the run.
    """
    ends_s = float(run.time_s[-1]), late_s + float(other.time_s[-1])
    period_s = max(run.period_s, other.period_s, max(ends_s) / _SHIFT_SAMPLES)
    has_zone = run.start is not None and datetime.fromisoformat(run.start).tzinfo is not None
    if has_zone or period_s > _HALF_HOUR_S:
        return []
    per_half_hour = int(_HALF_HOUR_S // period_s)
    clock = np.arange(min(0.0, late_s), max(ends_s), _HALF_HOUR_S / per_half_hour)
    own = _moving(on_clock(clock, run.time_s, _readings(run)))
    its = _moving(on_clock(clock, other.time_s + late_s, _readings(other)))
    left = {k: _left(own, its, k * per_half_hour) for k in range(-_MOST_HALF_HOURS, _MOST_HALF_HOURS + 1)}
    best: tuple[float, float, int] | None = None
    for k in range(1 - _MOST_HALF_HOURS, _MOST_HALF_HOURS):
        for j, (now, then) in enumerate(left[k].T):
            # what only lags behind agrees half an hour earlier or later, too
            beside = min((left[near][1, j] for near in (k - 1, k + 1) if left[near].size), default=0.0)
            is_far_better = then < min(_AGREES, now / _FAR_BETTER, beside / _SHARP)
            if is_far_better and (best is None or then < best[0]):
                best = float(then), float(now), k
    if best is None:
        return []
    then, now, k = best
    shift_s = k * _HALF_HOUR_S
    when = f"{abs(shift_s) / 3600.0:g} h {'later' if k > 0 else 'earlier'}"
    said = f"Run {other.name!r} fits {run.name!r} far better when it begins {when} than their clocks say: a straight "
    said += f"line then leaves {100 * np.sqrt(then):.1f} % of its movement, not {100 * np.sqrt(now):.0f} %."
    advice = "if their clocks are in two time zones, or one in summer time, say so: "
    advice += f"late_s = {late_s + shift_s:g} in [runs.{other.name}]"
    evidence = {"shift_s": shift_s, "late_s": late_s + shift_s, "left_now": np.sqrt(now), "left_then": np.sqrt(then)}
    return [FINDINGS.finding("loggers-shifted", said, Where(), evidence, advice)]


def _moving(values: Matrix) -> Matrix:
    """The columns that move and have a value nearly wherever any has."""
    counts = np.isfinite(values).sum(axis=0)
    with np.errstate(all="ignore"):
        is_moving = np.asarray(np.nanstd(values, axis=0) > 0.0)
    is_known = np.asarray(counts > 0.9 * max(counts.tolist(), default=0))
    return values[:, np.flatnonzero(is_moving & is_known)]


def _left(own: Matrix, its: Matrix, steps: int) -> Matrix:
    """Shares of the variance of its columns that straight lines through the own ones leave, now and moved by so many
    samples, shape (2, n_columns); (2, 0) where too few samples can be compared.
    """
    there = np.asarray(np.isfinite(own).all(axis=1))
    together = np.flatnonzero(there & np.isfinite(its).all(axis=1))
    rows = together[(together + steps >= 0) & (together + steps < len(own))]
    rows = rows[there[rows + steps]]
    if not own.size or len(rows) < max(0.5 * len(together), 10 * (own.shape[1] + 1)):
        return np.zeros((2, 0))
    values = its[rows] - its[rows].mean(axis=0)
    shares = []
    for of in (own[rows], own[rows + steps]):
        design = np.column_stack([np.ones(len(of)), (of - of.mean(axis=0)) / np.maximum(of.std(axis=0), 1e-300)])
        rest = values - design @ np.linalg.lstsq(design, values, rcond=None)[0]
        shares.append((rest**2).sum(axis=0) / np.maximum((values**2).sum(axis=0), 1e-300))
    return np.array(shares, dtype=np.float64)


def begins_after_s(run: TimedRun, other: TimedRun) -> float:
    """How long after a run another one begins [s]: by their dates, else by the clocks of the files.

    Raises RecordingError: one has dates with a time zone, the other without: nobody knows what lies between them.
    """
    if not _has_dates(run, other):
        late_s = other.first_s - run.first_s if run.start is None and other.start is None else 0.0
        # times of day: the nearest of all days
        is_daily = run.clock.time_of_day and other.clock.time_of_day
        return (late_s + 0.5 * _DAY_S) % _DAY_S - 0.5 * _DAY_S if is_daily else late_s
    starts = [datetime.fromisoformat(one.start or "") for one in (run, other)]
    if (starts[0].tzinfo is None) != (starts[1].tzinfo is None):
        raise RecordingError(
            f"dates of {run.name!r} {_zone(starts[0])} and of {other.name!r} {_zone(starts[1])}",
            expected="both with a time zone, or both without one",
            where=f"beside in [runs.{run.name}] of the machine file",
            advice=f"say in [runs.{other.name}] how many seconds after {run.name} it begins: late_s = 12.5",
        )
    return (starts[1] - starts[0]).total_seconds()


def _has_dates(*runs: TimedRun) -> bool:
    return all(run.start is not None for run in runs)


def _zone(start: datetime) -> str:
    return "without a time zone" if start.tzinfo is None else f"with the time zone {start.tzname()}"


def on_clock(clock_s: Vector, time_s: Vector, values: np.ndarray) -> np.ndarray:
    """Readings at other times, shape (n_times, n_channels): means about each if they are quicker, else the nearest.

    `values` has shape (n_samples, n_channels); NaN where nothing is known. Nothing is put between two readings: a
    thermometer of coarse steps would look broken, and a switch half on.
    """
    step_s, own_s = float(np.median(np.diff(clock_s))), float(np.median(np.diff(time_s)))
    result = np.full((len(clock_s), values.shape[1]), np.nan)
    if own_s < _FASTER * step_s:
        steps = np.diff(clock_s)
        half = 0.5 * np.r_[step_s, np.where(steps > _GAP_PERIODS * step_s, step_s, steps), step_s]
        of = np.searchsorted(clock_s - half[:-1], time_s, side="right") - 1
        inside = (of >= 0) & (time_s < (clock_s + half[1:])[of])
        there = np.unique(of[inside])
        if len(there):
            result[there] = averaged(values[inside], of[inside], len(there))
        return result
    after = np.clip(np.searchsorted(time_s, clock_s), 1, len(time_s) - 1)
    nearest = after - (clock_s - time_s[after - 1] < time_s[after] - clock_s)
    # before the first reading and after the last one, a whole period would be a reading of another sample
    is_between = (time_s[0] <= clock_s) & (clock_s <= time_s[-1])
    known = np.abs(time_s[nearest] - clock_s) <= np.where(is_between, own_s, 0.5 * own_s)
    result[known] = values[nearest[known]]
    return result


def two_loggers(runs: Sequence[TimedRun], planned: Plan) -> list[Finding]:
    """A finding if runs look like halves of others: temperatures and no displacement in some, the reverse in others."""
    kinds: dict[frozenset[str], list[TimedRun]] = {}
    for run in runs:
        kinds.setdefault(frozenset(one.name for one in planned.channels if run.name in one.headers), []).append(run)
    # beside runs of one logger only those are halves in which some of its channels are missing
    whole = [of for of in kinds if any(other < of for other in kinds)]
    halves = {of: found for of, found in kinds.items() if of not in whole}
    if len(halves) != 2:
        return []
    roles = {one.name: one.role for one in planned.channels}
    (first, firsts), (second, seconds) = halves.items()
    moved = ["displacement" in {roles[name] for name in of} for of in (first, second)]
    if first & second or moved[0] == moved[1]:
        return []
    named = [{_own_part(run.name, [one.name for one in of]): run for run in of} for of in (firsts, seconds)]
    warm, gauged = named if moved[1] else reversed(named)
    both = [key for key in warm if key in gauged]
    is_plain = warm.keys() == gauged.keys() or len(both) > 1
    # of a pair that stands alone no name says that it is one
    is_vague = bool(whole) and len(both) == 1 and not _has_dates(warm[both[0]], gauged[both[0]])
    if not is_plain or is_vague or not all(_may_be_one(warm[key], gauged[key]) for key in both):
        return []
    pairs = {warm[key].name: gauged[key].name for key in both}
    alone = [run.name for of in (warm, gauged) for key, run in of.items() if key not in both]
    name, other = next(iter(pairs.items()))
    more = f", and {len(pairs) - 1} more such pairs" if len(pairs) > 1 else ""
    told = f"Run {name!r} has no displacement, run {other!r} none of its temperatures{more}: two loggers may have "
    told += f"recorded them at one time.{f' Nothing goes with {listed(alone, 6)}.' if alone else ''}"
    advice = f'if so, say it in the machine file: beside = ["{other}"] in [runs."{name}"]; `selector describe --write` '
    return [FINDINGS.finding(TWO_LOGGERS, told, Where(run=name), {"beside": pairs}, f"{advice}writes that")]


def _own_part(name: str, names: Sequence[str]) -> str:
    """What tells a run from the others of its kind: its name without what all have in front and behind."""
    front, behind = (_alike(words) for words in (names, [one[::-1] for one in names]))
    return name[len(front) : max(len(name) - len(behind), len(front))]


def _alike(names: Sequence[str]) -> str:
    """What all begin with, but for a number."""
    letters = takewhile(lambda of: len(set(of)) == 1, zip(*names, strict=False))
    return "".join(of[0] for of in letters).rstrip("0123456789")


def _may_be_one(run: TimedRun, other: TimedRun) -> bool:
    try:
        late_s = begins_after_s(run, other)
    except RecordingError:
        # the user has to say it
        late_s = 0.0
    shared_s = min(run.time_s[-1], other.time_s[-1] + late_s) - max(0.0, late_s)
    return bool(shared_s >= _LEAST_SHARED * min(run.time_s[-1], other.time_s[-1]))
