"""`simulate`: a model file in, a recording of the simulated machine and its machine file out."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from selector.cli import showing
from selector.cli.showing import AsJson
from selector.cli.simulation_files import LABEL, require_places, written_together
from selector.cli.simulation_page import PictureAt, Report, page_of, require_page_options, write_page
from selector.cli.source import MachineFile
from selector.errors import CancelledError, InputError, ModelFileError, OptionError
from selector.findings import Finding

if TYPE_CHECKING:
    from rich.console import Console

    from selector.physics.thermal.cyclogram import Cyclogram
    from selector.physics.thermal.laws import Conditions
    from selector.physics.thermal.model_file import ModelFile
    from selector.physics.thermal.schedule import Vector
    from selector.physics.thermal.thermal_model import FileModel
    from selector.recording import Recording
    from selector.report.simulation_report import SimulationPage

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
Inputs = Annotated[
    list[Path] | None,
    typer.Option(
        "--inputs",
        metavar="RUN",
        help="Recordings whose speed, hall temperature and so on drive the model, run by run; repeat.",
    ),
]


def thermal(
    model: ThermalModelFile,
    out: Annotated[
        Path,
        typer.Option("--out", metavar="RUN.csv", help="Recording to write; with --inputs a folder, one file a run."),
    ],
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
    if machine is not None and not inputs:
        raise OptionError(
            "--machine without --inputs",
            expected="recordings that the machine file describes",
            where="--machine",
            advice="add --inputs RUN, or leave --machine out",
        )
    with showing.progress("simulating") as say, _named(model):
        work = (
            _driven(file, model, out, inputs, machine, seed, report, say)
            if inputs
            else _scheduled(file, model, out, cycle, seed, report)
        )
        say(1, 1, "writing")
        page = None
        if report is not None:
            page = page_of(work.machine, work.simulated, work.findings, work.conditions, model, picture_at_min)
        summary = _summary(file, model, work, report)
        _write(work, f"{file.model.name}{LABEL}", page, report)
    try:
        if as_json:
            showing.print_json(summary)
        else:
            _show(showing.screen(), work.simulated, summary, work.findings)
    except KeyboardInterrupt:
        raise CancelledError("stopped after the simulation; its files were written") from None


@contextmanager
def _named(model: Path) -> Iterator[None]:
    """Errors about a key of the model file name the file too."""
    try:
        yield
    except InputError as error:
        if not error.where.startswith(("key ", "model ")):
            raise
        where = f"{model}, {error.where.removeprefix('model ')}"
        raise type(error)(error.found, expected=error.expected, where=where, advice=error.advice) from error


@dataclass(frozen=True)
class _Work:
    """A simulation, the file of each run, the machine file, what is to be said, which files were read, what acted."""

    simulated: Recording
    targets: dict[str, Path]
    machine_path: Path
    findings: tuple[Finding, ...]
    read: list[Path]
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

    if out.suffix.lower() != ".csv":
        raise OptionError(
            f"{out.name!r}",
            expected="a file that ends in .csv",
            where="--out",
            advice="name the recording, e.g. --out run1.csv; only --inputs writes a folder",
        )
    columns, read, findings = _columns(file, model)
    read += [cycle] if cycle else []
    run = out.stem or "simulation"
    beside = out.with_suffix(".machine.toml")
    require_places([out], beside, report, [model, *read])
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
    return _Work(simulated, {run: out}, beside, findings, read, machine, lambda _: conditions)


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
    from selector.readers.writing import run_files

    single = out.suffix.lower() == ".csv" and not out.is_dir()
    if out.exists() and not out.is_dir() and not single:
        raise OptionError(
            "a file of this name exists",
            expected="a folder, or a name that is free: --inputs writes one file a run",
            where=f"--out {out}",
            advice="choose another name",
        )
    reading = read_recordings(inputs, machine=machine)
    if single and len(reading.runs) != 1:
        raise OptionError(
            f"{out.name!r} for {len(reading.runs)} runs",
            expected="a folder: --inputs writes one file a run",
            where=f"--out {out}",
            advice="name a folder, e.g. --out simulated",
        )
    columns, read, said = _columns(file, model)
    read += [Path(run.file) for run in reading.runs]
    if reading.machine_file is not None:
        read.append(Path(reading.machine_file))
    runs = reading.recording.runs
    targets = {runs[0]: out} if single else run_files(runs, out, "csv")
    machine_path = out.with_suffix(".machine.toml") if single else out / "machine.toml"
    require_places(targets.values(), machine_path, report, [model, *read])
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
        targets,
        machine_path,
        findings,
        read,
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
    from selector.cli.simulation_columns import column_beside
    from selector.physics.thermal.model_file import columns_needed

    found: dict[str, tuple[Vector, Vector]] = {}
    read: list[Path] = []
    findings: list[Finding] = []
    for key, course in columns_needed(file).items():
        path, found[key], told = column_beside(model, course, key)
        read.append(path)
        findings += told
    return found, read, tuple(findings)


def _write(work: _Work, machine_name: str, page: SimulationPage | None, report: Path | None) -> None:
    """The recordings, their machine file and the page, all or none."""
    from selector.readers.writing import write_recording

    pages = [] if page is None or report is None else [report]
    with written_together([*pages, *work.targets.values(), work.machine_path]) as drafts:
        if page is not None and report is not None:
            write_page(page, drafts[report])
        at = {run: drafts[path] for run, path in work.targets.items()}
        write_recording(work.simulated, at, drafts[work.machine_path], machine_name)


def _summary(file: ModelFile, model: Path, work: _Work, report: Path | None) -> dict[str, Any]:
    """The contract `selector.simulation/1`."""
    simulated = work.simulated
    balances = simulated.provenance["runs"]
    runs = []
    for run in simulated.runs:
        time_s = simulated.time_s(run)
        runs.append(
            {
                "run": run,
                "file": work.targets[run],
                "rows": len(time_s),
                "duration_s": time_s[-1] - time_s[0],
                "balance": balances.get(run) or None,
            }
        )
    channels = []
    for channel in simulated.channels:
        values = simulated.frame[channel.name]
        channels.append(
            {
                "name": channel.name,
                "role": channel.role,
                "unit": channel.unit,
                "place": channel.place,
                "axis": channel.axis,
                "min": float(values.min()),
                "max": float(values.max()),
            }
        )
    return {
        "schema": "selector.simulation/1",
        "kind": "thermal",
        "model": {"file": model, "kind": file.model.kind, "name": file.model.name},
        "seed": simulated.provenance["simulated"]["seed"] if simulated.provenance["simulated"]["instruments"] else None,
        "files": [*work.targets.values(), work.machine_path],
        "machine_file": work.machine_path,
        "report": report,
        "runs": runs,
        "channels": channels,
        "findings": list(work.findings),
    }


def _show(console: Console, simulated: Recording, summary: dict[str, Any], findings: Iterable[Finding]) -> None:
    rows = [(c["name"], c["role"], c["unit"], c["place"] or c["axis"], c["min"], c["max"]) for c in summary["channels"]]
    title = f"{summary['model']['name']}: simulated, {len(simulated.runs)} run{'s' * (len(simulated.runs) != 1)}"
    columns = ["channel", "role", "unit", "place or axis", "lowest", "highest"]
    console.print(showing.table(title, columns, rows, numeric=["lowest", "highest"]))
    showing.show_findings(console, findings)
    *tables, machine_file = summary["files"]
    named = str(tables[0]) if len(tables) == 1 else f"{len(tables)} files to {tables[0].parent}"
    console.print(f"wrote {named}, and {machine_file}", markup=False, soft_wrap=True)
    if summary["report"] is not None:
        console.print(f"wrote {summary['report']}", markup=False, soft_wrap=True)
    console.print(f"read it with --machine {machine_file}", markup=False, soft_wrap=True)
