"""Which values has a column that a model file refers to, and does it look like what the key asks for."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from selector.errors import InputError, ModelFileError
from selector.findings import Finding, Where

if TYPE_CHECKING:
    from selector.physics.thermal.model_schema import Column
    from selector.physics.thermal.schedule import Vector

_ROLE_OF_KEY = {"spindle_speed_rpm": "spindle_speed", "ambient_degc": "ambient", "coolant_degc": "temperature"}
_ALIKE = ({"temperature", "ambient"}, {"spindle_speed"}, {"displacement"})


def column_beside(model: Path, course: Column, key: str) -> tuple[Path, tuple[Vector, Vector], list[Finding]]:
    """The file, (time_s, values) in the unit of the key, and a warning if the column looks like something else.

    Raises
    ------
    InputError
        The file is elsewhere or cannot be read, or it has no such column in one run.
    """
    from selector.readers import Overrides
    from selector.readers import read as read_recordings

    where = f"{model}, key conditions.{key}"
    path = _beside(model, course.file, f"{where}.file")
    role, column = _ROLE_OF_KEY.get(key), course.column
    try:
        reading = read_recordings([path], overrides=Overrides(roles={column: role} if role else {}))
    except InputError as error:
        if error.where != "--role":
            raise
        raise ModelFileError(
            f"no column {column!r} in {path.name}", expected=error.expected, where=f"{where}.column",
            advice="correct the name of the column, or of the file",
        ) from error  # fmt: skip
    recording = reading.recording
    names = [channel.name for channel in reading.channels if column in (channel.name, channel.column)]
    if len(names) != 1 or len(recording.runs) != 1:
        raise ModelFileError(
            f"no column {column!r} in {path.name}" if not names else f"{len(recording.runs)} runs in {path.name}",
            expected="one of " + ", ".join(recording.names) + " in one run",
            where=f"{where}.column" if not names else f"{where}.file",
            advice="correct the name of the column, or of the file",
        )
    values = recording.values(recording.runs[0], names)[:, 0]
    return path, (recording.time_s(recording.runs[0]), values), _of_another_kind(path, column, role, key)


def _of_another_kind(path: Path, column: str, role: str | None, key: str) -> list[Finding]:
    """A warning if the column, read by itself, would be taken for another quantity."""
    from selector.readers import read as read_recordings

    try:
        by_itself = read_recordings([path]).channels
    except InputError:
        return []
    taken = next((channel.role for channel in by_itself if column in (channel.name, channel.column)), None)
    if not any(taken in kind and role not in kind for kind in _ALIKE):
        return []
    return [
        Finding(
            "unlike-column",
            "warning",
            f"Column {column!r} of {path.name} looks like the role {taken}, but conditions.{key} takes its values.",
            Where(channel=column, file=path.name),
            {"column": column, "role": taken, "key": key},
            "check the name of the column in the model file",
        )
    ]


def _beside(model: Path, name: str, where: str) -> Path:
    """The file of this name in the folder of the model file, or below it.

    Raises
    ------
    ModelFileError
        The name leads elsewhere, also through a link.
    """
    folder = model.resolve().parent
    path = (folder / name).resolve()
    if Path(name).is_absolute() or not path.is_relative_to(folder):
        raise ModelFileError(
            f"{name!r}, which is outside the folder of the model file",
            expected="a file beside the model file, or in a folder below it",
            where=where,
            advice="copy the recording there",
        )
    return path
