"""Which values have the columns that a model file refers to, and do they look like what the keys ask for."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Protocol

from selector.errors import InputError, ModelFileError
from selector.findings import Finding, Where

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    Vector = NDArray[np.float64]

_ALIKE = (
    {"temperature", "ambient"},
    {"spindle_speed"},
    # a length without a role is taken for a displacement
    {"displacement", "position", "position_command"},
    {"velocity"},
    {"force"},
)


class ColumnOfFile(Protocol):
    """A column of a recording beside the model file, as its sections name it."""

    @property
    def file(self) -> str:
        """Name of the file."""

    @property
    def column(self) -> str:
        """Name of the column or channel in it."""


def columns_beside(
    model: Path, needed: Mapping[str, ColumnOfFile], roles: Mapping[str, str], section: str = ""
) -> tuple[dict[str, tuple[Vector, Vector]], list[Path], tuple[Finding, ...]]:
    """Key → (time_s, values in the unit of its role) of the columns that a model file refers to; the files; warnings.

    A warning says that a column looks like something else than its key asks for. `section` stands before the keys.

    Raises
    ------
    InputError
        A file is elsewhere or cannot be read, or it has no such column in one run.
    """
    found: dict[str, tuple[Vector, Vector]] = {}
    read: list[Path] = []
    findings: list[Finding] = []
    for key, course in needed.items():
        path, found[key], told = _column_beside(model, course, f"{section}{key}", roles.get(key))
        read.append(path)
        findings += told
    return found, read, tuple(findings)


def _column_beside(
    model: Path, course: ColumnOfFile, key: str, role: str | None
) -> tuple[Path, tuple[Vector, Vector], list[Finding]]:
    from selector.readers import Overrides
    from selector.readers import read as read_recordings

    where = f"{model}, key {key}"
    column, unit = course.column, getattr(course, "unit", None)
    path = _beside(model, course.file, f"{where}.file")
    said = Overrides(roles={column: role} if role else {}, units={column: unit} if unit else {})
    try:
        reading = read_recordings([path], overrides=said)
    except InputError as error:
        if error.where not in ("--role", "--unit"):
            place = f"{where}.file, {path}{error.where.removeprefix(str(path)).removeprefix(path.name)}"
            raise type(error)(error.found, expected=error.expected, where=place, advice=error.advice) from error
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
            f"Column {column!r} of {path.name} looks like the role {taken}, but {key} takes its values.",
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
