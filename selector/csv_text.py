"""CSV that a spreadsheet opens without running any of it, and that reads back to the same names."""

import csv
import io
import re
from collections.abc import Iterable, Sequence

_FORMULA = re.compile(r"'*[=+\-@\t\r\n]")
_NUMBER = re.compile(r"[-+]?(\d+\.?\d*|\.\d+)([eE][-+]?\d+)?")


def defused(text: str) -> str:
    r"""A name or another text for a cell: what a spreadsheet would run as a formula begins with an apostrophe.

    That is what begins with ``= + - @``, a tab or a line end. What does not print becomes a blank, because not every
    reader takes a quoted line end for part of a cell.

    >>> defused("=1+1"), defused("T1"), defused("'-x"), defused("@a\tb")
    ("'=1+1", 'T1', "''-x", "'@a b")
    """
    safe = f"'{text}" if _FORMULA.match(text) else text
    return "".join(sign if sign.isprintable() else " " for sign in safe)


def as_written(text: str) -> str:
    """What `defused` made this text of.

    >>> as_written("'=1+1"), as_written("'T1'"), as_written("''-x")
    ('=1+1', "'T1'", "'-x")
    """
    return text[1:] if text.startswith("'") and _FORMULA.match(text) else text


def csv_text(names: Sequence[str], rows: Iterable[Sequence[object]] = ()) -> str:
    """A table as CSV, lines ended by LF; texts are `defused`, but not numbers in rows that are texts."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(map(defused, names))
    for row in rows:
        writer.writerow(
            defused(cell) if isinstance(cell, str) and not _NUMBER.fullmatch(cell) else cell for cell in row
        )
    return text.getvalue()
