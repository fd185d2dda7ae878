"""Every control that a model can be exported to, and how its program is executed for the proof."""

import platform
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from typing import Protocol

import numpy as np

from selector import __version__
from selector.controllers.c_compiler import compiler, compiler_version
from selector.controllers.model_file import ModelFile
from selector.controllers.replay.compiled import (
    RESOLUTION_UM,
    c_answers,
    fmpy_version,
    fmu_answers,
    halrun_answers,
    linuxcnc_version,
    python_answers,
)
from selector.controllers.replay.macro_b_executed import macro_b_answers, macro_corrections_um
from selector.controllers.replay.parts import (
    Answers,
    Execution,
    Part,
    Rows,
    at_most,
    in_single_um,
    straight_line_um,
    tenths_um,
    unguarded_um,
    units_in_single_um,
)
from selector.controllers.replay.printers_executed import klipper_answers, reprapfirmware_answers
from selector.controllers.replay.structured_text_executed import (
    drive_answers,
    parser_name,
    printed_parameters_um,
    setting_data_answers,
    st_answers,
    temp_comp_answers,
    text_of_plcopen,
    text_of_tcpou,
)
from selector.controllers.writers.beckhoff import ADS_TABLE, beckhoff_export
from selector.controllers.writers.c99 import NAME, SINGLE_NAME, c_export
from selector.controllers.writers.exported import Exported
from selector.controllers.writers.fanuc import FILE as MACRO_FILE
from selector.controllers.writers.fanuc import fanuc_export, macro_model
from selector.controllers.writers.fmu import FILE as UNIT
from selector.controllers.writers.fmu import fmu_export
from selector.controllers.writers.klipper import NAME as EXTRA_NAME
from selector.controllers.writers.klipper import klipper_export
from selector.controllers.writers.linuxcnc import NAME as HAL_NAME
from selector.controllers.writers.linuxcnc import linuxcnc_export
from selector.controllers.writers.python_module import mitsubishi_export, python_export
from selector.controllers.writers.reprapfirmware import STEP, reprapfirmware_export
from selector.controllers.writers.rexroth import FILE as DRIVE_FILE
from selector.controllers.writers.rexroth import rexroth_export
from selector.controllers.writers.sinumerik import SETTING_DATA, has_own_line, sinumerik_export
from selector.controllers.writers.structured_text import BLOCK, plcopen_export, st_export, tcpou_export
from selector.errors import NotExecutableError
from selector.types import Array

__all__ = ["TARGETS", "NotExecutableError", "Target", "Writer"]


class Writer(Protocol):
    """Writes the files for one control."""

    def __call__(self, model: ModelFile, /, *, is_sign_verified: bool = False) -> Exported:
        """Files, and what to do with them."""


@dataclass(frozen=True)
class Target:
    """One control."""

    title: str  #: For people
    write: Writer
    parts: tuple[Part, ...]  #: Its files that compute something, the main program first
    has_guard: bool = True  #: Whether it checks sensors and limits the correction
    takes_touch_offs: bool = True  #: Whether its program can be adapted
    #: Patterns of the files that not every model gets: those of an earlier export are not left beside a new one
    not_always: tuple[str, ...] = ()


def _own(what: str) -> Callable[[], str]:
    return lambda: f"selector {__version__}, {what}"


def _cc() -> str:
    return compiler_version(compiler())


def _as_text(file: str, text_of: Callable[[str], str] = str) -> Execution:
    """Runs the Structured Text in a file."""
    return lambda model, rows, files, _main: st_answers(model, rows, text_of(files[file]))


def _alone(execute: Callable[..., Answers]) -> Execution:
    return lambda model, rows, files, _main: execute(model, rows, files=files)


def _line_of_sinumerik(model: ModelFile, rows: Rows, whole: Answers, main: Answers) -> Array:
    """The whole correction where the slope is over another axis, else the straight line."""
    has_line = [has_own_line(output) for output in model.outputs]
    return np.where(has_line, straight_line_um(model, rows, whole, main), main.correction_um)


_ST_FILE, _SCL_FILE, _BLOCK_FILE, _XML_FILE = f"{NAME}.st", f"{NAME}.scl", f"{BLOCK}.TcPOU", f"{BLOCK}.xml"
LARGEST_MARGIN_PERCENT = 100.0  #: By which sensors may be followed beyond their ranges
_SMALLER = "its guard is smaller"
_SINGLE = "it calculates in single precision"
_NO_CLAMP = "the control's straight line goes on beyond the valid positions, and has no clamp"
_BLOCK_OF_TWINCAT = Part(_BLOCK_FILE, _as_text(_BLOCK_FILE, text_of_tcpou), parser_name)
_PYTHON = Part(f"{NAME}.py", _alone(python_answers), lambda: f"Python {platform.python_version()}")

TARGETS: Mapping[str, Target] = {
    "c": Target(
        "C99",
        c_export,
        (
            Part(f"{NAME}.c", _alone(c_answers), _cc),
            Part(
                f"{SINGLE_NAME}.c",
                _alone(partial(c_answers, precision="float", name=SINGLE_NAME)),
                _cc,
                in_single_um,
                lacks=_SINGLE,
            ),
        ),
        # the last: of version 0.1, never left beside a newer program
        not_always=(f"{SINGLE_NAME}.[ch]", f"{NAME}_i.[ch]"),
    ),
    "fmu": Target("Functional mock-up unit (FMI 3.0)", fmu_export, (Part(UNIT, _alone(fmu_answers), fmpy_version),)),
    "st": Target("IEC 61131-3 Structured Text", st_export, (Part(_ST_FILE, _as_text(_ST_FILE), parser_name),)),
    "plcopen": Target(
        "PLCopen XML", plcopen_export, (Part(_XML_FILE, _as_text(_XML_FILE, text_of_plcopen), parser_name),)
    ),
    "tcpou": Target("Beckhoff TwinCAT 3", tcpou_export, (_BLOCK_OF_TWINCAT,)),
    "linuxcnc": Target(
        "LinuxCNC",
        linuxcnc_export,
        (Part(f"{HAL_NAME}.comp", _alone(halrun_answers), linuxcnc_version, allowed_um=at_most(RESOLUTION_UM)),),
    ),
    "klipper": Target(
        "Klipper",
        klipper_export,
        (
            Part(
                f"{EXTRA_NAME}.py",
                _alone(klipper_answers),
                lambda: f"Python {platform.python_version()}, a stand-in for Klipper",
                allowed_um=at_most(1e-9),  # positions arrive in mm
            ),
        ),
        takes_touch_offs=False,
    ),
    "sinumerik": Target(
        "Siemens SINUMERIK 840D sl",
        sinumerik_export,
        (
            Part(_SCL_FILE, _as_text(_SCL_FILE), parser_name, in_single_um, lacks=_SINGLE),
            Part(SETTING_DATA, setting_data_answers, parser_name, _line_of_sinumerik, units_in_single_um, _NO_CLAMP),
        ),
    ),
    "beckhoff": Target(
        "Beckhoff TwinCAT CNC TF5200",
        beckhoff_export,
        (
            _BLOCK_OF_TWINCAT,
            Part(ADS_TABLE, temp_comp_answers, _own("formula of TF5200"), straight_line_um, tenths_um, _NO_CLAMP),
        ),
        not_always=("temp_comp_*.lis",),
    ),
    "fanuc": Target(
        "FANUC custom macro B",
        fanuc_export,
        (
            Part(
                MACRO_FILE,
                _alone(macro_b_answers),
                _own("macro B"),
                lambda model, rows, _whole, _main: macro_corrections_um(model, rows),
                at_most(1e-9),
                _SMALLER,
            ),
        ),
        takes_touch_offs=False,
    ),
    "rexroth": Target(
        "Bosch Rexroth IndraDrive",
        rexroth_export,
        (
            Part(
                DRIVE_FILE,
                _alone(drive_answers),
                _own("drive formula"),
                lambda model, rows, _whole, _main: unguarded_um(model, rows),
                lambda model, rows, _whole: printed_parameters_um(model, rows),
                "the drive has no guard: no check of the sensor, no clamp, no slew limit",
                tells_mode=False,
            ),
        ),
        has_guard=False,
        takes_touch_offs=False,
    ),
    "reprapfirmware": Target(
        "RepRapFirmware",
        reprapfirmware_export,
        (
            Part(
                STEP,
                _alone(reprapfirmware_answers),
                _own("meta commands in binary32"),
                lambda model, rows, whole, main: in_single_um(macro_model(model), rows, whole, main),
                lambda model, rows, whole: units_in_single_um(macro_model(model), rows, whole),
                _SINGLE,
            ),
        ),
        takes_touch_offs=False,
    ),
    "mitsubishi": Target("Mitsubishi M800", mitsubishi_export, (_PYTHON,)),
    "python": Target("Python", python_export, (_PYTHON,)),
}
