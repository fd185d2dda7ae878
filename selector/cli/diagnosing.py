"""`diagnose`: recordings and a simulation in; where they differ, which physics was left out, and the fit with it."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from selector.atomic_file import folder_written_whole, require_writable_folder
from selector.cli.shared import showing
from selector.cli.shared.diagnosed.answer import answered
from selector.cli.shared.diagnosed.asked import Asked, asked_of, require_usable
from selector.cli.shared.files import written_folder
from selector.cli.shared.progress import progress_bar
from selector.cli.shared.showing import AsJson
from selector.cli.shared.source import Source, with_source
from selector.cli.shared.studying import AcceptChanges, StudyPath, hashes, opened_study, repeated_words, told_if_no_text

if TYPE_CHECKING:
    from rich.console import Console

    from selector.diagnosis.answer import Diagnosis

_of_simulation = partial(typer.Option, rich_help_panel="What it is compared with")

Simulation = Annotated[
    list[Path] | None,
    _of_simulation(
        "--simulation",
        metavar="PATH",
        help="Simulated runs, named as the recorded ones: a folder, or a file; repeat.",
    ),
]
Model = Annotated[
    Path | None,
    _of_simulation(
        "--model",
        metavar="MODEL.toml|UNIT.fmu",
        help="Instead: a model file of `selector simulate`, or an FMU; the recordings drive it, and it is refitted.",
    ),
]
SimulationTimeUnit = Annotated[
    str | None,
    _of_simulation(
        "--simulation-time-unit",
        metavar="UNIT",
        help="Unit of the time in the simulated files, if it is another one and not written there.",
    ),
]
Responses = Annotated[
    list[str] | None,
    typer.Option("--response", metavar="NAME", help="Channel to compare; repeat. Default: all that are simulated."),
]
HoldOut = Annotated[
    str,
    typer.Option(
        "--holdout",
        metavar="last|RUN|SHARE",
        help="What nothing is fitted to: the last run (of a single one its last 30 %), a run, or a share of every run.",
    ),
]
Seed = Annotated[int, typer.Option("--seed", metavar="N", help="Of the draws of noise.")]
FalseAlarm = Annotated[
    float,
    typer.Option("--false-alarm", metavar="P", help="Allowed probability of naming something where nothing is."),
]
Out = Annotated[
    Path | None,
    typer.Option(
        "--out",
        metavar="DIR",
        help="Write diagnosis.json, report.html and study.toml; with --model improved.toml; where physics is named "
        "that is not in that, correction.json, and model.json if it is thermal. Those of an earlier answer there are "
        "replaced or removed.",
        parser=written_folder,
    ),
]


@with_source
def diagnose(
    source: Source,
    context: typer.Context,
    from_study: StudyPath = None,
    accept_changes: AcceptChanges = False,
    simulation: Simulation = None,
    model: Model = None,
    simulation_time_unit: SimulationTimeUnit = None,
    response: Responses = None,
    holdout: HoldOut = "last",
    seed: Seed = 0,
    false_alarm: FalseAlarm = 0.02,
    out: Out = None,
    as_json: AsJson = False,
) -> None:
    """Says what a simulation left out: where it differs from the recordings, which physics or fault of the data
    explains it, how sure that is, and how much closer the simulation comes with it.

    What is named was tested against noise on rows that it was not fitted to. Where nothing of the catalogue explains
    a difference, that is said, and nothing is named.
    """
    console = showing.screen(as_json)
    opened = opened_study(from_study, source, context, accept_changes=accept_changes, console=console)
    asked = Asked(simulation, model, simulation_time_unit, response, holdout, seed, false_alarm)
    if opened is not None:
        source, asked = opened.source, asked_of(opened)
    require_usable(asked)
    if out is not None:
        require_writable_folder(out, "--out")
    from selector.cli.shared.diagnosed.files import (
        earlier_answer,
        require_replaceable,
        write_diagnosis_study,
        write_results,
    )
    from selector.cli.shared.recordings_used import beside_recordings

    if out is not None:
        require_replaceable(out, with_model=asked.model is not None)
    with progress_bar() as progress:
        answer = answered(source, asked, progress)
        found = answer.found
        if out is not None:
            progress("writing", 1.0)
            require_replaceable(out, with_model=asked.model is not None)
            with folder_written_whole(out, earlier_answer(out)) as folder:
                written = write_results(answer, folder)
                results = hashes(folder)
                with told_if_no_text(console):
                    read = (answer.recorded, answer.simulated)
                    written += write_diagnosis_study(folder, out, source, asked, *read, opened)
    if as_json:
        showing.print_json(found.as_dict())
    else:
        _show(console, found)
    showing.show_findings(console, beside_recordings(answer.recorded.findings))
    if out is not None:
        console.print(f"wrote {out}: {', '.join(written)}", markup=False)
        if opened is not None and opened.study.results:
            console.print(repeated_words(opened.study, results), markup=False)


def _show(console: Console, found: Diagnosis) -> None:
    from selector.telling.diagnosed.account import diagnosis_account

    showing.show_account(console, diagnosis_account(found))
    showing.show_findings(console, found.findings)
