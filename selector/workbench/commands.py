"""Which command line does the same as a page: words after ``selector``, and the text that a person copies."""

from __future__ import annotations

import os
import shlex
import subprocess
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from pathlib import Path

from selector.controllers.writers.targets import TARGETS
from selector.readers import Overrides
from selector.selection import Options
from selector.study import DiagnoseSection

SELECTION, DIAGNOSIS = "selection", "diagnosis"
"""Folders of the answers in the study folder."""


@dataclass(frozen=True)
class Export:
    """What is asked of an export."""

    model: str = ""  #: Model file in the study folder
    target: str = "c"  #: One of `selector.controllers.writers.targets.TARGETS`
    replayed: tuple[Path, ...] = ()  #: Recordings that are run through the program
    is_sign_verified: bool = False  #: Whether the sign test of the commissioning sheet was passed
    tested: str = ""  #: Digits of the equations SHA-256 of the program that passed it; empty: nobody said
    #: clamp_um and slew_um_per_s: Output → largest correction, and fastest change of it; none: what the model says, or
    #: the export decides
    clamp_um: Mapping[str, float] = field(default_factory=dict)
    slew_um_per_s: Mapping[str, float] = field(default_factory=dict)
    inverted: tuple[str, ...] = ()  #: Outputs whose axis the control counts the other way

    def of(self, outputs: Sequence[str]) -> Export:
        """What is asked of these outputs; another model has others."""
        return replace(
            self,
            clamp_um={name: self.clamp_um[name] for name in outputs if name in self.clamp_um},
            slew_um_per_s={name: self.slew_um_per_s[name] for name in outputs if name in self.slew_um_per_s},
            inverted=tuple(name for name in outputs if name in self.inverted),
        )

    @property
    def folder(self) -> str:
        """Folder of the files in the study folder."""
        return f"export-{self.target}"


_READING = tuple(field.name for field in fields(Overrides) if field.name not in ("units", "roles", "partial"))
_FLAGS = ("interactions", "memory", "absolute_similarity", "ridge")
_VALUES = ("max_sensors", "degree", "reference", "tolerance", "seed", "formula", "within", "target")


def option_of(name: str) -> str:
    """The option of the command line that is called like a field."""
    return f"--{name.strip('_').replace('_', '-')}"


def source_arguments(
    folder: Path, paths: Sequence[Path], machine: Path | None, overrides: Overrides
) -> tuple[str, ...]:
    """The recordings, and how they are read; paths in `folder` are told from there."""
    return (*(told_path(folder, path) for path in paths), *_reading_words(folder, machine, overrides))


def _reading_words(folder: Path, machine: Path | None, overrides: Overrides) -> Iterator[str]:
    if machine is not None:
        yield from ("--machine", told_path(folder, machine))
    for name in _READING:
        value = getattr(overrides, name)
        if value is not None:
            yield from (option_of(name), f"{value:.12g}" if isinstance(value, float) else str(value))
    for name, unit in overrides.units.items():
        yield from ("--unit", f"{name}={unit}")
    for name, role in overrides.roles.items():
        yield from ("--role", f"{name}={role}")


def option_arguments(options: Options) -> tuple[str, ...]:
    """What is asked of a selection; what is left at its default is not said."""
    return tuple(_option_words(options))


def _option_words(options: Options) -> Iterator[str]:
    default = Options()
    for name in options.responses:
        yield from ("--response", name)
    for level in options.levels or ():
        yield from ("--lambda", repr(level))
    if options.rounds > max(1, len(options.levels or ())):
        yield from ("--rounds", str(options.rounds))
    for name in _VALUES:
        value = getattr(options, name)
        if value != getattr(default, name):
            yield from (option_of(name), repr(value) if isinstance(value, float) else str(value))
    yield from (option_of(name) for name in _FLAGS if getattr(options, name))
    for name in options.must:
        yield from ("--must", name)
    for name in options.never:
        yield from ("--never", name)
    for name, cost in options.cost.items():
        yield from ("--cost", f"{name}={cost:g}")
    for run, condition in options.conditions.items():
        yield from ("--condition", f"{run}={condition}")


def diagnosis_arguments(asked: DiagnoseSection) -> tuple[str, ...]:
    """What is asked of a diagnosis; what is left at its default is not said."""
    default = DiagnoseSection()
    words = [word for path in asked.simulation for word in ("--simulation", path)]
    words += [] if asked.model is None else ["--model", asked.model]
    words += [word for name in asked.responses for word in ("--response", name)]
    for name in ("simulation_time_unit", "holdout", "seed"):
        if getattr(asked, name) != getattr(default, name):
            words += [option_of(name), str(getattr(asked, name))]
    if asked.false_alarm != default.false_alarm:
        words += ["--false-alarm", repr(asked.false_alarm)]
    return tuple(words)


def export_command(folder: Path, asked: Export, machine: Path | None, overrides: Overrides) -> tuple[str, ...]:
    """`selector export`, which reads as all other commands do; paths in `folder` are told from there."""
    words = ["export", asked.model, "--for", asked.target, "--out", asked.folder]
    words += [word for path in asked.replayed for word in ("--replay", told_path(folder, path))]
    words += _reading_words(folder, machine, overrides) if asked.replayed else ()
    # a control without a guard refuses limits
    limits = (("--clamp", asked.clamp_um), ("--slew", asked.slew_um_per_s)) if TARGETS[asked.target].has_guard else ()
    for option, values in limits:
        words += [word for name, value in values.items() for word in (option, f"{name}={value:.12g}")]
    words += [word for name in asked.inverted for word in ("--invert", name)]
    if asked.is_sign_verified:
        words += ["--sign-verified", *(["--tested", asked.tested] if asked.tested else [])]
    return tuple(words)


def command_words(command: Sequence[str]) -> list[str]:
    """The command as a person types it in the shell of this system, word by word, ``selector`` first."""
    quoted = (lambda word: subprocess.list2cmdline([word])) if os.name == "nt" else shlex.quote
    return [quoted(word) for word in ("selector", *command)]


def command_text(command: Sequence[str]) -> str:
    """The command as one line."""
    return " ".join(command_words(command))


def told_path(folder: Path, path: Path) -> str:
    """A path as a command in `folder` names it."""
    return path.relative_to(folder).as_posix() if path.is_relative_to(folder) else str(path)
