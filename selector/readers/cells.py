"""What a cell says, where names, units and samples are in a sheet of cells, and a column of them → numbers, or text."""

import functools
import re
import unicodedata
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from itertools import zip_longest
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
from numpy.typing import NDArray

from selector.errors import ReadError
from selector.findings import Finding, Where
from selector.readers.finding_table import FINDINGS
from selector.readers.tables import BreakWord, listed, shown_lines
from selector.text_file import rows_by_kind
from selector.types import Indices, Vector
from selector.units import parse_unit

_ROWS = rows_by_kind(Path(__file__).with_name("cell_words.txt"))
_WORDS = {kind: frozenset(" ".join(rows).split()) for kind, rows in _ROWS.items()}
#: Words that mean "no value", and those that loggers write for a broken or saturated sensor; trimmed, in lower case.
MISSING_WORDS, BREAK_WORDS = _WORDS["missing"], _WORDS["break"]
BOOLEAN_WORDS = dict.fromkeys(_WORDS["on"], 1.0) | dict.fromkeys(_WORDS["off"], 0.0)  #: Words of two-valued columns.

_POINT = re.compile(r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eEdD][+-]?\d{1,4})?")
_COMMA = re.compile(r"[+-]?(?:\d+,?\d*|,\d+)(?:[eEdD][+-]?\d{1,4})?")
_THOUSANDS_POINT = re.compile(r"[+-]?\d{1,3}(?:[ '’_\u00a0\u202f]\d{3})+(?:\.\d+)?|[+-]?\d{1,3}(?:,\d{3})+(?:\.\d+)?")
_THOUSANDS_COMMA = re.compile(r"[+-]?\d{1,3}(?:[ '’_\u00a0\u202f]\d{3})+(?:,\d+)?|[+-]?\d{1,3}(?:\.\d{3})+(?:,\d+)?")
_CLOCK = r"\d{1,4}[:h]\d{1,2}(?:[:m]\d{1,2}(?:[.,:]\d{1,9})?)?s?"
_NOON = r"(?:[ap]\.?\s?m\.?|上午|下午|午前|午後)"
_ZONE = r"(?:Z|UTC|GMT|[+-]\d{2}:?\d{2}|[A-Z]{3,5})"
_DATE = (
    r"(?:\d{1,4}[-/.]\d{1,2}[-/.]\d{1,4}\.?|\d{1,4}[- ][^\W\d_]{3,10}\.?[- ,]+\d{1,4}"
    r"|\d{2,4}年\d{1,2}月\d{1,2}日|[^\W\d_]{3,10}\.? \d{1,2},? \d{4}"
    r"|[12]\d{3}[01]\d[0-3]\d[T_ -][0-2]\d[0-5]\d[0-5]\d(?:[.,]\d+)?)"
)
_TIME = re.compile(
    rf"(?:(?:[^\W\d_]{{2,3}},? )?{_DATE}(?:[T ,;_]\s*{_NOON}?\s?{_CLOCK}\s?{_NOON}?)?\s?{_ZONE}?"
    rf"|{_NOON}?\s?{_CLOCK}\s?{_NOON}?\s?{_ZONE}?|\d{{1,2}}时\d{{1,2}}分(?:\d{{1,2}}秒)?|(?:\d+\s?d(?:ays?)?,?\s)?{_CLOCK})",
    re.IGNORECASE,
)
_WITH_UNIT = re.compile(r"([+-]?[\d.,]+(?:[eE][+-]?\d+)?)\s*([^\d\s.,+-][^\d,;]{0,11})")


def is_number(text: str, decimal: str) -> bool:
    """Whether a trimmed cell is a number with this decimal mark."""
    return (_COMMA if decimal == "," else _POINT).fullmatch(text) is not None


def is_grouped_number(text: str, decimal: str) -> bool:
    """Whether a trimmed cell is a number whose thousands are set apart, such as ``1.234,5`` or ``1'234.5``."""
    return (_THOUSANDS_COMMA if decimal == "," else _THOUSANDS_POINT).fullmatch(text) is not None


def is_time(text: str) -> bool:
    """Whether a trimmed cell is a date, a time of day, or both."""
    return 3 < len(text) < 60 and _TIME.fullmatch(text) is not None


def folded_word(text: str) -> str:
    """A cell as it is compared with the word lists."""
    return unicodedata.normalize("NFKC", text).strip().strip("\"'").strip().lower()


@functools.lru_cache(maxsize=20_000)
def cell_kind(text: str, decimal: str) -> str:
    """``"empty"``, ``"number"``, ``"time"``, ``"missing"``, ``"break"`` or ``"text"``."""
    cell = text.strip().strip('"').strip()
    kind = _judged(cell, decimal)[1].partition(":")[0] if cell else "empty"
    return {"grouped": "number", "unit": "number", "other": "text", "bool": "text"}.get(kind, kind)


Text: TypeAlias = Any  # pyarrow.Array or pyarrow.ChunkedArray of strings; pyarrow has no types

_ORDINARY = {".": r"^[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d{1,3})?$", ",": r"^[+-]?(\d+,?\d*|,\d+)([eE][+-]?\d{1,3})?$"}


@dataclass
class ColumnNotes:
    """What was met while the cells of a column were turned into numbers; row numbers from 0."""

    unreadable: dict[str, list[int]] = field(default_factory=dict)
    grouped: tuple[str, int] | None = None
    other_decimal: tuple[str, int] | None = None
    unit: str | None = None
    infinite: int = 0
    words: dict[str, float] = field(default_factory=dict)
    breaks: tuple[BreakWord, ...] = ()


def numbers_or_text(cells: Text, decimal: str) -> tuple[Vector | NDArray[np.object_], ColumnNotes]:
    """float64 values with NaN = missing if the column holds numbers (or ON/OFF words), otherwise its text.

    A column counts as numbers when at least half of the cells that say anything are numbers.
    """
    notes = ColumnNotes()
    quick = _cast(cells if decimal == "." else pc.replace_substring(cells, ",", "."))
    if quick is not None and (decimal == "." or not pc.any(pc.match_substring(cells, ".")).as_py()):
        return _finite(quick, notes), notes
    trimmed = pc.utf8_trim(cells, '" \t\u00a0\u2007\u202f\u3000\ufeff')
    plain = pc.if_else(pc.equal(trimmed, ""), pa.scalar(None, pa.string()), trimmed)
    if decimal == "." or not pc.any(pc.match_substring(plain, "."), min_count=0).as_py():
        quick = _cast(plain if decimal == "." else pc.replace_substring(plain, ",", "."))
        if quick is not None:
            return _finite(quick, notes), notes
    return _word_by_word(plain, decimal, notes)


def _cast(cells: Text) -> Vector | None:
    try:
        values = pc.cast(cells, pa.float64())
    except pa.ArrowInvalid:
        return None
    if isinstance(values, pa.ChunkedArray):
        values = values.combine_chunks()
    return np.array(values.to_numpy(zero_copy_only=False), dtype=np.float64)


def _finite(values: Vector, notes: ColumnNotes) -> Vector:
    infinite = np.isinf(values)
    if infinite.any():
        notes.infinite = int(infinite.sum())
        values[infinite] = np.nan
    return values


def _word_by_word(plain: Text, decimal: str, notes: ColumnNotes) -> tuple[Vector | NDArray[np.object_], ColumnNotes]:
    """The slow path: ordinary numbers at once, every other distinct cell is judged once."""
    if isinstance(plain, pa.ChunkedArray):
        plain = pa.concat_arrays(plain.chunks) if plain.num_chunks else pa.array([], pa.string())
    ordinary = pc.fill_null(pc.match_substring_regex(plain, _ORDINARY[decimal]), False)
    nothing = pa.scalar(None, pa.string())
    pointed = pc.replace_substring(plain, ",", ".") if decimal == "," else plain
    values = _cast(pc.if_else(ordinary, pointed, nothing))
    if values is None:  # cannot happen: the pattern admits only what the cast reads
        values = np.full(len(plain), np.nan)
    encoded = pc.if_else(ordinary, nothing, plain).dictionary_encode()
    words: list[str] = encoded.dictionary.to_pylist()
    codes = np.array(pc.fill_null(encoded.indices, -1).to_numpy(zero_copy_only=False), dtype=np.int64)
    if len(words) > 2000 and len(words) > 0.9 * (len(plain) - plain.null_count):
        # nearly every cell is another word that is no number: stamps, which another module reads
        shown = [_judged(word, decimal)[1] for word in words[:: len(words) // 300]]
        if sum(kind in ("time", "text") for kind in shown) > 0.9 * len(shown):
            stamps: NDArray[np.object_] = np.array(plain.to_pylist(), dtype=np.object_)
            return stamps, notes
    counts = np.bincount(codes[codes >= 0], minlength=len(words))
    judged = [_judged(word, decimal) for word in words]
    tally = {"number": int(pc.sum(ordinary).as_py() or 0)}
    for (_, kind), count in zip(judged, counts, strict=True):
        tally[kind.partition(":")[0]] = tally.get(kind.partition(":")[0], 0) + int(count)
    numeric = sum(tally.get(kind, 0) for kind in ("number", "grouped", "other", "unit"))
    text = sum(tally.get(kind, 0) for kind in ("text", "time", "bool"))
    table = np.array([value for value, _ in judged] + [np.nan], dtype=np.float64)
    switched = {word: value for word, (value, kind) in zip(words, judged, strict=True) if kind == "bool"}
    if numeric == 0 and 0 < tally.get("bool", 0) == text and len({folded_word(word) for word in switched}) <= 2:
        notes.words = switched
        return table[codes], notes
    if text > 0 and numeric < text:
        words_only: NDArray[np.object_] = np.array(plain.to_pylist(), dtype=np.object_)
        return words_only, notes

    def rows_of(code: int) -> Indices:
        return np.flatnonzero(codes == code).astype(np.int64)

    breaks: list[BreakWord] = []
    for code, (word, (_, kind)) in enumerate(zip(words, judged, strict=True)):
        if kind == "break":
            breaks.append(BreakWord(word.strip(), rows_of(code)))
        elif kind in ("text", "time", "bool"):
            table[code] = np.nan
            if len(notes.unreadable) < 20:
                notes.unreadable[word] = [int(row) for row in rows_of(code)[:20]]
            else:
                notes.unreadable.setdefault("…", []).append(int(rows_of(code)[0]))
        elif kind == "grouped":
            notes.grouped = (notes.grouped or (word, 0))[0], tally["grouped"]
        elif kind == "other":
            notes.other_decimal = (notes.other_decimal or (word, 0))[0], tally["other"]
        elif kind.startswith("unit:"):
            notes.unit = notes.unit or kind[5:]
    notes.breaks = tuple(breaks)
    return _finite(np.where(codes >= 0, table[codes], values), notes), notes


def _judged(word: str, decimal: str) -> tuple[float, str]:
    """(value or NaN, what kind of cell it is)."""
    # full-width digits and typographic minus signs, too
    cell = unicodedata.normalize("NFKC", word).replace("−", "-").replace("–", "-").strip()
    if is_number(cell, decimal):
        return _value(cell, decimal), "number"
    folded = folded_word(word)
    if not folded or folded in MISSING_WORDS:
        return np.nan, "missing"
    if folded in BREAK_WORDS:
        return np.nan, "break"
    if is_grouped_number(cell, decimal):
        bare = "".join(c for c in cell if c.isdigit() or c in "+-" or c == decimal)
        return _value(bare, decimal), "grouped"
    other = "," if decimal == "." else "."
    if is_number(cell, other):
        return _value(cell, other), "other"
    if folded in BOOLEAN_WORDS:
        return BOOLEAN_WORDS[folded], "bool"
    if is_time(cell):
        return np.nan, "time"
    parts = _WITH_UNIT.fullmatch(cell)
    if parts is not None and parse_unit(unit := parts[2].strip()) is not None:
        for mark in (decimal, other):
            if is_number(parts[1], mark):
                return _value(parts[1], mark), f"unit:{unit}"
    return np.nan, "text"


def _value(cell: str, decimal: str) -> float:
    text = cell.replace(",", ".") if decimal == "," else cell
    return float(text.lower().replace("d", "e"))


def column_findings(header: str, notes: ColumnNotes, lines: Indices | None, where: str) -> Iterator[Finding]:
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
        told = f"{column} has {count} number(s) such as {example!r}, read as whole numbers with grouped thousands."
        yield FINDINGS.finding("grouped-thousands", told, place, {"example": example, "count": count})
    if notes.other_decimal:
        example, count = notes.other_decimal
        told = f"{column} has {count} number(s) with another decimal mark than the rest of the file, such as "
        told += f"{example!r}; the mark was taken as a decimal mark."
        yield FINDINGS.finding("mixed-decimal", told, place, {"example": example, "count": count})
    if notes.unit:
        told = f"The cells of column {header!r} of {where} carry a unit: {notes.unit!r}."
        yield FINDINGS.finding("unit-in-cells", told, place, {"unit": notes.unit})
    if notes.infinite:
        told = f"{column} has {notes.infinite} infinite value(s); they are missing values."
        yield FINDINGS.finding("infinite-values", told, place, {"count": notes.infinite})
    if notes.words:
        shown = ", ".join(f"{word} = {value:g}" for word, value in notes.words.items())
        yield FINDINGS.finding("words-as-numbers", f"{column} holds words: {shown}.", place, notes.words)


def no_header_finding(where: str, headers: list[str]) -> Finding:
    """The file names no channels."""
    told = f"{where} has no row of channel names; the columns are called {listed(headers, 3)}."
    return FINDINGS.finding("no-header", told, evidence={"columns": len(headers)})


_TIME_NAME, _COUNTER_NAME = (re.compile(f"^({'|'.join(_ROWS[kind])})$", re.IGNORECASE) for kind in ("time", "counter"))
#: Names of columns that hold one part of a date and time each, from the year to the second.
_TIME_PARTS = tuple(_WORDS[part] for part in ("year", "month", "day", "hour", "minute", "second"))
_STATISTICS = frozenset(["", "avg", "smp", "max", "min", "std", "tot", "med", "mom"])  #: What a Campbell row says.
_FORMAT_CELL = re.compile(
    r"^[\[(]?(?:[dDmMyYhHs]{1,4}[-/.: ]?){2,6}(?:\.?[fS0]+)?[\])]?$|^(ts|rn|datetime|date|time)$", re.IGNORECASE
)
_SEARCHED_ROWS = 5_000


@dataclass(frozen=True)
class Layout:
    """Rows by their position in the sheet, from 0; None = there is no such row."""

    names: int | None
    units: int | None
    description: int | None
    first: int
    above: int | None = None  #: Names over several columns (merged cells), behind which those below them stand.

    def headers(self, rows: Sequence[Sequence[str]]) -> list[str]:
        """The names of the columns; behind what stands over them where they have gaps, or a name stands twice."""
        names = [] if self.names is None else list(rows[self.names])
        if self.above is None:
            return names
        found, over, gaps, twice = [], "", _is_filled_up(rows[self.above], names), _repeated(names)
        for upper, name in zip_longest(rows[self.above], names, fillvalue=""):
            over = upper or over
            found.append((f"{over} {name}".strip() if gaps or name in twice else name) if name else upper)
        return found


def is_time_name(name: str) -> bool:
    """Whether a column of this name (without its unit) is likely to hold the time."""
    return _TIME_NAME.match(name.strip().strip(":").strip()) is not None


def time_part(name: str) -> int | None:
    """Which part of a date and time a column of this name holds: 0 the year to 5 the second, or None."""
    return next((part for part, words in enumerate(_TIME_PARTS) if name.strip().casefold() in words), None)


def is_counter_name(name: str) -> bool:
    """Whether a column of this name is likely to number the samples."""
    return _COUNTER_NAME.match(name.strip()) is not None


def without_unit(header: str) -> str:
    """The header cell without a bracketed or appended unit; see `selector.readers.roles.names.name_and_unit`."""
    return re.split(r"\s*[\[({<]|\s*/\s*|\s+in\s+|,\s", header.strip(), maxsplit=1)[0].strip()


def column_kinds(body: Sequence[Sequence[str]], n_columns: int, decimal: str) -> list[str]:
    """What each column mostly holds: "number", "time", "text" or "empty"."""
    kinds: list[str] = []
    for position in range(n_columns):
        seen = [cell_kind(row[position], decimal) for row in body if position < len(row)]
        tally = {kind: seen.count(kind) for kind in ("number", "time", "text", "missing", "break")}
        told = tally["number"] + tally["time"] + tally["text"]
        if told == 0:
            kinds.append("number" if tally["missing"] + tally["break"] else "empty")
        elif tally["number"] >= 0.5 * told:
            kinds.append("number")
        else:
            kinds.append("time" if tally["time"] >= 0.5 * told else "text")
    return kinds


def layout(
    rows: Sequence[Sequence[str]], kinds: Sequence[str], decimal: str, header_row: int | None, where: str
) -> Layout:
    """The rows of names, units and the first sample, from the rows at the top of the file.

    `kinds` of columns are those of `column_kinds`; `header_row` is the position of the names in `rows` if the user
    named it, -1 = there is no such row.
    """
    if header_row is not None and header_row >= len(rows):
        raise ReadError(
            f"header row {header_row + 1} of {len(rows)} rows",
            expected="a row of the file",
            where=where,
            advice="correct --header-row",
        )
    start = 0 if header_row is None else header_row + 1
    first = _first_sample(rows, kinds, decimal, start)
    if first is None:
        raise ReadError(
            "no row that fits the columns of numbers below the header",
            expected="rows of numbers under a row of names",
            where=where,
            advice="name the row of the channel names (--header-row), the separator or the decimal mark",
        )
    if header_row is not None and header_row < 0:
        return Layout(None, None, None, first)
    candidates = [i for i in range(max(0, first - 40), first) if _is_heading(rows[i], kinds, decimal)]
    if header_row is not None:
        below = [i for i in candidates if i > header_row]
        units = next((i for i in reversed(below) if _unit_share(rows[i]) >= 0.6), None)
        return Layout(header_row, units, None, first)
    close = [i for i in candidates if len(candidates) > 1 and i >= first - 4 and _unit_share(rows[i]) >= 0.6]
    units = close[-1] if close else None
    rest = [i for i in candidates if i != units]
    if not rest:
        numbered = _numbered_heading(rows, first)
        return Layout(first, None, None, first + 1) if numbered else Layout(None, None, None, first)

    def merit(i: int) -> tuple[bool, int, bool, int]:
        filled = [cell for cell in rows[i] if cell]
        return _is_timed(rows[i]), len(set(filled)), units is not None and i == units - 1, i

    names = max(rest, key=merit)
    if names + 1 in rest and _is_filled_up(rows[names], rows[names + 1]):
        return Layout(names + 1, units, None, first, names)
    extra = [i for i in rest if i > names and any(c.isalpha() for cell in rows[i] for c in cell)]
    extra = [i for i in extra if not {cell.casefold() for cell in rows[i]} <= _STATISTICS]
    found = Layout(names, units, extra[-1] if extra else None, first)
    # names that stand twice are told apart by what stands over them, or not at all; two times are tables side by side
    twice = _repeated(rows[names])
    if twice and names and _unit_share(rows[names - 1]) < 0.6 and not any(map(is_time_name, map(without_unit, twice))):
        joined = replace(found, above=names - 1)
        return found if _repeated(joined.headers(rows)) else joined
    return found


def _is_timed(row: Sequence[str]) -> bool:
    """Whether one of these names is that of the time; beside a date it says when the recording was made."""
    return any(is_time_name(without_unit(cell)) for cell in row if cell) and not any(map(is_time, row))


def _repeated(names: Sequence[str]) -> set[str]:
    return {name for name, times in Counter(names).items() if name and times > 1}


def _first_sample(rows: Sequence[Sequence[str]], kinds: Sequence[str], decimal: str, start: int) -> int | None:
    headed = False
    for i in range(start, min(len(rows), start + _SEARCHED_ROWS)):
        good, garbage, filled = _fit(rows[i], kinds, decimal)
        like = good > 0 and (garbage == 0 or (headed and garbage <= 0.25 * filled))
        if like:
            following = [row for row in rows[i + 1 : i + 30] if any(row)][:10]
            fitting = sum(_fit(row, kinds, decimal)[0] > 0 for row in following)
            # numbers of channels over their names are no sample
            full = [row for row in following[:3] if row not in rows[:i] and sum(map(bool, row)) >= filled]
            named = any(_is_timed(row) and _is_heading(row, kinds, decimal) for row in full)
            if fitting >= 0.5 * len(following) and not named:
                return i
        headed = headed or _is_heading(rows[i], kinds, decimal)
    return None


def _fit(row: Sequence[str], kinds: Sequence[str], decimal: str) -> tuple[int, int, int]:
    """(cells that fit their column, cells that contradict it, filled cells); too short a row fits nothing."""
    if len(row) < max(1, (len(kinds) + 1) // 2) or (len(kinds) > 1 and len(row) < 2):
        return 0, 0, 0
    good = garbage = filled = 0
    for cell, kind in zip(row, kinds, strict=False):
        found = cell_kind(cell, decimal)
        if found == "empty":
            continue
        filled += 1
        if kind in ("number", "time"):
            good += found == kind
            garbage += found == "text" or (found != kind and found in ("number", "time"))
    return good, garbage, filled


def _is_heading(row: Sequence[str], kinds: Sequence[str], decimal: str) -> bool:
    filled = [cell for cell in row if cell]
    wanted = sum(kind != "empty" for kind in kinds)
    if not filled or len(filled) < 0.5 * min(wanted, len(kinds)) or (wanted > 1 and len(filled) < 2):
        return False
    words = sum(cell_kind(cell, decimal) not in ("number", "time") for cell in filled)
    if any(kind == "number" and c and cell_kind(c, decimal) == "text" for c, kind in zip(row, kinds, strict=False)):
        # names may be numbers ("time_s", "1", "2") as long as one of them is a word above a column of numbers
        return words >= 0.5 * len(filled) or is_time_name(without_unit(filled[0]))
    return words >= 0.5 * len(filled)


def _is_filled_up(row: Sequence[str], below: Sequence[str]) -> bool:
    """Whether each of two rows of names has what the other lacks, as merged cells leave them."""
    gaps = {(bool(upper), bool(lower)) for upper, lower in zip_longest(row, below, fillvalue="")}
    return {(True, False), (False, True)} <= gaps


def _unit_share(row: Sequence[str]) -> float:
    filled = [cell for cell in row if cell]
    units = sum(parse_unit(cell) is not None or _FORMAT_CELL.match(cell) is not None for cell in filled)
    return units / max(len(filled), 1)


def _numbered_heading(rows: Sequence[Sequence[str]], first: int) -> bool:
    """Whether the first row counts 0, 1, 2, ... or 1, 2, 3, ... and the next one does not go on like it."""
    row, below = list(rows[first]), rows[first + 1 : first + 2]
    counts = [[str(begin + k) for k in range(len(row))] for begin in (0, 1)]
    return len(row) > 2 and len(below) > 0 and row in counts and list(below[0])[1:] != row[1:]
