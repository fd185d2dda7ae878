"""What a format reader hands on: a table as it stands in the file, before clock, roles and units."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from selector.csv_text import as_written
from selector.errors import ReadError
from selector.findings import Finding
from selector.number_text import shortened
from selector.readers.finding_table import DUPLICATE_HEADER, FINDINGS
from selector.types import Indices, Vector

#: A recording with more columns than this is a mistake in the separator or a matrix stored the wrong way round.
MAX_COLUMNS = 10_000
MAX_CELLS = 600_000_000  #: Cells (8 bytes each) beyond which a file is not read into memory at once: 4.8 GB.


@dataclass(frozen=True)
class Overrides:
    """What the user decides instead of the reader; None or empty = the reader finds out."""

    #: encoding, separator and decimal: Of delimited text. `separator` may be ``"tab"`` or ``"blank"``.
    encoding: str | None = None
    separator: str | None = None
    decimal: str | None = None
    header_row: int | None = None  #: Line (text) or row (Excel) of the channel names, counted from 1; 0 = there is none
    sheet: str | None = None  #: Excel sheet, TDMS group or MAT variable to read
    #: time_column and time_unit: Name of the time column; a unit of time or ``"datetime"``
    time_column: str | None = None
    time_unit: str | None = None
    date_order: str | None = None  #: {"dmy", "mdy", "ymd"} or None: Order of day, month and year in dates
    period_s: float | None = None  #: Sampling period [s] of a recording without a time column
    #: since and until: Date, or date and time, by the recordings' own clock: samples from then on, and before then
    since: str | None = None
    until: str | None = None
    mean_s: float | None = None  #: Means over so many seconds [s] are taken in place of samples
    #: units and roles: Unit and role by channel or column name
    units: Mapping[str, str] = field(default_factory=dict)
    roles: Mapping[str, str] = field(default_factory=dict)
    #: Whether channels of the machine file may be lacking in all files, as in a simulation of some channels only
    partial: bool = False
    #: Channels of the machine file that must be in a file, as those that a model reads; None: all of them
    needed: tuple[str, ...] | None = None

    @property
    def has_window(self) -> bool:
        """Whether a part of the time is asked for."""
        return self.since is not None or self.until is not None


@dataclass(frozen=True)
class BreakWord:
    """A word such as ``OPEN`` that stood where a number was due: which rows."""

    word: str
    rows: Indices


@dataclass(frozen=True)
class Column:
    """One column as it stands in the file."""

    header: str  #: The header cell, blanks at the ends removed; unique in its table
    values: NDArray[Any]  #: (n_rows,): float64 with NaN = missing, datetime64[ns], or object (str or None) for text
    unit: str | None = None  #: Unit as written in a unit row or in the metadata of the file (not in the header cell)
    breaks: tuple[BreakWord, ...] = ()  #: Sensor-break words that became NaN
    description: str | None = None  #: Comment or place that the file gives for this column

    @property
    def kind(self) -> str:
        """``"number"``, ``"datetime"`` or ``"text"``."""
        return {"f": "number", "M": "datetime"}.get(self.values.dtype.kind, "text")


@dataclass(frozen=True)
class Table:
    """One table of a file, which is one run."""

    name: str  #: Name proposed for the run
    file: Path  #: Where it was read
    columns: tuple[Column, ...]  #: All of the same length
    #: How the file was read: format, encoding, separator, decimal, skipped_rows, unit_row, ..
    reading: Mapping[str, Any]
    findings: tuple[Finding, ...] = ()  #: What was noticed; `where.run` is filled in by the assembly
    lines: Indices | None = None  #: (n_rows,): Line or row number in the file of every row, for messages
    #: Seconds of the file's own clock, if the format has one outside of its columns (TDMS, MDF)
    time_s: Vector | None = None
    start: np.datetime64 | None = None  #: Absolute time of ``time_s == 0`` in that case

    def __len__(self) -> int:
        return len(self.columns[0].values) if self.columns else 0

    def line(self, row: int) -> str:
        """Place of a row for messages: ``line 12`` or ``row 12``."""
        return f"line {self.lines[row]}" if self.lines is not None else f"row {row + 1}"


def reading_of(format: str, **told: Any) -> dict[str, Any]:  # noqa: A002 - the contract's word
    """How a file was read, as `Table` holds it; what is not told does not exist in this format."""
    nothing = {"encoding": None, "separator": None, "decimal": None, "skipped_rows": 0, "unit_row": False}
    return {"format": format, **nothing, **told}


def checked_width(n_columns: int, where: str) -> None:
    """Raise unless the table has a number of columns that can be channels."""
    if n_columns > MAX_COLUMNS:
        raise ReadError(
            f"{n_columns} columns",
            expected=f"one column per channel, at most {MAX_COLUMNS}",
            where=where,
            advice="store one row per sample (transpose the table), or name the right separator",
        )


def checked_size(n_cells: int, where: str) -> None:
    """Raise if a table would not fit into memory."""
    if n_cells > MAX_CELLS:
        raise ReadError(
            f"{n_cells:.3g} numbers in one table",
            expected=f"at most {MAX_CELLS:.3g} numbers in memory",
            where=where,
            advice="store the recording as Parquet, which is read piece by piece, or split it into runs",
        )


def unique_headers(headers: Sequence[str], where: str) -> tuple[list[str], list[Finding]]:
    """Headers without blanks at the ends, empty ones as ``col3``, repeated ones as ``T1.2``, and what was changed.

    Of more than 190 letters the middle is left out, and an apostrophe that keeps a spreadsheet from running a name.
    """
    taken: set[str] = set()
    unique: list[str] = []
    repeated: dict[str, list[str]] = {}
    for position, raw in enumerate(headers, start=1):
        # on one line: control characters are blanks
        shown = "".join(c if c.isprintable() else " " for c in raw)
        text = as_written(shortened(" ".join(shown.split()), 190)) or f"col{position}"
        name, count = text, 1
        while name in taken:
            count += 1
            name = f"{text}.{count}"
        if name != text:
            repeated.setdefault(text, []).append(name)
        taken.add(name)
        unique.append(name)
    findings = []
    for text, names in repeated.items():
        told = f"{len(names) + 1} columns of {where} are called {text!r}; the later ones are read as "
        told += f"{', '.join(names)}."
        findings.append(FINDINGS.finding(DUPLICATE_HEADER, told, evidence={"column": text, "read_as": names}))
    return unique, findings


def listed(names: Iterable[str], most: int) -> str:
    """The names in one line; of more than so many the first, and dots."""
    told = list(names)
    return ", ".join(told[:most]) + (" …" if len(told) > most else "")


def shown_lines(lines: Sequence[int]) -> str:
    """``"lines 3, 7, 9"`` or, when there are many, the first five and the last."""
    if len(lines) == 1:
        return f"line {lines[0]}"
    if len(lines) <= 6:
        return "lines " + ", ".join(map(str, lines))
    return "lines " + ", ".join(map(str, lines[:5])) + f", … {lines[-1]}"
