"""`predict`: heating and cooling tests and a duty cycle in, displacement and a correction program out."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from selector.cli import showing
from selector.cli.files import folder_written_whole, require_writable_folder
from selector.cli.showing import AsJson
from selector.cli.source import Source, with_source
from selector.errors import OptionError
from selector.findings import Finding

if TYPE_CHECKING:
    from rich.console import Console

    from selector.physics.thermal.prediction import Prediction
    from selector.readers import Reading
    from selector.readers.cycle_file import CycleFile
    from selector.recording import Recording

_SPEED_UNIT = re.compile(r"rpm|(1|r|u|rev|об)\s*/\s*min|min\s*(\^?-1|⁻¹)|об/мин", re.IGNORECASE)
"""Names of a spindle speed that say its unit, r/min."""
_PROGRAM = "Correction program"

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
    typer.Option(
        "--operations", metavar="MIN,MIN,...", help="Lengths of the operations in minutes.", rich_help_panel=_PROGRAM
    ),
]
Tolerance = Annotated[
    float | None,
    typer.Option(
        "--tolerance", metavar="µm", help="Drift that is allowed between corrections.", rich_help_panel=_PROGRAM
    ),
]
Resolution = Annotated[
    float | None,
    typer.Option(
        "--resolution",
        metavar="MIN",
        help="Corrections only at whole multiples of these minutes, never late. Default: exact times.",
        rich_help_panel=_PROGRAM,
    ),
]


def _folder(text: str) -> Path:
    # an empty path would be the folder that one is in
    if not text.strip():
        raise OptionError(
            "no name", expected="a folder for the results", where="--out", advice="name one, e.g. --out prediction"
        )
    return Path(text)


Out = Annotated[
    Path | None,
    typer.Option(
        "--out",
        metavar="DIR",
        parser=_folder,
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
    from selector.physics.thermal.prediction import cyclogram_of_rows
    from selector.physics.thermal.prediction import predict as predicted
    from selector.physics.thermal.thermal_test import thermal_tests
    from selector.readers.cycle_file import read_cycle

    lengths_s = _operations(operations)
    _require_positive(tolerance, "--tolerance", "a drift in µm above 0", "e.g. --tolerance 10")
    _require_positive(resolution, "--resolution", "minutes above 0", "e.g. --resolution 1, or leave it out")
    if out is not None:
        require_writable_folder(out, "--out")
        _refuse_folder_of_inputs(out, [cycle, *source.machine_files, *source.runs])
    steps = read_cycle(cycle)
    cyclogram, of_cycle = cyclogram_of_rows(steps.time_s, steps.speed_rpm, lengths_s)
    reading = source.reading()
    if out is not None:
        _refuse_folder_of_inputs(out, [run.file for run in reading.runs])
    recording, responses, of_recording = _tests(reading, response)
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
    written = [] if out is None else _write(prediction, reading, steps, out)
    if as_json:
        showing.print_json(prediction.as_dict())
    console = showing.screen(as_json)
    if not as_json:
        _show(console, prediction)
    if out is not None:
        console.print(f"wrote {out}: {', '.join(written)}", markup=False)


def _refuse_folder_of_inputs(out: Path, inputs: Sequence[str | Path]) -> None:
    """What is written must replace no input, and must not be read as a run by the next command."""
    from selector.readers.names import printable_name

    for file in (Path(one) for one in inputs):
        held = file if file.is_dir() else file.absolute().parent
        if out.exists() and file.exists() and out.samefile(held):
            raise OptionError(
                f"this folder holds {printable_name(file.name)}, which is read", where=f"--out {out}",
                expected="a folder that holds no recording, duty cycle or machine file of this command",
                advice="choose another folder, e.g. one inside of it",
            )  # fmt: skip


def _tests(reading: Reading, response: list[str] | None) -> tuple[Recording, tuple[str, ...], tuple[Finding, ...]]:
    """The recording without the faults of speed and displacements, which these are, and what was found."""
    from selector.quality import inspect, without_faults

    recording = reading.recording
    responses = tuple(dict.fromkeys(response)) if response else recording.with_role("displacement")
    speeds = recording.with_role("spindle_speed")
    if not responses:
        raise OptionError(
            "no displacement in the recordings", expected="a channel with the role displacement",
            where="the recordings", advice="give the channel of the gauge that role in the machine file",
        )  # fmt: skip
    used = {name for name in (*responses, *speeds) if name in recording.names}
    _require_units(reading, used)
    # where a displacement starts is its zero here, and it may have moved on within the first samples
    faults = [fault for fault in inspect(recording, used) if fault.id != "run-starts-warm"]
    clean = without_faults(recording, faults)
    gone = sorted(used - set(clean.names))
    if gone:
        why = next((fault.statement for fault in faults if fault.where.channel == gone[0]), "it is faulty in every run")
        raise OptionError(
            f"{gone[0]} is left out of every run: {why}", expected="readings without a fault",
            where="the recordings", advice="look at the findings of `selector describe`, and correct the files",
        )  # fmt: skip
    return clean, responses, (*reading.findings, *faults)


def _require_units(reading: Reading, used: set[str]) -> None:
    """A displacement in the wrong unit becomes a wrong correction, a time in the wrong unit a late one: no guessing."""
    if "unit" in reading.reading["time"]["guessed"]:
        raise OptionError(
            f"no unit of the time (column {', '.join(map(repr, reading.reading['time']['columns']))})",
            expected="a unit that the file or the machine file says", where="the recordings",
            advice='write unit = "s" (or "min", ...) under [time] in the machine file, or give --time-unit',
        )  # fmt: skip
    for channel in reading.channels:
        if channel.name in used and channel.role == "spindle_speed" and "unit" in channel.guessed:
            if any(_SPEED_UNIT.search(name) for name in (channel.name, str(channel.column))):
                continue
            raise OptionError(
                f"no unit of {channel.name} (taken for {channel.unit_in_file})",
                expected="a unit that the file or the machine file says", where="the recordings",
                advice=f'write unit = "rpm" (or "1/s") under [channels.{channel.name}], or give --unit '
                f"{channel.name}=rpm",
            )  # fmt: skip
        if channel.name in used and channel.role == "displacement" and "unit" in channel.guessed:
            raise OptionError(
                f"no unit of {channel.name} (taken for {channel.unit_in_file})",
                expected="a unit that the file or the machine file says", where="the recordings",
                advice=f'write unit = "um" (or "mm") under [channels.{channel.name}], or give --unit {channel.name}=um',
            )  # fmt: skip


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


def _write(prediction: Prediction, reading: Reading, cycle: CycleFile, out: Path) -> list[str]:
    """The names of the files that were written."""
    from selector.cli.material import provenance_of
    from selector.physics.thermal.correction_text import program_blocks, program_table
    from selector.report import write_prediction_report

    files = {"prediction.json": showing.json_text(prediction.as_dict()) + "\n"}
    if prediction.programs:
        files["program.csv"] = program_table(prediction.programs)
        files["program.txt"] = program_blocks(prediction.programs)
    with folder_written_whole(out) as folder:
        for name, text in files.items():
            (folder / name).write_text(text, encoding="utf-8", newline="\n")
        write_prediction_report(
            prediction,
            folder / "report.html",
            description=reading.description(),
            provenance={**provenance_of(reading), "duty cycle": cycle.file},
        )
    return [*files, "report.html"]


def _show(console: Console, prediction: Prediction) -> None:
    """The course in an hourly table, the modes, the program and the findings, for a person."""
    import numpy as np

    from selector.physics.thermal.correction_text import notation
    from selector.physics.thermal.cyclogram_kind import cyclogram_kind

    end = prediction.cyclogram.end_s
    console.print(
        f"{cyclogram_kind(prediction.cyclogram).capitalize()} duty cycle of {showing.duration_text(end)}, "
        f"{prediction.method} method",
        style="bold", markup=False,
    )  # fmt: skip
    shown = np.unique(np.r_[np.linspace(0.0, end, 9), prediction.cyclogram.start_s[:12]])
    rows: list[tuple[object, ...]] = [
        (
            f"{time / 60:.4g}",
            f"{speed:.6g}",
            *(
                f"{np.interp(time, prediction.time_s, prediction.displacement_um[:, r]):.1f}"
                for r in range(len(prediction.responses))
            ),
        )
        for time, speed in zip(shown.tolist(), prediction.cyclogram.speed_at(shown).tolist(), strict=True)
    ]
    columns = ["min", "r/min", *prediction.responses]
    console.print(showing.table("Predicted displacement [µm]", columns, rows, numeric=columns))
    if prediction.modes:
        rows = [tuple(None if s is None else s / 60 for s in (m.tau_s, m.low, m.high)) for m in prediction.modes]
        columns = ["time constant", "low", "high"]
        console.print(
            showing.table("Thermal modes: time constants in minutes, 95 % intervals", columns, rows, numeric=columns)
        )
    for name, program in prediction.programs.items():
        rows = [(number, notation(operation)) for number, operation in enumerate(program.operations, start=1)]
        title = f"Corrections of {name}, tolerance {program.tolerance_um:g} µm: number-{{minutes}}-{{µm}}"
        console.print(showing.table(title, ["operation", "corrections"], rows, numeric=["operation"]))
    if prediction.programs:
        console.print(
            "Times are rounded down to 0.1 min here, so corrections act up to 6 s early; --json has the exact ones.",
            markup=False,
        )
    showing.show_findings(console, prediction.findings)
