"""How lines are cut into cells, and which lines are samples: comments, repeated headers, cut lines are set aside."""

import csv
import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from selector.errors import ReadError
from selector.findings import Action, Finding
from selector.readers.cells import cell_kind, is_grouped_number
from selector.readers.finding_table import FINDINGS
from selector.readers.tables import MAX_COLUMNS, checked_width, shown_lines
from selector.types import Indices

#: Candidates; "blanks" = two or more blanks (or tabs), "blank" = one or more.
SEPARATORS = (";", "\t", ",", "|", "blanks", "blank")
_NAMED = {"tab": "\t", "\\t": "\t", "blank": "blank", "space": "blank", " ": "blank", "semicolon": ";", "comma": ","}
_COMMENT = re.compile(r"^\s*(#|%|//|!)")


@dataclass(frozen=True)
class Dialect:
    """How lines are cut into cells."""

    separator: str  #: One character, or "blanks" / "blank", see `SEPARATORS`
    decimal: str  #: ``"."`` or ``","``
    n_columns: int  #: Cells of an ordinary line
    quoted: bool  #: Whether double quotes enclose cells

    @property
    def shown_separator(self) -> str:
        """The separator as contracts and messages show it."""
        return {"\t": "tab", "blanks": "blank", "blank": "blank"}.get(self.separator, self.separator)


def is_comment(line: str) -> bool:
    """Whether a line starts with a comment mark (``#``, ``%``, ``//``, ``!``)."""
    return _COMMENT.match(line) is not None


def cells_of(line: str, separator: str, quoted: bool) -> list[str]:
    """The trimmed cells of one line."""
    if separator == "blank":
        parts = line.split()
    elif separator == "blanks":
        parts = re.split(r"\s{2,}|\t", line.strip())
    elif quoted and '"' in line:
        try:
            parts = next(csv.reader([line], delimiter=separator, skipinitialspace=True), [])
        except (csv.Error, StopIteration):
            parts = line.split(separator)
    else:
        parts = line.split(separator)
    return [part.strip() for part in parts]


def dialect(
    body: Sequence[str], head: Sequence[str], where: str, separator: str | None, decimal: str | None
) -> Dialect:
    """The dialect under which most cells of the sample lines are numbers and most lines have the same count.

    `body` are lines from inside the file, without comments and empty lines; of the first lines, `head`, one of words
    with the same count of cells speaks for a separator. `separator` and `decimal` are what the user named.
    """
    named = _named_separator(separator, where)
    if decimal is not None and decimal not in (".", ","):
        raise ReadError(f"decimal mark {decimal!r}", expected="'.' or ','", where=where, advice="correct the option")
    widest = max((line.count(s) for line in (*body[:20], *head[:20]) for s in ";\t,|"), default=0)
    widest = max(widest, max((len(line.split()) for line in body[:3]), default=0))
    if widest > 4 * MAX_COLUMNS:
        checked_width(widest + 1, where)
    marked = [line for line in (*body, *head) if '"' in line]
    quoted = bool(marked) and sum(line.count('"') % 2 == 0 for line in marked) >= 0.8 * len(marked)
    best: tuple[float, Dialect] | None = None
    for candidate in SEPARATORS if named is None else (named,):
        if len(candidate) == 1 and named is None and not any(candidate in line for line in body):
            continue
        rows = [cells_of(line, candidate, quoted) for line in body]
        counts = Counter(len(row) for row in rows)
        n_columns = max(counts, key=lambda n: (counts[n], n))
        for mark in (".", ",") if decimal is None else (decimal,):
            if candidate == "," and mark == "," and not quoted:
                continue
            tried = Dialect(candidate, mark, n_columns, quoted)
            score = _score(rows, head, tried)
            if best is None or score > best[0] + 1e-9:
                best = (score, tried)
    single = _single_column(body, head, decimal, quoted)
    if named is None and single is not None and (best is None or single[0] >= best[0] - 1e-9):
        best = single
    if best is None or best[0] < 0.1:
        raise ReadError(
            "no table of numbers"
            + (f" when cut at {separator!r}" if separator else "")
            + (f" in its {len(head)} line(s)" if len(head) < 60 else ""),
            expected="a row of names above rows of numbers, the columns set apart by , ; tab | or blanks",
            where=where,
            advice="export the recording as CSV, or name the separator and the decimal mark (--separator, --decimal)",
        )
    checked_width(best[1].n_columns, where)
    return best[1]


def _score(rows: list[list[str]], head: Sequence[str], tried: Dialect) -> float:
    n_columns, decimal = tried.n_columns, tried.decimal
    if n_columns < 2:
        return 0.0
    agreeing = [row for row in rows if len(row) == n_columns]
    usual = agreeing[:60]
    trailing = all(not row[-1] for row in usual)
    good = 0
    filled = 0
    grouped = 0
    for position in range(min(n_columns, 200)):
        kinds = [cell_kind(row[position], decimal) for row in usual if position < len(row)]
        kinds = [kind for kind in kinds if kind != "empty"]
        if not kinds:
            continue
        filled += 1
        known = sum(kind != "text" for kind in kinds)
        # a column of missing-value words alone is no evidence for a separator
        if known >= 0.5 * len(kinds) and any(kind in ("number", "time") for kind in kinds):
            good += 1
        # 20,125 is rather a decimal than twenty thousand
        grouped += any(is_grouped_number(row[position], decimal) for row in usual if position < len(row))
    if good == 0 or filled == 0:
        return 0.0
    score = len(agreeing) / len(rows) * (good - 0.1 * min(grouped, good)) / filled
    for line in head:
        words = cells_of(line, tried.separator, tried.quoted)
        fits = len(words) == n_columns or (trailing and len(words) == n_columns - 1)
        if fits and len([w for w in words if w]) >= min(2, n_columns - trailing):
            texts = sum(cell_kind(w, decimal) == "text" for w in words)
            if texts >= 0.5 * len(words):
                score += 0.3
                break
    # commas inside numbers must not win over a real separator that explains the same cells
    preference = {",": 0.03, "blanks": 0.02, "blank": 0.0}.get(tried.separator, 0.05)
    return score + preference + (0.004 if decimal == "." else 0.0)


def _single_column(
    body: Sequence[str], head: Sequence[str], decimal: str | None, quoted: bool
) -> tuple[float, Dialect] | None:
    best: tuple[float, Dialect] | None = None
    for mark in (".", ",") if decimal is None else (decimal,):
        share = sum(cell_kind(line, mark) in ("number", "missing", "break") for line in body) / max(len(body), 1)
        if not any(cell_kind(line, mark) == "number" for line in body):
            continue
        # a heading without the mark speaks for one column: "T1" above "20,5"
        heading = next((line for line in head if cell_kind(line, mark) == "text"), None)
        bonus = 0.34 if heading is not None and not any(s in heading for s in ";,\t|") else 0.0
        score = share + bonus + (0.004 if mark == "." else 0.0)
        if share > 0.5 and (best is None or score > best[0]):
            best = (score, Dialect(",", mark, 1, quoted) if mark == "." else Dialect(";", mark, 1, quoted))
    return best


def _named_separator(separator: str | None, where: str) -> str | None:
    if separator is None:
        return None
    named = _NAMED.get(separator.lower(), separator)
    if named in SEPARATORS:
        return named
    # the text is cut as UTF-8 bytes, so a separator has to be one byte
    if len(named) != 1 or not named.isascii() or named in '"\n\r\0' or named.isalnum():
        raise ReadError(
            f"separator {separator!r}",
            expected="one ASCII character that is no letter, digit, quotation mark or line end, or 'tab' or 'blank'",
            where=where,
            advice="correct the option",
        )
    return named


def decimal_doubts(numbers: Sequence[str], chosen: Dialect, where: str) -> list[Finding]:
    """A finding if every number that has the decimal mark could also be a whole number with grouped thousands.

    ``1,234`` is 1.234 or 1234; ``0,234``, ``1,23`` and ``12345,678`` can only be decimals.
    """
    mark = chosen.decimal
    if mark == "." and chosen.separator in (",", "blank", "blanks"):
        return []
    marked = [number for number in numbers if mark in number]
    if not marked or any(re.fullmatch(rf"[+-]?[1-9]\d{{0,2}}\{mark}\d{{3}}", n) is None for n in marked):
        return []
    other = "." if mark == "," else ","
    if any(other in number for number in numbers):
        return []
    example = marked[0]
    return [
        FINDINGS.finding(
            "ambiguous-decimal",
            f"In {where} every number with a {mark!r} has three digits behind it: {example} was read as "
            f"{example.replace(',', '.')}, but it could be {example.replace(mark, '')} with grouped thousands.",
            evidence={"decimal": mark, "example": example, "alternative": f"{mark!r} groups thousands"},
            suggestion=f"if the numbers are 1000 times too small, name the other decimal mark (--decimal '{other}')",
        )
    ]


@dataclass(frozen=True)
class Body:
    """The samples as clean text and what was set aside."""

    text: bytes  #: UTF-8, one sample a line, every line with the same number of cells
    separator: str  #: One character
    lines: Indices  #: (n_samples,): Line number in the file of every sample, from 1
    findings: tuple[Finding, ...]  #: Ragged, repeated and cut lines


#: What is said of the lines that are not plain samples.
_ASIDE = {
    "ragged-rows": "{count} line(s) of {where} have fewer than {n_columns} cells ({lines}); the cells that are not "
    "there are missing values.",
    "overlong-rows": "{count} line(s) of {where} have more than {n_columns} cells ({lines}) and were left out, because "
    "it is not known which cell belongs to which channel.",
    "repeated-header": "The header of {where} is repeated at {lines}; these lines were left out.",
    "text-lines": "{count} line(s) of {where} are text, no samples ({lines}); they are left out.",
    "comment-lines": "{count} comment line(s) between the samples of {where} were left out ({lines}).",
}


def body(
    text: bytes, first_line: int, dialect: Dialect, headings: Sequence[str], where: str, *, remarks_last: bool = False
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
    aside: dict[str, list[int]] = {kind: [] for kind in _ASIDE}
    n_filled = int((~empty).sum())
    for i in np.flatnonzero(suspect):
        line = text[starts[i] : ends[i]].decode("utf-8", "replace")
        if not line.strip() or not line.strip(separator + " \t"):
            continue
        if line.strip() in heading_set or is_comment(line):
            aside["repeated-header" if line.strip() in heading_set else "comment-lines"].append(int(numbers[i]))
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
            aside["overlong-rows"].append(int(numbers[i]))
            continue
        if len(cells) == 1 and n_columns > 1 and cell_kind(cells[0], dialect.decimal) == "text":
            aside["text-lines"].append(int(numbers[i]))
            continue
        if len(cells) < n_columns:
            aside["ragged-rows"].append(int(numbers[i]))
            if cut_off and i == len(ends) - 1:
                continue
        replaced[int(i)] = separator.join(
            _quoted(cell, separator) if dialect.quoted else cell for cell in cells + [""] * (n_columns - len(cells))
        ).encode()
        keep[i] = True
    wrong = aside["ragged-rows"] + aside["overlong-rows"]
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
    findings = []
    for kind, at in aside.items():
        if at:
            told = _ASIDE[kind].format(count=len(at), where=where, n_columns=n_columns, lines=shown_lines(at))
            if kind == "ragged-rows" and cut_off and not keep[-1:].all():
                told += " The last line is cut off and was left out."
            action: Action = "leave-out-stretch" if kind == "overlong-rows" else "none"
            evidence = {"lines": at[:50], "count": len(at)}
            findings.append(FINDINGS.finding(kind, told, evidence=evidence, action=action))
    return Body(clean, separator, numbers[kept], tuple(findings))


def _joined(text: bytes, starts: Indices, ends: Indices, kept: Indices, replaced: dict[int, bytes]) -> bytes:
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


def _tabbed(text: bytes, separator: str) -> bytes:
    pattern = rb"[ \t\x0b\x0c]+" if separator == "blank" else rb"[ ]{2,}|[ ]*\t[ ]*"
    text = re.sub(rb"(?m)^[ \t\x0b\x0c]+|[ \t\x0b\x0c]+$", b"", text.replace(b"\xc2\xa0", b" "))
    return re.sub(pattern, b"\t", text)


def _quoted(cell: str, separator: str) -> str:
    if separator in cell or '"' in cell or "\n" in cell:
        return '"' + cell.replace('"', '""') + '"'
    return cell
