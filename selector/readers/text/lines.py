"""Which lines of the body are samples: comments, repeated headers, ragged and cut lines are set aside and told."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from selector.errors import ReadError
from selector.findings import Finding
from selector.readers.cells import cell_kind
from selector.readers.finding_table import FINDINGS
from selector.readers.text.sniffing import Dialect, cells_of, is_comment


@dataclass(frozen=True)
class Body:
    """The samples as clean text and what was set aside."""

    text: bytes  #: UTF-8, one sample a line, every line with the same number of cells
    separator: str  #: One character
    lines: NDArray[np.int64]  #: (n_samples,): Line number in the file of every sample, from 1
    findings: tuple[Finding, ...]  #: Ragged, repeated and cut lines


def body(
    text: bytes,
    first_line: int,
    dialect: Dialect,
    n_columns: int,
    headings: Sequence[str],
    where: str,
    *,
    remarks_last: bool = False,
) -> Body:
    """The samples of a file.

    Parameters
    ----------
    text : bytes
        UTF-8 from the first sample on.
    first_line : int
        Its line number in the file, from 1.
    n_columns : int
        Cells that a line has to have.
    headings : sequence of str
        Header lines; where they are met again inside the body they are left out.
    remarks_last : bool
        Whether the last column holds free text, in which the separator may stand.

    Raises
    ------
    ReadError
        More than half of the lines do not have the right number of cells.
    """
    cut_off = bool(text) and not text.endswith(b"\n")
    separator = dialect.separator
    if separator in ("blank", "blanks"):
        text = _tabbed(text, separator)
        separator = "\t"
    if not text.endswith(b"\n"):
        text += b"\n"
    buffer = np.frombuffer(text, np.uint8)
    ends = np.flatnonzero(buffer == 10)
    marks = np.flatnonzero(buffer == ord(separator))
    starts = np.r_[0, ends[:-1] + 1]
    unbalanced = np.zeros(len(ends), dtype=bool)
    if dialect.quoted and b'"' in text:
        quotes = np.flatnonzero(buffer == 34)
        before = np.atleast_1d(np.searchsorted(quotes, starts))
        unbalanced = ((np.searchsorted(quotes, ends) - before) & 1).astype(bool)
        line_of = np.atleast_1d(np.searchsorted(ends, marks))
        marks = marks[((np.searchsorted(quotes, marks) - before[line_of]) & 1) == 0]
    found = np.searchsorted(marks, ends) - np.searchsorted(marks, starts) + 1
    numbers = first_line + np.arange(len(ends), dtype=np.int64)
    empty = ends == starts
    odd_start = np.isin(buffer[np.minimum(starts, len(buffer) - 1)], np.frombuffer(b"#%/! \t", np.uint8))
    heading_set = {heading.strip() for heading in headings if heading.strip()}
    heading_lengths = {len(h.encode()) for h in heading_set}
    suspect = (found != n_columns) | odd_start | unbalanced
    if heading_set:
        length = ends - starts
        suspect |= (
            (length >= min(heading_lengths)) & (length <= max(heading_lengths) + 4) & ~_digit_start(buffer, starts)
        )
    suspect &= ~empty
    keep = ~empty & ~suspect
    replaced: dict[int, bytes] = {}
    ragged: list[int] = []
    too_long: list[int] = []
    repeated: list[int] = []
    comments: list[int] = []
    remarks: list[int] = []
    n_filled = int((~empty).sum())
    for i in np.flatnonzero(suspect):
        line = text[starts[i] : ends[i]].decode("utf-8", "replace")
        if not line.strip() or not line.strip(separator + " \t"):
            continue
        if line.strip() in heading_set:
            repeated.append(int(numbers[i]))
            continue
        if is_comment(line):
            comments.append(int(numbers[i]))
            continue
        if unbalanced[i]:
            line = line.replace('"', "")
        elif found[i] == n_columns:
            keep[i] = True
            continue
        cells = _trimmed(cells_of(line, separator, dialect.quoted), n_columns)
        if len(cells) > n_columns and remarks_last:
            cells = [*cells[: n_columns - 1], " ".join(cells[n_columns - 1 :])]
        if len(cells) > n_columns:
            too_long.append(int(numbers[i]))
            continue
        if len(cells) == 1 and n_columns > 1 and cell_kind(cells[0], dialect.decimal) == "text":
            remarks.append(int(numbers[i]))
            continue
        if len(cells) < n_columns:
            ragged.append(int(numbers[i]))
            if cut_off and i == len(ends) - 1:
                continue
        replaced[int(i)] = separator.join(
            _quoted(cell, separator) if dialect.quoted else cell for cell in cells + [""] * (n_columns - len(cells))
        ).encode()
        keep[i] = True
    if len(ragged) + len(too_long) > 0.5 * n_filled and n_filled > 3:
        raise ReadError(
            f"{len(ragged) + len(too_long)} of {n_filled} lines do not have {n_columns} cells "
            f"(first: line {(ragged + too_long)[0]})",
            expected=f"{n_columns} cells set apart by {dialect.shown_separator!r} on every line",
            where=where,
            advice="name the separator and the decimal mark (--separator, --decimal), or export with ';' between "
            "columns",
        )
    kept = np.flatnonzero(keep)
    clean = _joined(text, starts, ends, kept, replaced)
    findings = _told(
        where, n_columns, ragged, too_long, repeated, comments, remarks, cut_off and not bool(keep[-1:].all())
    )
    return Body(clean, separator, numbers[kept], tuple(findings))


def _joined(
    text: bytes, starts: NDArray[np.int64], ends: NDArray[np.int64], kept: NDArray[np.int64], replaced: dict[int, bytes]
) -> bytes:
    if len(kept) == len(starts) and not replaced:
        return text
    pieces: list[bytes] = []
    # unbroken stretches of unchanged lines are copied in one go
    changed = np.array(sorted(replaced), dtype=np.int64)
    plain = kept[~np.isin(kept, changed)]
    breaks = np.flatnonzero(np.diff(plain) != 1) + 1
    stretches = {int(part[0]): int(part[-1]) for part in np.split(plain, breaks) if len(part)}
    for i in sorted([*stretches, *replaced]):
        if i in replaced:
            pieces.append(replaced[i] + b"\n")
        else:
            pieces.append(text[starts[i] : ends[stretches[i]] + 1])
    return b"".join(pieces)


def _told(
    where: str,
    n_columns: int,
    ragged: list[int],
    too_long: list[int],
    repeated: list[int],
    comments: list[int],
    remarks: list[int],
    last_cut: bool,
) -> list[Finding]:
    findings: list[Finding] = []
    if ragged:
        findings.append(
            FINDINGS.finding(
                "ragged-rows",
                f"{len(ragged)} line(s) of {where} have fewer than {n_columns} cells ({shown_lines(ragged)}); the "
                f"cells "
                "that are not there are missing values."
                + (" The last line is cut off and was left out." if last_cut else ""),
                evidence={"lines": ragged[:50], "count": len(ragged)},
            )
        )
    if too_long:
        findings.append(
            FINDINGS.finding(
                "overlong-rows",
                f"{len(too_long)} line(s) of {where} have more than {n_columns} cells ({shown_lines(too_long)}) and "
                f"were "
                "left out, because it is not known which cell belongs to which channel.",
                evidence={"lines": too_long[:50], "count": len(too_long)},
                action="leave-out-stretch",
            )
        )
    if repeated:
        findings.append(
            FINDINGS.finding(
                "repeated-header",
                f"The header of {where} is repeated at {shown_lines(repeated)}; these lines were left out.",
                evidence={"lines": repeated[:50], "count": len(repeated)},
            )
        )
    if remarks:
        findings.append(
            FINDINGS.finding(
                "text-lines",
                f"{len(remarks)} line(s) of {where} are text, no samples ({shown_lines(remarks)}); they are left out.",
                evidence={"lines": remarks[:50], "count": len(remarks)},
            )
        )
    if comments:
        findings.append(
            FINDINGS.finding(
                "comment-lines",
                f"{len(comments)} comment line(s) between the samples of {where} were left out "
                f"({shown_lines(comments)}).",
                evidence={"lines": comments[:50], "count": len(comments)},
            )
        )
    return findings


def shown_lines(lines: Sequence[int]) -> str:
    """``"lines 3, 7, 9"`` or, when there are many, the first five and the last."""
    if len(lines) == 1:
        return f"line {lines[0]}"
    if len(lines) <= 6:
        return "lines " + ", ".join(map(str, lines))
    return "lines " + ", ".join(map(str, lines[:5])) + f", … {lines[-1]}"


def _tabbed(text: bytes, separator: str) -> bytes:
    pattern = rb"[ \t\x0b\x0c]+" if separator == "blank" else rb"[ ]{2,}|[ ]*\t[ ]*"
    text = re.sub(rb"(?m)^[ \t\x0b\x0c]+|[ \t\x0b\x0c]+$", b"", text.replace(b"\xc2\xa0", b" "))
    return re.sub(pattern, b"\t", text)


def _digit_start(buffer: NDArray[np.uint8], starts: NDArray[np.int64]) -> NDArray[np.bool_]:
    initial = buffer[np.minimum(starts, len(buffer) - 1)]
    out: NDArray[np.bool_] = ((initial >= 48) & (initial <= 57)) | (initial == 45)
    return out


def _trimmed(cells: list[str], n_columns: int) -> list[str]:
    while len(cells) > n_columns and not cells[-1]:
        cells = cells[:-1]
    return cells


def _quoted(cell: str, separator: str) -> str:
    if separator in cell or '"' in cell or "\n" in cell:
        return '"' + cell.replace('"', '""') + '"'
    return cell
