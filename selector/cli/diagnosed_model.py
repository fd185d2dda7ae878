"""Which model does `diagnose --model` run again, and what does it write: the improved model, or a correction."""

from __future__ import annotations

import sys
import threading
import time
import tomllib
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from selector.errors import ModelFileError, OptionError

if TYPE_CHECKING:
    from selector.diagnosis.open_model.modelled import Improved, Modelled
    from selector.diagnosis.open_model.runnable import Kind, Runnable
    from selector.recording import Recording

Progress = Callable[[int, int, str], None]

_HEAD = "Written by `selector diagnose --model`: the model with what the recordings say was left out."
_LINE_S = 10.0
_THERMAL_ROLES = {"spindle_speed_rpm": "spindle_speed", "ambient_degc": "ambient", "coolant_degc": "temperature"}


def diagnosed_model(
    model: Path,
    recording: Recording,
    responses: list[str] | None,
    holdout: str,
    seed: int,
    false_alarm: float,
    progress: Progress,
) -> Modelled:
    """The diagnosis of a model file of ours (mode C) or of an FMU (mode B) that the recordings drive.

    Raises
    ------
    InputError
        It cannot be read, or the recordings cannot drive it.
    """
    from selector.cli.simulating import named
    from selector.diagnosis.open_model.modelled import diagnosis_of_model

    with named(model), _runnable(model, recording) as runnable, _told(progress) as say:
        return diagnosis_of_model(
            runnable,
            recording,
            responses=responses or None,
            holdout=holdout,
            seed=seed,
            false_alarm=false_alarm,
            progress=say,
        )


@contextmanager
def _told(progress: Progress) -> Iterator[Progress]:
    """The progress, and on a stderr that is no terminal, which shows no bar, a line of it every ten seconds."""
    if sys.stderr.isatty():
        yield progress
        return
    begun, done, latest = time.monotonic(), threading.Event(), ["beginning"]

    def say(step: int, total: int, text: str) -> None:
        progress(step, total, text)
        latest[0] = f"about {step / max(total, 1):.0%} done, {text}"

    def write() -> None:
        while not done.wait(_LINE_S):
            sys.stderr.write(f"selector: {time.monotonic() - begun:.0f} s: {latest[0]}\n")
            sys.stderr.flush()

    writer = threading.Thread(target=write, daemon=True)
    writer.start()
    try:
        yield say
    finally:
        done.set()
        writer.join(1.0)


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
