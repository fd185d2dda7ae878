"""`report`: the page of results that are on disk, once more or several in one file."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from selector.atomic_file import refuse_to_replace_input
from selector.cli.shared import showing
from selector.cli.shared.option_table import argument, option
from selector.cli.shared.progress import progress_bar
from selector.cli.shared.studying import OpenedStudy, source_of_study
from selector.errors import InputError, OptionError

if TYPE_CHECKING:
    from selector.telling.result_file import Result

Say = Callable[[str], None]


def report(
    results: Annotated[list[Path], argument("report RESULT...")],
    out: Annotated[Path, option("report --out")],
    title: Annotated[str | None, option("report --title")] = None,
) -> None:
    """Makes the report of results again, from their files; several stand in one file, one after the other.

    A selection.json holds all that its page shows but how its recordings were read and where the sensors sit. That,
    and what a diagnosis.json does not hold, is read from the recordings that a study.toml beside it names, if they
    are unchanged; else it is left out, and told.
    """
    from selector.atomic_file import write_whole
    from selector.telling.page import one_page
    from selector.telling.result_file import read_result

    if out.is_dir():
        raise OptionError(
            "a folder of this name exists",
            expected="a name for the file",
            where=f"--out {out}",
            advice=f"e.g. --out {out / 'report.html'}",
        )
    console = showing.screen()
    read = [read_result(result) for result in results]
    inputs = [file for one in read for file in (one.path, one.path.with_name("study.toml"))]
    refuse_to_replace_input(out, inputs, "--out")

    def say(text: str) -> None:
        console.print(text, markup=False)

    pages = [_page(one, say) for one in read]
    names = [str(one.path.parent.absolute().name) for one in read]
    page = one_page(pages, title or f"Report: {', '.join(names)}")
    write_whole(out, page.encode("utf-8", "replace"))
    showing.show_written(console, out)


def _page(result: Result, say: Say) -> str:
    from selector.controllers.model_file import read_model
    from selector.telling.diagnosed import diagnosis_account
    from selector.telling.model_card import model_card_account
    from selector.telling.page import account_page
    from selector.telling.predicted import prediction_account
    from selector.telling.result_file import diagnosis_of, made_of, prediction_of

    if result.kind == "selection":
        return _selection_page(result, say)
    if result.kind == "model":
        return account_page(model_card_account(read_model(result.path)))
    if result.kind == "prediction":
        return made_of(result, lambda told: account_page(prediction_account(prediction_of(told), drawn=True)))
    return _diagnosis_again(result, say) or made_of(
        result, lambda told: account_page(diagnosis_account(diagnosis_of(told), is_alone=True))
    )


def _selection_page(result: Result, say: Say) -> str:
    from selector.selection.result_file import selection_of
    from selector.study.data import study_data
    from selector.telling.page import account_page
    from selector.telling.result_file import made_of
    from selector.telling.selected.account import selection_account

    selection = made_of(result, selection_of)
    study = _unchanged_study(result, say, "how the recordings were read, and where the sensors sit")
    said, date = (None, None) if study is None else (study.source, study.study.date)
    description = None if said is None else study_data(said.runs, said.machine, said.overrides()).description
    return made_of(result, lambda _: account_page(selection_account(selection, description, date=date, drawn=True)))


def _diagnosis_again(result: Result, say: Say) -> str | None:
    """The whole page of a diagnosis, made from its recordings; None where that cannot be."""
    from selector.cli.shared.diagnosed import answered, asked_of
    from selector.telling.diagnosed import diagnosis_account
    from selector.telling.page import account_page

    study = _unchanged_study(result, say, "pictures and evidence")
    if study is None or study.study.diagnose is None:
        return None
    with progress_bar() as progress:
        answer = answered(study.source, asked_of(study), progress)
    if showing.json_text(answer.found.as_dict()) + "\n" != result.path.read_text(encoding="utf-8"):
        say(f"{result.path}: done again, this is not the answer; the page shows what the file says, without pictures")
        return None
    description = answer.recorded.description()
    return account_page(diagnosis_account(answer.found, provenance=answer.told, description=description, drawn=True))


def _unchanged_study(result: Result, say: Say, what: str) -> OpenedStudy | None:
    """The study beside a result, if there is one and its files are what they were; else it is told what is left out."""
    from selector.study import STUDY_FILE, read_study, require_unchanged

    place = result.path.with_name(STUDY_FILE)
    if not place.is_file():
        say(f"{result.path}: left out: {what}; there is no {STUDY_FILE} beside it")
        return None
    try:
        study = read_study(place)
        require_unchanged(study, place)
    except InputError as error:
        say(f"{result.path}: left out: {what}; {error.found}")
        return None
    return OpenedStudy(study, place, source_of_study(study, place.parent))
