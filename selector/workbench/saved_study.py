"""What was asked: the study file of a study folder, and whether answers in it were asked as the form asks now."""

from __future__ import annotations

import dataclasses
import functools
import math
from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path

from selector.controllers import decided_limits, read_model
from selector.controllers.guard.decided import is_turned, with_turned_signs
from selector.controllers.model_file import ModelFile, model_text
from selector.controllers.writers.targets import TARGETS
from selector.errors import InputError, OptionError
from selector.readers import Overrides, Reading
from selector.readers.files import recording_files
from selector.selection import Options
from selector.study import (
    STUDY_FILE,
    DiagnoseSection,
    ExportSection,
    InputFile,
    SelectSection,
    export_section,
    input_file,
    options_of,
    overrides_of,
    path_at,
    read_study,
    select_section,
    study_of,
    write_study,
)
from selector.workbench.commands import Export, option_of
from selector.workbench.typed import FIELDS


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
        raise OptionError(
            "no recordings", expected="recordings that can be read", where="study file", advice="load some first"
        )
    files: dict[str, InputFile] = {}
    for run in reading.runs:
        files[run.file] = input_file(run.file, folder, "recording", run.sha256)
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
    model, clamp, slew = said.model or "", dict(said.clamp), dict(said.slew)
    return Export(model, said.target, replayed, clamp_um=clamp, slew_um_per_s=slew, inverted=said.invert)


def _export_section(asked: Export, folder: Path) -> ExportSection:
    replayed = asked.replayed or ()
    said = {"target": asked.target, "clamp": dict(asked.clamp_um), "slew": dict(asked.slew_um_per_s)}
    return export_section(folder, model=folder / asked.model, replay=replayed, **said, invert=asked.inverted)


def other_than_asked(answer: Path, options: Options, overrides: Overrides, runs: tuple[Path, ...]) -> tuple[str, ...]:
    """What is asked otherwise now than when the selection in the folder `answer` was made, in the words of the fields.

    Nothing where it was asked the same, or where no study file lies there.
    """
    try:
        study = read_study(answer / STUDY_FILE)
    except InputError:
        return ()
    then, now = study.select, select_section(options)
    if then is None:
        return ()
    fields = [name for name in SelectSection.model_fields if getattr(then, name) != getattr(now, name)]
    found = [FIELDS.get("--response" if name == "responses" else option_of(name), name) for name in fields]
    if {path_at(run, answer).resolve() for run in study.recordings.runs} != {run.resolve() for run in runs}:
        found.append("the recordings")
    if overrides_of(study) != overrides:
        found.append("how they are read")
    return tuple(found)


MODEL, SHEET = "model.json", "commissioning.html"
_UNVERIFIED = "SIGN UNVERIFIED"
_NEAR = 1e-9  #: A command says twelve digits.


def model_at(path: Path) -> ModelFile | None:
    """The model in a file; None: there is none that can be read."""
    try:
        return _read(path, path.stat().st_mtime_ns)
    except (OSError, InputError):
        return None


@functools.lru_cache(maxsize=8)
def _read(path: Path, _: int) -> ModelFile:
    return read_model(path)


def other_than_exported(
    files: Path, model: Path, asked: Export, now: Sequence[str], then: Sequence[str] | None
) -> tuple[str, ...]:
    """What is asked otherwise now than when the files in the folder `files` were written, in the words of the fields.

    `model` is the file that would be exported now; without `then`, the command that wrote the files, another session
    did.
    """
    here, there = model_at(model), model_at(files / MODEL)
    if here is None or there is None:
        return ()
    named = [output.name for output in here.outputs]
    if named != [output.name for output in there.outputs]:
        return ("the model",)
    turned_then = [output.name for output in there.outputs if is_turned(output)]
    here = with_turned_signs(here, [name for name in asked.inverted if name in named])
    found = []
    if _bare(with_turned_signs(here, turned_then)) != _bare(with_turned_signs(there, [*_turned(here)])):
        found.append("the model")
    limits, before = decided_limits(here)[0], decided_limits(there)[0]
    has_guard = TARGETS[asked.target].has_guard
    for option, key, values in (
        ("--clamp", "clamp_um", asked.clamp_um),
        ("--slew", "slew_um_per_s", asked.slew_um_per_s),
    ):
        for name in named:
            limit = getattr(limits[name], key)
            limit = values.get(name, limit) if has_guard else limit
            if not math.isclose(limit, getattr(before[name], key), rel_tol=_NEAR):
                found.append(f"{FIELDS[option]} of {name}")
    if _turned(here) != _turned(there):
        found.append(FIELDS["--invert"])
    sheet = files / SHEET
    is_unverified = sheet.is_file() and _UNVERIFIED in sheet.read_text(encoding="utf-8", errors="replace")
    if is_unverified == asked.is_sign_verified:
        found.append(FIELDS["--sign-verified"])
    if then is not None:
        if _said(now, "--tested") != _said(then, "--tested"):
            found.append(FIELDS["--tested"])
        if set(_said(now, "--replay")) != set(_said(then, "--replay")):
            found.append("the recordings to run through the program")
    return tuple(found)


def _turned(model: ModelFile) -> tuple[str, ...]:
    return tuple(output.name for output in model.outputs if is_turned(output))


def _bare(model: ModelFile) -> str:
    """The model without limits, which an export fills in."""
    return model_text(model.model_copy(update={"guard": model.guard.model_copy(update={"limits": ()})}))


def _said(command: Sequence[str], option: str) -> list[str]:
    return [value for word, value in pairwise(command) if word == option]
