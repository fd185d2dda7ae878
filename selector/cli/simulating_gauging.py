"""`simulate gauging`: a gauge and the grinding that it stops in, recordings of parts and their machine file out."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from selector.cli.channel_comparison import comparison_object, show_comparison
from selector.cli.gauging_analysis import gauging_object, show_analysis
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
from selector.findings import Finding

if TYPE_CHECKING:
    from rich.console import Console

    from selector.physics.channel_differences import ChannelDifference
    from selector.physics.gauging.gauging_model import GaugingModel, GaugingSimulation
    from selector.physics.gauging.gauging_summary import GaugingSummary
    from selector.readers import Reading

_RUNS_OF_PARTS = "every part that is ground is a run of its own"

GaugingModelFile = Annotated[
    Path, typer.Argument(metavar="MODEL.toml", help="Model file of a gauge and the grinding that it stops.")
]
Report = Annotated[
    Path | None,
    typer.Option(
        "--report",
        metavar="REPORT.html",
        help="Also write a page: finished sizes, what filter and threshold are best, parts in time, the gauge.",
    ),
]


@dataclass(frozen=True)
class _Work:
    """A simulation, where it goes, and what is to be said of it."""

    simulation: GaugingSimulation
    destination: Destination
    findings: tuple[Finding, ...]
    differences: tuple[ChannelDifference, ...] | None = None
    inputs: tuple[str, ...] = ()


def gauging(
    model: GaugingModelFile,
    out: Annotated[
        Path,
        typer.Option(
            "--out", metavar="RUN.csv", help="Recording to write; with --inputs and of several parts a folder."
        ),
    ],
    inputs: Inputs = None,
    machine: MachineFile = None,
    seed: Annotated[
        int | None,
        typer.Option("--seed", metavar="N", min=0, help="Of noise and spread. Default: that of the model file."),
    ] = None,
    report: Report = None,
    as_json: AsJson = False,
) -> None:
    """Simulates how a gauge stops grinding when the part is to size, and writes a recording of it.

    Told are the thresholds, the distribution of finished sizes by formula and by Monte Carlo, the capability, and which
    filter and threshold would be best. Beside RUN.csv stands RUN.machine.toml, for --machine of the other commands.
    Several parts are one run each, so --out is a folder then, which receives one file a run and machine.toml; so it is
    with --inputs, where recorded allowances drive the gauge, run by run, at their time stamps.
    """
    from selector.physics.gauging.gauging_model import gauging_model
    from selector.physics.gauging.gauging_summary import gauging_summary
    from selector.physics.gauging.model_file import read_model_file

    file = read_model_file(model)
    if report is not None:
        require_page_place(report)
    require_inputs_for_machine(machine, inputs)
    with counted_progress("simulating") as say, named(model):
        built = gauging_model(file)
        work = (
            _driven(built, model, out, inputs, machine, seed, report, say)
            if inputs
            else _planned(built, model, out, seed, report, say)
        )
        say(0, 1, "sizes and filters")
        summary = gauging_summary(built, work.simulation, progress=say)
        findings = (*work.findings, *summary.findings)
        page = None
        if report is not None:
            from selector.cli.gauging_page import page_of
            from selector.report.gauging_report import write_gauging_report

            told = (findings, model, work.differences or (), work.inputs)
            shown = page_of(built, work.simulation, summary, *told)
            page = partial(write_gauging_report, shown)
        say(1, 1, "writing")
        recording = work.simulation.recording
        done = Simulated(
            recording,
            work.destination,
            findings,
            command="gauging",
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
        {"gauging": gauging_object(built, work.simulation, summary) | {"comparison": compared}},
        lambda console: _show(console, built, summary, work.differences or ()),
    )


def _planned(
    built: GaugingModel, model: Path, out: Path, seed: int | None, report: Path | None, progress: Any
) -> _Work:
    """The parts that the model file describes."""
    destination = own_destination(out, list(built.runs), report, [model], _RUNS_OF_PARTS)
    progress(0, 1, "")
    simulation = built.simulation(run=next(iter(destination.targets)), seed=seed, progress=progress)
    return _Work(simulation, destination, simulation.findings)


def _driven(
    built: GaugingModel,
    model: Path,
    out: Path,
    inputs: list[Path],
    machine: Path | None,
    seed: int | None,
    report: Path | None,
    progress: Any,
) -> _Work:
    """The gauge on every recorded run."""
    from selector.physics.channel_differences import channel_differences
    from selector.physics.gauging.gauging_channels import roles_asked
    from selector.physics.gauging.gauging_driving import driven_runs
    from selector.readers import Overrides
    from selector.readers import read as read_recordings

    require_free_folder(out, "--inputs writes one file a run")
    reading = read_recordings(inputs, machine=machine)
    asked = roles_asked(built.file, reading.recording, _unread(reading))
    if asked:
        # a column whose role was guessed otherwise, or not at all, is what the model file says
        reading = read_recordings(inputs, machine=machine, overrides=Overrides(roles=asked))
    destination = driven_destination(out, reading, report, [model])
    with named_runs({run.name: run.file for run in reading.runs}):
        driven = driven_runs(built, reading.recording, seed=seed, progress=progress)
    said = (*reading.findings, *driven.findings)
    differences = channel_differences(driven.simulation.recording, reading.recording, driven.inputs)
    return _Work(driven.simulation, destination, said, differences, driven.inputs)


def _unread(reading: Reading) -> list[str]:
    """Columns of which nothing tells what they measure, or nothing but their names."""
    found = [one.evidence.get("columns", []) for one in reading.findings if one.id == "columns-without-role"]
    guessed = [channel.name for channel in reading.channels if {"role", "unit"} <= set(channel.guessed)]
    return [*(str(name) for names in found for name in names), *guessed]


def _show(
    console: Console, built: GaugingModel, summary: GaugingSummary, differences: tuple[ChannelDifference, ...]
) -> None:
    show_comparison(console, differences)
    show_analysis(console, built, summary)
