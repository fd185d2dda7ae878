"""What the cells of a column gave cause to say."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from selector.findings import Finding, Where
from selector.readers.cells import ColumnNotes
from selector.readers.finding_table import FINDINGS
from selector.readers.tables import listed
from selector.readers.text.lines import shown_lines


def column_findings(header: str, notes: ColumnNotes, lines: NDArray[np.int64] | None, where: str) -> Iterator[Finding]:
    """What the cells of one column gave cause to say."""
    place, column = Where(channel=header), f"Column {header!r} of {where}"
    if notes.unreadable:
        rows = [row for rows in notes.unreadable.values() for row in rows]
        at = sorted(row + 1 if lines is None else int(lines[row]) for row in rows)
        words = ", ".join(repr(word[:30]) for word in list(notes.unreadable)[:4])
        yield FINDINGS.finding(
            "unreadable-cells",
            f"{column} has cells that are no numbers ({words}; {shown_lines(at)}); they are missing values.",
            place,
            {"words": [word[:60] for word in notes.unreadable], "lines": at[:50]},
        )
    if notes.grouped:
        example, count = notes.grouped
        yield FINDINGS.finding(
            "grouped-thousands",
            f"{column} has {count} number(s) such as {example!r}, read as whole numbers with grouped thousands.",
            place,
            {"example": example, "count": count},
        )
    if notes.other_decimal:
        example, count = notes.other_decimal
        yield FINDINGS.finding(
            "mixed-decimal",
            f"{column} has {count} number(s) with another decimal mark than the rest of the file, such as {example!r}; "
            "the mark was taken as a decimal mark.",
            place,
            {"example": example, "count": count},
        )
    if notes.unit:
        yield FINDINGS.finding(
            "unit-in-cells",
            f"The cells of column {header!r} of {where} carry a unit: {notes.unit!r}.",
            place,
            {"unit": notes.unit},
        )
    if notes.infinite:
        yield FINDINGS.finding(
            "infinite-values",
            f"{column} has {notes.infinite} infinite value(s); they are missing values.",
            place,
            {"count": notes.infinite},
        )
    if notes.words:
        shown = ", ".join(f"{word} = {value:g}" for word, value in notes.words.items())
        yield FINDINGS.finding("words-as-numbers", f"{column} holds words: {shown}.", place, notes.words)


def no_header_finding(where: str, headers: list[str]) -> Finding:
    """The file names no channels."""
    return FINDINGS.finding(
        "no-header",
        f"{where} has no row of channel names; the columns are called {listed(headers, 3)}.",
        evidence={"columns": len(headers)},
    )
