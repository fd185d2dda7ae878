"""What `diagnose --out` writes beside its answer, and which files of a folder it may replace."""

from __future__ import annotations

import dataclasses
import hashlib
from pathlib import Path
from typing import TYPE_CHECKING, Any

from selector.errors import OptionError

if TYPE_CHECKING:
    from selector.controllers.model_file import ModelFile
    from selector.diagnosis.answer import Diagnosis
    from selector.diagnosis.open_model.modelled import Improved
    from selector.readers import Reading

_CORRECTION = "selector.correction/1"
_BEGINNING_BYTES = 4000
_OURS = {
    "diagnosis.json": '"schema": "selector.diagnosis/1"',
    "report.html": "<title>What the simulation left out",
    "correction.json": f'"schema": "{_CORRECTION}"',
    "model.json": '"name": "correction of ',
    "improved.toml": "# Written by `selector diagnose",
    "study.toml": "[diagnose]",
}
"""File → what its beginning holds if a diagnosis wrote it."""


def correction_told(found: Diagnosis, improved: Improved | None) -> tuple[Diagnosis, ModelFile | None]:
    """The answer with what is to be said of its correction, and the model file of that if a control can compute it."""
    from selector.controllers.from_diagnosis import correction_of

    if not _is_corrected(found, improved):
        return found, None
    model, findings = correction_of(found)
    return dataclasses.replace(found, findings=(*found.findings, *findings)), model


def write_correction(
    found: Diagnosis, improved: Improved | None, model: ModelFile | None, folder: Path
) -> tuple[str, ...]:
    """correction.json, what is to be added to the simulation run by run, and model.json if there is a `model`.

    Neither where nothing of physics was named, or where all of it is in the improved model.

    Returns
    -------
    tuple of str
        Names of what was written.
    """
    from selector.cli.showing import json_text
    from selector.controllers import write_model

    if not _is_corrected(found, improved):
        return ()
    (folder / "correction.json").write_text(json_text(_correction(found)) + "\n", encoding="utf-8", newline="\n")
    if model is None:
        return ("correction.json",)
    write_model(model, folder / "model.json")
    return ("correction.json", "model.json")


def _correction(found: Diagnosis) -> dict[str, Any]:
    """The content of correction.json: added to the simulation as it was given it makes the error of the answer."""
    from selector.diagnosis.answer import recalibration_of
    from selector.diagnosis.correction import corrections, physics_of

    comparison, of = found.comparison, corrections(found)
    faulty = {name: one.of_recording for name, one in of.items() if one.of_recording.any()}
    runs = {}
    for run, rows in comparison.rows_of_runs():
        runs[run] = {
            "time_s": comparison.time_s[rows].tolist(),
            "add": {name: one.add[rows].tolist() for name, one in of.items()},
            "of_effects": {name: one.of_effects[rows].tolist() for name, one in of.items()},
        }
        if faulty:
            runs[run]["subtract_from_recording"] = {name: course[rows].tolist() for name, course in faulty.items()}
    return {
        "schema": _CORRECTION,
        "effects": [effect.id for effect in physics_of(found)],
        "units": {name: comparison.channel(name).unit for name in of},
        "recalibration": {
            name: {key: dict(vars(one)) for key, one in recalibration_of(found.recalibration[name]).items()}
            for name in of
            if name in found.recalibration
        },
        "runs": runs,
    }


def provenance(
    recorded: Reading, simulated: Reading | None, model: Path | None, options: dict[str, Any]
) -> dict[str, Any]:
    """Files with their SHA-256, and what was asked, as the report shows them."""
    from selector.cli.material import provenance_of
    from selector.readers.names import printable_name

    told = provenance_of(recorded)
    if simulated is not None:
        told["runs"] |= {f"{run}, simulated": entry for run, entry in provenance_of(simulated)["runs"].items()}
    asked = {name: value for name, value in options.items() if value}
    if model is not None:
        asked["model"] = printable_name(model.name)
        asked["SHA-256 of the model"] = hashlib.sha256(model.read_bytes()).hexdigest()
    return told | asked


def require_replaceable(folder: Path, *, with_model: bool) -> None:
    """Ends with an error where a file stands in `folder` in the place of one of ours, and no diagnosis wrote it.

    Raises
    ------
    OptionError
        There is such a file.
    """
    names = [name for name in _OURS if with_model or name != "improved.toml"]
    foreign = [name for name in names if (folder / name).exists() and not _is_ours(folder / name)]
    if foreign:
        raise OptionError(
            f"{', '.join(foreign)} in {folder}, which no `selector diagnose` wrote",
            expected="a new or an empty folder, or one with an earlier diagnosis",
            where="--out",
            advice="choose another folder, or move these files away",
        )


def earlier_answer(folder: Path) -> tuple[str, ...]:
    """Files in this folder that an earlier diagnosis wrote; one of the same name by something else is none of them."""
    return tuple(name for name in _OURS if _is_ours(folder / name))


def _is_ours(path: Path) -> bool:
    if not path.is_file():
        return False
    with path.open("rb") as file:
        beginning = file.read(_BEGINNING_BYTES).decode("utf-8", errors="replace")
    return _OURS[path.name] in beginning


def _is_corrected(found: Diagnosis, improved: Improved | None) -> bool:
    from selector.diagnosis.correction import physics_of

    return bool(physics_of(found)) and (improved is None or bool(improved.not_in_it))
