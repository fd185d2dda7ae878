"""Which channels the recording has, from which columns, with which role, and with which unit in each run."""

import re
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np

from selector.errors import InputError, Misfit, OptionError, RecordingError, refuse
from selector.findings import Finding, Where
from selector.readers.cells import is_counter_name, is_time_name, time_part
from selector.readers.finding_table import FINDINGS
from selector.readers.machine_file import ChannelSection, Machine
from selector.readers.roles.names import closest, found_header, known_unit, name_and_unit, role_guess, role_of_numbers
from selector.readers.runs import TimedRun
from selector.readers.tables import Column, Overrides, listed
from selector.text_file import shell_word
from selector.types import Array
from selector.units import ROLES, same_dimension, to_canonical, unit_for_role

#: Who was believed: the header of the run, the machine file, an option; or each header, where nothing is declared.
Ruling = Literal["header", "declared", "option", "each"]


@dataclass(frozen=True)
class Dispute:
    """One channel for which some runs print another unit than the machine file, an option, or the other runs.

    `printed` holds the runs in dispute and the unit in their headers; with ``"each"`` it holds all runs with their
    units. `declared` is what the machine file or the option says.
    """

    channel: str
    role: str
    ruling: Ruling
    printed: tuple[tuple[str, str], ...]
    declared: str | None = None


def believed(
    declared: str, printed: Mapping[str, str | None], *, by_option: bool
) -> tuple[dict[str, str], dict[str, str], Ruling]:
    """(unit of each run, what the headers in dispute print, who was believed in them).

    One line of a machine file holds for all runs. Where every run prints another unit, the line is the user's
    correction of the files. Where it holds for some runs, the others were recorded in another unit and say so: their
    headers count. An option is said for this very reading and counts always.

    `printed` has the known unit in the header of each run, None or "1" where there is none.
    """
    other = {run: unit for run, unit in printed.items() if unit not in (None, "1", declared) and unit is not None}
    units = dict.fromkeys(printed, declared)
    if by_option:
        return units, other, "option"
    convertible = all(same_dimension(unit, declared) for unit in other.values())
    if len(other) == len(printed) or not convertible:
        return units, other, "declared"
    return {**units, **other}, other, "header"


def _unit_finding(members: Sequence[Dispute]) -> Finding:
    """One finding for all channels about which the same is to be said of the same runs."""
    first = members[0]
    names = [one.channel for one in members]
    roles = {one.role for one in members}
    kind = f"{first.role.replace('_', ' ')} " if len(roles) == 1 else ""
    what = f"{len(names)} {kind}channels ({listed(names, 6)})" if len(names) > 1 else f"channel {names[0]!r}"
    by_unit: dict[str, list[str]] = {}
    for run, unit in first.printed:
        by_unit.setdefault(unit, []).append(run)
    said = "; ".join(f"{unit} in {listed(runs, 6)}" for unit, runs in by_unit.items())
    where = Where(
        channel=names[0] if len(names) == 1 else None, run=first.printed[0][0] if len(first.printed) == 1 else None
    )
    evidence = {"channels": names, "in_file": by_unit, "asked": first.declared, "believed": first.ruling}
    each = "" if len(names) == 1 else ", and so for each of these channels"
    if first.ruling == "each":
        told = f"The runs have different units for {what}: {said}. Each run was read in its own."
        own = {"channels": names, "in_file": by_unit}
        advice = "nothing to do if the headers are right; a machine file need not name these units"
        return FINDINGS.finding("units-differ", told, where, own, advice, level="info")
    if first.ruling == "header":
        told = f"The machine file says {first.declared} for {what}, but the headers say {said}. Other runs do not "
        told += "contradict the machine file, so these were read as their headers say."
        advice = "nothing to do if the headers are right; if they are wrong, correct them in the files or add "
        advice += f"--unit {shell_word(names[0])}={first.declared}{each}"
        return FINDINGS.finding("units-differ", told, where, evidence, advice, level="warning")
    asked, advice = "The option", "leave the option out if the headers are right"
    it, these = ("it was", "this channel") if len(names) == 1 else ("they were", "these channels")
    if first.ruling != "option":
        asked, advice = "The machine file", "nothing to do if the headers are wrong; if they are right, remove the "
        advice += f"line unit = … of {these} from the machine file"
    told = f"{asked} says {first.declared} for {what}, but the headers say {said}; {it} read in {first.declared}."
    return FINDINGS.finding("unit-conflict", told, where, evidence, advice)


def missing_everywhere(runs: Sequence[TimedRun], name: str, wanted: str) -> RecordingError:
    """A channel of the machine file that no run has."""
    columns = list(dict.fromkeys(c.header for run in runs for c in run.columns))
    texts = {t for run in runs for t in run.texts}
    stripped = {name_and_unit(h)[0]: h for h in columns}
    near = closest(wanted, [*columns, *stripped])
    found = f"no column {wanted!r} in any of the {len(runs)} run(s); the columns are {listed(columns, 30)}"
    if wanted in texts:
        found = f"column {wanted!r} holds text, not numbers"
    elif any(wanted in run.clock.columns for run in runs):
        found = f"column {wanted!r} is the time column"
    return RecordingError(
        found,
        expected=f"the column of channel {name!r}" + (f" (nearest: {stripped.get(near, near)!r})" if near else ""),
        where=f"machine file, channels.{name}",
        advice="correct `column` of this channel in the machine file, or remove the channel",
    )


def _misfits(runs: Sequence[TimedRun], machine: Machine | None, overrides: Overrides) -> Iterator[Misfit]:
    """Overrides that name a channel or role that does not exist."""
    headers = [c.header for run in runs for c in run.columns]
    known = {*headers, *(name_and_unit(h)[0] for h in headers), *(machine.channels if machine is not None else ())}
    for option, mapping in (("--unit", overrides.units), ("--role", overrides.roles)):
        for name in mapping:
            if name not in known:
                near = closest(name, known)
                expected = "one of " + ", ".join(sorted(known)[:20]) + (f" (nearest: {near!r})" if near else "")
                yield f"no channel or column {name!r}", expected, option, "correct the name"
    for name, role in overrides.roles.items():
        if role not in ROLES:
            yield f"role {role!r} for {name!r}", "one of " + ", ".join(ROLES), "--role", "correct the role"


@dataclass(frozen=True)
class Planned:
    """One channel and the column it comes from in every run."""

    name: str
    role: str
    headers: dict[str, str]  #: Runs that do not have the channel are not in it
    units: dict[str, str]  #: Unit of the values in that run's file
    place: str | None
    axis: str | None
    xyz_m: tuple[float, float, float] | None
    guessed: tuple[str, ...]  #: Which of "role", "unit", "axis", "place" were guessed
    dispute: Dispute | None = None  #: Where headers and machine file, or the headers of the runs, name different units
    doubt: str | None = None  #: What else it could be, in words, where the guess of its role is uncertain
    #: Run → stretches [s from its start] that count as missing
    left_out: dict[str, tuple[tuple[float, float], ...]] = field(default_factory=dict)

    def canonical(self, values: Array, run: str, time_s: Array) -> Array:
        """Values of a run's file in the unit of the role; NaN where they are left out."""
        with np.errstate(all="ignore"):
            result = to_canonical(values, self.units[run], self.role)
        for first, last in self.left_out.get(run, ()):
            result = np.where((time_s >= first) & (time_s <= last), np.nan, result)
        return result


@dataclass(frozen=True)
class Plan:
    """All channels; columns that are no channels and why; what is to be said."""

    channels: tuple[Planned, ...]
    undeclared: dict[str, str] = field(default_factory=dict)
    findings: tuple[Finding, ...] = ()


def plan(runs: Sequence[TimedRun], machine: Machine | None, overrides: Overrides) -> Plan:
    """The channels of the recording.

    Raises RecordingError: A channel of the machine file is in no file, or no column is a channel. Raises UnitError: A
    unit is unknown or does not fit the role. Raises OptionError: An override names a channel or role that does not
    exist.
    """
    refuse(_misfits(runs, machine, overrides), OptionError)
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
    alike: dict[tuple[object, ...], list[Dispute]] = {}
    for one in (channel.dispute for channel in result.channels if channel.dispute is not None):
        alike.setdefault((one.ruling, one.printed, one.declared), []).append(one)
    missing = (*_doubted(result.channels), *_missing_in_runs(result.channels, runs))
    return replace(result, findings=(*result.findings, *missing, *map(_unit_finding, alike.values())))


def _doubted(channels: Sequence[Planned]) -> Iterator[Finding]:
    """One finding for all channels whose role is uncertain for one reason."""
    alike: dict[tuple[str, str, str], list[str]] = {}
    for one in channels:
        if one.doubt is not None:
            alike.setdefault((one.role, next(iter(one.units.values())), one.doubt), []).append(one.name)
    for (role, unit, doubt), names in alike.items():
        what = f"Channel {names[0]!r} was" if len(names) == 1 else f"Channels {listed(names, 12)} were"
        told = f"{what} taken for {role} in {unit}, but this is uncertain: {doubt}."
        where = Where(channel=names[0] if len(names) == 1 else None)
        yield FINDINGS.finding("ambiguous-role", told, where, {"role": role, "unit": unit, "channels": names})


def _declared(runs: Sequence[TimedRun], machine: Machine, overrides: Overrides) -> Plan:
    findings: list[Finding] = []
    channels: list[Planned] = []
    lacking: list[str] = []
    used: dict[str, set[str]] = {run.name: set() for run in runs}
    # V is no other way to write v where both are channels
    exactly = {section.column or name for name, section in machine.channels.items()}
    for name, section in machine.channels.items():
        wanted = section.column or name
        headers: dict[str, str] = {}
        for run in runs:
            own = [c.header for c in run.columns if c.header == wanted or c.header not in exactly]
            position = found_header(own, wanted)
            if position is not None and own[position] not in used[run.name]:
                headers[run.name] = own[position]
                used[run.name].add(own[position])
        if not headers and (overrides.partial or (overrides.needed is not None and name not in overrides.needed)):
            lacking.append(name)
            continue
        if not headers:
            raise missing_everywhere(runs, name, wanted)
        channels.append(_planned(name, section, headers, runs, overrides, findings, strict=True))
    if lacking:
        told = f"Of the channels of the machine file, {', '.join(lacking[:10])} are in none of the files."
        findings.append(FINDINGS.finding("channels-lacking", told, evidence={"channels": lacking}))
    ignored: dict[str, str] = {}
    for run in runs:
        for column in run.columns:
            if column.header not in used[run.name] and not _is_auxiliary(column):
                ignored.setdefault(column.header, "not in the machine file")
    if ignored:
        told = f"{len(ignored)} column(s) of the files are not in the machine file and were not read: "
        told += f"{listed(ignored, 10)}."
        findings.append(FINDINGS.finding("columns-ignored", told, evidence={"columns": list(ignored)[:200]}))
    return Plan(tuple(channels), ignored, tuple(findings))


def _missing_in_runs(channels: Sequence[Planned], runs: Sequence[TimedRun]) -> Iterator[Finding]:
    """One finding for all channels that the same runs lack."""
    lacked: dict[tuple[str, ...], list[Planned]] = {}
    for one in channels:
        lacked.setdefault(tuple(run.name for run in runs if run.name not in one.headers), []).append(one)
    for absent, of in lacked.items():
        if not absent:
            continue
        columns = {one.name: next(iter(one.headers.values())) for one in of}
        shown = listed((f"{n!r}" if n == c else f"{n!r} (column {c!r})" for n, c in columns.items()), 8)
        what = f"Channel {shown} is" if len(of) == 1 else f"{len(of)} channels ({shown}) are"
        told = f"{what} missing in run(s) {', '.join(absent[:8])}; samples there are missing values."
        where = Where(channel=of[0].name if len(of) == 1 else None)
        yield FINDINGS.finding("channel-missing-in-run", told, where, {"runs": list(absent), "columns": columns})


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
        try:
            planned = _planned(name, ChannelSection(), headers, runs, overrides, findings, strict=False)
        except _NoRoleError:
            undeclared[name] = "its role could not be inferred"
            continue
        channels.append(planned)
    if not channels:
        channels = [_by_numbers(name, headers, runs, overrides, findings) for name, headers in names.items()]
        undeclared = {}
    texts = list(dict.fromkeys(text for run in runs for text in run.texts))
    findings += _of_columns(texts, list(auxiliary), [c for c in channels if c.guessed], list(undeclared))
    return Plan(tuple(channels), undeclared, tuple(findings))


def _of_columns(
    texts: list[str], auxiliary: list[str], guessed: list[Planned], undeclared: list[str]
) -> Iterator[Finding]:
    """What is to be said of columns that no machine file declares."""
    if texts:
        told = f"Column(s) {', '.join(texts[:8])} hold text; they were not read."
        yield FINDINGS.finding("text-columns", told, evidence={"columns": texts[:200]})
    if auxiliary:
        told = f"Column(s) {', '.join(auxiliary[:8])} number the samples or are further clocks; they are no channels."
        yield FINDINGS.finding("auxiliary-columns", told, evidence={"columns": auxiliary})
    if guessed:
        shown = listed((f"{c.name}: {c.role} [{next(iter(c.units.values()))}]" for c in guessed), 12)
        told = "No machine file says what the channels are; they were guessed from names, units and numbers: "
        evidence = {c.name: {"role": c.role, "guessed": list(c.guessed)} for c in guessed}
        yield FINDINGS.finding("roles-guessed", f"{told}{shown}.", evidence=evidence)
    if undeclared:
        told = f"Nothing tells what {len(undeclared)} column(s) measure; they were not read: {listed(undeclared, 10)}."
        columns = {"columns": undeclared[:200]}
        yield FINDINGS.finding("columns-without-role", told, evidence=columns, action="leave-out-channel")


def _by_numbers(
    name: str, headers: dict[str, str], runs: Sequence[TimedRun], overrides: Overrides, findings: list[Finding]
) -> Planned:
    """Where no column at all can be told by its name: a role by the numbers, so that there is something to correct."""
    first = next(run for run in runs if run.name in headers)
    section = ChannelSection(role=role_of_numbers(first.by_header[headers[first.name]].values))
    planned = _planned(name, section, headers, runs, overrides, findings, strict=False)
    return replace(planned, guessed=("role", *planned.guessed), doubt="nothing but its numbers says so")


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
    columns = {run.name: run.by_header[headers[run.name]] for run in with_channel}
    first = columns[with_channel[0].name]
    asked_role = overrides.roles.get(name, overrides.roles.get(first.header)) or section.role
    option = overrides.units.get(name, overrides.units.get(first.header))
    asked_unit = option or section.unit
    told: list[Finding] = []
    in_file = {run: _unit_in_file(column, told, run) for run, column in columns.items()}
    sample = np.concatenate([column.values[:5000] for column in columns.values()][:5])
    hint = known_unit(asked_unit) or in_file[with_channel[0].name]
    guess = role_guess(name_and_unit(name)[0], hint, sample, asked_role)
    if guess.role is None:
        raise _NoRoleError("no role", expected="a role", where=name, advice="name the role in the machine file")
    findings += told if asked_unit is None else ()  # of a unit that is said nothing needs to be known from the file
    units: dict[str, str] = {}
    dispute = None
    unit_guessed = False
    where = f"channel {name!r}" + (" of the machine file" if strict else "")
    if asked_unit is not None:
        declared = unit_for_role(asked_unit, guess.role, where=f"--unit {name}={option}" if option else where)
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
    if axis is not None and guess.role == "displacement" and re.fullmatch("[XYZABCUVW][0-9]?", axis.upper()) is None:
        told_axis = f"Channel {name!r} is along axis {axis!r}, and machines have X, Y, Z, A, B, C, U, V and W."
        findings.append(FINDINGS.finding("axis-unusual", told_axis, Where(channel=name), {"axis": axis}))
    if section.place is None and first.description is not None:
        guessed.append("place")
    if unit_guessed and strict and asked_role is not None:
        assumed = f"Neither the machine file nor the files say the unit of channel {name!r}; {guess.unit} is assumed."
        findings.append(FINDINGS.finding("unit-guessed", assumed, Where(channel=name), {"unit": guess.unit}))
    place = section.place or first.description
    return Planned(name, guess.role, headers, units, place, axis, section.xyz, tuple(guessed), dispute, guess.doubt)


def _unit_in_file(column: Column, findings: list[Finding], run: str) -> str | None:
    text = column.unit if column.unit is not None and column.unit.strip() else name_and_unit(column.header)[1]
    known = known_unit(text)
    if text is not None and text.strip() and known is None:
        told = f"The unit {text!r} of column {column.header!r} in run {run!r} is not known; it was not used."
        findings.append(FINDINGS.finding("unknown-unit", told, Where(channel=column.header, run=run), {"unit": text}))
    return known


def _is_auxiliary(column: Column) -> bool:
    """Whether a column only numbers the samples or is a further clock."""
    name = name_and_unit(column.header, time=True)[0]
    if is_counter_name(name):
        steps = np.diff(column.values[np.isfinite(column.values)])
        return len(steps) > 0 and bool(np.all(steps == np.round(steps))) and float(np.mean(steps == 1)) > 0.9
    # "min" may be the least of some readings
    is_part = time_part(name) is not None and name.casefold() not in ("min", "mon", "sec")
    return is_part or (is_time_name(name) and name.casefold() != "t") or name.casefold() in ("ms", "msec")
