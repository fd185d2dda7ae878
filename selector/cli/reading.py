"""`describe` and `convert`: what is in these files, what was guessed, what is wrong, and the same in a plain form."""

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from selector import atomic_file
from selector.cli.shared import showing
from selector.cli.shared.option_table import option
from selector.cli.shared.progress import progress_bar
from selector.cli.shared.showing import AsJson, Everything
from selector.cli.shared.source import Source, with_source
from selector.errors import CancelledError

if TYPE_CHECKING:
    from selector.readers import Reading


@with_source
def describe(
    source: Source,
    write: Annotated[Path | None, option("describe --write")] = None,
    force: Annotated[bool, option("describe --force")] = False,
    everything: Everything = False,
    as_json: AsJson = False,
) -> None:
    """Shows what was read, what was guessed and what is wrong with the recordings.

    With --write the guesses become a machine file: correct it and give it to every other command with --machine. A
    clock that was guessed stands in it as a comment only, so that every command says so until you do. Cables that
    changed places and units of single runs that the findings prove stand in it as repairs of these runs.
    """
    from selector.quality import usable
    from selector.readers import guessed_clock, machine_of, write_machine_file
    from selector.readers.roles.repairs import proposed
    from selector.study.data import drift_of
    from selector.telling.origin import description_account

    if write is not None:
        atomic_file.refuse_to_overwrite(write, force=force, option="--write")
    with progress_bar() as progress:
        progress("reading", None)
        reading = source.reading()
        progress("looking for faults", None)
        clean, faults = usable(reading.recording)
    findings = (*reading.findings, *faults)
    description: dict[str, Any] = {**reading.description(), "drift": drift_of(clean), "findings": findings}
    if write is not None:
        atomic_file.refuse_to_replace_input(write, [file for file, _ in reading.files], "--write")
        written = machine_of(reading)
        repairs = proposed(written.runs, findings)
        new = [run for run, repair in repairs.items() if written.runs.get(run) != repair]
        written = written.model_copy(update={"runs": repairs})
        write_machine_file(written, write, reading.undeclared, guessed_clock(reading))
    if as_json:
        showing.print_json(description)
    console = showing.screen(as_json)
    if not as_json:
        showing.show_answer(console, description_account(description), findings, everything=everything)
    if write is not None:
        console.print(f"wrote {write}; correct it there and give it with --machine {write}", markup=False)
        if new:
            told = f"it repairs {', '.join(new)} as the findings propose: check these lines"
            console.print(f"{told}, and describe again with it: one fault can hide another", markup=False)


@with_source
def convert(
    source: Source,
    out: Annotated[Path, option("convert --out")],
    table_format: Annotated[Literal["csv", "parquet"], option("convert --format")] = "csv",
    lake: Annotated[bool, option("convert --lake")] = False,
    as_json: AsJson = False,
) -> None:
    """Writes clean recordings: UTF-8, comma, decimal point, time in seconds, canonical units, and machine.toml.

    What a file says is written as it was read; nothing is filled in, and nothing left out but codes of broken sensors
    (850, −9999). Tables of the same name in DIR are replaced, unless they are among the recordings that were read; a
    machine file there that says something else is not.

    With --lake recordings with date and time go where `collect` keeps what a machine says: late files and files that
    were given before are no harm, and --since, --until and --mean-s of the other commands read windows of it.
    """
    from selector.quality import inspect, without_faults
    from selector.quality.finding_table import SENSOR_BREAK
    from selector.readers import convert as converted
    from selector.readers.tables import listed

    atomic_file.require_writable_folder(out, "--out")
    with progress_bar() as progress:
        progress("reading", None)
        reading = source.reading()
    broken = tuple(finding for finding in inspect(reading.recording) if finding.id == SENSOR_BREAK)
    reading = replace(
        reading, recording=without_faults(reading.recording, broken), findings=(*reading.findings, *broken)
    )
    counts: dict[str, int] = {}
    if lake:
        paths, counts, told = _into_lake(reading, out)
    else:
        if out.exists():
            # it may hold what was read, which `converted` refuses to replace
            paths = converted(reading, out, table_format)
        else:
            with atomic_file.folder_written_whole(out) as folder:
                paths = [out / path.name for path in converted(reading, folder, table_format)]
        told = f"wrote {len(paths)} files to {out}: {listed((path.name for path in paths), 20)}"
    if as_json:
        showing.print_json({"schema": "selector.conversion/1", "files": paths, **counts, "findings": reading.findings})
        return
    console = showing.screen()
    showing.show_findings(console, reading.findings, everything=True)
    console.print(told, markup=False)


def _into_lake(reading: "Reading", folder: Path) -> tuple[list[Path], dict[str, int], str]:
    from selector.live.lake import kept

    try:
        paths, new, other = kept(reading, folder)
    except KeyboardInterrupt as stop:
        said = f"stopped. The days that are in {folder} by now stay, and are whole; the same command goes on"
        raise CancelledError(said) from stop
    rows = len(reading.recording.frame)
    files = "the file of a day" if len(paths) == 1 else f"{len(paths)} files of days"
    told = f"{rows} rows are in {files} in {folder}" + f"; {rows - new} times were there already" * (new < rows)
    if other:
        told += f"\nat {other} of them the lake says something else than these recordings, and stays"
    return paths, {"rows": rows, "new_rows": new, "other_rows": other}, told
