"""`prove`: holds the blind proof and prints the score; the report and the files of every case on request."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterable, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from selector.atomic_file import folder_written_whole, require_writable_folder
from selector.cli.shared import showing
from selector.cli.shared.files import write_answer, written_folder
from selector.cli.shared.progress import counted_progress
from selector.cli.shared.showing import AsJson
from selector.errors import OptionError

if TYPE_CHECKING:
    from rich.console import Console

    from proving_ground.case import Scenario
    from proving_ground.runner import Answerer, Outcome

_which = partial(typer.Option, rich_help_panel="Which cases")

Families = Annotated[
    list[str] | None, _which("--families", metavar="NAME", help="Family of scenarios; repeat. Default: all.")
]
Names = Annotated[
    list[str] | None, _which("--scenarios", metavar="PATTERN", help="Only scenarios such as 'thermal.*'; repeat.")
]
Strengths = Annotated[str, _which("--strengths", metavar="D,D,…", help="What an oracle could detect, d′.")]
Seeds = Annotated[
    str | None,
    _which("--seeds", metavar="FROM:TO|N,N", help="Seeds, TO not included. Default: 0:5, with --exam 10000:10005."),
]
Exam = Annotated[bool, _which("--exam", metavar="", help="Seeds from 10000 on, which nobody develops with.")]
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
    typer.Option(
        "--out", metavar="DIR", parser=written_folder, help="Write score.json, cases.csv and report.html, all or none."
    ),
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

    chosen = all_scenarios(_split(families), _split(scenarios), _published(recordings))
    if list_only:
        _show_list(chosen, as_json)
        return
    numbers = _seeds(seeds if seeds is not None else "10000:10005" if exam else "0:5")
    runner.require_seeds(numbers, is_exam=exam)
    asked = runner.questions(chosen, _strengths(strengths), numbers)
    for folder, option, results in ((out, "--out", ("score.json", "report.html")), (write_cases, "--write-cases", ())):
        if folder is not None:
            require_writable_folder(folder, option, results)
    console = showing.screen(as_json)
    if write_cases is not None:
        _write_cases(write_cases, asked, console, as_json)
        return
    answerers = (runner.Answerer(runner.TOOL, runner.answer_of_selector), *_rivals(rivals))
    outcomes = runner.outcomes(asked, answerers, n_jobs=jobs or os.cpu_count() or 1, progress=_say_done)
    _tell(outcomes, exam, out, console, as_json)


def _tell(outcomes: tuple[Outcome, ...], is_exam: bool, out: Path | None, console: Console, as_json: bool) -> None:
    from proving_ground.results import cases_csv, proof_account, score_object

    result = score_object(outcomes, is_exam=is_exam)
    if out is not None:
        files = {"score.json": showing.json_text(result) + "\n", "cases.csv": cases_csv(outcomes)}
        write_answer(out, files, proof_account(outcomes, result, is_exam=is_exam, drawn=True))
    if as_json:
        showing.print_json(result)
    else:
        showing.show_account(console, proof_account(outcomes, result, is_exam=is_exam))
    if out is not None:
        showing.show_written(console, out, ("score.json", "cases.csv", "report.html"))


def _published(folder: Path | None) -> tuple[Scenario, ...]:
    """Scenarios of the recordings in a folder; what was looked for in vain is told."""
    if folder is None:
        return ()
    from proving_ground.real import published

    found, lacking = published(folder)
    for name in lacking:
        typer.echo(f"recording {name} is absent: there is no folder {folder / name}", err=True)
    return found


def _show_list(scenarios: Sequence[Scenario], as_json: bool) -> None:
    if as_json:
        showing.print_json([{"name": s.name, "family": s.family, "kind": s.kind, "note": s.note} for s in scenarios])
        return
    rows = [(one.name, one.family, one.kind, one.note) for one in scenarios]
    showing.screen().print(showing.table(f"{len(rows)} scenarios", ["name", "family", "kind", "note"], rows))


def _write_cases(folder: Path, asked: Sequence[Any], console: Console, as_json: bool) -> None:
    from proving_ground.runner import write_bundles

    with folder_written_whole(folder) as part, counted_progress("writing cases") as say:
        sealed = write_bundles(asked, part, progress=say)
    if as_json:
        showing.print_json({"cases": len(asked), "answers_sha256": sealed})
    else:
        console.print(f"wrote {folder}: cases, answers.json apart; its SHA-256 is {sealed}", markup=False)


def _rivals(names: list[str] | None) -> tuple[Answerer, ...]:
    """The other methods that are asked; what `all` cannot find is told."""
    if not names:
        return ()
    from proving_ground.rivals import RIVALS
    from proving_ground.rivals import rivals as known_rivals

    found = known_rivals(_split(names))
    if "all" in _split(names):
        for rival in (one for one in RIVALS if not one.is_here):
            typer.echo(f"rival {rival.name} is absent: the package {rival.package} is not installed", err=True)
    return found


def _split(given: Iterable[str] | None) -> tuple[str, ...]:
    return tuple(part.strip() for text in given or () for part in text.split(",") if part.strip())


def _strengths(text: str) -> tuple[float, ...]:
    try:
        found = tuple(float(part) for part in text.split(",") if part.strip())
    except ValueError:
        found = ()
    if not found or not all(0.0 < value <= 1000.0 for value in found):
        raise OptionError(
            repr(text), expected="numbers from 0 to 1000, with commas", where="--strengths", advice="e.g. 3,6,12"
        )
    return tuple(dict.fromkeys(found))


def _seeds(text: str) -> tuple[int, ...]:
    """Seeds of an option: a range, or numbers."""
    found: list[int] = []
    try:
        for part in text.split(","):
            first, colon, end = part.partition(":")
            found += range(int(first), int(end)) if colon else [int(first)]
    except (ValueError, MemoryError):
        raise OptionError(
            repr(text), expected="FROM:TO, or numbers with commas", where="--seeds", advice="e.g. 0:5 or 3,7"
        ) from None
    return tuple(dict.fromkeys(found))


def _say_done(done: int, total: int, outcome: Outcome) -> None:
    from proving_ground.results import line_of

    try:
        sys.stderr.write(f"[{done}/{total}] {line_of(outcome)}\n")
    except UnicodeEncodeError:
        sys.stderr.write(f"[{done}/{total}] {line_of(outcome)}\n".encode("ascii", "replace").decode())
