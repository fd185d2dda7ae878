"""What the cells of a column gave cause to say."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from selector.findings import Finding, Where
from selector.readers.cells import ColumnNotes
from selector.readers.finding_table import FINDINGS
from selector.readers.text.lines import shown_lines


def column_findings(header: str, notes: ColumnNotes, lines: NDArray[np.int64] | None, where: str) -> list[Finding]:
    """What the cells of one column gave cause to say."""

    def line(row: int) -> int:
        return int(lines[row]) if lines is not None else row + 1

    place = Where(channel=header)
    findings: list[Finding] = []
    if notes.unreadable:
        at = sorted(line(row) for rows in notes.unreadable.values() for row in rows)
        words = ", ".join(repr(word[:30]) for word in list(notes.unreadable)[:4])
        findings.append(
            FINDINGS.finding(
                "unreadable-cells",
                f"Column {header!r} of {where} has cells that are no numbers ({words}; {shown_lines(at)}); they are "
                "missing values.",
                place,
                {"words": [word[:60] for word in notes.unreadable], "lines": at[:50]},
            )
        )
    if notes.grouped:
        findings.append(
            FINDINGS.finding(
                "grouped-thousands",
                f"Column {header!r} of {where} has {notes.grouped[1]} number(s) such as {notes.grouped[0]!r}, read as "
                "whole numbers with grouped thousands.",
                place,
                {"example": notes.grouped[0], "count": notes.grouped[1]},
            )
        )
    if notes.other_decimal:
        findings.append(
            FINDINGS.finding(
                "mixed-decimal",
                f"Column {header!r} of {where} has {notes.other_decimal[1]} number(s) with another decimal mark "
                f"than the "
                f"rest of the file, such as {notes.other_decimal[0]!r}; the mark was taken as a decimal mark.",
                place,
                {"example": notes.other_decimal[0], "count": notes.other_decimal[1]},
            )
        )
    if notes.unit:
        findings.append(
            FINDINGS.finding(
                "unit-in-cells",
                f"The cells of column {header!r} of {where} carry a unit: {notes.unit!r}.",
                place,
                {"unit": notes.unit},
            )
        )
    if notes.infinite:
        findings.append(
            FINDINGS.finding(
                "infinite-values",
                f"Column {header!r} of {where} has {notes.infinite} infinite value(s); they are missing values.",
                place,
                {"count": notes.infinite},
            )
        )
    if notes.words:
        shown = ", ".join(f"{word} = {value:g}" for word, value in notes.words.items())
        findings.append(
            FINDINGS.finding(
                "words-as-numbers", f"Column {header!r} of {where} holds words: {shown}.", place, notes.words
            )
        )
    return findings


def no_header_finding(where: str, headers: list[str]) -> Finding:
    """The file names no channels."""
    return FINDINGS.finding(
        "no-header",
        f"{where} has no row of channel names; the columns are called {', '.join(headers[:3])}"
        + (" …" if len(headers) > 3 else "")
        + ".",
        evidence={"columns": len(headers)},
    )
