"""Where sensors sit: written into the machine file, and into what was read, without reading it again."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from pathlib import Path

from selector.errors import OptionError
from selector.readers import Reading, guessed_clock, machine_of, write_machine_file
from selector.workbench.study_folder import MACHINE_BEFORE


def placed(reading: Reading | None, places_m: Mapping[str, tuple[float, float, float]], path: Path) -> Reading:
    """The same reading with other places of some sensors [m], after the machine file at `path` has been written.

    Raises
    ------
    InputError
        There is no such channel, or the file cannot be written.
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
