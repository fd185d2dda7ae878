"""`describe` and `convert`: what is in these files, what was guessed, what is wrong, and the same in a plain form."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from selector.cli import showing
from selector.cli.files import folder_written_whole, refuse_to_overwrite, refuse_to_replace_input
from selector.cli.showing import AsJson
from selector.cli.source import Source, with_source

if TYPE_CHECKING:
    from rich.console import Console
    from rich.table import Table


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

    With --write the guesses become a machine file: correct it and give it to every other command with --machine. A
    clock that was guessed stands in it as a comment only, so that every command says so until you do.
    """
    from selector.cli.material import drift_of
    from selector.quality import inspect, without_faults
    from selector.readers import guessed_clock, machine_of, write_machine_file

    if write is not None:
        refuse_to_overwrite(write, force=force, option="--write")
    reading = source.reading()
    faults = inspect(reading.recording)
    findings = (*reading.findings, *faults)
    drift = drift_of(without_faults(reading.recording, faults))
    description: dict[str, Any] = {**reading.description(), "drift": drift, "findings": findings}
    if write is not None:
        refuse_to_replace_input(write, [run.file for run in reading.runs], "--write")
        write_machine_file(machine_of(reading), write, reading.undeclared, guessed_clock(reading))
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
    table_format: Annotated[
        TableFormat, typer.Option("--format", metavar="csv|parquet", help="Format of the tables.")
    ] = TableFormat.CSV,
    as_json: AsJson = False,
) -> None:
    """Writes clean recordings: UTF-8, comma, decimal point, time in seconds, canonical units, and machine.toml.

    What a file says is written as it was read; nothing is left out or filled in. Files of the same name in DIR are
    replaced, unless they are among the recordings that were read.
    """
    from selector.readers import convert as converted

    reading = source.reading()
    if out.exists():
        # it may hold what was read, which `converted` refuses to replace
        paths = converted(reading, out, table_format.value)
    else:
        with folder_written_whole(out) as folder:
            paths = [out / path.name for path in converted(reading, folder, table_format.value)]
    if as_json:
        showing.print_json({"schema": "selector.conversion/1", "files": paths, "findings": reading.findings})
        return
    console = showing.screen()
    showing.show_findings(console, reading.findings)
    console.print(f"wrote {len(paths)} files to {out}: {', '.join(path.name for path in paths)}", markup=False)


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
    if description["drift"]:
        console.print(_drift_table(description["drift"]))
    first, *others = _ways(description)
    console.print(f"Read as: {first}", markup=False)
    for other in others:
        console.print(f"  but {other}", markup=False)
    findings = description["findings"]
    console.print(f"\n{len(findings)} finding{'' if len(findings) == 1 else 's'}", markup=False)
    showing.show_findings(console, findings)


def _drift_table(drift: list[Mapping[str, Any]]) -> Table:
    """Ranges of the first hour and of the whole test, a run a row."""
    names = list(dict.fromkeys(one["name"] for run in drift for one in run["drifts"]))
    rows = []
    for run in drift:
        told = {one["name"]: one for one in run["drifts"]}
        cells = (
            " / ".join(showing.cell_text(told[name][part]) for part in ("first_hour", "whole")) if name in told else ""
            for name in names
        )
        rows.append((run["run"], run["test"], showing.duration_text(run["duration_s"]), *cells))
    title = "Drift after ISO 230-3: range in the first 60 min / in the whole test [µm; A, B, C: µm/m]"
    return showing.table(title, ["run", "moved", "test of", *names], rows, numeric=names)


def _ways(description: Mapping[str, Any]) -> Iterator[str]:
    """How the first file was read, then each run that was read in another way."""
    reading = description["reading"]
    yield _way(reading)
    for run, own in reading.get("per_run", {}).items():
        yield f"{run}: {_way(own)}"


def _way(reading: Mapping[str, Any]) -> str:
    names = {",": "comma", ".": "point", ";": "semicolon", "|": "bar"}
    parts = [str(reading["format"])]
    for key in ("encoding", "separator", "decimal"):
        if reading.get(key) is not None:
            parts.append(f"{key} {names.get(reading[key], reading[key])}")
    if reading.get("sheet") is not None:
        parts.append(f"sheet {reading['sheet']}")
    if reading.get("header_row"):
        parts.append(f"names in row {reading['header_row']}")
    if reading.get("unit_row"):
        parts.append("a row of units")
    time = reading["time"]
    clock = " and ".join(time["columns"])
    guessed = f" ({' and '.join(time['guessed'])} guessed)" if time["guessed"] else ""
    parts.append(f"time from {clock} [{time['unit']}]{guessed}" if clock else f"no time column{guessed}")
    return ", ".join(parts)
