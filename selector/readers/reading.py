"""Files → a Recording, with everything that was found and guessed on the way, and its description."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from selector.errors import InputError, OptionError, ReadError
from selector.findings import Finding, Where
from selector.quality import without_faults
from selector.quality.broken_sensors import broken_sensors
from selector.quality.survey import Survey
from selector.readers.beside import called_after, joined, of_clocks, two_loggers
from selector.readers.binary.optional import quiet
from selector.readers.clock.clock import TimeOptions
from selector.readers.clock.stamps import time_unit
from selector.readers.files import recording_files, tables_of
from selector.readers.finding_table import FINDINGS
from selector.readers.machine_file import ChannelSection, Machine, MachineSection, TimeSection
from selector.readers.machine_file import machine as machine_at
from selector.readers.roles.plan import Plan, Planned, plan
from selector.readers.roles.repairs import repaired, used_runs
from selector.readers.runs import Beside, TimedRun, tables_of_runs, timed_run, uniquely_named
from selector.readers.tables import Overrides
from selector.readers.window import files_within, require_some, thinning, within
from selector.recording import Channel, Recording
from selector.text_file import shell_word
from selector.types import Vector
from selector.units import CANONICAL_UNITS


def assembled(runs: Sequence[TimedRun], planned: Plan) -> tuple[Recording, list[Finding]]:
    """The recording in canonical units, and what there is to say about values."""
    channels = [channel_of(p) for p in planned.channels]
    names = [c.name for c in channels]
    findings: list[Finding] = []
    parts: list[Vector] = []
    provenance: dict[str, Any] = {}
    for run in runs:
        values = np.full((len(run.time_s), len(channels)), np.nan)
        for k, channel in enumerate(planned.channels):
            if run.name in channel.headers:
                column = run.by_header[channel.headers[run.name]]
                values[:, k] = channel.canonical(column.values, run.name, run.time_s)
        values[~np.isfinite(values)] = np.nan
        empty = np.isnan(values).all(axis=0)
        if empty.all():
            advice = "check the decimal mark and the columns, or leave this file out"
            if not any(run.name in channel.headers for channel in planned.channels):
                role = shell_word(f"{run.columns[0].header if run.columns else 'COLUMN'}=displacement")
                advice = f"say what its columns measure, e.g. --role {role}, or leave this file out"
            elif any(run.name in channel.left_out for channel in planned.channels):
                advice = f'see what leave_out of [runs."{run.name}"] in the machine file takes, or say use = false'
            raise ReadError(
                f"no value in any of the channels {', '.join(names[:10])}",
                expected="numbers in at least one channel",
                where=run.file.name,
                advice=advice,
            )
        for name, channel, nothing in zip(names, planned.channels, empty, strict=True):
            if nothing and run.name in channel.headers and run.name not in channel.left_out:
                told = f"Channel {name!r} has no value in run {run.name!r}."
                place, advice = Where(channel=name, run=run.name), "leave the channel or the run out"
                findings.append(FINDINGS.finding("empty-channel", told, place, {}, advice, "leave-out-stretch"))
        parts.append(values)
        units = {one.name: one.units[run.name] for one in planned.channels if run.name in one.headers}
        provenance[run.name] = provenance_of(run) | {"units": units}
    run_of_row = np.repeat(np.array([run.name for run in runs], dtype=object), [len(p) for p in parts])
    time_s = np.concatenate([run.time_s for run in runs])
    index = pd.MultiIndex.from_arrays([run_of_row, time_s], names=["run", "time_s"])
    frame = pd.DataFrame(np.concatenate(parts), columns=names, index=index)
    return Recording(frame, tuple(channels), {"runs": provenance}), findings


def channel_of(planned: Planned) -> Channel:
    """The channel as the recording holds it."""
    return Channel(
        planned.name, planned.role, CANONICAL_UNITS[planned.role], planned.place, planned.axis, planned.xyz_m
    )


def provenance_of(run: TimedRun) -> dict[str, Any]:
    """Where a run comes from and how it was read, as `Recording.provenance` holds it."""
    return {
        "file": str(run.file),
        "sha256": run.sha256,
        "start": run.start,
        "first_stamp_s": run.first_s,
        "time_columns": list(run.clock.columns),
        "time_unit": run.clock.unit,
        "time_guessed": list(run.clock.guessed),
        "reading": dict(run.table.reading),
    }


def placed(runs: Sequence[TimedRun], planned: Plan) -> Iterator[Finding]:
    """Findings of all runs with the names of run and channel; those about columns that were not read are left away."""
    for run in runs:
        channel_of_header = {p.headers[run.name]: p.name for p in planned.channels if run.name in p.headers}
        for finding in run.findings:
            header = finding.where.channel
            if header is not None and header not in channel_of_header and header not in run.clock.columns:
                continue
            channel = channel_of_header.get(header) if header is not None else None
            where = replace(finding.where, channel=channel or header, run=run.name, file=run.file.name)
            yield replace(finding, where=where)


def condensed(findings: Sequence[Finding]) -> tuple[Finding, ...]:
    """One finding in place of many that say the same of more than three runs, the first to be worst."""
    groups: dict[tuple[str, str, str | None], list[Finding]] = {}
    for finding in findings:
        groups.setdefault((finding.id, finding.level, finding.where.channel), []).append(finding)
    out: list[Finding] = []
    for members in groups.values():
        runs = list(dict.fromkeys(m.where.run for m in members if m.where.run is not None))
        timed = any(m.where.from_s is not None for m in members)
        if len(runs) <= 3 or timed or len(runs) < len(members):
            out += members
            continue
        first = members[0]
        more = f" The same holds for {len(runs) - 1} more runs ({', '.join(runs[1:5])}{' …' if len(runs) > 5 else ''})."
        where, evidence = replace(first.where, run=None, file=None), {**first.evidence, "runs": runs}
        out.append(replace(first, statement=first.statement + more, where=where, evidence=evidence))
    rank = {"error": 0, "warning": 1, "info": 2}
    return tuple(sorted(out, key=lambda finding: rank[finding.level]))


_SHOWN_READING = ("format", "encoding", "separator", "decimal", "skipped_rows", "unit_row")

_OPTION_VALUES = {
    "--time-unit": "a unit of time (s, ms, min, h, d) or 'datetime'",
    "--period-s": "a period above zero in seconds",
    "--mean-s": "a positive number of seconds, e.g. 60: a minute",
    "--date-order": "dmy, mdy or ymd",
}


@dataclass(frozen=True)
class RunInfo:
    """One run: name, file, hash, number of rows, length, median period [s], absolute start (ISO 8601) if known."""

    name: str
    file: str
    sha256: str
    rows: int
    duration_s: float
    period_s: float
    start: str | None
    begins_s: float = 0.0  #: Its own clock at the first sample, where that is no date [s]
    beside: tuple[Beside, ...] = ()  #: What other loggers recorded of it

    def as_dict(self) -> dict[str, Any]:
        """JSON form, without `begins_s`; `beside` where there is any."""
        shown = {name: value for name, value in vars(self).items() if name not in ("name", "begins_s", "beside")}
        beside = [
            {"run": one.name, "file": one.file, "sha256": one.sha256, "begins_s": one.begins_s} for one in self.beside
        ]
        return {"run": self.name, **shown, **({"beside": beside} if beside else {})}


@dataclass(frozen=True, kw_only=True)
class ChannelInfo(Channel):
    """A channel with the column and unit that it has in the file, and which of what is said of it was guessed.

    `units_of_runs` says the unit of each run where they differ; `unit_in_file` then names all of them.
    """

    column: str
    unit_in_file: str
    guessed: tuple[str, ...]
    units_of_runs: Mapping[str, str] = field(default_factory=dict)

    def as_dict(self) -> dict[str, Any]:
        """JSON form: what is not known is not there."""
        always = ("name", "column", "role", "unit", "unit_in_file")
        told = {name: getattr(self, name) for name in always} | {"guessed": list(self.guessed)}
        if self.units_of_runs:
            told["unit_per_run"] = dict(self.units_of_runs)
        known = {"place": self.place, "axis": self.axis, "xyz": None if self.xyz_m is None else list(self.xyz_m)}
        return told | {name: value for name, value in known.items() if value is not None}


@dataclass(frozen=True)
class Reading:
    """What was read and how."""

    recording: Recording  #: All runs
    findings: tuple[Finding, ...]  #: The worst first
    runs: tuple[RunInfo, ...]
    channels: tuple[ChannelInfo, ...]
    #: Format, encoding, separator, decimal mark, skipped_rows, unit_row of the first file; `per_run` holds the others
    #: where they differ; `time` says which column is the clock, its unit, and what of it was guessed
    reading: Mapping[str, Any]
    machine: Machine | None = None  #: The machine file that was used
    undeclared: Mapping[str, str] = field(default_factory=dict)  #: Columns that are no channels, and why
    machine_file: str | None = None  #: Where the machine file was read

    @property
    def files(self) -> tuple[tuple[str, str], ...]:
        """Every file that was read, with its hash; once for each of its runs."""
        found: list[tuple[str, str]] = []
        for run in self.runs:
            found += [(run.file, run.sha256), *((one.file, one.sha256) for one in run.beside)]
        return tuple(found)

    def description(self) -> dict[str, Any]:
        """The `selector.description/1` contract as JSON values.

        `place`, `axis` and `xyz` of a channel appear where they are known, `unit_per_run` where its runs have different
        units.
        """
        return {
            "schema": "selector.description/1",
            "runs": [run.as_dict() for run in self.runs],
            "channels": [channel.as_dict() for channel in self.channels],
            "reading": dict(self.reading),
            "findings": [finding.as_dict() for finding in self.findings],
        }


def read(paths: Sequence[Path], machine: Path | Machine | None = None, overrides: Overrides | None = None) -> Reading:
    """The recording in some files, and in folders whose recordings are read in natural order.

    A run is called after its file. Without a machine file, ``machine.toml`` of a folder in `paths` is taken, if there
    is one; otherwise roles and units are inferred.

    Raises ReadError, RecordingError, UnitError, OptionError: The input is unusable; the message says what was found,
    what was expected, where, and what to do.
    """
    overrides = overrides or Overrides()
    found = recording_files([Path(path) for path in ([paths] if isinstance(paths, str | Path) else paths)])
    findings = list(found.findings)
    declared = machine_at(Path(machine)) if isinstance(machine, Path | str) else machine
    machine_file = str(machine) if isinstance(machine, Path | str) else None
    if declared is None and found.machine is not None:
        declared, machine_file = machine_at(found.machine), str(found.machine)
        used = f"The machine file {found.machine.name} in the folder of the recordings was used."
        findings.append(FINDINGS.finding("machine-file-found", used, Where(file=str(found.machine))))
    options = time_options(declared, overrides)
    timed: list[TimedRun] = []
    outside: list[str] = []
    rows = 0
    columns = [c.column or n for n, c in declared.channels.items()] if declared is not None else []
    with quiet(), np.errstate(all="ignore"):
        for path in files_within(found.files, overrides):
            tables, sha256 = tables_of(path, overrides)
            for whole in tables:
                for of in tables_of_runs(whole, columns):
                    parts = [called_after(name, timed_run(one, sha256, options)) for name, one in of]
                    run = _of_parts(parts, declared, overrides)
                    rows += len(run.time_s)
                    kept = within(_believed(run, declared, overrides), overrides)
                    if kept is None:
                        outside.append(run.name)
                    else:
                        timed.append(kept)
        require_some(timed, overrides)
        findings += thinning(rows, timed, outside, overrides)
        runs, planned, noticed = settled(timed, declared, overrides)
        recording, told = assembled(runs, planned)
    said = condensed([*findings, *noticed, *told])
    infos, channels = tuple(map(_run_info, runs)), tuple(_channel_info(planned, runs))
    return Reading(recording, said, infos, channels, _how(runs), declared, planned.undeclared, machine_file)


def _of_parts(parts: Sequence[TimedRun], declared: Machine | None, overrides: Overrides) -> TimedRun:
    """The run of a table, or of parts of it that have clocks of their own."""
    return parts[0] if len(parts) == 1 else of_clocks([_without_codes(part, declared, overrides) for part in parts])


def _believed(run: TimedRun, declared: Machine | None, overrides: Overrides) -> TimedRun:
    """A run, and one of which means are taken without codes of broken sensors."""
    is_averaged = declared is not None and any(section.beside for section in declared.runs.values())
    return _without_codes(run, declared, overrides) if overrides.mean_s is not None or is_averaged else run


def _without_codes(run: TimedRun, declared: Machine | None, overrides: Overrides) -> TimedRun:
    """A run without codes of broken sensors and without what a repair leaves out."""
    try:
        runs, planned, _ = settled([run], declared, replace(overrides, partial=True))
        recording, _ = assembled(runs, planned)
    except InputError:
        # told where all runs are read
        return run
    name = runs[0].name
    headers = {one.name: one.headers[name] for one in planned.channels}
    broken = tuple(broken_sensors(Survey(recording)))
    values = without_faults(recording, broken).values(name, recording.names)
    lacking = {headers[channel]: np.isnan(values[:, k]) for k, channel in enumerate(recording.names)}
    columns = [
        replace(one, values=np.where(lacking[one.header], np.nan, one.values)) if one.header in lacking else one
        for one in run.columns
    ]
    told = [replace(one, where=replace(one.where, channel=headers[str(one.where.channel)])) for one in broken]
    return replace(run, columns=tuple(columns), findings=(*run.findings, *told))


def settled(
    timed: Sequence[TimedRun], declared: Machine | None, overrides: Overrides
) -> tuple[list[TimedRun], Plan, list[Finding]]:
    """The runs that are used under their own names, what their columns are, and what was noticed of both."""
    runs, renamed = uniquely_named(timed)
    runs, unused = used_runs(runs, declared)
    if declared is not None and not overrides.partial:
        runs = joined(runs, declared.runs)
    planned = repaired(plan(runs, declared, overrides), declared, runs)
    noticed = [*placed(runs, planned), *planned.findings, *two_loggers(runs, planned)]
    return runs, planned, [*renamed, *unused, *noticed]


def time_options(declared: Machine | None, overrides: Overrides) -> TimeOptions:
    """What the machine file and the user say about the time; the user's word counts more."""
    section = declared.time if declared is not None else TimeSection()
    columns = (overrides.time_column,) if overrides.time_column is not None else section.columns
    unit = overrides.time_unit or section.unit
    period_s = overrides.period_s if overrides.period_s is not None else section.period_s
    for option, value, fine in (
        ("--time-unit", overrides.time_unit, unit == "datetime" or time_unit(unit) is not None),
        ("--period-s", overrides.period_s, period_s is None or (np.isfinite(period_s) and period_s > 0)),
        ("--mean-s", overrides.mean_s, 0.0 < (overrides.mean_s or 0.0) < np.inf),
        ("--date-order", overrides.date_order, overrides.date_order in ("dmy", "mdy", "ymd")),
    ):
        if value is not None and not fine:
            raise OptionError(
                f"{value!r}", expected=_OPTION_VALUES[option], where=option, advice="correct the value of the option"
            )
    return TimeOptions(columns, unit, period_s, overrides.date_order or section.date_order)


def _run_info(run: TimedRun) -> RunInfo:
    length_s = float(run.time_s[-1])
    begins = run.start, run.first_s
    return RunInfo(run.name, str(run.file), run.sha256, len(run.time_s), length_s, run.period_s, *begins, run.beside)


def _channel_info(planned: Plan, runs: Sequence[TimedRun]) -> Iterator[ChannelInfo]:
    for channel in planned.channels:
        column = channel.headers[next(run.name for run in runs if run.name in channel.headers)]
        units = tuple(dict.fromkeys(channel.units.values()))
        yield ChannelInfo(
            **vars(channel_of(channel)),
            column=column,
            unit_in_file=", ".join(units),
            guessed=channel.guessed,
            units_of_runs=dict(channel.units) if len(units) > 1 else {},
        )


def _how(runs: Sequence[TimedRun]) -> dict[str, Any]:
    def shown(run: TimedRun) -> dict[str, Any]:
        told = {key: run.table.reading.get(key) for key in _SHOWN_READING}
        told.update({k: v for k, v in run.table.reading.items() if k in ("sheet", "header_row", "first_data_row")})
        time = {"columns": list(run.clock.columns), "unit": run.clock.unit, "guessed": list(run.clock.guessed)}
        return {**told, "time": time}

    first = shown(runs[0])
    differing = {run.name: own for run in runs[1:] if (own := shown(run)) != first}
    return {**first, "per_run": differing} if differing else first


def machine_of(reading: Reading) -> Machine:
    """The machine file that says in so many words how this was read: for the user to correct.

    A unit in it holds for all runs; where the runs differ, the units stay with the headers of the files. A unit of time
    or a period that was guessed is left out: said there, it would put other recordings on a wrong clock unheard.
    """
    time, times = reading.reading["time"], _times(reading)
    columns = tuple(time["columns"]) if all(one["columns"] == time["columns"] for one in times) else ()
    # said: every run is in the same unit of time, and none of them only by a guess
    is_said = len({one["unit"] for one in times}) == 1 and not any("unit" in one["guessed"] for one in times)
    unit = time["unit"] if is_said else None
    declared = reading.machine or Machine()
    section = TimeSection(
        column=None if not columns else columns[0] if len(columns) == 1 else columns,
        unit=unit if unit == "datetime" else time_unit(unit),
        period_s=reading.runs[0].period_s if unit == "sample" else None,
        date_order=declared.time.date_order,
    )
    channels: dict[str, ChannelSection] = {}
    for c in reading.channels:
        of_runs = declared.channels.get(c.name, ChannelSection()).unit
        channels[c.name] = channel_section(c, c.column, of_runs if c.units_of_runs else c.unit_in_file)
    name = MachineSection(name=declared.machine.name)
    return Machine(machine=name, time=section, channels=channels, runs=declared.runs)


def channel_section(of: Channel, column: str, unit: str | None) -> ChannelSection:
    """What a machine file says of a channel that stands in this column in this unit."""
    own = None if column == of.name else column
    return ChannelSection(column=own, role=of.role, unit=unit, place=of.place, axis=of.axis, xyz=of.xyz_m)


def guessed_clock(reading: Reading) -> str | None:
    """The line of ``[time]`` that would say what was guessed of the clock; None: nothing was, or the runs differ."""
    told = {(time["unit"], "unit" in time["guessed"]) for time in _times(reading)}
    (unit, is_guessed), *others = told
    if others or not is_guessed:
        return None
    return f"period_s = {reading.runs[0].period_s!r}" if unit == "sample" else f'unit = "{time_unit(unit) or unit}"'


def _times(reading: Reading) -> list[Mapping[str, Any]]:
    return [reading.reading["time"], *(own["time"] for own in reading.reading.get("per_run", {}).values())]
