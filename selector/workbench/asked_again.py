"""Whether an answer or an export in the study folder was asked as the form asks now."""

from __future__ import annotations

import functools
import math
from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path

from selector.controllers import decided_limits, read_model
from selector.controllers.guard.decided import is_turned, with_turned_signs
from selector.controllers.model_file import ModelFile, model_text
from selector.controllers.writers.targets import TARGETS
from selector.errors import InputError
from selector.readers import Overrides
from selector.selection import Options
from selector.study import STUDY_FILE, SelectSection, overrides_of, path_at, read_study, select_section
from selector.workbench.commands import Export, option_of
from selector.workbench.typed import FIELDS


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
    found = [_title(name) for name in fields]
    if {path_at(run, answer).resolve() for run in study.recordings.runs} != {run.resolve() for run in runs}:
        found.append("the recordings")
    if overrides_of(study) != overrides:
        found.append("how they are read")
    return tuple(found)


def _title(name: str) -> str:
    if name == "responses":
        return FIELDS["--response"]
    return FIELDS.get(option_of(name), name)


MODEL, SHEET = "model.json", "commissioning.html"
_UNVERIFIED = "SIGN UNVERIFIED"
_NEAR = 1e-9
"""A command says twelve digits."""


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
