"""How are simulated runs read beside recorded ones, and which values have the columns of a model file."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from selector.cli.shared.finding_table import FINDINGS
from selector.errors import InputError, ModelFileError, ReadError, RecordingError, UnitError
from selector.findings import Finding, Where
from selector.physics.model_text import file_beside
from selector.physics.simulation_kind import DutyCycle
from selector.readers.finding_table import UNIT_CONFLICT
from selector.readers.tables import listed
from selector.readers.window import WINDOW

if TYPE_CHECKING:
    from selector.physics.model_text import Column
    from selector.physics.simulation_kind import SimulationKind
    from selector.readers import Machine, Overrides, Reading
    from selector.recording import Recording
    from selector.types import Vector

_TIME_UNIT = "--simulation-time-unit"
_UNITS_S = {"ms": 1e-3, "s": 1.0, "min": 60.0, "h": 3600.0}
#: Part by which a simulated run may be longer or shorter than the recorded one when its unit of time is told by it.
_SAME_SPAN = 0.03


def driving_recordings(kind: SimulationKind, file: Any, inputs: Sequence[Path], machine: Path | None) -> Reading:
    """The recordings; columns whose role was guessed, and otherwise than the model says, are read as it says."""
    from selector.readers import Overrides
    from selector.readers import read as read_recordings
    from selector.readers.finding_table import COLUMNS_WITHOUT_ROLE

    reading = read_recordings(inputs, machine=machine)
    lacking = [one.evidence.get("columns", []) for one in reading.findings if one.id == COLUMNS_WITHOUT_ROLE]
    guessed = [channel.name for channel in reading.channels if {"role", "unit"} <= set(channel.guessed)]
    asked = kind.roles_asked(file, reading.recording, [*(str(name) for names in lacking for name in names), *guessed])
    return read_recordings(inputs, machine=machine, overrides=Overrides(roles=dict(asked))) if asked else reading


def duty_cycle(kind: SimulationKind, name: str, value: Any) -> Any:
    """What an option says; a duty cycle is read from its file."""
    if value is None or not any(option.name == name and option.kind is DutyCycle for option in kind.options):
        return value
    from selector.readers.cycle_file import read_cycle

    rows = read_cycle(value)
    return DutyCycle(value, rows.time_s, rows.speed_rpm)


def simulated_reading(
    paths: Sequence[Path], recorded: Reading, overrides: Overrides, time_unit: str | None = None
) -> Reading:
    """The simulation of recorded runs.

    Channels, units and roles are those of the recordings; channels may be lacking. What is said about the format of
    the recordings is tried first; a simulation written otherwise is read as it is. The unit of its time is, in this
    order: `time_unit`, what its header says, that of the recordings, unless the length of the runs shows another one.

    Raises InputError: the files cannot be read, or hold none of the recorded channels.
    """
    from selector.readers import machine_of

    machine = recorded.machine if recorded.machine is not None else machine_of(recorded)
    # what was wrong with a recorded run is not wrong with its simulation
    machine = machine.model_copy(update={"runs": {}})
    wrong: list[InputError] = []
    names: tuple[str, ...] = ()
    for asked, described in _ways(machine, overrides):
        try:
            found = _with_its_clock(paths, recorded, described, asked, time_unit)
        except InputError as error:
            wrong.append(error)
            continue
        if set(found.recording.names) & set(recorded.recording.names):
            return found
        names = names or found.recording.names
    # that nothing can be cut out of it, or that its columns are others, says more than in which format it is not
    most = max(wrong, key=lambda error: (error.where == WINDOW, isinstance(error, RecordingError)), default=None)
    raise most or _nothing_in_common(paths, recorded, names)


def _ways(machine: Machine, overrides: Overrides) -> Iterator[tuple[Overrides, Machine]]:
    """What to read with: first all that was said about the recordings, then less and less of their format."""
    from selector.readers import Overrides as Plain
    from selector.readers.machine_file import TimeSection

    same = dataclasses.replace(overrides, partial=True)
    kept = ("date_order", "units", "roles", "since", "until", "mean_s")
    own_format = Plain(**{name: getattr(overrides, name) for name in kept}, partial=True)
    own_clock = machine.model_copy(update={"time": TimeSection(date_order=machine.time.date_order)})
    yield same, machine
    yield dataclasses.replace(same, time_column=None, time_unit=None, period_s=None), own_clock
    yield own_format, machine
    yield own_format, own_clock


def not_simulated(recorded: Recording, simulated: Recording, responses: Sequence[str]) -> tuple[Finding, ...]:
    """Recorded channels like those that are compared, of which the simulation has none."""
    roles = {recorded.channel(name).role for name in responses}
    lacking = [one.name for one in recorded.channels if one.role in roles and one.name not in simulated.names]
    return tuple(
        FINDINGS.finding(
            "recorded-only", f"{name} is recorded but not simulated, and is not compared.", Where(channel=name)
        )
        for name in lacking
    )


def _with_its_clock(
    paths: Sequence[Path], recorded: Reading, machine: Machine, overrides: Overrides, time_unit: str | None
) -> Reading:
    if time_unit is not None:
        try:
            return _in_its_units(paths, recorded, machine, dataclasses.replace(overrides, time_unit=time_unit))
        except InputError as error:
            if error.where != "--time-unit":
                raise
            raise error.at(_TIME_UNIT, advice=error.advice.replace(error.where, _TIME_UNIT)) from error
    free = machine.model_copy(update={"time": machine.time.model_copy(update={"unit": None})})
    found = _in_its_units(paths, recorded, free, dataclasses.replace(overrides, time_unit=None))
    times = [found.reading["time"], *(own["time"] for own in found.reading.get("per_run", {}).values())]
    if not any("unit" in time["guessed"] for time in times):
        return found
    told = recorded.reading["time"]["unit"]
    usual = told if told in _UNITS_S else None
    unit = _unit_by_length(found, recorded, usual)
    if unit is None:
        return found
    result = _in_its_units(paths, recorded, machine, dataclasses.replace(overrides, time_unit=unit))
    if unit == usual:
        return result
    said = FINDINGS.finding(
        "simulated-time-unit",
        f"The time of the simulation was read in {unit}: only then its runs are as long as the recorded ones.",
        Where(),
        {"unit": unit, "unit_of_recording": usual},
        f"name it with {_TIME_UNIT}, or write it into the header of the time column",
    )
    return dataclasses.replace(result, findings=(said, *result.findings))


def _in_its_units(paths: Sequence[Path], recorded: Reading, machine: Machine, overrides: Overrides) -> Reading:
    """The files in the units that their headers say, and in those of the recordings where they say none.

    What a header seems to say in the recordings as well, where the machine file says otherwise, is no unit: ``x_m`` of
    a motor.
    """
    from selector.readers import read

    found = read(paths, machine, overrides)
    no_units = _disputed(recorded)
    own = {name for name, printed in _disputed(found).items() if printed != no_units.get(name)}
    if not own:
        return found
    columns = own | {channel.column for channel in found.channels if channel.name in own}
    channels = {
        name: section.model_copy(update={"unit": None}) if name in own else section
        for name, section in machine.channels.items()
    }
    units = {name: unit for name, unit in overrides.units.items() if name not in columns}
    try:
        return read(
            paths, machine.model_copy(update={"channels": channels}), dataclasses.replace(overrides, units=units)
        )
    except UnitError as error:
        place = error.where.removesuffix(" of the machine file")
        where = f"headers of the simulation {listed(map(str, paths), 3)}, {place}"
        advice = "correct the unit in the header, or simulate the quantity that was recorded"
        raise error.at(where, advice=advice) from error


def _disputed(found: Reading) -> dict[str, set[str]]:
    """Channel → units in its headers, of those for which the machine file was believed instead."""
    conflicts = [finding.evidence for finding in found.findings if finding.id == UNIT_CONFLICT]
    return {name: set(said["in_file"]) for said in conflicts for name in said["channels"]}


def _unit_by_length(found: Reading, recorded: Reading, usual: str | None) -> str | None:
    """The unit of time in which simulated runs are as long as recorded ones; `usual` if none or that one is."""
    length = {run.name: run.duration_s for run in recorded.runs}
    assumed_s = _UNITS_S.get(found.reading["time"]["unit"])
    pairs = [(run.duration_s, length[run.name]) for run in found.runs if run.name in length]
    if assumed_s is None or not pairs:
        return usual
    fitting = [
        unit
        for unit, unit_s in _UNITS_S.items()
        if all(abs(span_s / assumed_s * unit_s - whole_s) <= _SAME_SPAN * whole_s for span_s, whole_s in pairs)
    ]
    return usual if not fitting or usual in fitting else fitting[0]


def _nothing_in_common(paths: Sequence[Path], recorded: Reading, names: Sequence[str]) -> ReadError:
    has = f"the simulation has {', '.join(names[:12])}" if names else "the simulation has no channels"
    return ReadError(
        f"none of the recorded channels; {has}",
        expected=f"columns with some of {', '.join(recorded.recording.names[:12])}",
        where=f"--simulation {listed(map(str, paths), 3)}",
        advice="name the simulated columns as the recorded channels, or as the columns in the machine file",
    )


def columns_beside(
    model: Path, needed: Mapping[str, Column], roles: Mapping[str, str], section: str = ""
) -> tuple[dict[str, tuple[Vector, Vector]], list[Path]]:
    """Key → (time_s, values in the unit of its role) of the columns that a model file refers to; and the files.

    `section` stands before the keys.

    Raises InputError: a file is elsewhere or cannot be read, or it has no such column in one run.
    """
    both = {key: _column_beside(model, course, f"{section}{key}", roles.get(key)) for key, course in needed.items()}
    return {key: values for key, (_, values) in both.items()}, [path for path, _ in both.values()]


def _column_beside(model: Path, course: Column, key: str, role: str | None) -> tuple[Path, tuple[Vector, Vector]]:
    from selector.readers import Overrides
    from selector.readers import read as read_recordings

    where = f"{model}, key {key}"
    column, unit = course.column, getattr(course, "unit", None)
    path = file_beside(model, course.file, f"{where}.file", "recording")
    said = Overrides(roles={column: role} if role else {}, units={column: unit} if unit else {})
    try:
        reading = read_recordings([path], overrides=said)
    except InputError as error:
        if error.where not in ("--role", "--unit"):
            place = f"{where}.file, {path}{error.where.removeprefix(str(path)).removeprefix(path.name)}"
            raise error.at(place) from error
        raise ModelFileError(
            f"no column {column!r} of numbers in {path.name}",
            expected=error.expected if error.expected.removeprefix("one of").strip() else "columns of numbers",
            where=f"{where}.column",
            advice="correct the name of the column, or of the file",
        ) from error  # fmt: skip
    recording = reading.recording
    names = [channel.name for channel in reading.channels if column in (channel.name, channel.column)]
    if len(names) != 1 or len(recording.runs) != 1:
        raise ModelFileError(
            f"no column {column!r} in {path.name}" if not names else f"{len(recording.runs)} runs in {path.name}",
            expected=f"one of {', '.join(recording.names)} in one run" if recording.names else "columns of numbers",
            where=f"{where}.column" if not names else f"{where}.file",
            advice="correct the name of the column, or of the file",
        )
    values = recording.values(recording.runs[0], names)[:, 0]
    return path, (recording.time_s(recording.runs[0]), values)
