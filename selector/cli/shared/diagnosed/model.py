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
    from selector.cli.shared.diagnosed.asked import Asked
    from selector.diagnosis.open_model.modelled import Modelled
    from selector.diagnosis.open_model.runnable import Runnable
    from selector.physics.simulation_kind import SimulationKind
    from selector.recording import Recording

Progress = Callable[[int, int, str], None]

_LINE_S = 10.0


def diagnosed_model(model: Path, recording: Recording, asked: Asked, progress: Progress) -> Modelled:
    """The diagnosis of a model file of ours (mode C) or of an FMU (mode B) that the recordings drive.

    Raises InputError: it cannot be read, or the recordings cannot drive it.
    """
    from selector.cli.shared.simulation_files import named
    from selector.diagnosis.open_model.modelled import diagnosis_of_model

    with named(model), _runnable(model, recording) as runnable, _told(progress) as say:
        return diagnosis_of_model(
            runnable,
            recording,
            responses=asked.responses or None,
            holdout=asked.holdout,
            seed=asked.seed,
            false_alarm=asked.false_alarm,
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
    columns = columns_beside(model, kind.columns_needed(file), kind.column_roles(), kind.column_section)[0]
    return kind.name, file, columns


def _kind_of(model: Path) -> SimulationKind:
    """What `kind` in a model file says; a file that says nothing of use is left to a reader that complains."""
    from selector.physics.model_text import LARGEST_FILE_BYTES
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
    found: Any = None
    try:
        with model.open("rb") as file:
            text = file.read(LARGEST_FILE_BYTES).decode("utf-8-sig", errors="replace")
        section = tomllib.loads(text.replace("\r\n", "\n")).get("model")
        found = section.get("kind") if isinstance(section, dict) else None
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
