"""`apply`: an exported model on other recordings, and how well it does there."""

from __future__ import annotations

import dataclasses
import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from selector.cli import showing
from selector.cli.models import Model
from selector.cli.showing import AsJson
from selector.cli.source import Source, with_source

if TYPE_CHECKING:
    from rich.console import Console

    from selector.controllers.application import Accuracy, Application
    from selector.findings import Finding
    from selector.recording import Recording


@with_source
def apply(
    source: Source,
    model: Model,
    out: Annotated[
        Path | None, typer.Option("--out", metavar="FILE.csv", help="Write the predicted displacement of every sample.")
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Applies an exported model to other recordings and compares it with the displacement recorded there.

    Findings say where a run leaves the model's valid range and which sensor looks broken. A broken sensor is not
    mended: what is shown is what a control with this model would have done. Faults of the recorded displacement itself
    are left out of the comparison.
    """
    from selector.controllers.application import apply_model, write_predictions
    from selector.controllers.model_io import read_model
    from selector.quality import inspect, without_faults

    read = read_model(model)
    reading = source.reading()
    outputs = [output.name for output in read.outputs]
    used = {*outputs, *(item.name for item in read.inputs)}
    quality = [_of_comparison(finding, outputs) for finding in inspect(reading.recording) if _concerns(finding, used)]
    compared = without_faults(reading.recording, quality)
    rises = [item.name for item in read.inputs if item.reference == "rise" and item.name in compared.names]
    zeros = [item.name for item in read.outputs if item.reference == "rise" and item.name in compared.names]
    application = apply_model(
        read, compared, start_readings=_levels(compared, rises), displacement_start=_levels(compared, zeros)
    )
    findings = (*reading.findings, *quality, *application.findings)
    application = dataclasses.replace(application, findings=findings)
    if out is not None:
        write_predictions(application, out)
    if as_json:
        showing.print_json(application.as_dict())
    console = showing.screen(as_json)
    if not as_json:
        _show(console, application)
    if out is not None:
        console.print(f"wrote {out}", markup=False)


def _concerns(finding: Finding, used: set[str]) -> bool:
    return finding.where.channel is None or finding.where.channel in used


def _of_comparison(finding: Finding, outputs: list[str]) -> Finding:
    """The finding with the action that it has here: only faulty displacement is left out."""
    if finding.action == "leave-out-stretch" and finding.where.channel in outputs:
        return finding
    return dataclasses.replace(finding, action="none")


def _levels(recording: Recording, names: list[str]) -> dict[str, dict[str, float]]:
    """Start readings per run, counted as the model's own runs were; a channel without a reading is left out."""
    from selector.models.reference import start_readings

    return {
        run: {name: level for name, (level, _) in levels.items() if math.isfinite(level)}
        for run, levels in start_readings(recording, names).items()
    }


def _show(console: Console, application: Application) -> None:
    rows: list[tuple[object, ...]] = []
    for run, outputs in application.per_run.items():
        rows += [(run, name, *_cells(accuracy)) for name, accuracy in outputs.items()]
    rows += [("all runs", name, *_cells(accuracy)) for name, accuracy in application.overall.items()]
    columns = ["run", "response", "RMS error", "largest", "RMS before", "largest before"]
    console.print(showing.table("Displacement with and without compensation [µm]", columns, rows, numeric=columns[2:]))
    showing.show_findings(console, application.findings)


def _cells(accuracy: Accuracy) -> tuple[float | None, ...]:
    return accuracy.rmse_um, accuracy.max_um, accuracy.before_rmse_um, accuracy.before_max_um
