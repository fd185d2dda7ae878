"""`simulate vibration`: masses, joints and sources in, a recording of tool and workpiece and its machine file out."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from selector.cli.channel_comparison import comparison_object, show_comparison
from selector.cli.progress import counted_progress
from selector.cli.showing import AsJson
from selector.cli.simulating import (
    Destination,
    Inputs,
    Out,
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
from selector.findings import Finding

if TYPE_CHECKING:
    from rich.console import Console

    from selector.physics.channel_differences import ChannelDifference
    from selector.physics.vibration.vibration_model import VibrationModel, VibrationSimulation
    from selector.physics.vibration.vibration_summary import VibrationSummary

VibrationModelFile = Annotated[
    Path, typer.Argument(metavar="MODEL.toml", help="Model file of members, joints and sources of vibration.")
]
Report = Annotated[
    Path | None,
    typer.Option(
        "--report",
        metavar="REPORT.html",
        help="Also write a page: what the part keeps and where it comes from, modes, response, chains.",
    ),
]


@dataclass(frozen=True)
class _Work:
    """A simulation, where it goes, and what is to be said of it."""

    simulation: VibrationSimulation
    destination: Destination
    findings: tuple[Finding, ...]
    differences: tuple[ChannelDifference, ...] | None = None


def vibration(
    model: VibrationModelFile,
    out: Out,
    inputs: Inputs = None,
    machine: MachineFile = None,
    seed: Annotated[
        int | None,
        typer.Option(
            "--seed",
            metavar="N",
            min=0,
            help="Of phases and noise. Default: that of the model file; with --inputs its phases, and no noise.",
        ),
    ] = None,
    report: Report = None,
    as_json: AsJson = False,
) -> None:
    """Simulates how sources outside of the cut shake tool and workpiece, and writes a recording of it.

    Told are the modes of the structure, where each line of the sources goes, the periodic errors that it leaves on the
    part, and where the published chains are off the coupled structure. Beside RUN.csv stands RUN.machine.toml, for
    --machine of the other commands. With --inputs recorded speeds and forces drive the model, run by run, at their time
    stamps; --out is a folder then, which receives one file a run and machine.toml.
    """
    # arrays come in with it
    from selector.cli.vibration_analysis import vibration_object
    from selector.physics.vibration.model_file import read_model_file
    from selector.physics.vibration.vibration_model import vibration_model
    from selector.physics.vibration.vibration_summary import vibration_summary

    file = read_model_file(model)
    if report is not None:
        require_page_place(report)
    require_inputs_for_machine(machine, inputs)
    with counted_progress("simulating") as say, named(model, type(file).model_fields):
        built = vibration_model(file)
        work = (
            _driven(built, model, out, inputs, machine, seed, report, say)
            if inputs
            else _planned(built, model, out, seed, report, say)
        )
        say(0, 1, "modes, lines and errors")
        summary = vibration_summary(built, work.simulation)
        findings = (*work.findings, *summary.findings)
        page = None
        if report is not None:
            from selector.cli.vibration_page import page_of
            from selector.report.vibration_report import write_vibration_report

            shown = page_of(built, work.simulation, summary, findings, model, work.differences or ())
            page = partial(write_vibration_report, shown)
        say(1, 1, "writing")
        recording = work.simulation.recording
        done = Simulated(
            recording,
            work.destination,
            findings,
            command="vibration",
            model={"file": model, "kind": file.model.kind, "name": file.model.name},
            seed=recording.provenance["simulated"]["seed"],
            per_run=recording.provenance["runs"],
        )
        write(done, report, page)
    compared = None if work.differences is None else comparison_object(work.differences)
    tell(
        done,
        report,
        as_json,
        {"vibration": vibration_object(built, summary) | {"comparison": compared}},
        lambda console: _show(console, built, summary, work.differences or ()),
    )


def _planned(
    built: VibrationModel, model: Path, out: Path, seed: int | None, report: Path | None, progress: Any
) -> _Work:
    """The run that the model file describes."""
    destination = own_destination(out, [""], report, [model])
    progress(0, 1, "")
    simulation = built.simulation(run=next(iter(destination.targets)), seed=seed, progress=progress)
    return _Work(simulation, destination, simulation.findings)


def _driven(
    built: VibrationModel,
    model: Path,
    out: Path,
    inputs: list[Path],
    machine: Path | None,
    seed: int | None,
    report: Path | None,
    progress: Any,
) -> _Work:
    """One simulation of every recorded run."""
    from selector.physics.channel_differences import channel_differences
    from selector.physics.vibration.vibration_driving import driven_runs
    from selector.readers import read as read_recordings

    require_free_folder(out, "--inputs writes one file a run")
    reading = read_recordings(inputs, machine=machine)
    destination = driven_destination(out, reading, report, [model])
    files = {run.name: run.file for run in reading.runs}
    with named_runs(files, model, type(built.file).model_fields):
        driven = driven_runs(built, reading.recording, seed=seed, progress=progress)
    said = (*reading.findings, *driven.findings)
    differences = channel_differences(driven.simulation.recording, reading.recording, driven.inputs)
    return _Work(driven.simulation, destination, said, differences)


def _show(
    console: Console, built: VibrationModel, summary: VibrationSummary, differences: tuple[ChannelDifference, ...]
) -> None:
    from selector.cli.vibration_analysis import show_analysis

    show_comparison(console, differences)
    show_analysis(console, built, summary)
