"""Writing clean recordings and machine files: whole or not at all, and never over an input."""

import re
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.csv as arrow_csv
import pyarrow.parquet as pq

from selector.atomic_file import write_whole, written_together
from selector.csv_text import csv_text
from selector.errors import OptionError
from selector.readers.machine_file import Machine, MachineSection, TimeSection, machine_text
from selector.readers.reading import Reading, channel_section
from selector.readers.tables import unique_headers
from selector.recording import Recording
from selector.types import Vector

_RESERVED = re.compile(r"(con|prn|aux|nul|com\d|lpt\d)(\..*)?", re.IGNORECASE)


def write_machine_file(
    machine: Machine, path: Path, undeclared: Mapping[str, str] | None = None, guessed_clock: str | None = None
) -> Path:
    """Write a machine file (UTF-8); reading it back gives an equal `Machine`. What is a comment: see `machine_text`.

    Raises OptionError: The path cannot be written.
    """
    write_whole(path, machine_text(machine, undeclared, guessed_clock).encode("utf-8"))
    return path


def convert(reading: Reading, out_dir: Path, format: str = "csv") -> list[Path]:  # noqa: A002 - the contract's word
    """Write clean recordings and their ``machine.toml``; reading them back gives bit-identical values.

    Of channels that hold nothing but single precision, CSV has the digits that single precision needs: these bits.
    One file per run, called after it: UTF-8, comma, decimal point, one header row, first column ``time_s`` from the
    start of the run, canonical units, missing values empty. A header that a spreadsheet would take for a formula gets
    an apostrophe in front (`selector.csv_text.defused`), which is dropped when it is read. The recordings are named in
    the result, then the machine file.

    Raises OptionError: The format is unknown, a file to be written is one of the inputs, or the folder cannot be
    written.
    """
    if format not in ("csv", "parquet"):
        raise OptionError(
            f"format {format!r}", expected="csv or parquet", where="--format", advice="correct the option"
        )
    recording = reading.recording
    targets = run_files(recording.runs, out_dir, format)
    machine_path = out_dir / "machine.toml"
    inputs = {Path(run.file).resolve() for run in reading.runs}
    if reading.machine_file is not None:
        inputs.add(Path(reading.machine_file).resolve())
    for path in (*targets.values(), machine_path):
        if path.resolve() in inputs:
            raise OptionError(
                f"{path.name} in the output folder is one of the inputs", where=str(out_dir),
                expected="a folder in which nothing that was read is overwritten",
                advice="choose another output folder (--out)",
            )  # fmt: skip
    name = reading.machine.machine.name if reading.machine is not None else None
    return write_recording(recording, targets, machine_path, name, format)


def write_recording(
    recording: Recording, targets: Mapping[str, Path], machine_path: Path, machine_name: str | None = None,
    format: str = "csv",  # noqa: A002 - the contract's word
) -> list[Path]:  # fmt: skip
    """Write every run to its target and the machine file beside them, all or none; tables of these names go.

    Raises OptionError: another machine file stands there, or the folder cannot be written.
    """
    # as they are read again: the names, unless these cannot stand in a header
    headers = unique_headers(["time_s", *recording.names], "the output")[0][1:]
    writers: dict[Path, Callable[[Path], Any]] = {}
    for run, path in targets.items():
        writers[path] = _run_writer(recording, run, headers, format)
    pairs = zip(recording.channels, headers, strict=True)
    channels = {channel.name: channel_section(channel, header, channel.unit) for channel, header in pairs}
    machine, time = MachineSection(name=machine_name), TimeSection(column="time_s", unit="s")
    text = machine_text(Machine(machine=machine, time=time, channels=channels))
    if machine_path.exists() and machine_path.read_bytes() != text.encode("utf-8"):
        raise OptionError(
            "another machine file is in the output folder", where=str(machine_path),
            expected="a folder without one, because it may hold corrections made by hand",
            advice="choose another output folder (--out), or move that file away",
        )  # fmt: skip
    writers[machine_path] = lambda target: target.write_text(text, encoding="utf-8", newline="\n")
    try:
        with written_together(writers) as drafts:
            for path, write in writers.items():
                write(drafts[path])
    except OSError as error:
        raise OptionError(
            f"the output cannot be written ({error.strerror or error})", where=str(machine_path.parent),
            expected="a folder that can be written, and enough space", advice="choose another output folder (--out)",
        ) from error  # fmt: skip
    return [*targets.values(), machine_path]


def run_files(runs: tuple[str, ...], folder: Path, ending: str) -> dict[str, Path]:
    """Run → file in `folder`: called after the run, as every file system takes it, different even without case."""
    files: dict[str, Path] = {}
    taken: set[str] = set()
    for run in runs:
        stem = re.sub(r'[<>:"/\\|?*\x00-\x1f]', "_", run).strip(" .")[:150] or "run"
        if _RESERVED.fullmatch(stem) or stem.startswith("~$") or stem.casefold() == "machine":
            stem = f"run_{stem}"
        base, count = stem, 1
        while stem.casefold() in taken:
            count += 1
            stem = f"{base}_{count}"
        taken.add(stem.casefold())
        files[run] = folder / f"{stem}.{ending}"
    return files


def _run_writer(recording: Recording, run: str, headers: list[str], form: str) -> Callable[[Path], None]:
    def write(target: Path) -> None:
        values = recording.values(run, recording.names)
        arrays = [pa.array(recording.time_s(run))]
        arrays += [pa.array(values[:, k], from_pandas=True) for k in range(values.shape[1])]
        if form == "parquet":
            units = ["s", *(channel.unit for channel in recording.channels)]
            fields = [
                pa.field(name, pa.float64(), metadata={"unit": unit})
                for name, unit in zip(["time_s", *headers], units, strict=True)
            ]
            pq.write_table(pa.table(arrays, schema=pa.schema(fields)), target, row_group_size=200_000)
            return
        # 19.43 in single precision is 19.43000030517578 in double
        arrays[1:] = [_narrow(one) for one in values.T]
        with target.open("wb") as stream:
            stream.write(csv_text(["time_s", *headers]).encode("utf-8"))
            names = [str(k) for k in range(len(arrays))]
            options = arrow_csv.WriteOptions(include_header=False, quoting_style="none")
            arrow_csv.write_csv(pa.table(arrays, names=names), stream, options)

    return write


def _narrow(values: Vector) -> pa.Array:
    """Single precision where that is all there is."""
    with np.errstate(over="ignore"):
        single = values.astype(np.float32)
    return pa.array(single if np.array_equal(single, values, equal_nan=True) else values, from_pandas=True)
