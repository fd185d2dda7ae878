"""`select`: recordings in, sensors, a proven model, a model file and a report out."""

from __future__ import annotations

import datetime
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from selector.atomic_file import folder_written_whole, require_writable_folder
from selector.cli.shared import showing, studying
from selector.cli.shared.option_table import option
from selector.cli.shared.progress import Progress, progress_bar
from selector.cli.shared.showing import AsJson, Everything
from selector.cli.shared.source import Source, pairs, with_source
from selector.errors import OptionError

if TYPE_CHECKING:
    from selector.selection import Options, Selection
    from selector.study.data import StudyData
    from selector.telling.account import Account


Responses = Annotated[list[str] | None, option("select --response")]


@dataclass(frozen=True)
class Asked:
    """The options of `select`, one field an option, named as in `selector.selection.Options`."""

    responses: Responses = None
    level: Annotated[list[str] | None, option("select --lambda")] = None
    rounds: Annotated[int, option("select --rounds")] = 1
    max_sensors: Annotated[int, option("select --max-sensors")] = 5
    grouping: Annotated[str, option("select --grouping")] = "closure"
    absolute_similarity: Annotated[bool, option("select --absolute-similarity")] = False
    must: Annotated[list[str] | None, option("select --must")] = None
    never: Annotated[list[str] | None, option("select --never")] = None
    cost: Annotated[list[str] | None, option("select --cost")] = None
    tolerance: Annotated[float | None, option("select --tolerance")] = None
    degree: Annotated[int, option("select --degree")] = 1
    interactions: Annotated[bool, option("select --interactions")] = False
    memory: Annotated[bool, option("select --memory")] = False
    reference: Annotated[str, option("select --reference")] = "rise"
    ridge: Annotated[bool, option("select --ridge")] = False
    conditions: Annotated[list[str] | None, option("select --condition")] = None
    seed: Annotated[int, option("select --seed")] = 0
    formula: Annotated[str | None, option("select --formula")] = None
    within: Annotated[float | None, option("select --within")] = None
    target: Annotated[float | None, option("select --target")] = None

    def options(self) -> Options:
        """The same as options of a selection. Raises OptionError: one cannot be used."""
        from selector.selection import Options

        read = {
            "responses": tuple(self.responses or ()),
            "level": _levels(self.level),
            "rounds": self.rounds if self.rounds < 1 else max(self.rounds, len(self.level or ())),
            "must": tuple(self.must or ()),
            "never": tuple(self.never or ()),
            "cost": {name: _number(text, f"--cost {name}") for name, text in pairs(self.cost, "--cost").items()},
            "conditions": pairs(self.conditions, "--condition"),
        }
        return Options(**vars(self) | read)


def date_of(text: str | None) -> str | None:
    """A date as it is written into the files. Raises OptionError: it is none."""
    if text is None:
        return None
    try:
        return datetime.date.fromisoformat(text).isoformat()
    except ValueError:
        raise OptionError(
            repr(text), expected="a date as YYYY-MM-DD", where="--date", advice="e.g. --date 2026-11-20"
        ) from None


def _levels(given: list[str] | None) -> float | tuple[float, ...] | None:
    given = [text.strip().lower() for text in given or ()]
    if not given or given == ["auto"]:
        return None
    if "auto" in given:
        raise OptionError(
            ", ".join(given), expected="auto alone, or numbers", where="--lambda", advice="use one or the other"
        )
    levels = tuple(_number(text, "--lambda", "a number from 0 to 1, or auto") for text in given)
    return levels[0] if len(levels) == 1 else levels


def _number(text: str, where: str, expected: str = "a number with a decimal point") -> float:
    try:
        return float(text)
    except ValueError:
        raise OptionError(repr(text), expected=expected, where=where, advice="e.g. 0.995, with a point") from None


@with_source
def select(
    source: Source,
    context: typer.Context,
    *,
    from_study: studying.StudyPath = None,
    accept_changes: studying.AcceptChanges = False,
    asked: Asked,
    out: Annotated[Path | None, option("select --out")] = None,
    date: Annotated[str | None, option("select --date")] = None,
    everything: Everything = False,
    as_json: AsJson = False,
) -> None:
    """Chooses the sensors to keep, fits one model per displacement and proves it on runs that it has not seen.

    Sensors are grouped by the correlation of their readings, one stands for each group, and sets of them are compared.
    Everything is chosen anew inside every fold, so that the error shown is that of a day the model does not know.
    """
    from selector.telling.selected.account import selection_account

    console = showing.screen(as_json)
    opened = studying.opened_study(from_study, source, context, accept_changes=accept_changes, console=console)
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
        selection, data = study(source, options, progress)
        # what is neither written nor shown is not worked out
        tell = partial(selection_account, selection, data.description, date=date)
        with _results_folder(out, opened) as folder:
            account = None if folder is None else tell(drawn=True)
            if folder is not None and account is not None:
                from selector.telling import write_account

                progress("writing", 1.0)
                write_results(selection, account, data, folder, date=date)
                write_account(account, folder / "report.html")
                found = studying.hashes(folder)
            if folder is not None and out is not None:
                written = ["selection.json", "model.json", "report.html"]
                with studying.told_if_no_text(console):
                    files = studying.recording_entries(out, source, data.files, data.machine_file)
                    written += studying.write_study_beside(
                        folder, out, source, files, opened=opened, select=options, date=date
                    )
    if as_json:
        showing.print_json(selection.as_dict())
        showing.show_findings(console, data.beside)
    else:
        findings = (*selection.findings, *data.beside)
        showing.show_answer(console, account or tell(), findings, everything=everything)
    if out is not None:
        showing.show_written(console, out, written)
    if opened is not None and opened.study.results:
        console.print(studying.repeated_words(opened.study, found), markup=False)


@contextmanager
def _results_folder(out: Path | None, opened: studying.OpenedStudy | None) -> Iterator[Path | None]:
    """Where results are written: what becomes `out`, or a folder that goes again if they are only to be compared."""
    if out is not None:
        with folder_written_whole(out) as folder:
            yield folder
    elif opened is not None and opened.study.results:
        with tempfile.TemporaryDirectory() as temporary:
            yield Path(temporary)
    else:
        yield None


def study(source: Source, options: Options, progress: Progress) -> tuple[Selection, StudyData]:
    """Read, inspect and select; the result, and what it was made from."""
    from selector.models.best_subsets.subsets import compile_search
    from selector.selection import select as selected
    from selector.study.applied import proven_on_control
    from selector.study.data import study_data

    progress("compiling the search, which takes a while only once", None)
    compile_search()
    progress("reading", 0.0)
    data = study_data(source.runs, source.machine, source.overrides())
    selection = selected(data.source, options, findings=data.findings, provenance=data.provenance, progress=progress)
    return proven_on_control(selection, data), data


def write_results(
    selection: Selection, account: Account, data: StudyData, folder: Path, *, date: str | None = None
) -> None:
    """selection.json and model.json, into a folder that exists."""
    from selector.controllers.from_selection import model_file_of
    from selector.controllers.model_file import write_model

    model = model_file_of(selection, data.source.channels, source=data.source, date=date)
    (folder / "selection.json").write_text(showing.json_text(account.data) + "\n", encoding="utf-8", newline="\n")
    write_model(model, folder / "model.json")
