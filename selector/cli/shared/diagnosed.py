"""What a diagnosis is asked, on the command line or by a study, what answers it, and what `--out` writes."""

from __future__ import annotations

import dataclasses
import hashlib
import tomllib
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from selector import atomic_file
from selector.cli.shared.option_table import option
from selector.cli.shared.studying import OpenedStudy, recording_entries, write_study_beside
from selector.errors import ModelFileError, OptionError

if TYPE_CHECKING:
    from selector.cli.shared.source import Source
    from selector.controllers.model_file import ModelFile
    from selector.diagnosis.answer import Diagnosis
    from selector.diagnosis.comparison import Comparison
    from selector.diagnosis.open_model.modelled import Improved, Modelled
    from selector.diagnosis.open_model.runnable import Runnable
    from selector.physics.simulation_kind import Progress, SimulationKind
    from selector.readers import Reading
    from selector.recording import Recording


@dataclass(frozen=True)
class Asked:
    """The options of `diagnose`, one field an option."""

    simulation: Annotated[list[Path] | None, option("diagnose --simulation")] = None
    model: Annotated[Path | None, option("diagnose --model")] = None
    simulation_time_unit: Annotated[str | None, option("diagnose --simulation-time-unit")] = None
    responses: Annotated[list[str] | None, option("diagnose --response")] = None
    holdout: Annotated[str, option("diagnose --holdout")] = "last"
    seed: Annotated[int, option("diagnose --seed")] = 0
    false_alarm: Annotated[float, option("diagnose --false-alarm")] = 0.02


def asked_of(opened: OpenedStudy) -> Asked:
    """What the ``[diagnose]`` of a study asks. Raises StudyError: it has none."""
    from selector.study import path_at
    from selector.study.asked import require_diagnose

    section = require_diagnose(opened.study, where=str(opened.place))
    at_place = {
        "simulation": [path_at(path, opened.folder) for path in section.simulation] or None,
        "model": None if section.model is None else path_at(section.model, opened.folder),
        "responses": list(section.responses) or None,
    }
    return Asked(**section.model_dump() | at_place)


def require_usable(asked: Asked) -> None:
    """Ends with an error when options contradict each other or are out of their limits."""
    both = asked.simulation and asked.model
    _require(not both, "--simulation and --model", "one of them", "command line", "leave one out")
    _require(
        asked.simulation_time_unit is None or not asked.model,
        "a unit of time beside a model, which is driven at the times of the recordings",
        "simulated runs that it is of",
        "--simulation-time-unit",
        "leave it out",
    )
    _require(0 <= asked.seed < 2**53, str(asked.seed), "a whole number from 0 below 2^53", "--seed", "e.g. --seed 0")
    _require(
        0.0 < asked.false_alarm <= 0.2,
        str(asked.false_alarm),
        "a probability above 0 and up to 0.2",
        "--false-alarm",
        "e.g. 0.02",
    )


def _require(holds: bool, found: str, expected: str, where: str, advice: str) -> None:
    if not holds:
        raise OptionError(found, expected=expected, where=where, advice=advice)


def diagnosed_model(model: Path, recording: Recording, asked: Asked, progress: Progress) -> Modelled:
    """The diagnosis of a model file of ours (mode C) or of an FMU (mode B) that the recordings drive.

    Raises InputError: it cannot be read, or the recordings cannot drive it.
    """
    from selector.cli.shared.simulation_files import named
    from selector.diagnosis.open_model.modelled import diagnosis_of_model

    with named(model), _runnable(model, recording) as runnable:
        return diagnosis_of_model(
            runnable,
            recording,
            responses=asked.responses or None,
            holdout=asked.holdout,
            seed=asked.seed,
            false_alarm=asked.false_alarm,
            progress=progress,
        )


@contextmanager
def _runnable(model: Path, recording: Recording) -> Iterator[Runnable]:
    if model.suffix.lower() == ".fmu":
        from selector.diagnosis.open_model.runnable import fmu_model

        with fmu_model(model, recording) as unit:
            yield unit
        return
    from selector.diagnosis.open_model.runnable import OwnModel

    kind, file, columns = _read(model)
    yield OwnModel(kind, file, recording, columns)


def _read(model: Path) -> tuple[str, Any, dict[str, Any]]:
    """Kind and content of a model file, and the columns of files beside it that it refers to."""
    from selector.cli.shared.simulation_inputs import columns_beside

    kind = _kind_of(model)
    file = kind.read(model)
    columns, _ = columns_beside(model, kind.columns_needed(file), kind.column_roles(), kind.column_section)
    return kind.name, file, columns


def _kind_of(model: Path) -> SimulationKind:
    """What `kind` in a model file says; a file that says nothing of use is left to a reader that complains."""
    from selector.physics.model_text import word_of_kind
    from selector.physics.simulation_kind import kind_of_file, simulation_kinds

    kinds = simulation_kinds()
    if model.suffix.lower() != ".toml":
        raise OptionError(
            f"{model.name!r}",
            expected="a model file of `selector simulate` (.toml), or a functional mock-up unit (.fmu)",
            where="--model",
            advice="give simulated runs with --simulation if there is no such model",
        )
    if model.exists() and not model.is_file():
        # the reader refuses it; opening a pipe would wait for ever
        return kinds["thermal"]
    try:
        found = word_of_kind(model)
    except (OSError, tomllib.TOMLDecodeError, RecursionError):
        return kinds["thermal"]
    kind = kind_of_file(found) if isinstance(found, str) else None
    if kind is None:
        raise ModelFileError(
            "no kind of model" if found is None else f"kind {found!r}",
            expected="one of " + ", ".join(word for one in kinds.values() for word in one.file_kinds),
            where=f"{model}, key model.kind",
            advice='begin the file with [model], kind = "drive" and name = "…"',
        )
    return kind


@dataclass(frozen=True)
class Answer:
    """A diagnosis, what is written beside it, and what it was made from; `told` is its provenance."""

    found: Diagnosis
    improved: Improved | None
    correction: ModelFile | None
    recorded: Reading
    simulated: Reading | None
    told: dict[str, Any]


def answered(source: Source, asked: Asked, progress: Callable[[str, float], None]) -> Answer:
    """Read, compare and diagnose. Raises InputError: a file cannot be read, or what is asked cannot be answered."""
    from selector.study.data import without_folders

    progress("reading", 0.0)
    improved, simulated = None, None

    def say(done: int, total: int, text: str) -> None:
        progress(text, 0.05 + 0.95 * done / max(total, 1))

    _require(
        asked.model is None or source.mean_s is None, "--mean-s beside --model", "inputs as they were recorded",
        "--mean-s", "leave it out: a mean of the speed does not drive a model as the speed does",
    )  # fmt: skip
    recorded = source.reading()
    if asked.model is not None:
        done = diagnosed_model(asked.model, recorded.recording, asked, say)
        findings, improved = without_folders((*recorded.findings, *done.answer.findings)), done.improved
        found = dataclasses.replace(done.answer, findings=findings)
    else:
        from selector.diagnosis.workflow import diagnosis

        comparison, simulated = _compared(source, recorded, asked)
        found = diagnosis(comparison, seed=asked.seed, false_alarm=asked.false_alarm, progress=say)
    found, correction = correction_told(found, improved)
    options = {"holdout": asked.holdout, "false alarm": f"{asked.false_alarm:g}", "response": asked.responses}
    told = _provenance(recorded, simulated, asked.model, options)
    return Answer(found, improved, correction, recorded, simulated, told)


def _compared(source: Source, recorded: Reading, asked: Asked) -> tuple[Comparison, Reading]:
    """The recordings of a command line beside their simulation, and how that was read.

    Raises InputError: a file cannot be read, or the two cannot be compared.
    """
    from selector.cli.shared.simulation_inputs import not_simulated, simulated_reading
    from selector.diagnosis.matching.alignment import comparison_of
    from selector.readers.finding_table import CHANNELS_LACKING, COLUMNS_IGNORED
    from selector.study.data import without_folders

    if not asked.simulation:
        raise OptionError(
            "nothing to compare the recordings with",
            expected="simulated runs, named as the recorded ones",
            where="--simulation",
            advice="add --simulation PATH with a folder, or once for each file; or --model MODEL.toml",
        )
    simulated = simulated_reading(asked.simulation, recorded, source.overrides(), asked.simulation_time_unit)
    comparison = comparison_of(
        recorded.recording, simulated.recording, responses=asked.responses or None, holdout=asked.holdout
    )
    told = [dataclasses.replace(f, statement=f"Simulation: {f.statement}") for f in simulated.findings]
    said = [finding for finding in told if finding.id not in (COLUMNS_IGNORED, CHANNELS_LACKING)]
    if not asked.responses:
        said += not_simulated(recorded.recording, simulated.recording, comparison.responses)
    findings = without_folders((*recorded.findings, *said, *comparison.findings))
    return dataclasses.replace(comparison, findings=findings), simulated


def _provenance(
    recorded: Reading, simulated: Reading | None, model: Path | None, options: dict[str, Any]
) -> dict[str, Any]:
    """Files with their SHA-256, and what was asked, as the report shows them."""
    from selector.readers.roles.names import printable_name
    from selector.study.data import provenance_of

    told = provenance_of(recorded)
    if simulated is not None:
        told["runs"] |= {f"{run}, simulated": entry for run, entry in provenance_of(simulated)["runs"].items()}
    asked = {name: value for name, value in options.items() if value}
    if model is not None:
        asked["model"] = printable_name(model.name)
        asked["SHA-256 of the model"] = hashlib.sha256(model.read_bytes()).hexdigest()
    return told | asked


def correction_told(found: Diagnosis, improved: Improved | None) -> tuple[Diagnosis, ModelFile | None]:
    """The answer with what is to be said of its correction, and the model file of that if a control can compute it."""
    from selector.controllers.from_diagnosis import correction_of

    if not is_corrected(found, improved):
        return found, None
    model, findings = correction_of(found)
    return dataclasses.replace(found, findings=(*found.findings, *findings)), model


def is_corrected(found: Diagnosis, improved: Improved | None) -> bool:
    """Whether physics is named that is not in an improved model."""
    from selector.diagnosis.answer import physics_of

    return bool(physics_of(found)) and (improved is None or bool(improved.not_in_it))


#: File → what its beginning holds if a diagnosis wrote it.
_OURS = {
    "diagnosis.json": '"schema": "selector.diagnosis/1"',
    "report.html": "<title>What the simulation left out",
    "correction.json": '"schema": "selector.correction/1"',
    "model.json": '"name": "correction of ',
    "improved.toml": "# Written by `selector diagnose",
    "study.toml": "[diagnose]",
}


def write_results(answer: Answer, folder: Path) -> list[str]:
    """diagnosis.json, report.html, and the improved model or a correction, into a folder; their names."""
    from selector.cli.shared.showing import json_text
    from selector.telling.diagnosed import diagnosis_account
    from selector.telling.page import write_account

    found, improved = answer.found, answer.improved
    written = ["diagnosis.json", "report.html"]
    texts = {"diagnosis.json": json_text(found.as_dict()) + "\n"}
    if improved is not None:
        written.append("improved.toml")
        texts["improved.toml"] = improved.model.text(_head_of(improved))
    for name, text in texts.items():
        (folder / name).write_text(text, encoding="utf-8", newline="\n")
    written += write_correction(found, improved, answer.correction, folder)
    description = answer.recorded.description()
    account = diagnosis_account(found, provenance=answer.told, description=description, drawn=True)
    write_account(account, folder / "report.html")
    return written


def _head_of(improved: Improved) -> str:
    """What the model file says of itself: what was put in, everything fitted together."""
    return "\n".join([
        "Written by `selector diagnose --model`: the model with what the recordings say was left out.",
        f"Put in: {', '.join(improved.added)}.",
        f"Fitted to the runs {', '.join(improved.refit.comparison.runs)}, but for what was held out.",
        *(f"Not in it, its file cannot express it: {name}." for name in improved.not_in_it),
    ])  # fmt: skip


def write_correction(
    found: Diagnosis, improved: Improved | None, model: ModelFile | None, folder: Path
) -> tuple[str, ...]:
    """correction.json, what is to be added to the simulation run by run, and model.json if there is a `model`.

    Neither where nothing of physics was named, or where all of it is in the improved model; names of what was written.
    """
    from selector.cli.shared.showing import json_text
    from selector.controllers import write_model
    from selector.diagnosis.answer import correction_object

    if not is_corrected(found, improved):
        return ()
    (folder / "correction.json").write_text(json_text(correction_object(found)) + "\n", encoding="utf-8", newline="\n")
    if model is None:
        return ("correction.json",)
    write_model(model, folder / "model.json")
    return ("correction.json", "model.json")


def require_replaceable(folder: Path, *, with_model: bool) -> None:
    """Raises OptionError: in `folder` a file stands in the place of one of ours, and no diagnosis wrote it."""
    atomic_file.require_replaceable(
        folder, {name: mark for name, mark in _OURS.items() if with_model or name != "improved.toml"}
    )


def earlier_answer(folder: Path) -> tuple[str, ...]:
    """Files in this folder that an earlier diagnosis wrote; one of the same name by something else is none of them."""
    return tuple(name for name, mark in _OURS.items() if atomic_file.begins_with(folder / name, mark))


def write_diagnosis_study(
    folder: Path,
    out: Path,
    source: Source,
    asked: Asked,
    recorded: Reading,
    simulated: Reading | None,
    opened: OpenedStudy | None,
) -> list[str]:
    """study.toml of a diagnosis into a `folder` that holds its results and becomes `out`; the names written."""
    from selector.readers.files import recording_files
    from selector.study import diagnose_section, input_file

    files = recording_entries(out, source, recorded.files, recorded.machine_file)
    if simulated is not None and asked.simulation:
        known = {run.file: run.sha256 for run in simulated.runs}
        read = recording_files(asked.simulation).files
        files += [input_file(file, out, "simulation", known.get(str(file))) for file in read]
    if asked.model is not None:
        files.append(input_file(asked.model, out, "model"))
    section = diagnose_section(
        out, **vars(asked) | {"simulation": asked.simulation or (), "responses": tuple(asked.responses or ())}
    )
    return write_study_beside(folder, out, source, files, opened=opened, diagnose=section)
