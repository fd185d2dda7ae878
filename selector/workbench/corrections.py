"""What the user corrects of channels and places, as a machine file."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from selector.errors import OptionError
from selector.readers import Machine, Reading, guessed_clock, machine_of, machine_text, write_machine_file
from selector.readers.machine_file import ChannelSection, machine_from_text
from selector.workbench.study_folder import MACHINE_BEFORE

NO_CHANNEL = "not a channel"


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


def row_of(cells: Mapping[str, str | None], old: Row) -> Row:
    """A row with what stands in its cells now."""
    texts = {name: (cells.get(name) or "").strip() for name in ("role", "unit", "place", "axis")}
    return Row(
        old.name, old.column, texts["role"], texts["unit"], texts["place"], texts["axis"], old.guessed, old.reason
    )


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
