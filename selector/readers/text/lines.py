"""How lines are cut into cells, which lines are samples, and small tables that are read strictly."""

import csv
import math
import re
from collections import Counter
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from selector.errors import ReadError
from selector.findings import Action, Finding
from selector.readers.cells import cell_kind, is_grouped_number
from selector.readers.finding_table import FINDINGS
from selector.readers.tables import MAX_COLUMNS, checked_width, shown_lines
from selector.readers.text.encodings import decoded
from selector.types import Indices, Mask

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
    lines = _Lines.of(text if text.endswith(b"\n") else text + b"\n", separator, quoted=dialect.quoted)
    heading_set = {heading.strip() for heading in headings if heading.strip()}
    is_filled = lines.ends > lines.starts
    suspect = is_filled & lines.suspect(n_columns, heading_set)
    keep = is_filled & ~suspect
    replaced: dict[int, bytes] = {}
    aside: dict[str, list[int]] = {kind: [] for kind in _ASIDE}
    for i in np.flatnonzero(suspect).tolist():
        line = lines.line(i)
        if not line.strip() or not line.strip(separator + " \t"):
            continue
        kind = "repeated-header" if line.strip() in heading_set else "comment-lines" if is_comment(line) else ""
        if not kind and lines.n_cells[i] == n_columns and not lines.unbalanced[i]:
            keep[i] = True
            continue
        cells = _cells(line.replace('"', "") if lines.unbalanced[i] else line, separator, dialect, remarks_last)
        kind = kind or _kind_of_cells(cells, dialect)
        if kind:
            aside[kind].append(first_line + i)
        if kind in ("", "ragged-rows") and not (kind and cut_off and i == len(lines.ends) - 1):
            cells += [""] * (n_columns - len(cells))
            replaced[i] = separator.join(_quoted(one, separator) if dialect.quoted else one for one in cells).encode()
            keep[i] = True
    wrong, n_filled = aside["ragged-rows"] + aside["overlong-rows"], int(is_filled.sum())
    if len(wrong) > 0.5 * n_filled and n_filled > 3:
        raise ReadError(
            f"{len(wrong)} of {n_filled} lines do not have {n_columns} cells (first: line {wrong[0]})",
            expected=f"{n_columns} cells set apart by {dialect.shown_separator!r} on every line",
            where=where,
            advice="name the separator and the decimal mark (--separator, --decimal), or export with ';' between "
            "columns",
        )
    kept = np.flatnonzero(keep)
    clean = _joined(lines.text, lines.starts, lines.ends, kept, replaced)
    findings = _set_aside(aside, where, n_columns, is_last_cut=cut_off and not keep[-1:].all())
    return Body(clean, separator, first_line + kept, tuple(findings))


@dataclass(frozen=True)
class _Lines:
    """Lines of a text as its bytes show them."""

    text: bytes
    #: (n_lines,): Where lines begin and end
    starts: Indices
    ends: Indices
    n_cells: Indices  #: (n_lines,): By the separators outside of quotes
    unbalanced: Mask  #: (n_lines,): Whether a quote is open at the end

    @classmethod
    def of(cls, text: bytes, separator: str, *, quoted: bool) -> "_Lines":
        """All lines of a text that ends with a line break."""
        buffer = np.frombuffer(text, np.uint8)
        ends, marks = (np.flatnonzero(buffer == sign) for sign in (ord("\n"), ord(separator)))
        starts = np.r_[0, ends[:-1] + 1]
        unbalanced = np.zeros(len(ends), dtype=bool)
        if quoted and b'"' in text:
            quotes = np.flatnonzero(buffer == ord('"'))
            before = np.atleast_1d(np.searchsorted(quotes, starts))
            unbalanced = ((np.searchsorted(quotes, ends) - before) & 1).astype(bool)
            line_of = np.atleast_1d(np.searchsorted(ends, marks))
            marks = marks[((np.searchsorted(quotes, marks) - before[line_of]) & 1) == 0]
        n_cells = np.searchsorted(marks, ends) - np.searchsorted(marks, starts) + 1
        return cls(text, starts, ends, n_cells, unbalanced)

    def line(self, i: int) -> str:
        """One line."""
        return self.text[self.starts[i] : self.ends[i]].decode("utf-8", "replace")

    def suspect(self, n_columns: int, headings: Collection[str]) -> Mask:
        """Which may be something else than plain samples: they are looked at one by one; shape (n_lines,)."""
        buffer = np.frombuffer(self.text, np.uint8)
        initial = buffer[np.minimum(self.starts, len(buffer) - 1)]
        found = (self.n_cells != n_columns) | self.unbalanced | np.isin(initial, list(b"#%/! \t"))
        if headings:
            length, lengths = self.ends - self.starts, [len(heading.encode()) for heading in headings]
            could_be = (length >= min(lengths)) & (length <= max(lengths) + 4)
            found |= could_be & ~np.isin(initial, list(b"0123456789-"))
        return np.asarray(found)


def _cells(line: str, separator: str, dialect: Dialect, remarks_last: bool) -> list[str]:
    """The cells of a line without empty ones beyond the last column; what stands there may be one remark."""
    cells, n_columns = cells_of(line, separator, dialect.quoted), dialect.n_columns
    while len(cells) > n_columns and not cells[-1]:
        cells.pop()
    if len(cells) > n_columns and remarks_last:
        cells = [*cells[: n_columns - 1], " ".join(cells[n_columns - 1 :])]
    return cells


def _kind_of_cells(cells: Sequence[str], dialect: Dialect) -> str:
    """Which of `_ASIDE` a line is; of a plain sample nothing."""
    if len(cells) == 1 < dialect.n_columns and cell_kind(cells[0], dialect.decimal) == "text":
        return "text-lines"
    n_more = len(cells) - dialect.n_columns
    return "overlong-rows" if n_more > 0 else "ragged-rows" if n_more < 0 else ""


def _set_aside(
    aside: Mapping[str, Sequence[int]], where: str, n_columns: int, *, is_last_cut: bool
) -> Iterator[Finding]:
    for kind, at in aside.items():
        if at:
            told = _ASIDE[kind].format(count=len(at), where=where, n_columns=n_columns, lines=shown_lines(at))
            if kind == "ragged-rows" and is_last_cut:
                told += " The last line is cut off and was left out."
            action: Action = "leave-out-stretch" if kind == "overlong-rows" else "none"
            evidence = {"lines": at[:50], "count": len(at)}
            yield FINDINGS.finding(kind, told, evidence=evidence, action=action)


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


# small tables in which a wrong cell would become a wrong motion: nothing is guessed or left out
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
