"""`describe` and `convert`: what is in these files, what was guessed, what is wrong, and the same in a plain form."""

from __future__ import annotations

from collections.abc import Mapping
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from selector.cli import showing
from selector.cli.files import folder_written_whole, refuse_to_overwrite
from selector.cli.showing import AsJson
from selector.cli.source import Source, with_source

if TYPE_CHECKING:
    from rich.console import Console


class TableFormat(StrEnum):
    """Formats that `convert` writes."""

    CSV = "csv"
    PARQUET = "parquet"


@with_source
def describe(
    source: Source,
    write: Annotated[
        Path | None, typer.Option("--write", metavar="M.toml", help="Write the machine file, for correction.")
    ] = None,
    force: Annotated[bool, typer.Option("--force", metavar="", help="Replace the machine file if it exists.")] = False,
    as_json: AsJson = False,
) -> None:
    """Shows what was read, what was guessed and what is wrong with the recordings.

    With --write the guesses become a machine file: correct it and give it to every other command with --machine.
    """
    from selector.quality import inspect
    from selector.readers import write_machine_file

    if write is not None:
        refuse_to_overwrite(write, force=force, option="--write")
    reading = source.reading()
    findings = (*reading.findings, *inspect(reading.recording))
    description: dict[str, Any] = {**reading.description(), "findings": findings}
    if write is not None:
        write_machine_file(reading, write)
    if as_json:
        showing.print_json(description)
    console = showing.screen(as_json)
    if not as_json:
        _show(console, description)
    if write is not None:
        console.print(f"wrote {write}; correct it there and give it with --machine {write}", markup=False)


@with_source
def convert(
    source: Source,
    out: Annotated[Path, typer.Option("--out", metavar="DIR", help="Folder that receives the recordings.")],
    table_format: Annotated[TableFormat, typer.Option("--format", help="Format of the tables.")] = TableFormat.CSV,
    force: Annotated[bool, typer.Option("--force", metavar="", help="Replace files of the same name in DIR.")] = False,
    as_json: AsJson = False,
) -> None:
    """Writes clean recordings: UTF-8, comma, decimal point, time in seconds, canonical units, and machine.toml."""
    from selector.readers import convert as written_recordings

    reading = source.reading()


def _show(console: Console, description: Mapping[str, Any]) -> None:
    """Runs, channels, the way of reading and the findings, for a person."""
    runs = [
        (
            run["run"],
            run["file"],
            run["rows"],
            showing.duration_text(run["duration_s"]),
            "–" if run["period_s"] is None else showing.duration_text(run["period_s"]),
            run["start"],
        )
        for run in description["runs"]
    ]
    columns = ["run", "file", "rows", "duration", "step", "start"]
    console.print(showing.table("Runs", columns, runs, numeric=["rows", "duration", "step"]))
    channels = [
        (
            channel["name"],
            channel["column"],
            channel["role"],
            channel["unit"],
            channel["unit_in_file"],
            ", ".join(channel["guessed"]) or "nothing",
        )
        for channel in description["channels"]
    ]
    columns = ["channel", "column", "role", "unit", "unit in file", "guessed"]
    console.print(showing.table("Channels", columns, channels))
    how = [f"{name.replace('_', ' ')} {showing.cell_text(value)}" for name, value in description["reading"].items()]
    console.print("Read as: " + ", ".join(how), markup=False)
    findings = description["findings"]
    console.print(f"\n{len(findings)} finding{'' if len(findings) == 1 else 's'}", markup=False)
    showing.show_findings(console, findings)
