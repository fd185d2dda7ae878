"""Small tables in which a wrong cell would become a wrong motion: read strictly, nothing is guessed or left out."""

import math
import re
from pathlib import Path

from selector.errors import ReadError
from selector.readers.text.encodings import decoded
from selector.readers.text.lines import cells_of, is_comment

MOST_BYTES = 20_000_000
MOST_ROWS = 10_000
LONGEST_LINE = 4_000  #: Patterns for names and units take long on long text.
_SEPARATORS = (";", "\t", "|", ",", " ")
_NUMBER = re.compile(r"[+-]?(\d+([.]\d*)?|[.]\d+)([eE][+-]?\d+)?")


def refused(found: str, expected: str, where: str, advice: str) -> ReadError:
    """Why a table is not read."""
    return ReadError(found, expected=expected, where=where, advice=advice)


def strict_rows(path: Path, name: str, what: str, example: str) -> tuple[list[tuple[int, list[str]]], str]:
    """Line numbers and cells of the lines that are neither empty nor comments, the header first; the separator.

    `name` and `what` are what messages call the file and what it holds; `example` says how it looks.

    Raises ReadError: it is no such file, has no row, or more than belong there.
    """
    if not path.is_file():
        found = "a folder" if path.is_dir() else "no such file" if not path.exists() else "not a regular file"
        raise refused(found, "a text file", name, f"name the file with the {what}")
    if path.stat().st_size > MOST_BYTES:
        size = f"{path.stat().st_size / 1e6:.0f} MB"
        raise refused(size, f"a {what}, at most {MOST_BYTES / 1e6:.0f} MB", name, f"give {example}, nothing else")
    data = path.read_bytes()
    text = decoded(data, name).utf8.decode("utf-8") if data.strip() else ""
    lines = [(i, line) for i, line in enumerate(text.split("\n"), start=1) if line.strip(' \t\r;,|"')]
    lines = [(i, line.rstrip("\r")) for i, line in lines if not is_comment(line)]
    if lines and re.fullmatch(r'"?sep=."?', lines[0][1].strip(), re.IGNORECASE):
        lines = lines[1:]
    if not 2 <= len(lines) <= MOST_ROWS + 1:
        found = f"{len(lines) - 1} rows" if len(lines) > 1 else "no row below the header" if lines else "no rows"
        raise refused(found, f"{example}, at most {MOST_ROWS} rows", name, f"write the {what} into the file")
    for number, line in lines:
        if len(line) > LONGEST_LINE:
            found = f"a line of {len(line)} characters"
            raise refused(found, f"at most {LONGEST_LINE}", f"{name}, line {number}", f"give {example}")
    mark = next((mark for mark in _SEPARATORS if mark in lines[0][1].strip()), None)
    if mark is None:
        raise refused(
            f"a header with one column ({lines[0][1].strip()[:60]!r})", example, f"{name}, line {lines[0][0]}",
            "separate the columns by commas or semicolons",
        )  # fmt: skip
    cut = "blank" if mark == " " else mark
    rows = [(number, cells_of(line, cut, quoted=True)) for number, line in lines]
    for number, cells in rows:
        if len(cells) != len(rows[0][1]):
            expected = f"{len(rows[0][1])}, as in the header"
            raise refused(f"{len(cells)} cells", expected, f"{name}, line {number}", "complete the row")
    return rows, mark


def strict_number(cell: str, what: str, where: str, *, comma: bool) -> float:
    """The number in a cell; `comma`: it may have a decimal comma. Raises ReadError: it holds none."""
    text = cell.strip().replace("−", "-")
    if comma and text.count(",") == 1:
        text = text.replace(",", ".")
    value = float(text) if _NUMBER.fullmatch(text) else math.nan
    if not math.isfinite(value):
        raise refused(
            f"{what} {cell.strip()[:40]!r}" if text else f"no {what}",
            "a number with a decimal point, and no thousands separators", where,
            "correct the cell: 1500 for fifteen hundred; decimal commas are read only between semicolons or tabs",
        )  # fmt: skip
    return value
