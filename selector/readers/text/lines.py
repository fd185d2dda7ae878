"""Which lines of the body are samples: comments, repeated headers, ragged and cut lines are set aside and told."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field

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


@dataclass(frozen=True)
class _SetAside:
    """Numbers of the lines that are not plain samples."""

    ragged: list[int] = field(default_factory=list)
    too_long: list[int] = field(default_factory=list)
    repeated: list[int] = field(default_factory=list)
    comments: list[int] = field(default_factory=list)
    remarks: list[int] = field(default_factory=list)


def body(
    text: bytes,
    first_line: int,
    dialect: Dialect,
    headings: Sequence[str],
    where: str,
    *,
    remarks_last: bool = False,
) -> Body:
    """The samples of a file.

    `text` is UTF-8 from the first sample on, which is line `first_line` of the file, from 1; `headings` are left out
    where they are met again. `remarks_last`: the last column holds free text, in which the separator may stand.
    """
    cut_off = bool(text) and not text.endswith(b"\n")
    separator, n_columns = dialect.separator, dialect.n_columns
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
    initial = buffer[np.minimum(starts, len(buffer) - 1)]
    odd_start = np.isin(initial, np.frombuffer(b"#%/! \t", np.uint8))
    heading_set = {heading.strip() for heading in headings if heading.strip()}
    heading_lengths = {len(h.encode()) for h in heading_set}
    suspect = (found != n_columns) | odd_start | unbalanced
    if heading_set:
        length = ends - starts
        digit_start = np.isin(initial, np.frombuffer(b"0123456789-", np.uint8))
        suspect |= (length >= min(heading_lengths)) & (length <= max(heading_lengths) + 4) & ~digit_start
    suspect &= ~empty
    keep = ~empty & ~suspect
    replaced: dict[int, bytes] = {}
    aside = _SetAside()
    n_filled = int((~empty).sum())
    for i in np.flatnonzero(suspect):
        line = text[starts[i] : ends[i]].decode("utf-8", "replace")
        if not line.strip() or not line.strip(separator + " \t"):
            continue
        if line.strip() in heading_set:
            aside.repeated.append(int(numbers[i]))
            continue
        if is_comment(line):
            aside.comments.append(int(numbers[i]))
            continue
        if unbalanced[i]:
            line = line.replace('"', "")
        elif found[i] == n_columns:
            keep[i] = True
            continue
        cells = cells_of(line, separator, dialect.quoted)
        while len(cells) > n_columns and not cells[-1]:
            cells.pop()
        if len(cells) > n_columns and remarks_last:
            cells = [*cells[: n_columns - 1], " ".join(cells[n_columns - 1 :])]
        if len(cells) > n_columns:
            aside.too_long.append(int(numbers[i]))
            continue
        if len(cells) == 1 and n_columns > 1 and cell_kind(cells[0], dialect.decimal) == "text":
            aside.remarks.append(int(numbers[i]))
            continue
        if len(cells) < n_columns:
            aside.ragged.append(int(numbers[i]))
            if cut_off and i == len(ends) - 1:
                continue
        replaced[int(i)] = separator.join(
            _quoted(cell, separator) if dialect.quoted else cell for cell in cells + [""] * (n_columns - len(cells))
        ).encode()
        keep[i] = True
    wrong = aside.ragged + aside.too_long
    if len(wrong) > 0.5 * n_filled and n_filled > 3:
        raise ReadError(
            f"{len(wrong)} of {n_filled} lines do not have {n_columns} cells (first: line {wrong[0]})",
            expected=f"{n_columns} cells set apart by {dialect.shown_separator!r} on every line",
            where=where,
            advice="name the separator and the decimal mark (--separator, --decimal), or export with ';' between "
            "columns",
        )
    kept = np.flatnonzero(keep)
    clean = _joined(text, starts, ends, kept, replaced)
    findings = _told(where, n_columns, aside, cut_off and not bool(keep[-1:].all()))
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


def _told(where: str, n_columns: int, aside: _SetAside, last_cut: bool) -> Iterator[Finding]:
    def evidence(lines: list[int]) -> dict[str, object]:
        return {"lines": lines[:50], "count": len(lines)}

    if lines := aside.ragged:
        yield FINDINGS.finding(
            "ragged-rows",
            f"{len(lines)} line(s) of {where} have fewer than {n_columns} cells ({shown_lines(lines)}); the cells "
            "that are not there are missing values."
            + (" The last line is cut off and was left out." if last_cut else ""),
            evidence=evidence(lines),
        )
    if lines := aside.too_long:
        yield FINDINGS.finding(
            "overlong-rows",
            f"{len(lines)} line(s) of {where} have more than {n_columns} cells ({shown_lines(lines)}) and were left "
            "out, because it is not known which cell belongs to which channel.",
            evidence=evidence(lines),
            action="leave-out-stretch",
        )
    if lines := aside.repeated:
        yield FINDINGS.finding(
            "repeated-header",
            f"The header of {where} is repeated at {shown_lines(lines)}; these lines were left out.",
            evidence=evidence(lines),
        )
    if lines := aside.remarks:
        yield FINDINGS.finding(
            "text-lines",
            f"{len(lines)} line(s) of {where} are text, no samples ({shown_lines(lines)}); they are left out.",
            evidence=evidence(lines),
        )
    if lines := aside.comments:
        yield FINDINGS.finding(
            "comment-lines",
            f"{len(lines)} comment line(s) between the samples of {where} were left out ({shown_lines(lines)}).",
            evidence=evidence(lines),
        )


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


def _quoted(cell: str, separator: str) -> str:
    if separator in cell or '"' in cell or "\n" in cell:
        return '"' + cell.replace('"', '""') + '"'
    return cell
