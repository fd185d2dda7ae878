"""What may be asked of a prediction on the command line."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from selector.cli.shared.asked.selection import Responses
from selector.errors import OptionError

if TYPE_CHECKING:
    from selector.physics.thermal.prediction.answer import Start
    from selector.physics.thermal.prediction.prediction import Method, Tolerance

_of_program = partial(typer.Option, rich_help_panel="Correction program")

Cycle = Annotated[
    Path,
    typer.Option(
        "--cycle",
        metavar="CYCLE.csv",
        help="Duty cycle: time_s,spindle_speed, one row a change; beside them columns named as ambient channels.",
    ),
]
MethodName = Annotated[
    str,
    typer.Option(
        "--method", metavar="modal|piecewise", help="Thermal modes, or pieces of the measured characteristics."
    ),
]
Operations = Annotated[
    str | None,
    _of_program("--operations", metavar="MIN,MIN,...", help="Lengths of the operations in minutes."),
]
Tolerances = Annotated[
    list[str] | None,
    _of_program(
        "--tolerance",
        metavar="[NAME=]µm[,µm...]",
        help="Drift that is allowed between corrections: one for all, one an operation (10,5,10), or by response "
        "(Z=10); repeat.",
    ),
]
StartName = Annotated[
    str | None,
    typer.Option(
        "--start",
        metavar="cold|tests",
        help="How the duty cycle begins: cold, or where the tests end. Default: where they end if they are one long "
        "record, else cold.",
    ),
]
Resolution = Annotated[
    float | None,
    _of_program(
        "--resolution",
        metavar="MIN",
        help="Corrections only at whole multiples of these minutes, never late. Default: exact times.",
    ),
]
NcProgram = Annotated[
    str | None,
    _of_program(
        "--nc", metavar="fanuc|sinumerik", help="Write the program as an NC subprogram too, with a sheet (needs --out)."
    ),
]
Inverted = Annotated[
    list[str] | None,
    _of_program("--invert", metavar="NAME", help="Response whose axis the control counts the other way; repeat."),
]


@dataclass(frozen=True)
class Asked:
    """The options of `predict`, one field an option."""

    cycle: Cycle
    response: Responses = None
    method: MethodName = "modal"
    operations: Operations = None
    tolerance: Tolerances = None
    resolution: Resolution = None
    start: StartName = None
    nc: NcProgram = None
    invert: Inverted = None

    def require_usable(self) -> None:
        """Ends with an error when a number is out of its limits."""
        self.tolerances_um()
        self.begins()
        _require_positive(self.resolution, "--resolution", "minutes above 0", "e.g. --resolution 1, or leave it out")

    def kind(self) -> Method:
        """The method.

        Raises OptionError: there is none of this name.
        """
        if self.method == "modal":
            return "modal"
        if self.method == "piecewise":
            return "piecewise"
        raise OptionError(
            repr(self.method),
            expected="modal or piecewise",
            where="--method",
            advice="leave it out for the modal method",
        )

    def begins(self) -> Start | None:
        """How the duty cycle begins; None if nothing was said.

        Raises OptionError: it is neither cold nor tests.
        """
        known: dict[str | None, Start | None] = {None: None, "cold": "cold", "tests": "tests"}
        if self.start in known:
            return known[self.start]
        raise OptionError(
            repr(self.start), expected="cold or tests", where="--start",
            advice="leave it out, or say whether the machine is cold or goes on where the tests end",
        )  # fmt: skip

    def tolerances_um(self) -> Tolerance | None:
        """Tolerances in µm: one for all, or those of each response, one for all operations or one for each.

        Raises OptionError: one is no drift above 0, a response is named twice, or some have a name and others not.
        """
        told: dict[str | None, float | list[float]] = {}
        for option in self.tolerance or ():
            name, mark, numbers = option.rpartition("=")
            values = [_above_zero(part, option, "--tolerance", "a drift in µm above 0") for part in numbers.split(",")]
            key = name.strip() if mark else None
            if key in told or (told and None in (key, *told)):
                raise OptionError(
                    f"{option[:60]!r} beside other tolerances", expected="one for all, or one a response by its name",
                    where="--tolerance", advice="e.g. --tolerance 10, or --tolerance Z=10 --tolerance X=5",
                )  # fmt: skip
            told[key] = values if len(values) > 1 else values[0]
        if None in told:
            return told[None]
        return {name: values for name, values in told.items() if name is not None} or None

    def operations_s(self) -> list[float] | None:
        """Lengths in seconds, of minutes separated by commas.

        Raises OptionError: one is no length.
        """
        if self.operations is None:
            return None
        expected = "minutes above 0, separated by commas"
        parts = self.operations.split(",")
        return [60.0 * _above_zero(part, self.operations, "--operations", expected) for part in parts]


def _above_zero(part: str, option: str, where: str, expected: str) -> float:
    try:
        value = float(part)
    except ValueError:
        value = math.nan
    if not (math.isfinite(value) and value > 0):
        advice = f"e.g. {where} {_EXAMPLES[where]}"
        raise OptionError(f"{part.strip()!r} in {option[:60]!r}", expected=expected, where=where, advice=advice)
    return value


_EXAMPLES = {"--operations": "60,60,45.5", "--tolerance": "10 or --tolerance 10,5,10"}


def _require_positive(value: float | None, where: str, expected: str, advice: str) -> None:
    if value is not None and not (math.isfinite(value) and value > 0):
        raise OptionError(f"{value:g}", expected=expected, where=where, advice=advice)
