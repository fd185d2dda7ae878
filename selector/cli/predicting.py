"""`predict`: heating and cooling tests and a duty cycle in, displacement and a correction program out."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from selector.atomic_file import folder_written_whole, require_writable_folder
from selector.cli.shared import showing
from selector.cli.shared.asked.prediction import Asked
from selector.cli.shared.files import refuse_folder_of_inputs, written_folder
from selector.cli.shared.showing import AsJson, Everything
from selector.cli.shared.source import Source, with_source

if TYPE_CHECKING:
    from selector.physics.thermal.prediction.prediction import Prediction
    from selector.telling.account import Account

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
    asked: Asked,
    out: Out = None,
    everything: Everything = False,
    as_json: AsJson = False,
) -> None:
    """Predicts the displacement in a duty cycle from heating and cooling tests, and how to correct it.

    No thermometer is needed: what counts is at which speed the spindle turned for how long, and, if it was recorded,
    how the hall moved. With --operations or --tolerance it makes the correction program: when to correct each operation
    by how much, so that the drift stays within the tolerance.
    """
    import numpy as np

    from selector.physics.thermal.modes.cyclogram import AmbientCourse
    from selector.physics.thermal.modes.thermal_test import thermal_tests
    from selector.physics.thermal.prediction.prediction import cyclogram_of_rows
    from selector.physics.thermal.prediction.prediction import predict as predicted
    from selector.readers.cycle_file import heating_tests, read_cycle
    from selector.study.material import drift_of, provenance_of
    from selector.telling.predicted.account import prediction_account

    lengths_s = asked.operations_s()
    asked.require_usable()
    if out is not None:
        require_writable_folder(out, "--out", ("prediction.json", "report.html"))
        refuse_folder_of_inputs(out, [asked.cycle, *source.machine_files, *source.runs])
    steps = read_cycle(asked.cycle)
    cyclogram, of_cycle = cyclogram_of_rows(steps.time_s, steps.speed_rpm, lengths_s)
    reading = source.reading()
    if out is not None:
        refuse_folder_of_inputs(out, [run.file for run in reading.runs])
    recording, responses, of_recording = heating_tests(reading, asked.response or ())
    foreseen = steps.temperatures(recording.with_role("ambient"))
    hall = AmbientCourse(steps.time_s, np.column_stack([*foreseen.values()]), tuple(foreseen)) if foreseen else None
    prediction = predicted(
        thermal_tests(recording, responses),
        responses,
        cyclogram,
        method=asked.kind(),
        hall=hall,
        start=asked.begins(),
        operations_s=lengths_s,
        tolerance_um=asked.tolerances_um(),
        resolution_s=None if asked.resolution is None else 60.0 * asked.resolution,
        temperatures=[name for name in responses if name in recording.with_role("temperature")],
        told=(*of_recording, *of_cycle),
    )
    told_of_tests = {**provenance_of(reading), "duty cycle": steps.file}
    described = {**reading.description(), "drift": drift_of(recording)}
    account = prediction_account(prediction, described, told_of_tests, drawn=out is not None)
    written = [] if out is None else _write(prediction, account, out)
    console = showing.screen(as_json)
    if as_json:
        showing.print_json(account.data)
    else:
        showing.show_answer(console, account, prediction.findings, everything=everything)
    if out is not None:
        showing.show_written(console, out, written)


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
