"""`prove`: holds the blind proof and prints the score; the report and the files of every case on request."""

from __future__ import annotations

import os
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from selector.atomic_file import folder_written_whole, require_writable_folder
from selector.cli.shared import proof_cases, showing
from selector.cli.shared.showing import AsJson

if TYPE_CHECKING:
    from rich.console import Console

    from proving_ground.runner import Outcome

_which = partial(typer.Option, rich_help_panel="Which cases")

Families = Annotated[
    list[str] | None,
    _which("--families", metavar="NAME", help="Family of scenarios; repeat. Default: all."),
]
Names = Annotated[
    list[str] | None,
    _which("--scenarios", metavar="PATTERN", help="Only scenarios such as 'thermal.*'; repeat."),
]
Strengths = Annotated[
    str,
    _which("--strengths", metavar="D,D,…", help="What an oracle could detect, d′."),
]
Seeds = Annotated[
    str | None,
    _which(
        "--seeds",
        metavar="FROM:TO|N,N",
        help="Seeds, TO not included. Default: 0:5, with --exam 10000:10005.",
    ),
]
Exam = Annotated[
    bool,
    _which("--exam", metavar="", help="Seeds from 10000 on, which nobody develops with."),
]
Rivals = Annotated[
    list[str] | None,
    typer.Option("--rivals", metavar="NAME|all", help="Let other methods sit the same exam, too; repeat."),
]
Jobs = Annotated[
    int | None, typer.Option("--jobs", metavar="N", min=1, help="Processes. Default: as many as there are cores.")
]
List = Annotated[bool, _which("--list", metavar="", help="Print the names of the scenarios and stop.")]
Recordings = Annotated[
    Path | None,
    _which(
        "--recordings",
        metavar="DIR",
        help="Also real recordings from elsewhere: DIR holds silverbox, cascaded_tanks, ace_thermal.",
    ),
]
Cases = Annotated[
    Path | None,
    typer.Option(
        "--write-cases",
        metavar="DIR",
        help="Answer nothing: write the cases as folders for `selector diagnose`, and the answers apart.",
    ),
]
Out = Annotated[
    Path | None,
    typer.Option("--out", metavar="DIR", help="Write score.json, cases.csv and report.html, all or none."),
]


def prove(
    families: Families = None,
    scenarios: Names = None,
    strengths: Strengths = "3,6,12",
    seeds: Seeds = None,
    exam: Exam = False,
    rivals: Rivals = None,
    recordings: Recordings = None,
    jobs: Jobs = None,
    list_only: List = False,
    write_cases: Cases = None,
    out: Out = None,
    as_json: AsJson = False,
) -> None:
    """Proves blind that what a simulation left out is found: cases with sealed answers, scores beside their goals.

    A case is a recording in which an effect is concealed, and a simulation without it, made by other code than the
    catalogue of effects. The answer is judged against a truth that the program does not see; hashes of all cases are
    printed, so that anybody can check that they were not changed.
    """
    from proving_ground import runner
    from proving_ground.scenarios import scenarios as all_scenarios

    chosen = all_scenarios(proof_cases.split(families), proof_cases.split(scenarios), proof_cases.published(recordings))
    if list_only:
        proof_cases.show_list(chosen, as_json)
        return
    numbers = proof_cases.seeds(seeds if seeds is not None else "10000:10005" if exam else "0:5")
    runner.require_seeds(numbers, is_exam=exam)
    asked = runner.questions(chosen, proof_cases.strengths(strengths), numbers)
    for folder, option, results in ((out, "--out", ("score.json", "report.html")), (write_cases, "--write-cases", ())):
        if folder is not None:
            require_writable_folder(folder, option, results)
    console = showing.screen(as_json)
    if write_cases is not None:
        proof_cases.write_cases(write_cases, asked, console, as_json)
        return
    answerers = (runner.Answerer(runner.TOOL, runner.answer_of_selector), *proof_cases.rivals(rivals))
    outcomes = runner.outcomes(asked, answerers, n_jobs=jobs or os.cpu_count() or 1, progress=proof_cases.say_done)
    _tell(outcomes, exam, out, console, as_json)


def _tell(outcomes: tuple[Outcome, ...], is_exam: bool, out: Path | None, console: Console, as_json: bool) -> None:
    from proving_ground.results import cases_csv, proof_account, score_object

    result = score_object(outcomes, is_exam=is_exam)
    if out is not None:
        from selector.telling.page import write_account

        with folder_written_whole(out) as folder:
            files = {"score.json": showing.json_text(result) + "\n", "cases.csv": cases_csv(outcomes)}
            for name, text in files.items():
                (folder / name).write_text(text, encoding="utf-8", newline="\n")
            write_account(proof_account(outcomes, result, is_exam=is_exam, drawn=True), folder / "report.html")
    if as_json:
        showing.print_json(result)
    else:
        showing.show_account(console, proof_account(outcomes, result, is_exam=is_exam))
    if out is not None:
        showing.show_written(console, out, ("score.json", "cases.csv", "report.html"))
