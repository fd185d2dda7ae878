"""`prove`: holds the blind proof and prints the score; the report and the files of every case on request."""

import os
from functools import partial
from pathlib import Path
from typing import Annotated

from selector.atomic_file import folder_written_whole, require_writable_folder
from selector.cli.shared import showing
from selector.cli.shared.option_table import option
from selector.cli.shared.progress import counted_progress
from selector.cli.shared.showing import AsJson, write_answer


def prove(
    families: Annotated[list[str] | None, option("prove --families")] = None,
    scenarios: Annotated[list[str] | None, option("prove --scenarios")] = None,
    strengths: Annotated[str, option("prove --strengths")] = "3,6,12",
    seeds: Annotated[str | None, option("prove --seeds")] = None,
    is_exam: Annotated[bool, option("prove --exam")] = False,
    rivals: Annotated[list[str] | None, option("prove --rivals")] = None,
    recordings: Annotated[Path | None, option("prove --recordings")] = None,
    jobs: Annotated[int | None, option("prove --jobs", min=1)] = None,
    list_only: Annotated[bool, option("prove --list")] = False,
    write_cases: Annotated[Path | None, option("prove --write-cases")] = None,
    out: Annotated[Path | None, option("prove --out")] = None,
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
    for folder, name, written in ((out, "--out", ("score.json", "report.html")), (write_cases, "--write-cases", ())):
        if folder is not None:
            require_writable_folder(folder, name, written)
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
