"""What is read from the recordings on the bench, as far as they can be read, and what the user corrects of it."""

import codecs
import dataclasses
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from selector.errors import InputError, OptionError, RecordingError
from selector.findings import Finding
from selector.quality import inspect, usable
from selector.readers import (
    Machine,
    Overrides,
    Reading,
    guessed_clock,
    machine_of,
    machine_text,
    read,
    write_machine_file,
)
from selector.readers.finding_table import RUN_REPAIRED
from selector.readers.machine_file import ChannelSection, machine_from_text
from selector.readers.roles.repairs import proposed
from selector.workbench.access import defect
from selector.workbench.study_folder import MACHINE_BEFORE


@dataclasses.dataclass(frozen=True)
class Loaded:
    """A recording on the bench: where it is, whether it is used, and what the reader said when it refused it."""

    path: Path
    is_used: bool = True
    problem: InputError | None = None


@dataclasses.dataclass(frozen=True)
class Inspection:
    """What was read from the recordings in use, and what was found on the way; `problem` where nothing was.

    `number` is another one for each reading.
    """

    number: int = 0
    reading: Reading | None = None
    findings: tuple[Finding, ...] = ()
    problem: InputError | None = None


def as_far_as_readable(
    recordings: Iterable[Loaded], machine: Path | None, overrides: Overrides
) -> tuple[dict[Path, Loaded], Inspection]:
    """The recordings, marked where they are refused even alone; and what was read from those in use that are not."""
    loaded = {one.path: one for one in recordings}
    used = [path for path, one in loaded.items() if one.is_used]
    inspection = _read_together(used, machine, overrides)
    if inspection.problem is None:
        return loaded, inspection
    alone = {path: _read_together([path], machine, overrides).problem for path in used}
    refused = {path: problem for path, problem in alone.items() if problem is not None}
    loaded |= {path: Loaded(path, is_used=False, problem=problem) for path, problem in refused.items()}
    if refused:
        inspection = _read_together([path for path in used if path not in refused], machine, overrides)
    return loaded, inspection


def inspected(
    paths: Sequence[Path], machine: Machine | Path | None, overrides: Overrides
) -> tuple[Reading, tuple[Finding, ...]]:
    """What these recordings hold together, and what is found in it. Raises InputError: they cannot be read."""
    reading = read(paths, machine=machine, overrides=overrides)
    try:
        _, faults = usable(reading.recording)
    except RecordingError:  # of nothing that could be used, what is wrong is shown all the same
        faults = inspect(reading.recording)
    return reading, (*reading.findings, *faults)


def _read_together(paths: Sequence[Path], machine: Path | None, overrides: Overrides) -> Inspection:
    if not paths:
        return Inspection()
    try:
        return Inspection(0, *inspected(paths, machine, overrides))
    except InputError as problem:
        return Inspection(problem=problem)
    except Exception as error:
        # the thread that reads must not die silently
        return Inspection(problem=_input_error(error))


def _input_error(error: Exception) -> InputError:
    if isinstance(error, (OSError, MemoryError)):
        return InputError(
            str(error) or "more data than the memory of this machine holds",
            expected="recordings that can be opened and that fit into memory",
            where="recordings",
            advice="close the program that holds them open, or give fewer of them",
        )
    return defect("recordings", error)


def is_fault(finding: Finding) -> bool:
    """Whether a finding is one of data that are wrong: an error, or what is left out because of it."""
    return finding.level == "error" or finding.action != "none"


def repaired(reading: Reading, *findings: Finding) -> Machine | None:
    """The machine file with the repairs that findings propose, and without those that they tell of; None: as it is."""
    machine = machine_of(reading)
    told = {one.where.run for one in findings if one.id == RUN_REPAIRED}
    kept = {name: section for name, section in machine.runs.items() if name not in told}
    runs = proposed(kept, findings)
    return None if runs == dict(machine.runs) else machine.model_copy(update={"runs": runs})


_BYTES = 16_384
_LINES, _SIGNS = 8, 240


def excerpt(file: str | Path, reading: Mapping[str, Any]) -> str:
    """The first lines of a text table as they stand there; empty for other formats, or when it cannot be opened.

    `reading`: how it was read, see `selector.readers.Reading`; its encoding is used.
    """
    encoding = reading.get("encoding")
    if reading.get("format") != "delimited" or not encoding:
        return ""
    try:
        with Path(file).open("rb") as stream:
            beginning = stream.read(_BYTES)
        text = codecs.getincrementaldecoder(encoding)(errors="replace").decode(beginning)
    except (OSError, LookupError):
        return ""
    lines = text.removeprefix("\ufeff").splitlines()[:_LINES]
    return "\n".join(line if len(line) <= _SIGNS else line[: _SIGNS - 1] + "…" for line in lines)


NO_CHANNEL = "not a channel"
CELLS = ("role", "unit", "place", "axis")  #: What can be corrected.


@dataclass(frozen=True)
class Row:
    """A channel, or a column that is none, as it stands in the table: texts, empty where nothing is said.

    `guessed` names what nobody said, `reason` why a column is no channel.
    """

    name: str
    column: str
    role: str
    unit: str
    place: str = ""
    axis: str = ""
    guessed: tuple[str, ...] = ()
    reason: str = ""


def rows_of(reading: Reading) -> tuple[Row, ...]:
    """The channels in their order, then the columns that are none."""
    channels = [
        Row(one.name, one.column, one.role, one.unit_in_file, one.place or "", one.axis or "", one.guessed)
        for one in reading.channels
    ]
    others = [Row(name, name, NO_CHANNEL, "", reason=reason) for name, reason in reading.undeclared.items()]
    return (*channels, *others)


def corrected(reading: Reading, edited: Sequence[Row]) -> Machine:
    """The machine file of a reading with what the user changed in its table.

    Raises InputError: a row cannot be: a unit that is unknown or does not fit its role, a role that is none.
    """
    sections = dict(machine_of(reading).channels)
    before = {row.name: row for row in rows_of(reading)}
    for row in edited:
        old = before.get(row.name)
        if old is None or row == old:
            continue
        if row.role == NO_CHANNEL:
            sections.pop(row.name, None)
            continue
        changes = {"role": row.role, "place": row.place or None, "axis": row.axis or None}
        if row.unit != old.unit:
            # a unit here holds for all runs; where it was not touched it stays with the files
            changes["unit"] = row.unit or None
        known = sections.get(row.name, ChannelSection(column=row.column if row.column != row.name else None))
        sections[row.name] = known.model_copy(update=changes)
    if not sections:
        raise OptionError(
            "no channel is left",
            expected="at least one channel",
            where="table of channels",
            advice="give a column a role",
        )
    machine = machine_of(reading).model_copy(update={"channels": sections})
    # read back, so that roles and units are judged as those of a file
    return machine_from_text(machine_text(machine), "table of channels")


def placed(reading: Reading | None, places_m: Mapping[str, tuple[float, float, float]], path: Path) -> Reading:
    """The same reading with other places of some sensors [m], after the machine file at `path` has been written.

    Raises InputError: there is no such channel, or the file cannot be written.
    """
    known = set() if reading is None else set(reading.recording.names)
    if reading is None or not places_m.keys() <= known:
        raise OptionError(
            f"places of {', '.join(places_m)}",
            expected="places of channels that were read: " + (", ".join(sorted(known)) or "none yet"),
            where="machine file",
            advice="load recordings that hold them",
        )
    machine = machine_of(reading)
    channels = dict(machine.channels)
    for name, (x, y, z) in places_m.items():
        channels[name] = channels[name].model_copy(update={"xyz": (round(x, 4), round(y, 4), round(z, 4))})
    machine = machine.model_copy(update={"channels": channels})
    before = path.with_name(MACHINE_BEFORE)
    if path.exists() and not before.exists():
        before.write_bytes(path.read_bytes())
    write_machine_file(machine, path, reading.undeclared, guessed_clock(reading))
    at = {name: channel.xyz for name, channel in channels.items()}
    recording = reading.recording
    moved = tuple(dataclasses.replace(one, xyz_m=at.get(one.name, one.xyz_m)) for one in recording.channels)
    return dataclasses.replace(
        reading,
        recording=dataclasses.replace(recording, channels=moved),
        channels=tuple(dataclasses.replace(one, xyz_m=at.get(one.name, one.xyz_m)) for one in reading.channels),
        machine=machine,
        machine_file=str(path),
    )
