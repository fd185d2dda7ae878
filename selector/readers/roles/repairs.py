"""Repairs of single runs: what ``[runs.NAME]`` of a machine file says is done when the runs are read.

The files are never edited. A repair of a run that is not among those read is told, since its name may be misspelt.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import NoReturn

from selector.errors import RecordingError
from selector.findings import Finding, Where
from selector.quality.finding_table import SWAPPED_CHANNELS, WRONG_UNIT
from selector.readers.finding_table import FINDINGS, RUN_REPAIRED, TWO_LOGGERS
from selector.readers.machine_file import WHOLE, Machine, RunChannelSection, RunSection
from selector.readers.roles.names import one_of_words
from selector.readers.roles.plan import Plan, Planned
from selector.readers.runs import TimedRun
from selector.readers.tables import listed
from selector.units import same_dimension, unit_for_role


def used_runs(runs: Sequence[TimedRun], machine: Machine | None) -> tuple[list[TimedRun], list[Finding]]:
    """The runs that are to be used, and what there is to say about the others.

    Raises RecordingError: No run is left.
    """
    repairs = {} if machine is None else dict(machine.runs)
    names = [run.name for run in runs]
    kept = [run for run in runs if repairs.get(run.name, RunSection()).use]
    if not kept:
        raise RecordingError(
            f"use = false for every run: {listed(names, 8)}",
            expected="at least one run that is used",
            where="[runs] of the machine file",
            advice="take `use = false` away from the runs that are good",
        )
    told = "Run {name!r} is left out: the machine file says use = false."
    unused = [name for name in names if not repairs.get(name, RunSection()).use]
    findings = [FINDINGS.finding("run-not-used", told.format(name=name), Where(run=name)) for name in unused]
    unknown = [name for name in repairs if name not in names]
    if unknown:
        read = f"The machine file repairs runs that were not read: {listed(unknown, 8)}. Read were {listed(names, 8)}."
        evidence = {"repaired": unknown, "read": names[:100]}
        findings.append(FINDINGS.finding("repair-of-no-run", read, evidence=evidence))
    return kept, findings


def proposed(runs: Mapping[str, RunSection], findings: Iterable[Finding]) -> dict[str, RunSection]:
    """The repairs of a machine file and those that findings propose: swapped cables, a unit, a run in two files.

    Only what is proved, so that the readings would be left out without a repair, and what nobody has settled yet.
    """
    found = dict(runs)
    for finding in findings:
        run, name = finding.where.run, finding.where.channel
        for first, other in finding.evidence["beside"].items() if finding.id == TWO_LOGGERS else ():
            found[first] = found.get(first, RunSection()).model_copy(update={"beside": (other,)})
        if run is None or name is None or finding.action != "leave-out-channel":
            continue
        section = found.get(run, RunSection())
        touched = {one for pair in section.swap for one in pair} | set(section.channels)
        other, unit = finding.evidence.get("other"), finding.evidence.get("unit")
        if finding.id == SWAPPED_CHANNELS and other is not None and not touched & {name, other}:
            found[run] = section.model_copy(update={"swap": (*section.swap, (name, other))})
        elif finding.id == WRONG_UNIT and unit is not None and name not in touched:
            channels = {**section.channels, name: RunChannelSection(unit=unit)}
            found[run] = section.model_copy(update={"channels": channels})
    return found


def repaired(planned: Plan, machine: Machine | None, runs: Sequence[TimedRun]) -> Plan:
    """The plan with exchanged cables, units and left-out stretches of the runs that the machine file repairs.

    Raises RecordingError: A channel is none of the recording, or not in that run. Raises UnitError: The unit does not
    fit the role of the channel.
    """
    if machine is None:
        return planned
    channels = {
        one.name: replace(one, headers=dict(one.headers), units=dict(one.units), left_out=dict(one.left_out))
        for one in planned.channels
    }
    findings = list(planned.findings)
    ends_s = {run.name: float(run.time_s[-1]) for run in runs}
    parts = [(run.name, name, begins) for run in runs for name, begins in _recorded(run) if name in machine.runs]
    for run, part, begins_s in parts:
        section = machine.runs[part]
        for first, second in section.swap:
            one, other = (_in_run(channels, name, run) for name in (first, second))
            if not same_dimension(one.units[run], other.units[run]):
                found = f"{first} [{one.units[run]}] and {second} [{other.units[run]}]"
                _refuse(found, "two channels of the same kind, whose cables can have changed places", run)
            one.headers[run], other.headers[run] = other.headers[run], one.headers[run]
            one.units[run], other.units[run] = other.units[run], one.units[run]
        for name, repair in section.channels.items():
            channel = _in_run(channels, name, run)
            if repair.unit is not None:
                where = f"[runs.{part}.channels.{name}] of the machine file"
                channel.units[run] = unit_for_role(repair.unit, channel.role, where=where)
            left_out = tuple((first + begins_s, last + begins_s) for first, last in repair.leave_out)
            left_out = WHOLE if repair.leave_out == WHOLE else left_out
            if left_out:
                channel.left_out[run] = left_out
            beyond = [stretch for stretch in left_out if stretch[0] > ends_s[run] or stretch[1] < 0.0]
            if beyond:
                findings.append(_told_beyond(run, name, beyond, ends_s[run]))
        if section.swap or section.channels or section.beside:
            findings.append(_told(part, section))
    return replace(planned, channels=tuple(channels.values()), findings=tuple(findings))


def _recorded(run: TimedRun) -> Iterator[tuple[str, float]]:
    """The run, and what was recorded beside it: name, and the recorded start by the clock of the run [s]."""
    yield run.name, -run.skipped_s
    for one in run.beside:
        yield one.name, one.begins_s


def _in_run(channels: dict[str, Planned], name: str, run: str) -> Planned:
    if name not in channels:
        _refuse(f"no channel {name!r}", one_of_words(name, channels), run)
    if run not in channels[name].headers:
        _refuse(f"channel {name!r}, which run {run!r} does not have", f"a channel that {run!r} has", run)
    return channels[name]


def _refuse(found: str, expected: str, run: str) -> NoReturn:
    raise RecordingError(
        found,
        expected=expected,
        where=f"[runs.{run}] of the machine file",
        advice="correct the name in the machine file",
    )


def _told_beyond(run: str, name: str, stretches: Sequence[tuple[float, float]], end_s: float) -> Finding:
    told = ", ".join(f"{first:g} to {last:g} s" for first, last in stretches)
    told = f"Run {run!r} lasts {end_s:g} s; of {name} nothing is left out from {told}."
    evidence = {"leave_out": [list(stretch) for stretch in stretches], "duration_s": end_s}
    return FINDINGS.finding("repair-of-no-sample", told, Where(channel=name, run=run), evidence)


def _told(run: str, section: RunSection) -> Finding:
    done = [f"it has the channels of {listed(section.beside, 8)}"] if section.beside else []
    done += [f"{first} and {second} changed places" for first, second in section.swap]
    done += [f"{name} is in {repair.unit}" for name, repair in section.channels.items() if repair.unit is not None]
    done += [f"stretches of {name} are left out" for name, repair in section.channels.items() if repair.leave_out]
    told = f"Run {run!r} was read as the machine file repairs it: {'; '.join(done)}."
    return FINDINGS.finding(RUN_REPAIRED, told, Where(run=run), section.model_dump(exclude_defaults=True, mode="json"))
