"""`apply`: an exported model on other recordings, and how well it does there."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from selector.atomic_file import refuse_to_replace_input
from selector.cli.models import Model
from selector.cli.shared import showing
from selector.cli.shared.showing import AsJson
from selector.cli.shared.source import Source, with_source
from selector.findings import Finding, Where

if TYPE_CHECKING:
    from rich.console import Console

    from selector.controllers.application import Accuracy, Application


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
    from selector.controllers.application import (
        apply_model,
        displacement_starts,
        without_displacement_faults,
        write_predictions,
    )
    from selector.controllers.model_file import read_model
    from selector.models.design import datum_of

    read = read_model(model)
    reading = source.reading()
    if out is not None:
        refuse_to_replace_input(out, [model, *source.machine_files, *(run.file for run in reading.runs)], "--out")
    compared, quality = without_displacement_faults(read, reading.recording)
    rises = [item.name for item in read.inputs if item.reference == "rise" and item.name in compared.names]
    levels = datum_of(compared, rises, (), "rise").levels
    application = apply_model(read, compared, start_readings=_only(levels, rises))
    told = [finding for finding in quality if not any(_says_the_same(other, finding) for other in application.findings)]
    of_starts = (*_without_start(levels, rises), *_not_zeroed(displacement_starts(read, compared)))
    findings = (*reading.findings, *told, *of_starts, *application.findings)
    application = dataclasses.replace(application, findings=findings)
    if out is not None:
        write_predictions(application, out)
    if as_json:
        showing.print_json(application.as_dict())
    console = showing.screen(as_json)
    if not as_json:
        _show(console, application)
    if out is not None:
        showing.show_written(console, out)


def _says_the_same(said: Finding, finding: Finding) -> bool:
    """Whether the model's own look at a sensor covers what the quality check found there."""
    from selector.controllers.finding_table import SENSOR_LOOKS_BROKEN

    a, b = said.where, finding.where
    if said.id != SENSOR_LOOKS_BROKEN or (a.channel, a.run) != (b.channel, b.run):
        return False
    if a.from_s is None or a.to_s is None or b.from_s is None or b.to_s is None:
        return True
    return a.from_s <= b.to_s and b.from_s <= a.to_s


def _only(levels: Mapping[str, Mapping[str, float]], names: list[str]) -> dict[str, dict[str, float]]:
    return {
        run: {name: level for name, level in found.items() if name in names and math.isfinite(level)}
        for run, found in levels.items()
    }


def _without_start(levels: Mapping[str, Mapping[str, float]], rises: list[str]) -> Iterator[Finding]:
    """Sensors that have no reading at the start of a run: their rise counts from a later time."""
    from selector.cli.shared.finding_table import FINDINGS

    for run, found in levels.items():
        for name in rises:
            if not math.isfinite(found.get(name, math.nan)):
                yield FINDINGS.finding(
                    "start-missing",
                    f"{name} has no reading at the start of run {run}; its rise counts from its first reading, and the "
                    "prediction is too small by what happened before.",
                    Where(channel=name, run=run),
                    {},
                )


def _not_zeroed(starts: Mapping[str, Mapping[str, float]]) -> Iterator[Finding]:
    """Displacements whose start was taken as their zero, which the predictions then count from too."""
    from selector.cli.shared.finding_table import FINDINGS

    for run, found in starts.items():
        for name, start_um in found.items():
            if start_um:
                yield FINDINGS.finding(
                    "gauge-not-zeroed",
                    f"{name} starts run {run} at {start_um:.4g} µm: errors count from there, and the predictions "
                    "that are written have this start added, so that they lie over the recording.",
                    Where(channel=name, run=run),
                    {"start_um": start_um},
                    "zero the gauge before a run",
                )


def _show(console: Console, application: Application) -> None:
    rows: list[tuple[object, ...]] = []
    for run, outputs in application.per_run.items():
        rows += [(run, name, *_cells(accuracy)) for name, accuracy in outputs.items()]
    rows += [("all runs", name, *_cells(accuracy)) for name, accuracy in application.overall.items()]
    columns = ["run", "response", "RMS error", "largest", "RMS before", "largest before"]
    console.print(showing.table("Displacement with and without compensation [µm]", columns, rows, numeric=columns[2:]))
    console.print(
        "Before: displacement as recorded, from its start. Error: what the model itself leaves of it, at the samples "
        "that have a prediction; without limits and guard of a control, which `selector export --replay` adds.",
        markup=False,
    )
    showing.show_findings(console, application.findings)


def _cells(accuracy: Accuracy) -> tuple[float | None, ...]:
    return accuracy.rmse_um, accuracy.max_um, accuracy.before_rmse_um, accuracy.before_max_um
