"""Which model does `diagnose --model` run again, and what does it write: the improved model, or a correction."""

from __future__ import annotations

import dataclasses
import tomllib
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from selector.errors import ModelFileError, OptionError

if TYPE_CHECKING:
    from selector.controllers.model_file import ModelFile
    from selector.diagnosis.answer import Diagnosis, NamedEffect
    from selector.diagnosis.open_model.modelled import Improved, Modelled
    from selector.diagnosis.open_model.runnable import Kind, Runnable
    from selector.recording import Recording

_HEAD = "Written by `selector diagnose --model`: the model with what the recordings say was left out."
_CORRECTION = "selector.correction/1"
_BEGINNING_BYTES = 400
_THERMAL_ROLES = {"spindle_speed_rpm": "spindle_speed", "ambient_degc": "ambient", "coolant_degc": "temperature"}


def diagnosed_model(
    model: Path,
    recording: Recording,
    responses: list[str] | None,
    holdout: str,
    seed: int,
    false_alarm: float,
    progress: Callable[[int, int, str], None],
) -> Modelled:
    """The diagnosis of a model file of ours (mode C) or of an FMU (mode B) that the recordings drive.

    Raises
    ------
    InputError
        It cannot be read, or the recordings cannot drive it.
    """
    from selector.cli.simulating import named
    from selector.diagnosis.open_model.modelled import diagnosis_of_model

    with named(model), _runnable(model, recording) as runnable:
        return diagnosis_of_model(
            runnable,
            recording,
            responses=responses or None,
            holdout=holdout,
            seed=seed,
            false_alarm=false_alarm,
            progress=progress,
        )


def write_improved(improved: Improved, folder: Path) -> Path:
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


@contextmanager
def _runnable(model: Path, recording: Recording) -> Iterator[Runnable]:
    if model.suffix.lower() == ".fmu":
        from selector.diagnosis.open_model.fmu import fmu_model

        with fmu_model(model, recording) as unit:
            yield unit
        return
    from selector.diagnosis.open_model.runnable import OwnModel

    kind, file, columns = _read(model)
    yield OwnModel(kind, file, recording, columns)


def _read(model: Path) -> tuple[Kind, Any, dict[str, Any]]:
    """Physics and content of a model file, and the columns of files beside it that it refers to."""
    from selector.cli.simulation_columns import columns_beside

    physics = _physics(model)
    if physics == "thermal":
        from selector.physics.thermal.model_file import columns_needed as heat_needs
        from selector.physics.thermal.model_file import read_model_file as read_heat

        heat = read_heat(model)
        return physics, heat, columns_beside(model, heat_needs(heat), _THERMAL_ROLES, "conditions.")[0]
    if physics == "drive":
        from selector.physics.drive.model_file import COLUMN_ROLES
        from selector.physics.drive.model_file import columns_needed as drive_needs
        from selector.physics.drive.model_file import read_model_file as read_drive

        drive = read_drive(model)
        return physics, drive, columns_beside(model, drive_needs(drive), COLUMN_ROLES)[0]
    if physics == "vibration":
        from selector.physics.vibration.model_file import read_model_file as read_vibration

        return physics, read_vibration(model), {}
    from selector.physics.gauging.model_file import read_model_file as read_gauging

    return physics, read_gauging(model), {}


def _physics(model: Path) -> Kind:
    """What `kind` in a model file says; a file that says nothing of use is left to a reader that complains."""
    from selector.physics.model_text import FAMILY_OF_KIND, LARGEST_FILE_BYTES

    if model.suffix.lower() != ".toml":
        raise OptionError(
            f"{model.name!r}",
            expected="a model file of `selector simulate` (.toml), or a functional mock-up unit (.fmu)",
            where="--model",
            advice="give simulated runs with --simulation if there is no such model",
        )
    if model.exists() and not model.is_file():
        # the reader refuses it; opening a pipe would wait for ever
        return "thermal"
    found: Any = None
    try:
        with model.open("rb") as file:
            text = file.read(LARGEST_FILE_BYTES).decode("utf-8-sig", errors="replace")
        section = tomllib.loads(text.replace("\r\n", "\n")).get("model")
        found = section.get("kind") if isinstance(section, dict) else None
    except (OSError, tomllib.TOMLDecodeError, RecursionError):
        return "thermal"
    if not isinstance(found, str) or found not in FAMILY_OF_KIND:
        raise ModelFileError(
            "no kind of model" if found is None else f"kind {found!r}",
            expected="one of " + ", ".join(FAMILY_OF_KIND),
            where=f"{model}, key model.kind",
            advice='begin the file with [model], kind = "drive" and name = "…"',
        )
    return FAMILY_OF_KIND[found]  # type: ignore[return-value]


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
    """correction.json, what the effects add to the simulation run by run, and model.json if there is a `model`.

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
    physics = _physics_of(found)
    comparison = found.comparison
    courses = {name: sum(effect.courses[name] for effect in physics if name in effect.courses) for name in found.fit}
    runs = {
        run: {
            "time_s": comparison.time_s[rows].tolist(),
            "add": {name: course[rows].tolist() for name, course in courses.items() if not isinstance(course, int)},
        }
        for run, rows in comparison.rows_of_runs()
    }
    text = json_text({
        "schema": _CORRECTION,
        "effects": [effect.id for effect in physics],
        "units": {name: comparison.channel(name).unit for name in courses},
        "runs": runs,
    })  # fmt: skip
    (folder / "correction.json").write_text(text + "\n", encoding="utf-8", newline="\n")
    if model is None:
        return ("correction.json",)
    write_model(model, folder / "model.json")
    return ("correction.json", "model.json")


def earlier_answer(folder: Path) -> tuple[str, ...]:
    """Files beside an answer that an earlier diagnosis wrote into this folder, and that not every one writes.

    A file of the same name that something else wrote is none of them.
    """
    written: dict[str, Callable[[str], bool]] = {
        "correction.json": lambda text: f'"schema": "{_CORRECTION}"' in text,
        "model.json": lambda text: '"name": "correction of ' in text,
        "improved.toml": lambda text: text.startswith(f"# {_HEAD}"),
    }
    if not (folder / "diagnosis.json").is_file():
        return ()
    return tuple(name for name, is_ours in written.items() if is_ours(_beginning(folder / name)))


def _beginning(path: Path) -> str:
    if not path.is_file():
        return ""
    with path.open("rb") as file:
        return file.read(_BEGINNING_BYTES).decode("utf-8", errors="replace")


def _is_corrected(found: Diagnosis, improved: Improved | None) -> bool:
    return bool(_physics_of(found)) and (improved is None or bool(improved.not_in_it))


def _physics_of(found: Diagnosis) -> list[NamedEffect]:
    return [effect for effect in found.effects if not effect.id.startswith("data.")]
