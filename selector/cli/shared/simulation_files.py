"""Where simulations go: the file of each run, the machine file, the page; all are written or none."""

from __future__ import annotations

import re
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from selector.atomic_file import begins_with, refuse_to_replace_input, require_writable_folder, written_together
from selector.cli.shared.running import last_step
from selector.errors import InputError, OptionError

if TYPE_CHECKING:
    from selector.readers import Reading
    from selector.recording import Recording


@dataclass(frozen=True)
class Destination:
    """Where a simulation goes: the file of each run, and the machine file beside them."""

    targets: Mapping[str, Path]
    machine_path: Path


def require_inputs_for_machine(machine: Path | None, inputs: Sequence[Path] | None) -> None:
    """Refuses a machine file that describes no recordings. Raises OptionError: `--machine` without `--inputs`."""
    if machine is not None and not inputs:
        raise OptionError(
            "--machine without --inputs", expected="recordings that the machine file describes", where="--machine",
            advice="add --inputs RUN, or leave --machine out",
        )  # fmt: skip


def own_destination(
    out: Path, runs: Sequence[str], report: Path | None, read: Iterable[str | Path], why_folder: str = ""
) -> Destination:
    """Where the runs go that a model file describes itself: one as a file called `out`, several into that folder.

    `runs` of several; an empty name stands for a run that is called after the file.

    Raises OptionError: `out` is no .csv, or several runs need a folder; or as `require_places`.
    """
    if len(runs) > 1:
        return _folder(out, tuple(runs), why_folder, report, read)
    if out.suffix.lower() != ".csv":
        raise OptionError(
            f"{out.name!r}", expected="a file that ends in .csv", where="--out",
            advice="name the recording, e.g. --out run1.csv; only several runs go into a folder",
        )  # fmt: skip
    return _checked(Destination({runs[0] or out.stem or "simulation": out}, _beside(out)), report, read)


def driven_destination(out: Path, reading: Reading, report: Path | None, read: Iterable[str | Path]) -> Destination:
    """Where simulations of these recorded runs go: a folder with one file a run, or a .csv for a single run.

    Raises OptionError: `out` is a file and several runs need a folder; or as `require_places`.
    """
    runs = reading.recording.runs
    read = [*read, *(Path(run.file) for run in reading.runs)]
    if reading.machine_file is not None:
        read.append(Path(reading.machine_file))
    if out.suffix.lower() == ".csv" and not out.is_dir() and len(runs) == 1:
        return _checked(Destination({runs[0]: out}, _beside(out)), report, read)
    return _folder(out, runs, "--inputs writes one file a run", report, read)


def require_free_folder(out: Path, why_folder: str) -> None:
    """Raises OptionError: a file stands where a folder is to be. A name in .csv may be meant for a single run."""
    if out.exists() and not out.is_dir() and out.suffix.lower() != ".csv":
        raise OptionError(
            "a file of this name exists", expected=f"a folder, or a name that is free: {why_folder}",
            where=f"--out {out}", advice="choose another name",
        )  # fmt: skip


def _folder(
    out: Path, runs: tuple[str, ...], why_folder: str, report: Path | None, read: Iterable[str | Path]
) -> Destination:
    from selector.readers.writing import run_files

    if out.suffix.lower() == ".csv" and not out.is_dir():
        raise OptionError(
            f"{out.name!r} for {len(runs)} runs", expected=f"a folder: {why_folder}", where=f"--out {out}",
            advice="name a folder, e.g. --out simulated",
        )  # fmt: skip
    require_free_folder(out, why_folder)
    return _checked(Destination(run_files(runs, out, "csv"), out / "machine.toml"), report, read)


def _beside(out: Path) -> Path:
    return out.with_suffix(".machine.toml")


def _checked(destination: Destination, report: Path | None, read: Iterable[str | Path]) -> Destination:
    require_places(destination.targets.values(), destination.machine_path, report, read)
    return destination


@contextmanager
def named(model: Path, sections: Collection[str] = ()) -> Iterator[None]:
    """Errors about a key, an axis or a run of the model file, or about one of its `sections`, name the file too."""
    try:
        yield
    except InputError as error:
        is_of_file = error.where.startswith(("key ", "model ", "axis ", "run ")) or _section(error.where) in sections
        if not is_of_file:
            raise
        where = f"{model}, {error.where.removeprefix('model ')}"
        raise error.at(where) from error


@contextmanager
def named_runs(
    files: Mapping[str, str | Path], model: Path | None = None, sections: Collection[str] = ()
) -> Iterator[None]:
    """Errors about a run name its file in the place of the run; those about `sections` of the model file this too."""
    try:
        yield
    except InputError as error:
        run = next((run for run in files if error.where.startswith(f"run {run}, ")), None)
        if run is None:
            raise
        place = error.where.removeprefix(f"run {run}, ")
        where = f"{files[run]}, " + (f"with {place} of {model}" if _section(place) in sections else place)
        raise error.at(where) from error


def _section(where: str) -> str:
    """First part of a place that is written as a key: ``joints`` of ``joints[2].between``."""
    return re.split(r"[.\[,]", where, maxsplit=1)[0]


def write_simulation(
    recording: Recording,
    name: str,
    destination: Destination,
    report: Path | None,
    page: Callable[[Path], object] | None,
) -> None:
    """The recordings, their machine file and the page, all or none; `page` writes it to a path."""
    from selector.readers.writing import write_recording

    targets, machine_path = destination.targets, destination.machine_path
    pages = [] if page is None or report is None else [report]
    last = partial(last_step, "stopped after the simulation; its files were written")
    with named_as_asked(), written_together([*pages, *targets.values(), machine_path], last) as drafts:
        if page is not None and report is not None:
            page(drafts[report])
        at = {run: drafts[path] for run, path in targets.items()}
        write_recording(recording, at, drafts[machine_path], f"{name}{LABEL}")


#: Behind the name of the machine in the machine file of a simulation; by it an own file is known again.
LABEL = " (SIMULATED)"
_DRAFTS = re.compile(r"\.[0-9a-f]{16}\.part(?:[/\\]|$)")
_NO_PLACE_FOR_FILES = ("dev", "proc", "sys")


def require_places(
    recordings: Iterable[Path], machine_path: Path, report: Path | None, read: Iterable[str | Path]
) -> None:
    """Find out before long work whether the files can be written, and that no file is lost that is not ours.

    A recording or machine file that is there is replaced only if the machine file is one of a simulation.

    Raises OptionError: a file to be written is one that was read, is there and not ours, or its folder cannot be
    written to.
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
    if report is not None and report.exists() and not begins_with(report, "<title>Simulation: "):
        raise OptionError(
            f"{report.name} exists already, and is not the page of a simulation",
            expected="a name that is free, or that of an earlier page", where=f"--report {report}",
            advice="choose another name",
        )  # fmt: skip


def require_page_place(report: Path, option: str = "--report") -> None:
    """Find out before long work whether the page that an option names can be written.

    Raises OptionError: the name does not end in .html, or its place cannot be written to.
    """
    if report.is_dir():
        raise OptionError(
            "a folder of this name exists", expected="a file that ends in .html, or a name that is free",
            where=f"{option} {report}", advice=f"choose another name, e.g. {option} {report / 'run1.html'}",
        )  # fmt: skip
    if report.suffix.lower() not in (".html", ".htm"):
        raise OptionError(
            f"{report.name!r}", expected="a file that ends in .html", where=option,
            advice=f"name the page, e.g. {option} run1.html",
        )  # fmt: skip
    _refuse_broken_link(report, option)
    require_writable_folder(report.parent, option)


@contextmanager
def named_as_asked() -> Iterator[None]:
    """Errors name the files and folders that were asked for, not the drafts in hidden folders beside them."""
    try:
        yield
    except InputError as error:
        raise error.at(_DRAFTS.sub("", error.where)) from error
    except OSError as error:
        name = str(error.filename2 or error.filename or "")
        raise type(error)(error.errno, error.strerror, _DRAFTS.sub("", name) or None) from error


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
