"""`demo` and `audit-patent`: the main job on the recordings that come with the program, and the patent they are of."""

from collections import Counter
from dataclasses import replace
from pathlib import Path
from typing import Annotated

import typer

from selector.atomic_file import folder_written_whole, require_writable_folder
from selector.cli.selecting import study, write_results
from selector.cli.shared import showing
from selector.cli.shared.option_table import option
from selector.cli.shared.progress import progress_bar
from selector.cli.shared.showing import AsJson, Everything
from selector.cli.shared.source import Source


def demo(out: Annotated[Path, option("demo --out")] = Path("selector-demo"), everything: Everything = False) -> None:
    """Runs the main job on two shipped recordings and ends with the path of a report.

    First a real spindle, recorded for 40 hours with 16 thermometers and five probes; then the eight-sensor example of
    patent CN1868666, on a reconstruction of its recording, which was not measured.
    """
    with progress_bar(spoken=True):
        # for the first time this takes seconds: the modules are compiled, too
        from selector.audit import audit_patent
        from selector.selection import Options
        from selector.shipped import shipped
        from selector.telling.selected.account import selection_account, write_report

    require_writable_folder(out, "--out")
    console = showing.screen()
    studies = {
        "spindle46": Options(responses=("Y1",), memory=True),
        "patent8": Options(responses=("Z", "Y"), level=0.995, must=("T1", "T3"), tolerance=0.001),
    }
    measured = shipped("spindle46")
    sources = {
        "spindle46": Source(runs=[measured / "tests.parquet"], machine=measured / "machine.toml"),
        "patent8": Source(runs=[shipped("patent8")]),
    }
    first, selections, descriptions = next(iter(studies)), [], []
    with folder_written_whole(out) as folder:
        for name, options in studies.items():
            with progress_bar(spoken=True) as progress:
                selection, data = study(sources[name], options, progress)
            account = selection_account(selection, data.description)
            # the sentences of the reconstruction have its numbers
            shown = account if everything or name == first else replace(account, answer=None)
            showing.show_account(console, shown, everything=everything, rest="--all")
            showing.show_findings(console, selection.findings, everything=everything, most=1)
            (folder / name).mkdir()
            write_results(selection, account, data, folder / name)
            selections.append(selection)
            descriptions.append(data.description)
        verdicts = Counter(line.verdict for line in audit_patent())
        told = f"{verdicts['agrees independently']} of {verdicts.total()} agree independently"
        console.print(f"The patent's printed numbers: {told}; see `selector audit-patent`.", markup=False)
        write_report(selections, folder / "report.html", title="selector demo", description=descriptions)
    typer.echo(out / "report.html")


def audit_patent(as_json: AsJson = False) -> None:
    """Checks every number that patent CN1868666 prints: printed value, our value, whether they agree, and why.

    Agreement is independent, or by construction where the shipped recording was solved for to have the number. Numbers
    that contradict each other are told from those that are only in tension, and from what cannot be checked.
    Contradictions are news about the patent, not about this program: the exit code is 0 all the same.
    """
    from selector.audit import audit_patent as audited
    from selector.audit import audit_table_text

    lines = audited()
    if as_json:
        verdicts = Counter(line.verdict for line in lines)
        showing.print_json(
            {"schema": "selector.patent-audit/2", "verdicts": verdicts, "lines": [line.as_dict() for line in lines]}
        )
        return
    console = showing.screen()
    console.print(audit_table_text(lines, width=console.width), markup=False, soft_wrap=True)
