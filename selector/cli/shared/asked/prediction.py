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
    from selector.physics.thermal.prediction.prediction import Method

_of_program = partial(typer.Option, rich_help_panel="Correction program")

Cycle = Annotated[
    Path, typer.Option("--cycle", metavar="CYCLE.csv", help="Duty cycle: time_s,spindle_speed, one row a change.")
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
Tolerance = Annotated[
    float | None,
    _of_program("--tolerance", metavar="µm", help="Drift that is allowed between corrections."),
]
Resolution = Annotated[
    float | None,
    _of_program(
        "--resolution",
        metavar="MIN",
        help="Corrections only at whole multiples of these minutes, never late. Default: exact times.",
    ),
]


@dataclass(frozen=True)
class Asked:
    """The options of `predict`, one field an option."""

    cycle: Cycle
    response: Responses = None
    method: MethodName = "modal"
    operations: Operations = None
    tolerance: Tolerance = None
    resolution: Resolution = None

    def require_usable(self) -> None:
        """Ends with an error when a number is out of its limits."""
        _require_positive(self.tolerance, "--tolerance", "a drift in µm above 0", "e.g. --tolerance 10")
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

    def operations_s(self) -> list[float] | None:
        """Lengths in seconds, of minutes separated by commas.

        Raises OptionError: one is no length.
        """
        if self.operations is None:
            return None
        lengths = []
        for part in self.operations.split(","):
            try:
                minutes = float(part)
            except ValueError:
                minutes = math.nan
            if not (math.isfinite(minutes) and minutes > 0):
                raise OptionError(
                    f"{part.strip()!r} in {self.operations[:60]!r}", expected="minutes above 0, separated by commas",
                    where="--operations", advice="e.g. --operations 60,60,45.5",
                )  # fmt: skip
            lengths.append(60.0 * minutes)
        return lengths


def _require_positive(value: float | None, where: str, expected: str, advice: str) -> None:
    if value is not None and not (math.isfinite(value) and value > 0):
        raise OptionError(f"{value:g}", expected=expected, where=where, advice=advice)
