"""Where the files of a study lie, and whether they are still what they were."""

import hashlib
import os
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from selector.errors import InputError, ReadError, StudyError
from selector.readers.files import Found, recording_files
from selector.study.study_file import InputFile, Kind, Study


def reference_to(path: str | Path, folder: str | Path) -> str:
    """How a study file in `folder` names `path`: relative, with ``/``; absolute only between two drives.

    Links on the way are followed, because ``..`` behind a link leads elsewhere; a link at the end keeps its name.

    Raises UnicodeEncodeError: the path has bytes that are no text, and TOML holds only text.
    """
    target = os.path.abspath(path)  # noqa: PTH100 (resolve() would follow a link at the end)
    parent, name = os.path.split(target)
    place = Path(os.path.realpath(parent)) / name if name else Path(target)
    # there is no way to another drive
    with suppress(ValueError):
        place = Path(os.path.relpath(place, os.path.realpath(folder)))
    reference = place.as_posix()
    reference.encode("utf-8")
    return reference


def path_at(reference: str, folder: str | Path) -> Path:
    """The path that a study file in `folder` means; ``~`` and variables are letters like all others."""
    return Path(os.path.normpath(Path(os.path.realpath(folder)) / reference))


def input_file(path: str | Path, folder: str | Path, kind: Kind = "recording", sha256: str | None = None) -> InputFile:
    """The entry of a file in a study of `folder`; `sha256` if it is known already.

    Raises ReadError: the file cannot be read.
    """
    found = sha256_of(Path(path)) if sha256 is None else sha256
    return InputFile(path=reference_to(path, folder), sha256=found, kind=kind)


def sha256_of(path: Path) -> str:
    """SHA-256 of the bytes of a file, 64 hexadecimal digits.

    Raises ReadError: the file cannot be read, or is none: reading a pipe would wait for ever.
    """
    try:
        if not path.is_file():
            raise ReadError(
                "no file", expected="a file that is read by a study", where=str(path), advice="correct the path"
            )
        with path.open("rb") as file:
            return hashlib.file_digest(file, "sha256").hexdigest()
    except OSError as error:
        raise ReadError(
            f"a file that cannot be opened ({error.strerror or error})",
            expected="a file that is read by a study",
            where=str(path),
            advice="check the path and the rights to read it",
        ) from error


ACCEPT = "--accept-changes"
_MOST_TOLD = 12


@dataclass(frozen=True)
class Change:
    """One file that is not as the study has it; `expected` and `found` are SHA-256, None where there is no file.

    `path` is that of the study file, or the one it would have there.
    """

    path: str
    kind: Kind
    happened: Literal["changed", "missing", "added"]
    expected: str | None
    found: str | None


def changes(study: Study, folder: str | Path) -> tuple[Change, ...]:
    """Files of a study in `folder` that were changed, that are missing, and recordings that were added to a folder.

    A study without any ``[[files]]`` has nothing to compare with, and nothing has changed.
    """
    if not study.files:
        return ()
    found: list[Change] = []
    for file in study.files:
        path = path_at(file.path, folder)
        now = sha256_of(path) if path.is_file() else None
        if now != file.sha256:
            happened: Literal["changed", "missing"] = "missing" if now is None else "changed"
            found.append(Change(file.path, file.kind, happened, file.sha256, now))
    known = {path_at(file.path, folder).resolve() for file in study.files}
    for there, kind in _inside_named_folders(study, folder):
        if there.resolve() not in known:
            found.append(Change(reference_to(there, folder), kind, "added", None, sha256_of(there)))
    return tuple(found)


def require_unchanged(study: Study, place: str | Path) -> None:
    """Raises StudyError: the files of the study file at `place` are not those it was made of, with their hashes."""
    found = changes(study, Path(place).parent)
    if found:
        raise StudyError(
            change_words(found),
            expected="the files that the study measured, at the places it names, each with its SHA-256",
            where=str(place),
            advice="bring these files back; if the change is meant, add "
            f"{ACCEPT}: the answer is then that of the files as they are, and --out writes a study of these",
        )


def change_words(found: Sequence[Change]) -> str:
    """The changes in one text, each with what was expected and found."""
    told = []
    for one in found[:_MOST_TOLD]:
        if one.happened == "changed":
            told.append(f"{one.path} has changed: SHA-256 {one.found} instead of {one.expected}")
        elif one.happened == "missing":
            told.append(f"{one.path} is missing: no file with SHA-256 {one.expected}")
        else:
            told.append(f"{one.path} was added, SHA-256 {one.found}")
    more = len(found) - _MOST_TOLD
    return "; ".join(told) + (f"; and {more} more" if more > 0 else "")


def present(study: Study, folder: str | Path) -> tuple[Path, ...]:
    """The files and folders that the study names as its runs and that are still there; all of them if none is."""
    paths = tuple(path_at(run, folder) for run in study.recordings.runs)
    return tuple(path for path in paths if path.exists()) or paths


def _inside_named_folders(study: Study, folder: str | Path) -> Iterator[tuple[Path, Kind]]:
    """Files that the folders of a study hold now; what was named by itself cannot be added."""
    runs = _held([path_at(run, folder) for run in study.recordings.runs])
    if runs is not None:
        yield from ((file, "recording") for file in runs.files)
        if runs.machine is not None and study.recordings.machine is None:
            yield runs.machine, "machine"
    if study.diagnose is not None and any(file.kind == "simulation" for file in study.files):
        simulated = _held([path_at(path, folder) for path in study.diagnose.simulation])
        yield from ((file, "simulation") for file in (simulated.files if simulated is not None else ()))


def _held(paths: Sequence[Path]) -> Found | None:
    folders = [path for path in paths if path.is_dir()]
    try:
        return recording_files(folders) if folders else None
    except InputError:
        # nothing is left in it, which is told file by file
        return None


def listed_files(files: Sequence[InputFile]) -> tuple[InputFile, ...]:
    """Every file once, in the order in which they come: a workbook of three runs is one file."""
    once: dict[str, InputFile] = {}
    for file in files:
        once.setdefault(file.path, file)
    return tuple(once.values())
