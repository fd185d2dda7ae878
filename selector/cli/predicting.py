"""`predict`: heating and cooling tests and a duty cycle in, displacement and a correction program out."""

from __future__ import annotations

import math
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from selector.atomic_file import folder_written_whole, require_writable_folder
from selector.cli.shared import showing
from selector.cli.shared.files import refuse_folder_of_inputs, written_folder
from selector.cli.shared.showing import AsJson
from selector.cli.shared.source import Source, with_source
from selector.errors import OptionError

if TYPE_CHECKING:
    from selector.physics.thermal.prediction.prediction import Prediction
    from selector.telling.account import Account

_of_program = partial(typer.Option, rich_help_panel="Correction program")

Responses = Annotated[
    list[str] | None,
    typer.Option("--response", metavar="NAME", help="Displacement to predict; repeat. Default: all there are."),
]
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


Out = Annotated[
    Path | None,
    typer.Option(
        "--out",
        metavar="DIR",
        parser=written_folder,
        help="Write prediction.json, report.html, and program.csv and program.txt if there is a program.",
    ),
]


@with_source
def predict(
    source: Source,
    cycle: Cycle,
    response: Responses = None,
    method: MethodName = "modal",
    operations: Operations = None,
    tolerance: Tolerance = None,
    resolution: Resolution = None,
    out: Out = None,
    as_json: AsJson = False,
) -> None:
    """Predicts the displacement in a duty cycle from heating and cooling tests, and how to correct it.

    No thermometer is needed: what counts is at which speed the spindle turned for how long. With --operations or
    --tolerance it makes the correction program: when to correct each operation by how much, so that the drift stays
    within the tolerance.
    """
    from selector.cli.shared.recordings_used import provenance_of
    from selector.physics.thermal.modes.thermal_test import thermal_tests
    from selector.physics.thermal.prediction.prediction import cyclogram_of_rows
    from selector.physics.thermal.prediction.prediction import predict as predicted
    from selector.readers.cycle_file import read_cycle
    from selector.readers.heating_tests import heating_tests
    from selector.telling.predicted.account import prediction_account

    lengths_s = _operations(operations)
    _require_positive(tolerance, "--tolerance", "a drift in µm above 0", "e.g. --tolerance 10")
    _require_positive(resolution, "--resolution", "minutes above 0", "e.g. --resolution 1, or leave it out")
    if out is not None:
        require_writable_folder(out, "--out")
        refuse_folder_of_inputs(out, [cycle, *source.machine_files, *source.runs])
    steps = read_cycle(cycle)
    cyclogram, of_cycle = cyclogram_of_rows(steps.time_s, steps.speed_rpm, lengths_s)
    reading = source.reading()
    if out is not None:
        refuse_folder_of_inputs(out, [run.file for run in reading.runs])
    recording, responses, of_recording = heating_tests(reading, response or ())
    prediction = predicted(
        thermal_tests(recording, responses),
        responses,
        cyclogram,
        method=_method(method),
        operations_s=lengths_s,
        tolerance_um=tolerance,
        resolution_s=None if resolution is None else 60.0 * resolution,
        told=(*of_recording, *of_cycle),
    )
    told_of_tests = {**provenance_of(reading), "duty cycle": steps.file}
    account = prediction_account(prediction, reading.description(), told_of_tests, drawn=out is not None)
    written = [] if out is None else _write(prediction, account, out)
    console = showing.screen(as_json)
    if as_json:
        showing.print_json(account.data)
    else:
        showing.show_account(console, account)
        showing.show_findings(console, prediction.findings)
    if out is not None:
        console.print(f"wrote {out}: {', '.join(written)}", markup=False)


def _method(text: str) -> Literal["modal", "piecewise"]:
    if text == "modal":
        return "modal"
    if text == "piecewise":
        return "piecewise"
    raise OptionError(
        repr(text), expected="modal or piecewise", where="--method", advice="leave it out for the modal method"
    )


def _operations(text: str | None) -> list[float] | None:
    """Lengths in seconds, of minutes separated by commas."""
    if text is None:
        return None
    lengths = []
    for part in text.split(","):
        try:
            minutes = float(part)
        except ValueError:
            minutes = math.nan
        if not (math.isfinite(minutes) and minutes > 0):
            raise OptionError(
                f"{part.strip()!r} in {text[:60]!r}", expected="minutes above 0, separated by commas",
                where="--operations", advice="e.g. --operations 60,60,45.5",
            )  # fmt: skip
        lengths.append(60.0 * minutes)
    return lengths


def _require_positive(value: float | None, where: str, expected: str, advice: str) -> None:
    if value is not None and not (math.isfinite(value) and value > 0):
        raise OptionError(f"{value:g}", expected=expected, where=where, advice=advice)


def _write(prediction: Prediction, account: Account, out: Path) -> list[str]:
    """The names of the files that were written."""
    from selector.physics.thermal.prediction.correction_program import program_blocks, program_table
    from selector.telling import write_account

    files = {"prediction.json": showing.json_text(account.data) + "\n"}
    if prediction.programs:
        files["program.csv"] = program_table(prediction.programs)
        files["program.txt"] = program_blocks(prediction.programs)
    with folder_written_whole(out) as folder:
        for name, text in files.items():
            (folder / name).write_text(text, encoding="utf-8", newline="\n")
        write_account(account, folder / "report.html")
    return [*files, "report.html"]
