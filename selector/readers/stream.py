"""Recordings in Parquet that do not fit into memory: read piece by piece, only the columns that are asked for."""

import hashlib
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import cached_property
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from selector.errors import InputError, ReadError, RecordingError
from selector.findings import Finding, Where
from selector.readers.binary.optional import quiet
from selector.readers.binary.parquet import column_of, damaged, table_of
from selector.readers.files import recording_files
from selector.readers.finding_table import FINDINGS, MISSING_STAMPS, REPEATED_STAMPS
from selector.readers.machine_file import Machine
from selector.readers.machine_file import machine as machine_at
from selector.readers.reading import channel_of, condensed, provenance_of, settled, time_options
from selector.readers.roles.plan import Planned
from selector.readers.runs import TimedRun, timed_run
from selector.readers.tables import Overrides, Table, checked_width, unique_headers
from selector.recording import Channel, no_channel
from selector.types import Mask, Vector
from selector.units import convert

LARGE_BYTES = 400_000_000  #: Size of the float64 table beyond which reading piece by piece pays.

CHUNK_ROWS = 65_536
_HEAD_ROWS = 5_000


def is_large(paths: Sequence[Path]) -> bool:
    """Whether all files are Parquet and their table of float64 would take more than `LARGE_BYTES`.

    Only the metadata is read. Files that cannot be opened are not large: `read` says what is wrong with them.
    """
    total = 0
    try:
        for path in recording_files([Path(p) for p in paths]).files:
            with path.open("rb") as stream:
                if stream.read(4) != b"PAR1":
                    return False
            metadata = pq.read_metadata(path)
            total += metadata.num_rows * metadata.num_columns * 8
    except (InputError, OSError, pa.ArrowException, ValueError):
        return False
    return total > LARGE_BYTES


class ParquetSource:
    """Runs on disk that can be read in pieces; stands in for a `Recording` where a method needs one pass only.

    Runs are in the order of the files, channels in that of the machine file or the columns. Rows that were left out are
    among the findings once the run has been read.
    """

    def __init__(self, runs: Sequence[TimedRun], planned: Sequence[Planned], findings: Sequence[Finding]) -> None:
        self._runs = {run.name: run for run in runs}
        self._planned = {channel.name: channel for channel in planned}
        self._findings = list(findings)
        self._told: set[tuple[str, str]] = set()
        self.channels: tuple[Channel, ...] = tuple(channel_of(p) for p in planned)
        self.runs = tuple(self._runs)  #: Names of the runs
        self.names = tuple(self._planned)  #: Names of the channels

    @property
    def findings(self) -> tuple[Finding, ...]:
        """What there is to say so far."""
        return tuple(self._findings)

    @cached_property
    def provenance(self) -> Mapping[str, Any]:
        """As `Recording.provenance`; the files are read once for their SHA-256."""
        return {"runs": {name: provenance_of(run) | {"sha256": _sha256(run.file)} for name, run in self._runs.items()}}

    def rows(self, run: str) -> int:
        """Number of rows in the file of a run."""
        return int(pq.read_metadata(self._runs[run].file).num_rows)

    def chunks(self, run: str, names: Iterable[str]) -> Iterator[tuple[Vector, Vector]]:
        """(time_s, values) pieces of a run in order, at most `CHUNK_ROWS` rows each, canonical units, NaN = missing.

        Raises RecordingError: The time runs backwards: such a file has to be sorted first. Raises ReadError: The file
        is damaged.
        """
        timed = self._runs[run]
        wanted = list(names)
        for name in wanted:
            if name not in self._planned:
                raise no_channel(name, self.names)
        headers = {name: self._planned[name].headers.get(run) for name in wanted}
        positions: dict[str, str] = timed.table.reading["positions"]
        asked = [*timed.clock.columns, *dict.fromkeys(h for h in headers.values() if h is not None)]
        schema_names = [positions[header] for header in asked]
        clock = _Ticker(timed)
        try:
            with pq.ParquetFile(timed.file, buffer_size=1 << 20, pre_buffer=False) as file:
                if not schema_names:  # no clock and no column of this run: only its length matters
                    schema_names = [file.schema_arrow.names[0]]
                for batch in file.iter_batches(batch_size=CHUNK_ROWS, columns=schema_names):
                    time_s, keep = clock.time_s(batch)
                    values = np.full((len(time_s), len(wanted)), np.nan)
                    for k, name in enumerate(wanted):
                        header = headers[name]
                        if header is None:
                            continue
                        raw = column_of(batch.column(positions[header]))
                        if raw is None or raw.dtype.kind != "f":
                            continue
                        values[:, k] = self._planned[name].canonical(raw[keep], run, time_s)
                    del batch
                    if len(time_s):
                        yield time_s, values
        except (pa.ArrowException, OSError) as error:
            raise damaged(timed.file.name, error) from error
        self._tell(run, clock)

    def _tell(self, run: str, clock: "_Ticker") -> None:
        for kind, count, statement in (
            (MISSING_STAMPS, clock.missing, "have no time"),
            (REPEATED_STAMPS, clock.repeated, "have the stamp of the row before"),
        ):
            if count and (run, kind) not in self._told:
                self._told.add((run, kind))
                where = Where(run=run, file=self._runs[run].file.name)
                told = f"{count} row(s) of {where.file} {statement}; they were left out."
                advice = "convert the file to clean recordings first if these rows matter"
                finding = FINDINGS.finding(kind, told, where, {"count": count}, advice, "leave-out-stretch")
                self._findings.append(finding)


class _Ticker:
    """Seconds from the start of a run, one piece after the other."""

    def __init__(self, run: TimedRun) -> None:
        self._run = run
        self._last = -np.inf
        self._first: Any = None
        self._rows = 0
        self.missing = 0
        self.repeated = 0

    def time_s(self, batch: pa.RecordBatch) -> tuple[Vector, Mask]:
        """Time of the rows that are kept, and which rows these are."""
        told = self._run.clock
        n_rows = batch.num_rows
        if not told.columns:
            period_s = float(self._run.time_s[1] - self._run.time_s[0])
            seconds = (self._rows + np.arange(n_rows, dtype=np.float64)) * period_s
        else:
            raw = column_of(batch.column(0))
            if raw is None or raw.dtype.kind == "O":
                raise _no_stream_clock(self._run)
            if raw.dtype.kind == "M":
                first = self._first if self._first is not None else next(iter(raw[~np.isnat(raw)]), None)
                self._first = first
                seconds = np.full(n_rows, np.nan)
                if first is not None:
                    known = ~np.isnat(raw)
                    seconds[known] = (raw[known] - first).astype(np.int64) / 1e9
            else:
                seconds = convert(raw, told.unit, "s")
                known_s = seconds[np.isfinite(seconds)]
                if self._first is None and len(known_s):
                    self._first = known_s[0]
                seconds = seconds - (0.0 if self._first is None else self._first)
        self._rows += n_rows
        finite = np.isfinite(seconds)
        self.missing += int((~finite).sum())
        with np.errstate(invalid="ignore"):
            before = np.r_[self._last, np.fmax.accumulate(seconds)[:-1]] if n_rows else seconds
            before = np.where(np.isnan(before), self._last, before)
            back = finite & (seconds < before)
            repeated = finite & (seconds == before)
        if back.any():
            row = self._rows - n_rows + int(np.flatnonzero(back)[0])
            raise RecordingError(
                f"time runs backwards at row {row + 1} ({float(before[back][0]):g} s, then "
                f"{float(seconds[back][0]):g} s)",
                expected="rows in order of time, because the file is read piece by piece",
                where=self._run.file.name,
                advice="sort the file by its time column, or split it where a new recording begins",
            )
        self.repeated += int(repeated.sum())
        keep = finite & ~repeated
        if keep.any():
            self._last = float(seconds[keep][-1])
        return seconds[keep], keep


def stream_parquet(
    paths: Sequence[Path], machine: Path | Machine | None = None, overrides: Overrides | None = None
) -> ParquetSource:
    """A source over Parquet files, one per run; roles and units are settled on the first rows of each.

    Raises ReadError, RecordingError, UnitError, OptionError: As `selector.readers.read`; also if a file is not Parquet
    or its time is text.
    """
    found, overrides = recording_files([Path(path) for path in paths]), overrides or Overrides()
    declared = machine_at(machine) if isinstance(machine, Path | str) else machine
    if declared is None and found.machine is not None:
        declared = machine_at(found.machine)
    options = time_options(declared, overrides)
    with quiet(), np.errstate(all="ignore"):
        heads = [timed_run(_head(path), "", options) for path in found.files]
        if any(one.beside for one in (declared.runs if declared else {}).values()):
            raise RecordingError(
                "a run that is beside another one, and recordings so large that they are read in pieces",
                expected="recordings that are read whole",
                where="[runs] of the machine file",
                advice="take means (--mean-s 10), or join them with `selector convert --mean-s 10`",
            )
        runs, planned, noticed = settled(heads, declared, overrides)
    for run in runs:
        numeric = any(c.header in run.clock.columns and c.kind == "number" for c in run.table.columns)
        # epoch numbers would need their zero; a unit of time or a timestamp column is all that is read piece by piece
        units = {"s", "ms", "us", "ns", "min", "hour", "day"} if numeric else {"datetime", "sample"}
        if len(run.clock.columns) > 1 or run.clock.time_of_day or run.clock.unit not in units:
            raise _no_stream_clock(run)
    return ParquetSource(runs, planned.channels, condensed([*found.findings, *noticed]))


def _no_stream_clock(run: TimedRun) -> ReadError:
    return ReadError(
        f"time column(s) {', '.join(run.clock.columns)} that cannot be read piece by piece",
        expected="one column of numbers in a unit of time, or of timestamps",
        where=run.file.name,
        advice="store the time as float64 seconds (column time_s) or as Parquet timestamps",
    )


def _head(path: Path) -> Table:
    try:
        with path.open("rb") as stream:
            if stream.read(4) != b"PAR1":
                raise ReadError(
                    "a file that is not Parquet", expected="Parquet files only", where=path.name,
                    advice="convert it first: selector convert FILE --format parquet --out DIR",
                )  # fmt: skip
        with pq.ParquetFile(path, buffer_size=1 << 20, pre_buffer=False) as file:
            schema = file.schema_arrow
            checked_width(len(schema), path.name)
            head = pa.Table.from_batches(islice(file.iter_batches(batch_size=_HEAD_ROWS), 1), schema)
    except (pa.ArrowException, OSError, ValueError) as error:
        raise damaged(path.name, error) from error
    table = table_of(path, head, "parquet")
    headers = unique_headers([str(n) for n in schema.names], path.name)[0]
    kept = {key: table.reading[key] for key in ("format", "utc_columns")}
    return replace(table, reading={**kept, "positions": dict(zip(headers, schema.names, strict=True))})


def _sha256(path: Path) -> str:
    with path.open("rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()
