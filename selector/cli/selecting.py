"""`select`: recordings in, sensors, a proven model, a model file and a report out."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from selector.atomic_file import folder_written_whole, require_writable_folder
from selector.cli.shared import showing
from selector.cli.shared.asked.selection import Asked, Date, date_of
from selector.cli.shared.progress import Progress, progress_bar
from selector.cli.shared.showing import AsJson, Everything
from selector.cli.shared.source import Source, with_source
from selector.cli.shared.studying import (
    AcceptChanges,
    OpenedStudy,
    StudyPath,
    hashes,
    opened_study,
    recording_entries,
    repeated_words,
    told_if_no_text,
    write_study_beside,
)

if TYPE_CHECKING:
    from selector.selection import Selection
    from selector.selection.options import Options
    from selector.study.material import Material
    from selector.telling.account import Account

Out = Annotated[
    Path | None,
    typer.Option(
        "--out", metavar="DIR", help="Write selection.json, model.json, report.html and study.toml, all or none."
    ),
]


@with_source
def select(
    source: Source,
    context: typer.Context,
    *,
    from_study: StudyPath = None,
    accept_changes: AcceptChanges = False,
    asked: Asked,
    out: Out = None,
    date: Date = None,
    everything: Everything = False,
    as_json: AsJson = False,
) -> None:
    """Chooses the sensors to keep, fits one model per displacement and proves it on runs that it has not seen.

    Sensors are grouped by the correlation of their readings, one stands for each group, and sets of them are compared.
    Everything is chosen anew inside every fold, so that the error shown is that of a day the model does not know.
    """
    from selector.telling.selected.account import selection_account

    console = showing.screen(as_json)
    opened = opened_study(from_study, source, context, accept_changes=accept_changes, console=console)
    if opened is not None:
        from selector.study import options_of

        source, date = opened.source, opened.study.date
        options = options_of(opened.study, where=str(opened.place))
    else:
        options, date = asked.options(), date_of(date)
    if out is not None:
        require_writable_folder(out, "--out", ("selection.json", "model.json", "report.html"))
    written: list[str] = []
    with progress_bar() as progress:
        selection, material = study(source, options, progress)
        # what is neither written nor shown is not worked out
        tell = partial(selection_account, selection, material.description, date=date)
        with _results_folder(out, opened) as folder:
            account = None if folder is None else tell(drawn=True)
            if folder is not None and account is not None:
                from selector.telling import write_account

                progress("writing", 1.0)
                write_results(selection, account, material, folder, date=date)
                write_account(account, folder / "report.html")
                found = hashes(folder)
            if folder is not None and out is not None:
                written = ["selection.json", "model.json", "report.html"]
                with told_if_no_text(console):
                    files = recording_entries(out, source, material.files, material.machine_file)
                    written += write_study_beside(folder, out, source, files, opened=opened, select=options, date=date)
    if as_json:
        showing.print_json(selection.as_dict())
        showing.show_findings(console, material.beside)
    else:
        findings = (*selection.findings, *material.beside)
        showing.show_answer(console, account or tell(), findings, everything=everything)
    if out is not None:
        showing.show_written(console, out, written)
    if opened is not None and opened.study.results:
        console.print(repeated_words(opened.study, found), markup=False)


@contextmanager
def _results_folder(out: Path | None, opened: OpenedStudy | None) -> Iterator[Path | None]:
    """Where results are written: what becomes `out`, or a folder that goes again if they are only to be compared."""
    if out is not None:
        with folder_written_whole(out) as folder:
            yield folder
    elif opened is not None and opened.study.results:
        with tempfile.TemporaryDirectory() as temporary:
            yield Path(temporary)
    else:
        yield None


def study(source: Source, options: Options, progress: Progress) -> tuple[Selection, Material]:
    """Read, inspect and select; the result, and what it was made from."""
    from selector.models.best_subsets.subsets import compile_search
    from selector.selection import select as selected
    from selector.study.material import material_of

    progress("compiling the search, which takes a while only once", None)
    compile_search()
    progress("reading", 0.0)
    material = material_of(source.runs, source.machine, source.overrides())
    selection = selected(
        material.source, options, findings=material.findings, provenance=material.provenance, progress=progress
    )
    return selection, material


def write_results(
    selection: Selection, account: Account, material: Material, folder: Path, *, date: str | None = None
) -> None:
    """selection.json and model.json, into a folder that exists."""
    from selector.controllers.from_selection import model_file_of
    from selector.controllers.model_file import write_model

    model = model_file_of(selection, material.source.channels, source=material.source, date=date)
    (folder / "selection.json").write_text(showing.json_text(account.data) + "\n", encoding="utf-8", newline="\n")
    write_model(model, folder / "model.json")
