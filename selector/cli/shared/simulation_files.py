"""Where simulations go: the file of each run, the machine file, the page; all are written or none."""

from __future__ import annotations

import re
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from selector.cli.shared.files import LABEL, named_as_asked, require_places, written_together
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
    """Refuses a machine file that describes no recordings.

    Raises
    ------
    OptionError
        `--machine` without `--inputs`.
    """
    if machine is not None and not inputs:
        raise OptionError(
            "--machine without --inputs",
            expected="recordings that the machine file describes",
            where="--machine",
            advice="add --inputs RUN, or leave --machine out",
        )


def own_destination(
    out: Path, runs: Sequence[str], report: Path | None, read: Iterable[str | Path], why_folder: str = ""
) -> Destination:
    """Where the runs go that a model file describes itself: one as a file called `out`, several into that folder.

    `runs` of several; an empty name stands for a run that is called after the file.

    Raises
    ------
    OptionError
        `out` is no .csv, or several runs need a folder; or as `require_places`.
    """
    if len(runs) > 1:
        return _folder(out, tuple(runs), why_folder, report, read)
    if out.suffix.lower() != ".csv":
        raise OptionError(
            f"{out.name!r}",
            expected="a file that ends in .csv",
            where="--out",
            advice="name the recording, e.g. --out run1.csv; only --inputs writes a folder",
        )
    return _checked(Destination({runs[0] or out.stem or "simulation": out}, _beside(out)), report, read)


def driven_destination(out: Path, reading: Reading, report: Path | None, read: Iterable[str | Path]) -> Destination:
    """Where simulations of these recorded runs go: a folder with one file a run, or a .csv for a single run.

    Raises
    ------
    OptionError
        `out` is a file and several runs need a folder; or as `require_places`.
    """
    runs = reading.recording.runs
    read = [*read, *(Path(run.file) for run in reading.runs)]
    if reading.machine_file is not None:
        read.append(Path(reading.machine_file))
    if out.suffix.lower() == ".csv" and not out.is_dir() and len(runs) == 1:
        return _checked(Destination({runs[0]: out}, _beside(out)), report, read)
    return _folder(out, runs, "--inputs writes one file a run", report, read)


def require_free_folder(out: Path, why_folder: str) -> None:
    """Refuses a file where a folder is to be; a name that ends in .csv may be meant for a single run.

    Raises
    ------
    OptionError
        There is such a file.
    """
    if out.exists() and not out.is_dir() and out.suffix.lower() != ".csv":
        raise OptionError(
            "a file of this name exists",
            expected=f"a folder, or a name that is free: {why_folder}",
            where=f"--out {out}",
            advice="choose another name",
        )


def _folder(
    out: Path, runs: tuple[str, ...], why_folder: str, report: Path | None, read: Iterable[str | Path]
) -> Destination:
    from selector.readers.writing import run_files

    if out.suffix.lower() == ".csv" and not out.is_dir():
        raise OptionError(
            f"{out.name!r} for {len(runs)} runs",
            expected=f"a folder: {why_folder}",
            where=f"--out {out}",
            advice="name a folder, e.g. --out simulated",
        )
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
        raise type(error)(error.found, expected=error.expected, where=where, advice=error.advice) from error


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
        raise type(error)(error.found, expected=error.expected, where=where, advice=error.advice) from error


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
    with named_as_asked(), written_together([*pages, *targets.values(), machine_path]) as drafts:
        if page is not None and report is not None:
            page(drafts[report])
        at = {run: drafts[path] for run, path in targets.items()}
        write_recording(recording, at, drafts[machine_path], f"{name}{LABEL}")
