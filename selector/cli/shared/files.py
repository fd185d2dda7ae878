"""Where do files go: nothing is overwritten that is not ours, and those of a simulation are written all or none."""

from __future__ import annotations

import re
import secrets
import shutil
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path

from selector.atomic_file import refuse_to_replace_input, require_writable_folder
from selector.cli.shared.running import last_step
from selector.errors import InputError, OptionError


def refuse_folder_of_inputs(out: Path, inputs: Iterable[str | Path]) -> None:
    """What is written must replace no input, and must not be read as a run by the next command.

    Raises
    ------
    OptionError
        An input lies in the folder.
    """
    from selector.readers.roles.names import printable_name

    for file in (Path(one) for one in inputs):
        held = file if file.is_dir() else file.absolute().parent
        if out.exists() and file.exists() and out.samefile(held):
            raise OptionError(
                f"this folder holds {printable_name(file.name)}, which is read", where=f"--out {out}",
                expected="a folder that holds no recording, duty cycle or machine file of this command",
                advice="choose another folder, e.g. one inside of it",
            )  # fmt: skip


def written_folder(text: str | Path) -> Path:
    """The folder that an option names.

    Raises
    ------
    OptionError
        It names none.
    """
    if not str(text).strip():
        raise OptionError(
            "an empty name",
            expected="the name of a folder to write into",
            where="--out",
            advice="e.g. --out results; a variable of your script may be empty",
        )
    return Path(text)


LABEL = " (SIMULATED)"
"""Behind the name of the machine in the machine file of a simulation; by it an own file is known again."""

_DRAFTS = re.compile(r"\.[0-9a-f]{16}\.part(?:[/\\]|$)")
_NO_PLACE_FOR_FILES = ("dev", "proc", "sys")


def require_places(
    recordings: Iterable[Path], machine_path: Path, report: Path | None, read: Iterable[str | Path]
) -> None:
    """Find out before long work whether the files can be written, and that no file is lost that is not ours.

    A recording or machine file that is there is replaced only if the machine file is one of a simulation.

    Raises
    ------
    OptionError
        A file to be written is one that was read, is there and not ours, or its folder cannot be written to.
    """
    recordings, read = list(recordings), list(read)
    for path, option in [*((path, "--out") for path in (*recordings, machine_path)), (report, "--report")]:
        if path is None:
            continue
        refuse_to_replace_input(path, read, option)
        _refuse_broken_link(path, option)
        folder = path.parent.resolve()
        if len(folder.parts) > 1 and folder.parts[1] in _NO_PLACE_FOR_FILES and folder.parts[2:3] != ("shm",):
            raise OptionError(
                f"{folder}, where the system keeps its devices", expected="a folder on a disk",
                where=f"{option} {path}", advice="choose another folder",
            )  # fmt: skip
        require_writable_folder(path.parent, option)
    there = [path for path in (*recordings, machine_path) if path.exists()]
    if there and not (_is_simulated(machine_path) and all(path.is_file() for path in there)):
        raise OptionError(
            f"{there[0].name} exists already, and this command did not write it",
            expected=f"a name that is free, or that of an earlier simulation: its machine file {machine_path.name} "
            f"is called …{LABEL}",
            where=f"--out {there[0]}",
            advice="choose another name, or move the files that are there",
        )
    if report is not None and report.exists() and b"<title>Simulation: " not in _beginning(report):
        raise OptionError(
            f"{report.name} exists already, and is not the page of a simulation",
            expected="a name that is free, or that of an earlier page", where=f"--report {report}",
            advice="choose another name",
        )  # fmt: skip


def require_page_place(report: Path) -> None:
    """Find out before long work whether the page can be written.

    Raises
    ------
    OptionError
        The name does not end in .html, or its place cannot be written to.
    """
    if report.is_dir():
        raise OptionError(
            "a folder of this name exists", expected="a file that ends in .html, or a name that is free",
            where=f"--report {report}", advice=f"choose another name, e.g. --report {report / 'run1.html'}",
        )  # fmt: skip
    if report.suffix.lower() not in (".html", ".htm"):
        raise OptionError(
            f"{report.name!r}", expected="a file that ends in .html", where="--report",
            advice="name the page, e.g. --report run1.html",
        )  # fmt: skip
    _refuse_broken_link(report, "--report")
    require_writable_folder(report.parent, "--report")


@contextmanager
def named_as_asked() -> Iterator[None]:
    """Errors name the files and folders that were asked for, not the drafts in hidden folders beside them."""
    try:
        yield
    except InputError as error:
        where = _DRAFTS.sub("", error.where)
        raise type(error)(error.found, expected=error.expected, where=where, advice=error.advice) from error
    except OSError as error:
        name = str(error.filename2 or error.filename or "")
        raise type(error)(error.errno, error.strerror, _DRAFTS.sub("", name) or None) from error


@contextmanager
def written_together(paths: Iterable[Path]) -> Iterator[Mapping[Path, Path]]:
    """Path → draft to be written; when the block ends without an error, all drafts take their places, or none does."""
    folders = {path: path.parent for path in paths}
    made: list[Path] = []
    stages: dict[Path, Path] = {}
    done: list[tuple[Path, Path]] = []
    try:
        for folder in dict.fromkeys(folders.values()):
            for missing in [place for place in (*reversed(folder.parents), folder) if not place.exists()]:
                made.append(missing)
                missing.mkdir(exist_ok=True)
            stages[folder] = folder / f".{secrets.token_hex(8)}.part"
            stages[folder].mkdir()
        drafts = {path: stages[folder] / path.name for path, folder in folders.items()}
        yield drafts
        with last_step("stopped after the simulation; its files were written"):
            for path, draft in drafts.items():
                old = draft.with_name(f"{secrets.token_hex(8)}.old")
                done.append((path, old))
                if path.exists():
                    path.replace(old)
                draft.replace(path)
            done.clear()
            for stage in stages.values():
                shutil.rmtree(stage, ignore_errors=True)
            made.clear()
    except BaseException:
        for path, old in done:
            if old.exists():
                old.replace(path)
            elif not drafts[path].exists():
                path.unlink(missing_ok=True)
        for stage in stages.values():
            shutil.rmtree(stage, ignore_errors=True)
        for folder in reversed(made):
            if folder.exists() and not any(folder.iterdir()):
                folder.rmdir()
        raise
    finally:
        for stage in stages.values():
            shutil.rmtree(stage, ignore_errors=True)


def _refuse_broken_link(path: Path, option: str) -> None:
    """Raises OptionError if the path, or its folder, is a link to nothing: files would take the place of the link."""
    for place in (path, *path.parents):
        if place.is_symlink() and not place.exists():
            raise OptionError(
                f"a link to {place.readlink()}, which does not exist", expected="a name that is free, or a link to "
                "what exists", where=f"{option} {place}", advice="choose another name, or remove the link",
            )  # fmt: skip


def _is_simulated(machine_path: Path) -> bool:
    from selector.readers.machine_file import machine

    if not machine_path.is_file():
        return False
    try:
        name = machine(machine_path).machine.name
    except InputError:
        return False
    return name is not None and name.endswith(LABEL.strip())


def _beginning(path: Path) -> bytes:
    if not path.is_file():
        return b""
    with path.open("rb") as file:
        return file.read(4096)
