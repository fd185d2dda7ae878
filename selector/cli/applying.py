"""`apply`: an exported model on other recordings, and how well it does there."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from selector.atomic_file import refuse_to_replace_input, require_replaceable
from selector.cli.models import Model
from selector.cli.shared import showing
from selector.cli.shared.option_table import option
from selector.cli.shared.showing import AsJson, Everything
from selector.cli.shared.source import Source, with_source
from selector.findings import Finding

if TYPE_CHECKING:
    from rich.console import Console

    from selector.controllers.application import Application
    from selector.controllers.model_file import ModelFile


@with_source
def apply(
    source: Source,
    model: Model,
    out: Annotated[Path | None, option("apply --out")] = None,
    everything: Everything = False,
    as_json: AsJson = False,
) -> None:
    """Applies an exported model to other recordings and compares it with the displacement recorded there.

    Findings say where a run leaves the model's valid range and which sensor looks broken. A broken sensor is not
    mended: what is shown is what a control with this model would have done. Faults of the recorded displacement itself
    are left out of the comparison.
    """
    from selector.controllers.application import write_predictions
    from selector.controllers.self_check import usable_model
    from selector.study.applied import applied

    read, _ = usable_model(model)
    reading = source.reading(tuple(item.name for item in read.inputs))
    if out is not None:
        refuse_to_replace_input(out, [model, *source.machine_files, *(file for file, _ in reading.files)], "--out")
        require_replaceable(out.parent, {out.name: "run,time_s,"})
    application, _ = applied(read, reading)
    application = replace(application, findings=(*application.findings, *_not_adapted(read)))
    if out is not None:
        write_predictions(application, out)
    if as_json:
        showing.print_json(application.as_dict())
    console = showing.screen(as_json)
    if not as_json:
        _show(console, application, everything=everything)
    if out is not None:
        showing.show_written(console, out)


def _not_adapted(model: ModelFile) -> Iterator[Finding]:
    """Touch-offs would make these errors smaller, but there are none here."""
    from selector.cli.shared.finding_table import FINDINGS

    if model.adaptation is not None:
        names = [of.output for of in model.adaptation.outputs]
        yield FINDINGS.finding(
            "adaptation-not-applied",
            f"The model file says how touch-offs adapt {', '.join(names)}; here there are none.",
            None,
            {"outputs": names},
        )


def _show(console: Console, application: Application, *, everything: bool) -> None:
    of_runs = [(run, name, of) for run, outputs in application.per_run.items() for name, of in outputs.items()]
    shown, most = "", len(of_runs) if everything else showing.MOST_ROWS
    if len(of_runs) > most:
        shown = f"The {most} largest errors of {len(of_runs)}; --all shows all. "
        of_runs.sort(key=lambda one: -(one[2].rmse_um or 0.0))
    everywhere = [("all runs", name, of) for name, of in application.overall.items()]
    rows = [
        (run, name, of.rmse_um, of.max_um, of.before_rmse_um, of.before_max_um)
        for run, name, of in (*of_runs[:most], *everywhere)
    ]
    columns = ["run", "response", "RMS error", "largest", "RMS before", "largest before"]
    console.print(showing.table("Displacement with and without compensation [µm]", columns, rows, numeric=columns[2:]))
    console.print(
        f"{shown}Before: displacement as recorded, from its start. Error: what the model itself leaves of it, at the "
        "samples that have a prediction; without limits and guard of a control, which `selector export --replay` adds.",
        markup=False,
    )
    showing.show_findings(console, application.findings, everything=everything)
