"""`simulate thermal`: a model file in, a recording of the simulated machine and its machine file out."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from selector.cli.progress import counted_progress
from selector.cli.showing import AsJson
from selector.cli.simulating import (
    Destination,
    Inputs,
    Out,
    Simulated,
    driven_destination,
    named,
    own_destination,
    require_free_folder,
    require_inputs_for_machine,
    tell,
    write,
)
from selector.cli.simulation_page import PictureAt, Report, page_of, require_page_options, write_page
from selector.cli.source import MachineFile
from selector.errors import ModelFileError, OptionError
from selector.findings import Finding

if TYPE_CHECKING:
    from selector.physics.thermal.cyclogram import Cyclogram
    from selector.physics.thermal.laws import Conditions
    from selector.physics.thermal.model_file import ModelFile
    from selector.physics.thermal.schedule import Vector
    from selector.physics.thermal.thermal_model import FileModel
    from selector.recording import Recording

_ROLES_OF_COLUMNS = {"spindle_speed_rpm": "spindle_speed", "ambient_degc": "ambient", "coolant_degc": "temperature"}

ThermalModelFile = Annotated[
    Path,
    typer.Argument(metavar="MODEL.toml", help="Model file of a network, of thermal modes, or of the field machine."),
]
Cycle = Annotated[
    Path | None,
    typer.Option(
        "--cycle",
        metavar="CYCLE.csv",
        help="Duty cycle (time_s, spindle_speed) instead of the speeds of the model file; its last row is the end.",
    ),
]


def thermal(
    model: ThermalModelFile,
    out: Out,
    cycle: Cycle = None,
    inputs: Inputs = None,
    machine: MachineFile = None,
    seed: Annotated[
        int | None,
        typer.Option(
            "--seed",
            metavar="N",
            min=0,
            help="Of the instruments' noise. Default: that of the model file; none with --inputs.",
        ),
    ] = None,
    report: Report = None,
    picture_at_min: PictureAt = None,
    as_json: AsJson = False,
) -> None:
    """Simulates how a machine warms and moves, and writes a recording of it.

    Beside RUN.csv stands RUN.machine.toml, for --machine of the other commands. With --inputs the model is driven by
    recorded runs at their own time stamps; --out is a folder then, which receives one file a run and machine.toml and
    can be compared with the recordings. Without --seed such simulations have no noise.
    """
    from selector.physics.thermal.model_file import read_model_file

    file = read_model_file(model)
    require_page_options(file, report, picture_at_min)
    if cycle is not None and inputs:
        raise OptionError(
            "--cycle and --inputs together",
            expected="one of them: both say the spindle speed",
            where="command line",
            advice="leave one out",
        )
    require_inputs_for_machine(machine, inputs)
    with counted_progress("simulating") as say, named(model):
        work = (
            _driven(file, model, out, inputs, machine, seed, report, say)
            if inputs
            else _scheduled(file, model, out, cycle, seed, report)
        )
        say(1, 1, "writing")
        page = None
        if report is not None:
            shown = page_of(work.machine, work.recording, work.findings, work.conditions, model, picture_at_min)
            page = partial(write_page, shown)
        done = _done(file, model, work)
        write(done, report, page)
    tell(done, report, as_json)


def _done(file: ModelFile, model: Path, work: _Work) -> Simulated:
    told = work.recording.provenance["simulated"]
    balances = work.recording.provenance["runs"]
    return Simulated(
        work.recording,
        work.destination,
        work.findings,
        command="thermal",
        model={"file": model, "kind": file.model.kind, "name": file.model.name},
        seed=told["seed"] if told["instruments"] else None,
        per_run={run: {"balance": balances.get(run) or None} for run in work.recording.runs},
    )


@dataclass(frozen=True)
class _Work:
    """A simulation, where it goes, what is to be said, and what acted on which machine."""

    recording: Recording
    destination: Destination
    findings: tuple[Finding, ...]
    machine: FileModel
    conditions: Callable[[str], Conditions]


def _scheduled(
    file: ModelFile, model: Path, out: Path, cycle: Path | None, seed: int | None, report: Path | None
) -> _Work:
    """The run that the model file describes."""
    from selector.physics.thermal.model_file import require_few_samples
    from selector.physics.thermal.model_findings import model_findings
    from selector.physics.thermal.schedule import scheduled
    from selector.physics.thermal.thermal_model import simulation_findings, thermal_model

    columns, read, findings = _columns(file, model)
    destination = own_destination(out, [""], report, [model, *read, *([cycle] if cycle else [])])
    (run,) = destination.targets
    duration_s = file.run.duration_min * 60.0
    cyclogram = None if cycle is None else _cyclogram(cycle, duration_s)
    if cyclogram is not None:
        duration_s = cyclogram.end_s
        require_few_samples(file, duration_s, f"the duty cycle {cycle}")
    if duration_s < file.run.period_s:
        raise ModelFileError(
            f"a run of {duration_s:g} s with a sample every {file.run.period_s:g} s",
            expected="a run of one period or more",
            where="key run.duration_min" if cycle is None else f"{cycle}, with key run.period_s of {model}",
            advice="make run.duration_min larger or run.period_s smaller",
        )
    conditions = scheduled(
        file.conditions,
        columns,
        duration_s=duration_s,
        period_s=file.run.period_s,
        cyclogram=cyclogram,
    )
    machine = thermal_model(file)
    simulated = machine.simulate(conditions, run=run, seed=seed)
    findings = (*findings, *model_findings(file), *simulation_findings(simulated))
    return _Work(simulated, destination, findings, machine, lambda _: conditions)


def _driven(
    file: ModelFile,
    model: Path,
    out: Path,
    inputs: list[Path],
    machine: Path | None,
    seed: int | None,
    report: Path | None,
    progress: Any,
) -> _Work:
    """One simulation of every recorded run."""
    from selector.physics.thermal.driving import driven_runs
    from selector.physics.thermal.model_findings import model_findings
    from selector.physics.thermal.schedule import driven, scheduled
    from selector.physics.thermal.thermal_model import thermal_model
    from selector.readers import read as read_recordings

    require_free_folder(out, "--inputs writes one file a run")
    reading = read_recordings(inputs, machine=machine)
    columns, read, said = _columns(file, model)
    destination = driven_destination(out, reading, report, [model, *read])
    otherwise = scheduled(
        file.conditions,
        columns,
        duration_s=max(file.run.duration_min * 60.0, *(run.duration_s for run in reading.runs)),
        period_s=file.run.period_s,
    )
    model_of_file = thermal_model(file)
    simulated, findings = driven_runs(
        model_of_file,
        reading.recording,
        inputs=file.inputs,
        otherwise=otherwise,
        seed=seed,
        progress=progress,
    )
    findings = (*reading.findings, *said, *model_findings(file), *findings)
    return _Work(
        simulated,
        destination,
        findings,
        model_of_file,
        lambda run: driven(reading.recording, run, file.inputs, otherwise).conditions,
    )


def _cyclogram(cycle: Path, duration_s: float) -> Cyclogram:
    """The duty cycle in a file; its last row is the end, a single row holds for the duration of the model file."""
    from selector.physics.thermal.cyclogram import Cyclogram
    from selector.readers.cycle_file import read_cycle

    rows = read_cycle(cycle)
    if len(rows.time_s) == 1:
        return Cyclogram(rows.time_s, rows.speed_rpm, duration_s)
    return Cyclogram(rows.time_s[:-1], rows.speed_rpm[:-1], float(rows.time_s[-1]))


def _columns(file: ModelFile, model: Path) -> tuple[dict[str, tuple[Vector, Vector]], list[Path], tuple[Finding, ...]]:
    """Condition → (time_s, values) of the columns that the model file refers to, the files that hold them, findings."""
    from selector.cli.simulation_columns import columns_beside
    from selector.physics.thermal.model_file import columns_needed

    return columns_beside(model, columns_needed(file), _ROLES_OF_COLUMNS, "conditions.")
