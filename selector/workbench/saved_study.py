"""What was asked: the study file of a study folder, and whether answers in it were asked as the form asks now."""

import dataclasses
import functools
from pathlib import Path
from typing import Any

from selector.controllers import read_model
from selector.controllers.model_file import ModelFile
from selector.controllers.writers.targets import TARGETS
from selector.errors import InputError
from selector.readers import Overrides, Reading
from selector.readers.files import recording_files
from selector.selection import Options
from selector.study import (
    STUDY_FILE,
    DiagnoseSection,
    ExportSection,
    InputFile,
    export_section,
    input_file,
    options_of,
    overrides_of,
    path_at,
    read_study,
    study_of,
    write_study,
)
from selector.workbench.commands import Export
from selector.workbench.study_folder import no_recordings


@dataclasses.dataclass(frozen=True)
class Asked:
    """What a study file says, with the paths of this machine."""

    runs: tuple[Path, ...] = ()
    machine: Path | None = None
    overrides: Overrides = dataclasses.field(default_factory=Overrides)
    options: Options = dataclasses.field(default_factory=Options)
    diagnosis: DiagnoseSection = dataclasses.field(default_factory=DiagnoseSection)
    export: Export = dataclasses.field(default_factory=Export)


def asked_in(folder: Path) -> Asked | None:
    """What the study file of a folder asks; None: there is none.

    Raises InputError: it cannot be used, or a folder that it names holds no recording.
    """
    place = folder / STUDY_FILE
    if not place.exists():
        return None
    study = read_study(place)
    machine = study.recordings.machine
    runs = [path_at(run, folder) for run in study.recordings.runs]
    files = [recording_files([run]).files if run.is_dir() else (run,) for run in runs]
    return Asked(
        tuple(file for inside in files for file in inside),
        None if machine is None else path_at(machine, folder),
        overrides_of(study),
        Options() if study.select is None else options_of(study, where=str(place)),
        study.diagnose or DiagnoseSection(),
        _export_of(study.export, folder),
    )


def save(folder: Path, asked: Asked, reading: Reading | None, simulated: tuple[Path, ...]) -> Path:
    """Writes the study file of a folder, whole or not at all; where it is.

    Files that were read are named with their SHA-256, so that another recording under the same name is noticed.

    Raises OptionError: there is no recording, or an option cannot stand in a study file.
    """
    if reading is None or not asked.runs:
        raise no_recordings("study file")
    files: dict[str, InputFile] = {}
    for file, sha256 in reading.files:
        files[file] = input_file(file, folder, "recording", sha256)
    if asked.machine is not None:
        files[str(asked.machine)] = input_file(asked.machine, folder, "machine")
    is_compared = bool(asked.diagnosis.simulation or asked.diagnosis.model)
    for path in simulated if is_compared else ():
        files[str(path)] = input_file(path, folder, "model" if asked.diagnosis.model else "simulation")
    study = study_of(
        folder,
        asked.runs,
        machine=asked.machine,
        overrides=asked.overrides,
        select=asked.options,
        diagnose=asked.diagnosis if is_compared else None,
        export=_export_section(asked.export, folder) if asked.export.model else None,
        files=tuple(files.values()),
    )
    place = folder / STUDY_FILE
    write_study(study, place)
    return place


def _export_of(said: ExportSection | None, folder: Path) -> Export:
    """What is asked of an export; that the sign test was passed is never taken up."""
    if said is None or said.target not in TARGETS:
        return Export()
    replayed = tuple(path_at(path, folder) for path in said.replay)
    return Export(
        said.model or "", said.target, replayed, clamp_um=dict(said.clamp), slew_um_per_s=dict(said.slew),
        margin=said.margin or 0.0, inverted=said.invert,
    )  # fmt: skip


def _export_section(asked: Export, folder: Path) -> ExportSection:
    said: dict[str, Any] = {"target": asked.target, "clamp": dict(asked.clamp_um), "slew": dict(asked.slew_um_per_s)}
    said |= {"replay": asked.replayed or (), "margin": asked.margin or None, "invert": asked.inverted}
    return export_section(folder, model=folder / asked.model, **said)


MODEL, SHEET = "model.json", "commissioning.html"


def model_at(path: Path) -> ModelFile | None:
    """The model in a file; None: there is none that can be read."""
    try:
        return _read(path, path.stat().st_mtime_ns)
    except (OSError, InputError):
        return None


@functools.lru_cache(maxsize=8)
def _read(path: Path, _: int) -> ModelFile:
    return read_model(path)
