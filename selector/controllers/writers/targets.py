"""Every control that a model can be exported to, and how its program is executed for the proof."""

from __future__ import annotations

import platform
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Protocol

from selector import __version__
from selector.controllers.model_file import ModelFile
from selector.controllers.replay.compiled import c_answers, compiler, compiler_version
from selector.controllers.replay.drive_parameters_executed import drive_answers
from selector.controllers.replay.halrun_executed import RESOLUTION_UM, halrun_answers, linuxcnc_version
from selector.controllers.replay.macro_b_executed import macro_b_answers
from selector.controllers.replay.python_executed import python_answers
from selector.controllers.replay.replayed import Executor
from selector.controllers.replay.rows import Answers, Rows
from selector.controllers.replay.structured_text_executed import parser_name, scl_answers, st_answers, tcpou_answers
from selector.controllers.writers.beckhoff import beckhoff_export
from selector.controllers.writers.c99 import c_export
from selector.controllers.writers.exported import Exported
from selector.controllers.writers.fanuc import fanuc_export
from selector.controllers.writers.linuxcnc import linuxcnc_export
from selector.controllers.writers.python_module import python_export
from selector.controllers.writers.rexroth import rexroth_export
from selector.controllers.writers.sinumerik import sinumerik_export
from selector.controllers.writers.structured_text import st_export
from selector.controllers.writers.twincat import tcpou_export
from selector.errors import NotExecutableError

__all__ = ["TARGETS", "NotExecutableError", "Target", "Writer"]


class Writer(Protocol):
    """Writes the files for one control."""

    def __call__(self, model: ModelFile, /, *, is_sign_verified: bool = False) -> Exported:
        """Files, and what to do with them."""


@dataclass(frozen=True)
class Target:
    """One control.

    Attributes
    ----------
    title : str
        For people.
    write : Writer
    execute : Executor
        Runs the generated program.
    executed_by : callable
        Name and version of what runs it.
    tolerance_um : float
        Largest difference to the reference that its number type explains, 0 = to the last bit.
    has_whole_guard : bool
        False: where sensors fail or limits act, it differs from the reference.
    """

    title: str
    write: Writer
    execute: Executor
    executed_by: Callable[[], str]
    tolerance_um: float = 0.0
    has_whole_guard: bool = True


def _st(model: ModelFile, rows: Rows, *, files: Mapping[str, str]) -> Answers:
    (text,) = files.values()
    return st_answers(model, rows, text)


def _own(what: str) -> str:
    return f"selector {__version__}, {what}"


def _cc() -> str:
    name = compiler()
    return "no compiler" if name is None else compiler_version(name)


SINGLE_UM = 0.01
"""What single precision explains over the valid range; 6e-6 um was seen."""

TARGETS: Mapping[str, Target] = {
    "c": Target("C99", c_export, c_answers, _cc),
    "st": Target("IEC 61131-3 Structured Text", st_export, _st, parser_name),
    "tcpou": Target("Beckhoff TwinCAT 3", tcpou_export, tcpou_answers, parser_name),
    "linuxcnc": Target("LinuxCNC", linuxcnc_export, halrun_answers, linuxcnc_version, RESOLUTION_UM),
    "sinumerik": Target("Siemens SINUMERIK 840D sl", sinumerik_export, scl_answers, parser_name, SINGLE_UM),
    "beckhoff": Target("Beckhoff TwinCAT CNC TF5200", beckhoff_export, tcpou_answers, parser_name),
    "fanuc": Target(
        "FANUC custom macro B", fanuc_export, macro_b_answers, lambda: _own("macro B"), 1e-6, has_whole_guard=False
    ),
    "rexroth": Target(
        "Bosch Rexroth IndraDrive",
        rexroth_export,
        drive_answers,
        lambda: _own("drive formula"),
        SINGLE_UM,
        has_whole_guard=False,
    ),
    "python": Target("Python", python_export, python_answers, lambda: f"Python {platform.python_version()}"),
}
