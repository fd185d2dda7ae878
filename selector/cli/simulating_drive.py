"""`simulate drive`: the model file of a feed drive in, recordings of its axes and their machine file out."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from selector.cli.drive_analysis import drive_object, show_analysis
from selector.cli.drive_comparison import comparison_object, show_comparison
from selector.cli.progress import counted_progress
from selector.cli.showing import AsJson
from selector.cli.simulating import (
    Destination,
    Inputs,
    Simulated,
    driven_destination,
    named,
    named_runs,
    own_destination,
    require_free_folder,
    require_inputs_for_machine,
    tell,
    write,
)
from selector.cli.simulation_files import require_page_place
from selector.cli.source import MachineFile
from selector.errors import OptionError
from selector.findings import Finding

if TYPE_CHECKING:
    from rich.console import Console

    from selector.physics.drive.comparison import Difference
    from selector.physics.drive.drive_model import DriveModel, DriveSimulation
    from selector.physics.drive.drive_summary import DriveSummary
    from selector.physics.drive.model_schema import DriveFile

_RUNS_OF_CIRCLES = "a ball-bar test has one run for each feed and direction"

DriveModelFile = Annotated[Path, typer.Argument(metavar="MODEL.toml", help="Model file of a feed drive.")]
Report = Annotated[
    Path | None,
    typer.Option(
        "--report", metavar="REPORT.html", help="Also write a page: courses, errors and their causes, the control loop."
    ),
]


@dataclass(frozen=True)
class _Work:
    """A simulation, where it goes, and what is to be said of it."""

    simulation: DriveSimulation
    destination: Destination
    findings: tuple[Finding, ...]
    differences: tuple[Difference, ...] | None = None


def drive(
    model: DriveModelFile,
    out: Annotated[
        Path,
        typer.Option(
            "--out", metavar="RUN.csv", help="Recording to write; with --inputs and of a ball-bar test a folder."
        ),
    ],
    inputs: Inputs = None,
    open_loop: Annotated[
        bool,
        typer.Option(
            "--open-loop", metavar="", help="With --inputs: the recorded output of the control acts, not the model's."
        ),
    ] = False,
    machine: MachineFile = None,
    seed: Annotated[
        int | None,
        typer.Option("--seed", metavar="N", min=0, help="Of the noise. Default: that of the model file."),
    ] = None,
    report: Report = None,
    as_json: AsJson = False,
) -> None:
    """Simulates how the axes of a feed drive follow their command, and writes a recording of it.

    Beside RUN.csv stands RUN.machine.toml, for --machine of the other commands. With --inputs the axes follow recorded
    commands, run by run, at their time stamps. --out is a folder then, and for a ball-bar test, whose circles are one
    run for each feed and direction; it receives one file a run and machine.toml.
    """
    from selector.physics.drive.drive_summary import drive_summary
    from selector.physics.drive.model_file import read_model_file

    file = read_model_file(model)
    if report is not None:
        require_page_place(report)
    require_inputs_for_machine(machine, inputs)
    if open_loop and not inputs:
        raise OptionError(
            "--open-loop without --inputs",
            expected="recordings whose output of the control acts on the axes",
            where="--open-loop",
            advice="add --inputs RUN, or leave --open-loop out",
        )
    with counted_progress("simulating") as say, named(model):
        built, columns_findings, read = _model(file, model)
        work = (
            _driven(built, model, out, inputs, open_loop, machine, seed, report, read, say)
            if inputs
            else _planned(built, model, out, seed, report, read, say)
        )
        say(1, 1, "writing")
        summary = drive_summary(built, work.simulation)
        caused = () if summary.causes is None else summary.causes.findings
        findings = (*columns_findings, *work.findings, *caused)
        page = None
        if report is not None:
            from selector.cli.drive_page import page_of
            from selector.report.drive_report import write_drive_report

            page = partial(
                write_drive_report, page_of(built, work.simulation, summary, findings, model, work.differences or ())
            )
        told = work.simulation.recording.provenance
        done = Simulated(
            work.simulation.recording,
            work.destination,
            findings,
            command="drive",
            model={"file": model, "kind": file.model.kind, "name": file.model.name},
            seed=told["simulated"]["seed"],
            per_run=told["runs"],
        )
        write(done, report, page)
    compared = None if work.differences is None else comparison_object(work.differences)
    tell(
        done,
        report,
        as_json,
        {"drive": drive_object(built, summary) | {"comparison": compared}},
        lambda console: _show(console, built, summary, work.differences or ()),
    )


def _model(file: DriveFile, model: Path) -> tuple[DriveModel, tuple[Finding, ...], list[Path]]:
    """The model, what is to be said of the columns that its file refers to, and the files that hold them."""
    from selector.cli.simulation_columns import columns_beside
    from selector.physics.drive.drive_model import drive_model
    from selector.physics.drive.model_file import COLUMN_ROLES, columns_needed

    columns, read, findings = columns_beside(model, columns_needed(file), COLUMN_ROLES)
    return drive_model(file, columns), findings, read


def _planned(
    built: DriveModel, model: Path, out: Path, seed: int | None, report: Path | None, read: list[Path], progress: Any
) -> _Work:
    """The motion that the model file describes."""
    from selector.physics.drive.model_findings import model_findings, simulation_findings

    destination = own_destination(out, list(built.runs), report, [model, *read], _RUNS_OF_CIRCLES)
    before = model_findings(built)
    progress(0, 1, "")
    simulation = built.simulation(run=next(iter(destination.targets)), seed=seed)
    return _Work(simulation, destination, (*before, *simulation_findings(built, simulation)))


def _driven(
    built: DriveModel,
    model: Path,
    out: Path,
    inputs: list[Path],
    open_loop: bool,
    machine: Path | None,
    seed: int | None,
    report: Path | None,
    read: list[Path],
    progress: Any,
) -> _Work:
    """One simulation of every recorded run."""
    from selector.physics.drive.comparison import recorded_differences
    from selector.physics.drive.driving import driven_runs
    from selector.physics.drive.model_findings import model_findings, simulation_findings
    from selector.readers import read as read_recordings

    require_free_folder(out, "--inputs writes one file a run")
    reading = read_recordings(inputs, machine=machine)
    destination = driven_destination(out, reading, report, [model, *read])
    before = model_findings(built)
    with named_runs({run.name: run.file for run in reading.runs}):
        driven = driven_runs(built, reading.recording, opened=open_loop, seed=seed, progress=progress)
    after = simulation_findings(built, driven.simulation, driven=True)
    said = (*reading.findings, *before, *driven.findings, *after)
    differences = recorded_differences(built, driven, reading.recording)
    return _Work(driven.simulation, destination, said, differences)


def _show(console: Console, built: DriveModel, summary: DriveSummary, differences: tuple[Difference, ...]) -> None:
    show_comparison(console, differences)
    show_analysis(console, built, summary)
