"""Where the names, the units and the first sample are in a sheet of cells."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass

from selector.errors import ReadError
from selector.readers.cells import cell_kind
from selector.units import parse_unit

_TIME_NAME = re.compile(
    r"^(t|time|times?tamp|zeit(stempel|punkt)?|datum|date|uhrzeit|datetime|date[ _/&+-]*time|"
    r"datum[ _/&+-]*(uhr)?zeit|time[ _]?s(tamp|ec)?|elapsed.*|rel(ative)?[ _]time|abs(olute)?[ _]time|"
    r"laufzeit|messzeit|local[ _]?time|utc([ _]time)?|x_value|epoch|unix([ _]?time)?|filetime|tijd|tiempo|"
    r"fecha([ _]y?[ _]?hora)?|hora|"
    r"temps|heure|horodatage|tempo|data|ora|čas|cas|czas|aika|tid|idő|время|дата|дата[ /и]+время|час|"
    r"时间|時間|時刻|日期|日時|日付|时刻|采样时间|测量时间|日期时间|记录时间|시간)$",
    re.IGNORECASE,
)
_COUNTER_NAME = re.compile(
    r"^(#|no\.?|nr\.?|n°|№|index|idx|i|k|sample([ _]?(no\.?|nr\.?|number|index))?|samples|"
    r"record([ _]?(no\.?|number))?|rec(nbr|no)?|scan([ _]?(no\.?|number))?|row|count(er)?|lfd\.?[ _]?nr\.?|satz|"
    r"序号|编号|番号|номер|п/п|unnamed: 0|seq)$",
    re.IGNORECASE,
)
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


def is_time_name(name: str) -> bool:
    """Whether a column of this name (without its unit) is likely to hold the time."""
    return _TIME_NAME.match(name.strip().strip(":").strip()) is not None


def is_counter_name(name: str) -> bool:
    """Whether a column of this name is likely to number the samples."""
    return _COUNTER_NAME.match(name.strip()) is not None


def without_unit(header: str) -> str:
    """The header cell without a bracketed or appended unit; see `selector.readers.roles.inferred.name_and_unit`."""
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
    units = None
    if len(candidates) > 1:
        shares = {i: _unit_share(rows[i]) for i in candidates}
        close = [i for i in candidates if i >= first - 4 and shares[i] >= 0.6]
        units = close[-1] if close else None
    rest = [i for i in candidates if i != units]
    if not rest:
        numbered = _numbered_heading(rows, first)
        return Layout(first, None, None, first + 1) if numbered else Layout(None, None, None, first)

    def merit(i: int) -> tuple[bool, int, bool, int]:
        filled = [cell for cell in rows[i] if cell]
        timed = any(is_time_name(without_unit(cell)) for cell in filled)
        return timed, len(set(filled)), units is not None and i == units - 1, i

    names = max(rest, key=merit)
    extra = [i for i in rest if i > names and any(c.isalpha() for cell in rows[i] for c in cell)]
    return Layout(names, units, extra[-1] if extra else None, first)


def _first_sample(rows: Sequence[Sequence[str]], kinds: Sequence[str], decimal: str, start: int) -> int | None:
    headed = False
    for i in range(start, min(len(rows), start + _SEARCHED_ROWS)):
        good, garbage, filled = _fit(rows[i], kinds, decimal)
        like = good > 0 and (garbage == 0 or (headed and garbage <= 0.25 * filled))
        if like:
            following = [row for row in rows[i + 1 : i + 30] if any(row)][:10]
            fitting = sum(_fit(row, kinds, decimal)[0] > 0 for row in following)
            if fitting >= 0.5 * len(following):
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


def _unit_share(row: Sequence[str]) -> float:
    filled = [cell for cell in row if cell]
    if not filled:
        return 0.0
    units = sum(parse_unit(cell) is not None or _FORMAT_CELL.match(cell) is not None for cell in filled)
    return units / len(filled)


def _numbered_heading(rows: Sequence[Sequence[str]], first: int) -> bool:
    """Whether the first row counts 0, 1, 2, ... or 1, 2, 3, ... and the next one does not go on like it."""
    row = rows[first]
    if len(row) < 3 or first + 1 >= len(rows):
        return False
    for begin in (0, 1):
        if [str(begin + k) for k in range(len(row))] == list(row):
            return list(rows[first + 1])[1:] != list(row)[1:]
    return False
