"""Which channels the recording has, from which columns, with which role and unit."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from selector.errors import InputError, RecordingError
from selector.findings import Finding, Where
from selector.readers.layout import is_counter_name, is_time_name
from selector.readers.machine_file import ChannelSection, Machine
from selector.readers.names import found_header, name_and_unit
from selector.readers.plan_messages import check_overrides, doubtful_role, missing_everywhere
from selector.readers.roles import known_unit, role_guess, role_of_numbers
from selector.readers.runs import TimedRun
from selector.readers.tables import Column, Overrides
from selector.readers.units_of_runs import Dispute, believed, unit_findings
from selector.units import same_dimension, unit_for_role


@dataclass(frozen=True)
class Planned:
    """One channel and the column it comes from in every run.

    Attributes
    ----------
    headers : mapping of run name to header
        Runs that do not have the channel are not in it.
    units : mapping of run name to pint unit
        Unit of the values in that run's file.
    guessed : tuple of str
        Which of "role", "unit", "axis", "place" were guessed.
    dispute : Dispute or None
        Where headers and machine file, or the headers of the runs, name different units.
    """

    name: str
    role: str
    headers: dict[str, str]
    units: dict[str, str]
    place: str | None
    axis: str | None
    xyz_m: tuple[float, float, float] | None
    guessed: tuple[str, ...]
    dispute: Dispute | None = None


@dataclass(frozen=True)
class Plan:
    """All channels; columns that are no channels and why; what is to be said."""

    channels: tuple[Planned, ...]
    undeclared: dict[str, str] = field(default_factory=dict)
    findings: tuple[Finding, ...] = ()


def plan(runs: Sequence[TimedRun], machine: Machine | None, overrides: Overrides) -> Plan:
    """The channels of the recording.

    Raises
    ------
    RecordingError
        A channel of the machine file is in no file, or no column is a channel.
    UnitError
        A unit is unknown or does not fit the role.
    OptionError
        An override names a channel or role that does not exist.
    """
    check_overrides(runs, machine, overrides)
    result = (
        _declared(runs, machine, overrides) if machine is not None and machine.channels else _inferred(runs, overrides)
    )
    if not result.channels:
        columns = [c.header for c in runs[0].columns]
        if overrides.partial and machine is not None and machine.channels:
            raise RecordingError(
                f"none of the recorded channels (columns of numbers: {', '.join(columns[:20]) or 'none'})",
                expected=f"columns for some of {', '.join(list(machine.channels)[:20])}",
                where=runs[0].file.name,
                advice="name the columns as the recorded channels, or as the columns in the machine file",
            )
        raise RecordingError(
            f"no column whose meaning could be inferred (columns of numbers: {', '.join(columns[:20]) or 'none'})",
            expected="temperatures, displacements, spindle speed, ...",
            where=runs[0].file.name,
            advice="say what the columns are in a machine file: [channels.NAME] with role and unit",
        )
    told = unit_findings(channel.dispute for channel in result.channels if channel.dispute is not None)
    return replace(result, findings=(*result.findings, *told))


def _declared(runs: Sequence[TimedRun], machine: Machine, overrides: Overrides) -> Plan:
    findings: list[Finding] = []
    channels: list[Planned] = []
    lacking: list[str] = []
    used: dict[str, set[str]] = {run.name: set() for run in runs}
    for name, section in machine.channels.items():
        wanted = section.column or name
        headers: dict[str, str] = {}
        for run in runs:
            own = [c.header for c in run.columns]
            position = found_header(own, wanted)
            if position is not None and own[position] not in used[run.name]:
                headers[run.name] = own[position]
                used[run.name].add(own[position])
        if not headers and overrides.partial:
            lacking.append(name)
            continue
        if not headers:
            raise missing_everywhere(runs, name, wanted)
        absent = [run.name for run in runs if run.name not in headers]
        if absent:
            findings.append(
                Finding(
                    "channel-missing-in-run",
                    "warning",
                    f"Channel {name!r} (column {wanted!r}) is missing in run(s) {', '.join(absent[:8])}; its "
                    f"samples there "
                    "are missing values.",
                    Where(channel=name),
                    {"runs": absent, "column": wanted},
                    "leave the channel or these runs out if a model needs it",
                    "leave-out-stretch",
                )
            )
        channels.append(_planned(name, section, headers, runs, overrides, findings, strict=True))
    if lacking:
        findings.append(
            Finding(
                "channels-lacking",
                "info",
                f"Of the channels of the machine file, {', '.join(lacking[:10])} are in none of the files.",
                evidence={"channels": lacking},
            )
        )
    ignored: dict[str, str] = {}
    for run in runs:
        for column in run.columns:
            if column.header not in used[run.name] and not _is_auxiliary(column):
                ignored.setdefault(column.header, "not in the machine file")
    if ignored:
        findings.append(
            Finding(
                "columns-ignored",
                "info",
                f"{len(ignored)} column(s) of the files are not in the machine file and were not read: "
                f"{', '.join(list(ignored)[:10])}" + (" …" if len(ignored) > 10 else "") + ".",
                evidence={"columns": list(ignored)[:200]},
                suggestion="declare them in the machine file to use them",
            )
        )
    return Plan(tuple(channels), ignored, tuple(findings))


def _inferred(runs: Sequence[TimedRun], overrides: Overrides) -> Plan:
    findings: list[Finding] = []
    names: dict[str, dict[str, str]] = {}
    auxiliary: dict[str, None] = {}
    for run in runs:
        bare = [name_and_unit(c.header)[0] for c in run.columns]
        counts = Counter(bare)
        for column, name in zip(run.columns, bare, strict=True):
            own = name if counts[name] == 1 else column.header
            if _is_auxiliary(column) and own not in overrides.roles:
                auxiliary.setdefault(column.header, None)
            else:
                names.setdefault(own, {})[run.name] = column.header
    channels: list[Planned] = []
    undeclared: dict[str, str] = {}
    for name, headers in names.items():
        planned = _planned_or_none(name, headers, runs, overrides, findings)
        if planned is None:
            undeclared[name] = "its role could not be inferred"
            continue
        channels.append(planned)
        absent = [run.name for run in runs if run.name not in headers]
        if absent:
            findings.append(
                Finding(
                    "channel-missing-in-run",
                    "warning",
                    f"Channel {name!r} is missing in run(s) {', '.join(absent[:8])}; its samples there are missing "
                    f"values.",
                    Where(channel=name),
                    {"runs": absent},
                    "leave the channel or these runs out if a model needs it",
                    "leave-out-stretch",
                )
            )
    if not channels:
        for name, headers in names.items():
            findings += _by_numbers(name, headers, runs, overrides, channels)
        undeclared = {}
    texts = list(dict.fromkeys(text for run in runs for text in run.texts))
    if texts:
        findings.append(
            Finding(
                "text-columns",
                "info",
                f"Column(s) {', '.join(texts[:8])} hold text; they were not read.",
                evidence={"columns": texts[:200]},
            )
        )
    if auxiliary:
        findings.append(
            Finding(
                "auxiliary-columns",
                "info",
                f"Column(s) {', '.join(list(auxiliary)[:8])} number the samples or are further clocks; they are no "
                f"channels.",
                evidence={"columns": list(auxiliary)},
            )
        )
    guessed = [c for c in channels if c.guessed]
    if guessed:
        shown = ", ".join(f"{c.name}: {c.role} [{next(iter(c.units.values()))}]" for c in guessed[:12])
        findings.append(
            Finding(
                "roles-guessed",
                "info",
                f"No machine file says what the channels are; they were guessed from names, units and numbers: {shown}"
                + (" …" if len(guessed) > 12 else "")
                + ".",
                evidence={c.name: {"role": c.role, "guessed": list(c.guessed)} for c in guessed},
                suggestion="check them: selector describe FILE --write machine.toml writes a machine file to correct",
            )
        )
    if undeclared:
        findings.append(
            Finding(
                "columns-without-role",
                "warning",
                f"Nothing tells what {len(undeclared)} column(s) measure; they were not read: "
                f"{', '.join(list(undeclared)[:10])}" + (" …" if len(undeclared) > 10 else "") + ".",
                evidence={"columns": list(undeclared)[:200]},
                suggestion="give them a role in a machine file",
                action="leave-out-channel",
            )
        )
    return Plan(tuple(channels), undeclared, tuple(findings))


def _by_numbers(
    name: str, headers: dict[str, str], runs: Sequence[TimedRun], overrides: Overrides, channels: list[Planned]
) -> list[Finding]:
    """Where no column at all can be told by its name: a role by the numbers, so that there is something to correct."""
    first = next(run for run in runs if run.name in headers)
    role = role_of_numbers(_column(first, headers[first.name]).values)
    told: list[Finding] = []
    section = ChannelSection(role=role)
    planned = _planned(name, section, headers, runs, overrides, told, strict=False)
    channels.append(replace(planned, guessed=("role", *planned.guessed)))
    finding = Finding(
        "ambiguous-role",
        "warning",
        f"Nothing but its numbers tells what {name!r} is; it was taken for {role} in {planned.units[first.name]}.",
        Where(channel=name),
        {"role": role},
        "say what it is in a machine file: column, role and unit of this channel",
    )
    return [*told, finding]


def _planned_or_none(
    name: str, headers: dict[str, str], runs: Sequence[TimedRun], overrides: Overrides, findings: list[Finding]
) -> Planned | None:
    try:
        return _planned(name, ChannelSection(), headers, runs, overrides, findings, strict=False)
    except _NoRoleError:
        return None


class _NoRoleError(InputError):
    """Nothing speaks for any role."""


def _planned(
    name: str,
    section: ChannelSection,
    headers: dict[str, str],
    runs: Sequence[TimedRun],
    overrides: Overrides,
    findings: list[Finding],
    *,
    strict: bool,
) -> Planned:
    with_channel = [run for run in runs if run.name in headers]
    columns = {run.name: _column(run, headers[run.name]) for run in with_channel}
    first = columns[with_channel[0].name]
    asked_role = _asked(overrides.roles, name, first.header) or section.role
    option = _asked(overrides.units, name, first.header)
    asked_unit = option or section.unit
    in_file = {run: _unit_in_file(column, findings, run) for run, column in columns.items()}
    sample = np.concatenate([column.values[:5000] for column in columns.values()][:5])
    hint = known_unit(asked_unit) or in_file[with_channel[0].name]
    guess = role_guess(name_and_unit(name)[0], hint, sample, asked_role)
    if guess.role is None:
        raise _NoRoleError("no role", expected="a role", where=name, advice="name the role in the machine file")
    if guess.doubt is not None:
        findings.append(doubtful_role(name, guess))
    units: dict[str, str] = {}
    dispute = None
    unit_guessed = False
    where = f"channel {name!r}" + (" of the machine file" if strict else "")
    if asked_unit is not None:
        declared = unit_for_role(asked_unit, guess.role, where=where)
        units, printed, ruling = believed(declared, in_file, by_option=option is not None)
        if printed:
            dispute = Dispute(name, guess.role, ruling, tuple(printed.items()), declared)
        in_file = {}
    for run, found in in_file.items():
        if found is not None and same_dimension(found, unit_for_role(guess.unit, guess.role, where=where)):
            units[run] = found
        elif found is not None and found != "1":
            units[run] = unit_for_role(found, guess.role, where=f"{where}, run {run!r}")
        else:
            units[run] = guess.unit
            unit_guessed = unit_guessed or guess.role != "state"
    if dispute is None and len(set(units.values())) > 1:
        dispute = Dispute(name, guess.role, "each", tuple(units.items()))
    guessed = []
    if asked_role is None:
        guessed.append("role")
    if unit_guessed:
        guessed.append("unit")
    axis = section.axis or guess.axis
    if section.axis is None and guess.axis is not None:
        guessed.append("axis")
    if section.place is None and first.description is not None:
        guessed.append("place")
    if unit_guessed and strict and asked_role is not None:
        findings.append(
            Finding(
                "unit-guessed",
                "warning",
                f"Neither the machine file nor the files say the unit of channel {name!r}; {guess.unit} is assumed.",
                Where(channel=name),
                {"unit": guess.unit},
                "add unit = ... to this channel in the machine file",
            )
        )
    place = section.place or first.description
    return Planned(name, guess.role, headers, units, place, axis, section.xyz, tuple(guessed), dispute)


def _unit_in_file(column: Column, findings: list[Finding], run: str) -> str | None:
    text = column.unit if column.unit is not None and column.unit.strip() else name_and_unit(column.header)[1]
    known = known_unit(text)
    if text is not None and text.strip() and known is None:
        findings.append(
            Finding(
                "unknown-unit",
                "warning",
                f"The unit {text!r} of column {column.header!r} in run {run!r} is not known; it was not used.",
                Where(channel=column.header, run=run),
                {"unit": text},
                "name the unit in the machine file",
            )
        )
    return known


def _column(run: TimedRun, header: str) -> Column:
    return run.by_header[header]


def _asked(values: Mapping[str, str], name: str, header: str) -> str | None:
    return values.get(name, values.get(header))


def _is_auxiliary(column: Column) -> bool:
    """Whether a column only numbers the samples or is a further clock."""
    name = name_and_unit(column.header, time=True)[0]
    if is_counter_name(name):
        steps = np.diff(column.values[np.isfinite(column.values)])
        return len(steps) > 0 and bool(np.all(steps == np.round(steps))) and float(np.mean(steps == 1)) > 0.9
    return (is_time_name(name) and name.casefold() != "t") or name.casefold() in ("ms", "msec")
