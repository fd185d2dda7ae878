"""`diagnose`: recordings and a simulation in; where they differ, which physics was left out, and the fit with it."""

from pathlib import Path
from typing import Annotated

import typer

from selector.atomic_file import folder_written_whole, require_writable_folder
from selector.cli.shared import diagnosed, showing
from selector.cli.shared.option_table import option
from selector.cli.shared.progress import progress_bar
from selector.cli.shared.showing import AsJson, Everything
from selector.cli.shared.source import Source, with_source
from selector.cli.shared.studying import AcceptChanges, StudyPath, hashes, opened_study, repeated_words, told_if_no_text


@with_source
def diagnose(
    source: Source,
    context: typer.Context,
    *,
    from_study: StudyPath = None,
    accept_changes: AcceptChanges = False,
    asked: diagnosed.Asked,
    out: Annotated[Path | None, option("diagnose --out")] = None,
    everything: Everything = False,
    as_json: AsJson = False,
) -> None:
    """Says what a simulation left out: where it differs from the recordings, which physics or fault of the data
    explains it, how sure that is, and how much closer the simulation comes with it.

    What is named was tested against noise on rows that it was not fitted to. Where nothing of the catalogue explains
    a difference, that is said, and nothing is named.
    """
    console = showing.screen(as_json)
    opened = opened_study(from_study, source, context, accept_changes=accept_changes, console=console)
    if opened is not None:
        source, asked = opened.source, diagnosed.asked_of(opened)
    diagnosed.require_usable(asked)
    if out is not None:
        require_writable_folder(out, "--out")
        diagnosed.require_replaceable(out, with_model=asked.model is not None)
    # a model is run again and again: where there is no bar, a line says how far it is
    with progress_bar(spoken=asked.model is not None) as progress:
        answer = diagnosed.answered(source, asked, progress)
        found = answer.found
        if out is not None:
            progress("writing", 1.0)
            diagnosed.require_replaceable(out, with_model=asked.model is not None)
            with folder_written_whole(out, diagnosed.earlier_answer(out)) as folder:
                written = diagnosed.write_results(answer, folder)
                results = hashes(folder)
                with told_if_no_text(console):
                    read = (answer.recorded, answer.simulated)
                    written += diagnosed.write_diagnosis_study(folder, out, source, asked, *read, opened)
    from selector.study.data import beside_recordings

    beside = beside_recordings(answer.recorded.findings)
    if as_json:
        showing.print_json(found.as_dict())
        showing.show_findings(console, beside)
    else:
        from selector.telling.diagnosed import diagnosis_account

        showing.show_answer(console, diagnosis_account(found), (*found.findings, *beside), everything=everything)
    if out is not None:
        showing.show_written(console, out, written)
        if opened is not None and opened.study.results:
            console.print(repeated_words(opened.study, results), markup=False)
