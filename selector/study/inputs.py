"""Whether the files that a study was made of are still what they were."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from selector.errors import InputError, StudyError
from selector.readers.files import Found, recording_files
from selector.study.places import path_at, reference_to, sha256_of
from selector.study.study_file import InputFile, Kind, Study

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
    """Ends with an error when the files of the study file at `place` are not those it was made of.

    Raises
    ------
    StudyError
        They are not; the message names each of them with its hashes.
    """
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
