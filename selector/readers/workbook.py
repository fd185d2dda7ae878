"""Excel and OpenDocument workbooks → tables; cached values only, none that unpack to too much."""

import copy
import datetime
import io
import re
import sys
import zipfile
import zlib
from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import python_calamine
from numpy.typing import NDArray

from selector.errors import InputError, ReadError
from selector.findings import Finding, Level
from selector.readers.cells import column_findings, column_kinds, layout, no_header_finding, numbers_or_text
from selector.readers.finding_table import FINDINGS
from selector.readers.tables import Column, Overrides, Table, checked_size, checked_width, reading_of, unique_headers

MAX_ROWS = 1_048_576
MAX_COLUMNS = 16_384
#: Cells of the rectangle from A1 to the last cell; the parser makes room for all of them, empty or not.
MAX_CELLS = 50_000_000
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


MAX_UNPACKED_BYTES = 1_500_000_000  #: Size of the unpacked parts of a workbook beyond which it is taken for a zip bomb.
#: An xlsx unpacks to 5 to 20 times its size, an ods to 20 to 175 times where most of its columns never change.
_MOST_TIMES, _MOST_TIMES_ODS, _ALWAYS_BYTES = 60, 200, 30_000_000


def read_excel(path: Path, data: bytes, overrides: Overrides) -> list[Table]:
    """One table per sheet that looks like a run.

    Sheets with the same column names are runs; if there are several kinds of sheets, the kind with the most cells is
    read and the others are named in a finding.
    """
    where = path.name
    workbook = _workbook(data, where)
    names = _wanted_sheets(workbook.sheet_names, overrides.sheet, where)
    tables: list[Table] = []
    refused: dict[str, InputError] = {}
    for name in names:
        rows = _rows(workbook, name, where)
        if not any(any(cell != "" for cell in row) for row in rows):
            continue
        try:
            tables.append(_table(path, name, rows, overrides))
        except InputError as error:
            refused[name] = error
    if not tables:
        if len(refused) == 1:
            raise next(iter(refused.values()))
        raise ReadError(
            f"no sheet with a table of numbers (sheets: {', '.join(names[:10]) or 'none'})",
            expected="a row of names above rows of numbers",
            where=where,
            advice="name the sheet (--sheet) and the row of the names (--header-row)",
        )
    chosen, findings = _runs(tables, list(refused), where)
    first, *others = (
        replace(table, name=path.stem if len(chosen) == 1 else f"{path.stem}_{table.reading['sheet']}")
        for table in chosen
    )
    return [replace(first, findings=(*findings, *first.findings)), *others]


def _workbook(data: bytes, where: str) -> python_calamine.CalamineWorkbook:
    if data.startswith(b"\xd0\xcf\x11\xe0") and "EncryptedPackage".encode("utf-16-le") in data:
        raise _protected(where)
    if data.startswith(b"PK"):
        try:
            with zipfile.ZipFile(io.BytesIO(data)) as archive:
                unpacked = sum(entry.file_size for entry in archive.infolist())
                is_xlsx = any(entry.filename.lower().startswith("xl/") for entry in archive.infolist())
                times = _MOST_TIMES if is_xlsx else _MOST_TIMES_ODS
                most = min(MAX_UNPACKED_BYTES, times * len(data) + _ALWAYS_BYTES)
                if unpacked > most:
                    raise ReadError(
                        f"a workbook of {len(data) / 1e6:.2g} MB that unpacks to {unpacked / 1e6:.0f} MB",
                        expected=f"at most {most / 1e6:.0f} MB unpacked for a file of this size",
                        where=where,
                        advice="export the sheet as CSV or Parquet",
                    )
                check_extent(archive, where)
        except (zipfile.BadZipFile, zlib.error, EOFError, ValueError, OSError, RuntimeError) as error:
            raise _damaged(where, str(error)) from error
    with _parsing(where):
        return python_calamine.CalamineWorkbook.from_filelike(io.BytesIO(data))


@contextmanager
def _parsing(where: str) -> Iterator[None]:
    """What the parser cannot do is an error of the file."""
    try:
        yield
    except python_calamine.PasswordError as error:
        raise _protected(where) from error
    except (python_calamine.CalamineError, OSError, ValueError) as error:
        raise _damaged(where, str(error)) from error
    except BaseException as error:
        if type(error).__name__ != "PanicException":  # the parser's own defect on a damaged file
            raise
        raise _damaged(where, "the parser gave up") from error


def _protected(where: str) -> ReadError:
    return ReadError(
        "a workbook protected by a password",
        expected="a workbook without a password",
        where=where,
        advice="save it without a password (File > Info > Protect Workbook), or export the sheet as CSV",
    )


def _damaged(where: str, reason: str) -> ReadError:
    return ReadError(
        f"a workbook that cannot be opened ({reason[:160]})",
        expected="xlsx, xlsm, xlsb, xls or ods",
        where=where,
        advice="open it in a spreadsheet program and save it again as xlsx or CSV",
    )


def _wanted_sheets(names: Sequence[str], wanted: str | None, where: str) -> list[str]:
    if wanted is None:
        return list(names)
    if wanted in names:
        return [wanted]
    folded = {name.strip().casefold(): name for name in names}
    if wanted.strip().casefold() in folded:
        return [folded[wanted.strip().casefold()]]
    if wanted.isascii() and wanted.isdigit() and 1 <= int(wanted) <= len(names):
        return [names[int(wanted) - 1]]
    raise ReadError(
        f"no sheet {wanted!r}; the sheets are {', '.join(names[:20])}",
        expected="the name of a sheet, or its number from 1",
        where=where,
        advice="correct the sheet (--sheet)",
    )


def _rows(workbook: python_calamine.CalamineWorkbook, name: str, where: str) -> list[list[Any]]:
    place = f"{where}, sheet {name!r}"
    with _parsing(place):
        sheet = workbook.get_sheet_by_name(name)
        checked_width(int(sheet.total_width), place)
        checked_size(int(sheet.total_width) * int(sheet.total_height), place)
        rows: list[list[Any]] = sheet.to_python(skip_empty_area=False)
    return rows


def _table(path: Path, sheet: str, rows: list[list[Any]], overrides: Overrides) -> Table:
    where = f"{path.name}, sheet {sheet!r}"
    told = [i for i, row in enumerate(rows) if any(cell != "" for cell in row)]
    width = max(len(row) for row in rows)
    half = told[len(told) // 2 :][:200]
    sample = [[_shown(cell) for cell in rows[i]] for i in half]
    commas = sum(cell.count(",") for row in sample for cell in row if cell.replace(",", "").lstrip("-").isdigit())
    decimal = overrides.decimal or ("," if commas else ".")
    kinds = column_kinds(sample, width, decimal)
    head = [[_shown(cell) for cell in row] for row in rows[:2000]]
    head = [row if any(row) else [] for row in head]
    header_row = None if overrides.header_row is None else overrides.header_row - 1
    found = layout(head, kinds, decimal, header_row, where)
    names = found.headers(head)
    used = [k for k in range(width) if kinds[k] != "empty" or (k < len(names) and names[k])]
    lines = np.array([i for i in range(found.first, len(rows)) if any(cell != "" for cell in rows[i])], dtype=np.int64)
    heading = [cell for cell in names if cell]
    repeated = [
        int(i)
        for i in lines
        if heading and [s for s in (_shown(c) for c in rows[i] if isinstance(c, str)) if s] == heading
    ]
    lines = lines[~np.isin(lines, repeated)]
    findings: list[Finding] = []
    if repeated:
        numbers = [i + 1 for i in repeated[:50]]
        said = f"The header of {where} is repeated in row(s) {', '.join(map(str, numbers[:6]))}; these rows were "
        said += "left out."
        findings.append(FINDINGS.finding("repeated-header", said, evidence={"lines": numbers}, suggestion=""))
    headers, told_names = unique_headers([names[k] if k < len(names) else "" for k in used], where)
    if found.names is None:
        headers = [f"col{k + 1}" for k in used]
        findings.append(no_header_finding(where, headers))
    else:
        findings += told_names
    units = head[found.units] if found.units is not None else []
    columns = []
    for header, k in zip(headers, used, strict=True):
        values, notes = _values([rows[i][k] if k < len(rows[i]) else "" for i in lines], decimal)
        findings += column_findings(header, notes, lines + 1, where) if notes is not None else []
        unit = units[k] if k < len(units) and units[k] else None
        columns.append(Column(header, values, unit or (notes.unit if notes else None), notes.breaks if notes else ()))
    reading = reading_of(
        "excel",
        decimal=decimal if any(isinstance(c, str) and c for i in half for c in rows[i]) and commas else None,
        skipped_rows=found.first if found.names is None else found.names,
        unit_row=found.units is not None,
        sheet=sheet,
        header_row=None if found.names is None else found.names + 1,
        first_data_row=found.first + 1,
    )
    return Table(path.stem, path, tuple(columns), reading, tuple(findings), lines + 1)


def _shown(cell: Any) -> str:
    """A cell as text, the way the layout is judged."""
    if isinstance(cell, bool):
        return "1" if cell else "0"
    if isinstance(cell, float):
        return repr(int(cell)) if cell.is_integer() and abs(cell) < 1e15 else repr(cell)
    if isinstance(cell, datetime.datetime):
        return cell.isoformat(sep=" ")
    if isinstance(cell, datetime.timedelta):
        whole = cell.total_seconds()
        return f"{int(whole // 3600)}:{int(whole % 3600 // 60):02d}:{whole % 60:09.6f}"
    return str(cell).strip()


def _values(cells: list[Any], decimal: str) -> tuple[NDArray[Any], Any]:
    kinds = Counter(type(cell) for cell in cells if cell != "")
    if all(kind in (int, float, bool) for kind in kinds):
        return np.array([np.nan if cell == "" else float(cell) for cell in cells], dtype=np.float64), None
    if kinds and all(kind in (datetime.datetime, datetime.date) for kind in kinds):
        try:
            return np.array(
                [np.datetime64("NaT") if c == "" else np.datetime64(c) for c in cells], dtype="datetime64[ns]"
            ), None
        except (ValueError, OverflowError):
            pass
    text = pa.array([_number_text(cell, decimal) for cell in cells], pa.string())
    return numbers_or_text(text, decimal)


def _number_text(cell: Any, decimal: str) -> str | None:
    if cell == "":
        return None
    if isinstance(cell, (int, float)) and not isinstance(cell, bool):
        return repr(cell).replace(".", decimal)
    return _shown(cell).encode("utf-8", "replace").decode()


def _runs(tables: list[Table], refused: list[str], where: str) -> tuple[list[Table], tuple[Finding, ...]]:
    groups: dict[tuple[str, ...], list[Table]] = {}
    for table in tables:
        groups.setdefault(tuple(c.header for c in table.columns), []).append(table)
    best = max(groups.values(), key=lambda group: sum(len(t) * len(t.columns) for t in group))
    left = [str(t.reading["sheet"]) for t in tables if not any(t is chosen for chosen in best)] + refused
    findings: list[Finding] = []
    if len(best) > 1:
        several = f"{len(best)} sheets of {where} have the same columns; each was read as a run of its own."
        sheets = [t.reading["sheet"] for t in best]
        findings.append(FINDINGS.finding("sheets-are-runs", several, evidence={"sheets": sheets}))
    if left:
        told = f"Of {where} the sheet(s) {', '.join(left[:8])} were not read: they have other columns or no table of "
        told += "numbers."
        level: Level = "warning" if len(left) > len(refused) else "info"
        evidence = {"sheets": left}
        findings.append(FINDINGS.finding("sheets-left-out", told, evidence=evidence, level=level))
    return best, tuple(findings)
