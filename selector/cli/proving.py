"""`prove`: holds the blind proof and prints the score; the report and the files of every case on request."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from selector.cli import showing
from selector.cli.files import folder_written_whole, require_writable_folder
from selector.cli.progress import counted_progress
from selector.cli.showing import AsJson
from selector.errors import OptionError

if TYPE_CHECKING:
    from rich.console import Console

    from selector.proof.case import Scenario
    from selector.proof.runner import Answerer, Outcome
    from selector.proof.score_table import Row

_WHICH = "Which cases"

Families = Annotated[
    list[str] | None,
    typer.Option(
        "--families", metavar="NAME", help="Family of scenarios; repeat. Default: all.", rich_help_panel=_WHICH
    ),
]
Names = Annotated[
    list[str] | None,
    typer.Option(
        "--scenarios", metavar="PATTERN", help="Only scenarios such as 'thermal.*'; repeat.", rich_help_panel=_WHICH
    ),
]
Strengths = Annotated[
    str,
    typer.Option("--strengths", metavar="D,D,…", help="What an oracle could detect, d′.", rich_help_panel=_WHICH),
]
Seeds = Annotated[
    str | None,
    typer.Option(
        "--seeds",
        metavar="FROM:TO|N,N",
        help="Seeds, TO not included. Default: 0:5, with --exam 10000:10005.",
        rich_help_panel=_WHICH,
    ),
]
Exam = Annotated[
    bool,
    typer.Option("--exam", metavar="", help="Seeds from 10000 on, which nobody develops with.", rich_help_panel=_WHICH),
]
Rivals = Annotated[
    list[str] | None,
    typer.Option("--rivals", metavar="NAME|all", help="Let other methods sit the same exam, too; repeat."),
]
Jobs = Annotated[
    int | None, typer.Option("--jobs", metavar="N", min=1, help="Processes. Default: as many as there are cores.")
]
List = Annotated[
    bool, typer.Option("--list", metavar="", help="Print the names of the scenarios and stop.", rich_help_panel=_WHICH)
]
Recordings = Annotated[
    Path | None,
    typer.Option(
        "--recordings",
        metavar="DIR",
        help="Also real recordings from elsewhere: DIR holds silverbox, cascaded_tanks, ace_thermal.",
        rich_help_panel=_WHICH,
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
    from selector.proof import runner
    from selector.proof.scenarios import scenarios as all_scenarios

    chosen = all_scenarios(_split(families), _split(scenarios), _published(recordings))
    if list_only:
        _show_list(chosen, as_json)
        return
    numbers = _seeds(seeds if seeds is not None else "10000:10005" if exam else "0:5")
    runner.require_seeds(numbers, is_exam=exam)
    asked = runner.questions(chosen, _strengths(strengths), numbers)
    if not asked:
        raise OptionError(
            "no scenario", expected="at least one", where="--families, --scenarios", advice="ask for others"
        )
    for folder, option in ((out, "--out"), (write_cases, "--write-cases")):
        if folder is not None:
            require_writable_folder(folder, option)
    console = showing.screen(as_json)
    if write_cases is not None:
        _write_cases(write_cases, asked, console, as_json)
        return
    sitting = runner.Exam(asked, exam, (runner.Answerer(runner.TOOL, runner.answer_of_selector), *_rivals(rivals)))
    outcomes = runner.outcomes(sitting, n_jobs=jobs or os.cpu_count() or 1, progress=_say)
    _tell(outcomes, exam, out, console, as_json)


def _published(folder: Path | None) -> tuple[Scenario, ...]:
    """Scenarios of the recordings in a folder; what was looked for in vain is told."""
    if folder is None:
        return ()
    from selector.proof.real import published

    found, lacking = published(folder)
    for name in lacking:
        typer.echo(f"recording {name} is absent: there is no folder {folder / name}", err=True)
    return found


def _tell(outcomes: tuple[Outcome, ...], is_exam: bool, out: Path | None, console: Console, as_json: bool) -> None:
    from selector.proof.results import cases_csv, score_object, tables

    rows = tables(outcomes)
    result = score_object(outcomes, is_exam=is_exam)
    if out is not None:
        from selector.proof.page import page_of
        from selector.report.proof_report import proof_html

        with folder_written_whole(out) as folder:
            files = {"score.json": showing.json_text(result) + "\n", "cases.csv": cases_csv(outcomes)}
            files["report.html"] = proof_html(page_of(outcomes, is_exam=is_exam))
            for name, text in files.items():
                (folder / name).write_text(text, encoding="utf-8", newline="\n")
    if as_json:
        showing.print_json(result)
    else:
        _show(console, rows, result)
    if out is not None:
        console.print(f"wrote {out}: score.json, cases.csv, report.html", markup=False)


def _show(console: Console, rows: dict[str, tuple[Row, ...]], result: dict[str, Any]) -> None:
    from selector.proof.results import row_texts

    columns = ["score", "measured", "95 % interval", "n", "first bar", "goal", ""]
    for name, table in rows.items():
        console.print(showing.table(name, columns, [row_texts(row) for row in table], numeric=columns[1:6]))
    for failure in result["failures"][:10]:
        console.print(f"failed: {failure['scenario']}, seed {failure['seed']}: {failure['error']}", markup=False)
    console.print(f"seal of the cases: {result['seal']}", markup=False)
    console.print(f"hash of the answers: {result['answers_sha256']}", markup=False)


def _say(done: int, total: int, outcome: Outcome) -> None:
    """One line a case on stderr."""
    from selector.proof.results import line_of

    try:
        sys.stderr.write(f"[{done}/{total}] {line_of(outcome)}\n")
    except UnicodeEncodeError:
        sys.stderr.write(f"[{done}/{total}] {line_of(outcome)}\n".encode("ascii", "replace").decode())


def _show_list(scenarios: Sequence[Scenario], as_json: bool) -> None:
    if as_json:
        showing.print_json([{"name": s.name, "family": s.family, "kind": s.kind, "note": s.note} for s in scenarios])
        return
    rows = [(one.name, one.family, one.kind, one.note) for one in scenarios]
    showing.screen().print(showing.table(f"{len(rows)} scenarios", ["name", "family", "kind", "note"], rows))


def _write_cases(folder: Path, asked: Sequence[Any], console: Console, as_json: bool) -> None:
    from selector.proof.bundles import write_bundles

    with folder_written_whole(folder) as part, counted_progress("writing cases") as say:
        sealed = write_bundles(asked, part, progress=say)
    if as_json:
        showing.print_json({"cases": len(asked), "answers_sha256": sealed})
    else:
        console.print(f"wrote {folder}: cases, answers.json apart; its SHA-256 is {sealed}", markup=False)


def _rivals(names: list[str] | None) -> tuple[Answerer, ...]:
    if not names:
        return ()
    from selector.proof.rivals import absent, rivals

    found = rivals(_split(names))
    if "all" in _split(names):
        for rival in absent():
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
