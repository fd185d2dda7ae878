"""`prove`: holds the blind proof and prints the score; the report and the files of every case on request."""

import os
from functools import partial
from pathlib import Path
from typing import Annotated

import typer

from selector.atomic_file import folder_written_whole, require_writable_folder
from selector.cli.shared import showing
from selector.cli.shared.files import out_folder, write_answer
from selector.cli.shared.progress import counted_progress
from selector.cli.shared.showing import AsJson

_which = partial(typer.Option, rich_help_panel="Which cases")


def prove(
    families: Annotated[
        list[str] | None, _which("--families", metavar="NAME", help="Family of scenarios; repeat. Default: all.")
    ] = None,
    scenarios: Annotated[
        list[str] | None, _which("--scenarios", metavar="PATTERN", help="Only scenarios such as 'thermal.*'; repeat.")
    ] = None,
    strengths: Annotated[
        str, _which("--strengths", metavar="D,D,…", help="What an oracle could detect, d′.")
    ] = "3,6,12",
    seeds: Annotated[
        str | None,
        _which("--seeds", metavar="FROM:TO|N,N", help="Seeds, TO not included. Default: 0:5, with --exam 10000:10005."),
    ] = None,
    is_exam: Annotated[
        bool, _which("--exam", metavar="", help="Seeds from 10000 on, which nobody develops with.")
    ] = False,
    rivals: Annotated[
        list[str] | None,
        typer.Option("--rivals", metavar="NAME|all", help="Let other methods sit the same exam, too; repeat."),
    ] = None,
    recordings: Annotated[
        Path | None,
        _which(
            "--recordings",
            metavar="DIR",
            help="Also real recordings from elsewhere: DIR holds silverbox, cascaded_tanks, ace_thermal.",
        ),
    ] = None,
    jobs: Annotated[
        int | None, typer.Option("--jobs", metavar="N", min=1, help="Processes. Default: as many as there are cores.")
    ] = None,
    list_only: Annotated[bool, _which("--list", metavar="", help="Print the names of the scenarios and stop.")] = False,
    write_cases: Annotated[
        Path | None,
        typer.Option(
            "--write-cases",
            metavar="DIR",
            help="Answer nothing: write the cases as folders for `selector diagnose`, and the answers apart.",
        ),
    ] = None,
    out: Annotated[Path | None, out_folder(help="Write score.json, cases.csv and report.html, all or none.")] = None,
    as_json: AsJson = False,
) -> None:
    """Proves blind that what a simulation left out is found: cases with sealed answers, scores beside their goals.

    A case is a recording in which an effect is concealed, and a simulation without it, made by other code than the
    catalogue of effects. The answer is judged against a truth that the program does not see; hashes of all cases are
    printed, so that anybody can check that they were not changed.
    """
    from proving_ground import exam, results, runner

    chosen = exam.chosen_scenarios(families, scenarios, recordings)
    if list_only:
        names = ["name", "family", "kind", "note"]
        rows = [{name: getattr(one, name) for name in names} for one in chosen]
        if as_json:
            showing.print_json(rows)
        else:
            cells = [row.values() for row in rows]
            showing.screen().print(showing.table(f"{len(rows)} scenarios", names, cells))
        return
    numbers = exam.asked_seeds(seeds, is_exam=is_exam)
    asked = runner.questions(chosen, exam.asked_strengths(strengths), numbers)
    for folder, option, written in ((out, "--out", ("score.json", "report.html")), (write_cases, "--write-cases", ())):
        if folder is not None:
            require_writable_folder(folder, option, written)
    console = showing.screen(as_json)
    if write_cases is not None:
        with folder_written_whole(write_cases) as part, counted_progress("writing cases") as say:
            sealed = runner.write_bundles(asked, part, progress=say)
        if as_json:
            showing.print_json({"cases": len(asked), "answers_sha256": sealed})
        else:
            answers = f"answers.json apart; its SHA-256 is {sealed}"
            console.print(f"wrote {write_cases}: cases, {answers}", markup=False)
        return
    answerers = exam.asked_answerers(rivals)
    outcomes = runner.outcomes(asked, answerers, n_jobs=jobs or os.cpu_count() or 1, progress=exam.say_done)
    score = results.score_object(outcomes, is_exam=is_exam)
    told = partial(results.proof_account, outcomes, score, is_exam=is_exam)
    files: list[str] = []
    if out is not None:
        texts = {"score.json": showing.json_text(score) + "\n", "cases.csv": results.cases_csv(outcomes)}
        files = write_answer(out, texts, told(drawn=True))
    if as_json:
        showing.print_json(score)
    else:
        showing.show_account(console, told())
    if out is not None:
        showing.show_written(console, out, files)
