"""What `diagnose --out` writes: the answer, its page, the improved model or a correction, and the study."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from selector import atomic_file
from selector.cli.shared.studying import OpenedStudy, recording_entries, write_study_beside

if TYPE_CHECKING:
    from selector.cli.shared.diagnosed.answer import Answer
    from selector.cli.shared.diagnosed.asked import Asked
    from selector.cli.shared.source import Source
    from selector.controllers.model_file import ModelFile
    from selector.diagnosis.answer import Diagnosis
    from selector.diagnosis.open_model.modelled import Improved
    from selector.readers import Reading


_HEAD = "Written by `selector diagnose --model`: the model with what the recordings say was left out."
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
    from selector.telling.diagnosed.account import diagnosis_account
    from selector.telling.page import write_account

    found, improved = answer.found, answer.improved
    written = ["diagnosis.json", "report.html"]
    if improved is not None:
        written.append(_write_improved(improved, folder).name)
    written += write_correction(found, improved, answer.correction, folder)
    text = json_text(found.as_dict()) + "\n"
    (folder / "diagnosis.json").write_text(text, encoding="utf-8", newline="\n")
    description = answer.recorded.description()
    account = diagnosis_account(found, provenance=answer.told, description=description, drawn=True)
    write_account(account, folder / "report.html")
    return written


def _write_improved(improved: Improved, folder: Path) -> Path:
    """improved.toml, for `selector simulate`: what was put in, everything fitted together."""
    errors = improved.refit.comparison
    head = "\n".join([
        _HEAD,
        f"Put in: {', '.join(improved.added)}.",
        f"Fitted to the runs {', '.join(errors.runs)}, but for what was held out.",
        *(f"Not in it, its file cannot express it: {name}." for name in improved.not_in_it),
    ])  # fmt: skip
    path = folder / "improved.toml"
    path.write_text(improved.model.text(head), encoding="utf-8", newline="\n")
    return path


def write_correction(
    found: Diagnosis, improved: Improved | None, model: ModelFile | None, folder: Path
) -> tuple[str, ...]:
    """correction.json, what is to be added to the simulation run by run, and model.json if there is a `model`.

    Neither where nothing of physics was named, or where all of it is in the improved model; names of what was written.
    """
    from selector.cli.shared.diagnosed.answer import is_corrected
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
    """Ends with an error where a file stands in `folder` in the place of one of ours, and no diagnosis wrote it.

    Raises OptionError: there is such a file.
    """
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

    files = recording_entries(out, source, [(run.file, run.sha256) for run in recorded.runs], recorded.machine_file)
    if simulated is not None and asked.simulation:
        known = {run.file: run.sha256 for run in simulated.runs}
        read = recording_files(asked.simulation).files
        files += [input_file(file, out, "simulation", known.get(str(file))) for file in read]
    if asked.model is not None:
        files.append(input_file(asked.model, out, "model"))
    section = diagnose_section(
        out,
        **vars(asked) | {"simulation": asked.simulation or (), "responses": tuple(asked.responses or ())},
    )
    return write_study_beside(folder, out, source, files, opened=opened, diagnose=section)
