"""`selector simulate KIND`: a model file in, a recording of the simulated machine and its machine file out."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from selector.cli.shared import showing, simulation_files
from selector.cli.shared.option_table import option
from selector.cli.shared.progress import counted_progress
from selector.cli.shared.showing import AsJson, Everything
from selector.cli.shared.source import MachineFile
from selector.errors import CancelledError
from selector.physics.simulation_kind import DutyCycle, Option, RunSettings, SimulationKind
from selector.text_file import shell_word

if TYPE_CHECKING:
    from selector.findings import Finding
    from selector.telling.account import Account

Inputs = Annotated[list[Path] | None, option("simulate --inputs")]


def simulate_command(kind: SimulationKind) -> Callable[..., None]:
    """The command of a kind of simulation, with the options that only it has after those that all have."""
    own = {option.name: _typed(option) for option in kind.options}
    typed = {
        "model": Annotated[Path, typer.Argument(metavar="MODEL.toml", help=kind.model_help)],
        "out": Annotated[Path, typer.Option("--out", metavar="RUN.csv", help=kind.out_help)],
        "inputs": Inputs,
        **own,
        "machine": MachineFile,
        "seed": Annotated[int | None, typer.Option("--seed", metavar="N", min=0, help=kind.seed_help)],
        "report": Annotated[Path | None, typer.Option("--report", metavar="REPORT.html", help=kind.report_help)],
        "everything": Everything,
        "as_json": AsJson,
    }
    # None where nothing is said of these
    flags = ("as_json", "everything", *(option.name for option in kind.options if option.kind is bool))
    defaults: dict[str, Any] = dict.fromkeys(("model", "out"), inspect.Parameter.empty) | dict.fromkeys(flags, False)

    def command(**given: Any) -> None:
        _simulate(kind, asked={name: given.pop(name) for name in own}, **given)

    command.__signature__ = inspect.Signature(  # type: ignore[attr-defined]
        [
            inspect.Parameter(name, inspect.Parameter.KEYWORD_ONLY, annotation=told, default=defaults.get(name))
            for name, told in typed.items()
        ]
    )
    command.__annotations__ = typed
    command.__doc__ = kind.about
    return command


def _typed(option: Option) -> Any:
    named_as = "--" + option.name.replace("_", "-")
    told = typer.Option(named_as, metavar=option.metavar, help=option.help)
    if option.kind is bool:
        return Annotated[bool, told]
    return Annotated[(Path if option.kind is DutyCycle else option.kind) | None, told]


def _simulate(
    kind: SimulationKind,
    *,
    model: Path,
    out: Path,
    inputs: Sequence[Path] | None,
    machine: Path | None,
    seed: int | None,
    report: Path | None,
    everything: bool,
    as_json: bool,
    asked: Mapping[str, Any],
) -> None:
    from selector.cli.shared.simulation_inputs import columns_beside, driving_recordings, duty_cycle
    from selector.telling.simulated import account_of
    from selector.telling.simulated.result import SimulationResult, simulation_document

    file = kind.read(model)
    if report is not None:
        simulation_files.require_page_place(report)
    kind.require_options(file, asked, driven=bool(inputs), report=report is not None)
    simulation_files.require_inputs_for_machine(machine, inputs)
    with counted_progress("simulating") as say, simulation_files.named(model, kind.sections(file)):
        columns, read = columns_beside(model, kind.columns_needed(file), kind.column_roles(), kind.column_section)
        built = kind.model(file, columns)
        said: tuple[Finding, ...] = ()
        read = [model, *read, *(path for path in asked.values() if isinstance(path, Path))]
        if inputs:
            simulation_files.require_free_folder(out, "--inputs writes one file a run")
            reading = driving_recordings(kind, file, inputs, machine)
            destination = simulation_files.driven_destination(out, reading, report, read)
            said = reading.findings
            with simulation_files.named_runs({run.name: run.file for run in reading.runs}, model, kind.sections(file)):
                done = kind.driven(built, reading.recording, RunSettings(columns, seed, asked, say))
        else:
            destination = simulation_files.own_destination(out, kind.runs(built), report, read, kind.why_folder)
            say(0, 1, "")
            first = next(iter(destination.targets))
            asked_of = {name: duty_cycle(kind, name, value) for name, value in asked.items()}
            done = kind.planned(built, first, RunSettings(columns, seed, asked_of, say))
        before = kind.findings_before(built)
        summary = kind.summary(done, say)
        findings = (*said, *before, *done.findings, *kind.findings_after(done, summary))
        result = SimulationResult(kind.name, done, summary, findings, model, asked)
        account = account_of(result, drawn=report is not None)
        say(1, 1, "writing")
        page = None
        if report is not None:
            from selector.telling.page import write_account

            page = partial(write_account, account)
        simulation_files.write_simulation(done.recording, built.name, destination, report, page)
    told = simulation_document(result, destination.targets, destination.machine_path, report) | dict(account.data)
    try:
        if as_json:
            showing.print_json(told)
        else:
            _show(account, told, everything)
    except KeyboardInterrupt:
        raise CancelledError("stopped after the simulation; its files were written") from None


def _show(account: Account, summary: Mapping[str, Any], everything: bool) -> None:
    console = showing.screen()
    showing.show_answer(console, account, summary["findings"], everything=everything)
    *tables, machine_file = summary["files"]
    written = str(tables[0]) if len(tables) == 1 else f"{len(tables)} files to {tables[0].parent}"
    console.print(f"wrote {written}, and {machine_file}", markup=False, soft_wrap=True)
    if summary["report"] is not None:
        console.print(f"wrote {summary['report']}", markup=False, soft_wrap=True)
    console.print(f"read it with --machine {shell_word(str(machine_file))}", markup=False, soft_wrap=True)
