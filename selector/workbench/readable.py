"""What is read from the recordings on the bench, as far as they can be read, and how their files look."""

from __future__ import annotations

import codecs
import dataclasses
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from selector.errors import InputError
from selector.findings import Finding
from selector.quality import inspect
from selector.readers import Machine, Overrides, Reading, read


@dataclasses.dataclass(frozen=True)
class Loaded:
    """A recording on the bench: where it is, whether it is used, and what the reader said when it refused it."""

    path: Path
    is_used: bool = True
    problem: InputError | None = None


@dataclasses.dataclass(frozen=True)
class Material:
    """What was read from the recordings in use, and what was found on the way; `problem` where nothing was.

    `number` is another one for each reading.
    """

    number: int = 0
    reading: Reading | None = None
    findings: tuple[Finding, ...] = ()
    problem: InputError | None = None


def as_far_as_readable(
    recordings: Iterable[Loaded], machine: Path | None, overrides: Overrides
) -> tuple[dict[Path, Loaded], Material]:
    """The recordings, marked where they are refused even alone; and what was read from those in use that are not."""
    loaded = {one.path: one for one in recordings}
    used = [path for path, one in loaded.items() if one.is_used]
    material = _read_together(used, machine, overrides)
    if material.problem is None:
        return loaded, material
    alone = {path: _read_together([path], machine, overrides).problem for path in used}
    refused = {path: problem for path, problem in alone.items() if problem is not None}
    loaded |= {path: Loaded(path, is_used=False, problem=problem) for path, problem in refused.items()}
    if refused:
        material = _read_together([path for path in used if path not in refused], machine, overrides)
    return loaded, material


def inspected(
    paths: Sequence[Path], machine: Machine | Path | None, overrides: Overrides
) -> tuple[Reading, tuple[Finding, ...]]:
    """What these recordings hold together, and what is found in it.

    Raises InputError: they cannot be read.
    """
    reading = read(paths, machine=machine, overrides=overrides)
    return reading, (*reading.findings, *inspect(reading.recording))


def _read_together(paths: Sequence[Path], machine: Path | None, overrides: Overrides) -> Material:
    if not paths:
        return Material()
    try:
        return Material(0, *inspected(paths, machine, overrides))
    except InputError as problem:
        return Material(problem=problem)
    except Exception as error:
        # the thread that reads must not die silently
        return Material(problem=_input_error(error))


def _input_error(error: Exception) -> InputError:
    if isinstance(error, (OSError, MemoryError)):
        return InputError(
            str(error) or "more data than the memory of this machine holds",
            expected="recordings that can be opened and that fit into memory",
            where="recordings",
            advice="close the program that holds them open, or give fewer of them",
        )
    return InputError(
        f"this is a defect of the program, not of your data: {type(error).__name__}: {error}",
        expected="recordings that are read, or refused with a reason",
        where="recordings",
        advice="report it, with the recording; leave it out meanwhile",
    )


_BYTES = 16_384
_LINES, _SIGNS = 8, 240


def excerpt(file: str | Path, reading: Mapping[str, Any]) -> str:
    """The first lines of a text table as they stand there; empty for other formats, or when it cannot be opened.

    `reading`: how it was read, see `selector.readers.Reading`; its encoding is used.
    """
    encoding = reading.get("encoding")
    if reading.get("format") != "delimited" or not encoding:
        return ""
    try:
        with Path(file).open("rb") as stream:
            beginning = stream.read(_BYTES)
        text = codecs.getincrementaldecoder(encoding)(errors="replace").decode(beginning)
    except (OSError, LookupError):
        return ""
    lines = text.removeprefix("\ufeff").splitlines()[:_LINES]
    return "\n".join(line if len(line) <= _SIGNS else line[: _SIGNS - 1] + "…" for line in lines)
