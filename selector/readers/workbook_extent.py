"""How far the sheets of a zipped workbook reach, told from its parts before a parser makes room for them."""

from __future__ import annotations

import copy
import re
import sys
import zipfile
from collections.abc import Iterator

from selector.errors import ReadError

MAX_ROWS = 1_048_576
MAX_COLUMNS = 16_384
MAX_CELLS = 50_000_000
"""Cells of the rectangle from A1 to the last cell; the parser makes room for all of them, empty or not."""

_CHUNK_BYTES = 1 << 20
_LONGEST_TAG = 1 << 16
_XLSX = re.compile(
    rb"<(?:[A-Za-z_][\w.-]*:)?(?:(row)|c)(?=[\s/>])(?:[^<]*?\sr\s*=\s*[\"']\s*([A-Za-z]*)(\d*))?", re.ASCII
)
_ODS = re.compile(rb"<table:(table|table-row|(?:covered-)?table-cell)(?=[\s/>])([^<>]*)")
_REPEATED = re.compile(rb"number-(?:rows|columns)-repeated\s*=\s*[\"']\s*(\d+)")


def check_extent(archive: zipfile.ZipFile, where: str) -> None:
    """Raise if a sheet of an xlsx or ods workbook reaches further than a spreadsheet or the memory.

    A single value in the last cell of a sheet makes a parser ask for 17 thousand million cells; the declared dimension
    may lie, so that the places of the cells themselves are read. Memory: one piece of a part at a time.

    Raises
    ------
    ReadError
        A sheet has more than `MAX_ROWS`, `MAX_COLUMNS` or `MAX_CELLS`.
    """
    for entry in archive.infolist():
        name = entry.filename.lower()
        if name == "content.xml":
            _check_ods(archive, entry, where)
        elif name.endswith(".xml"):
            _check_xlsx(archive, entry, where)


def _tags(archive: zipfile.ZipFile, entry: zipfile.ZipInfo, pattern: re.Pattern[bytes]) -> Iterator[re.Match[bytes]]:
    """The tags of a part in their order; a tag longer than `_LONGEST_TAG` is cut. A part is as long as told."""
    rest, length = b"", 0
    to_its_end = copy.copy(entry)
    to_its_end.file_size = sys.maxsize
    with archive.open(to_its_end) as stream:
        while piece := stream.read(_CHUNK_BYTES):
            length += len(piece)
            if length > entry.file_size:
                raise zipfile.BadZipFile(
                    f"{entry.filename} is longer than the {entry.file_size} bytes it is told to be"
                )
            piece = rest + piece
            # from the last "<" on, the tag may go on in the next piece
            cut = piece.rfind(b"<")
            cut = len(piece) if cut < 0 or len(piece) - cut > _LONGEST_TAG else cut
            yield from pattern.finditer(piece, 0, cut)
            rest = piece[cut:]
    yield from pattern.finditer(rest)


def _check_xlsx(archive: zipfile.ZipFile, entry: zipfile.ZipInfo, where: str) -> None:
    row = column = last_row = last_column = 0
    columns: dict[bytes, int] = {}
    for tag in _tags(archive, entry, _XLSX):
        is_row, letters, digits = tag.groups()
        if is_row:
            row, column = _count(digits) if digits else row + 1, 0
            continue
        if letters:
            if letters not in columns:
                columns[letters] = _column(letters)
            column = columns[letters]
        else:
            column += 1
        at = _count(digits) if digits else max(row, 1)
        if at > last_row or column > last_column:
            last_row, last_column = max(last_row, at), max(last_column, column)
            _check(last_row, last_column, f"{where}, {entry.filename}")
    # a row without cells has no place in the table, but its number is read
    _check(max(last_row, row), last_column, f"{where}, {entry.filename}")


def _check_ods(archive: zipfile.ZipFile, entry: zipfile.ZipInfo, where: str) -> None:
    first = end = column = last_row = last_column = 0
    for tag in _tags(archive, entry, _ODS):
        kind, inside = tag.groups()
        if kind == b"table":
            first = end = last_row = last_column = 0
            continue
        repeated = _REPEATED.search(inside)
        count = _count(repeated[1]) if repeated else 1
        if kind == b"table-row":
            first, column = end, 0
            end = first + count
            continue
        column += count
        # cells and rows that are repeated without a value fill the sheet up to its end
        if b"value" in inside or not inside.rstrip().endswith(b"/"):
            last_row, last_column = max(last_row, end), max(last_column, column)
            _check(last_row, last_column, f"{where}, {entry.filename}")


def _count(digits: bytes) -> int:
    return int(digits[:12])


def _column(letters: bytes) -> int:
    number = 0
    for letter in letters[:8].upper():
        number = 26 * number + letter - 64
    return number


def _check(rows: int, columns: int, where: str) -> None:
    if rows > MAX_ROWS or columns > MAX_COLUMNS or rows * columns > MAX_CELLS:
        raise ReadError(
            f"a sheet that reaches to row {rows}, column {columns}",
            expected=f"at most {MAX_ROWS} rows, {MAX_COLUMNS} columns and {MAX_CELLS // 1_000_000} million cells from "
            "A1 to the last cell",
            where=where,
            advice="delete stray cells far away from the table, or export the sheet as CSV or Parquet",
        )
