"""Delimited text → tables, also where every channel brings its own time column, as TwinCAT Scope exports it."""

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TypeAlias

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.csv as arrow_csv

from selector.errors import ReadError
from selector.findings import Finding
from selector.readers.cells import Layout, column_findings, column_kinds, layout, no_header_finding, numbers_or_text
from selector.readers.clock.stamps import numeric_clock
from selector.readers.clock.ticking import Rate, one_clock
from selector.readers.finding_table import FINDINGS
from selector.readers.tables import Column, Overrides, Table, checked_size, checked_width, reading_of, unique_headers
from selector.readers.text.encodings import decoded
from selector.readers.text.lines import Dialect, body, cells_of, decimal_doubts, dialect, is_comment
from selector.units import convert, parse_unit, same_dimension

_UNIT_LABELS = ("unit", "einheit")


def paired_headings(rows: Sequence[Sequence[str]], n_columns: int) -> tuple[list[str], list[str | None]] | None:
    """Names and units if the header rows say ``Name, T1, Name, T2, ...``: the columns are time, value, time, value.

    `rows` are those above the first sample.
    """
    if n_columns < 4 or n_columns % 2:
        return None
    labelled: dict[str, list[str]] = {}
    for row in rows:
        cells = list(row) + [""] * (n_columns - len(row))
        labels = {cell.strip(":").casefold() for cell in cells[0:n_columns:2]}
        if len(labels) == 1 and (label := labels.pop()):
            labelled[label] = cells[1:n_columns:2]
    names = labelled.get("name")
    if names is None or not all(names):
        return None
    units = next((labelled[label] for label in _UNIT_LABELS if label in labelled), [""] * len(names))
    headers = [part for name in names for part in (f"time of {name}", name)]
    return headers, [part for unit in units for part in (None, unit if parse_unit(unit) else None)]


def on_one_clock(table: Table) -> Table:
    """The table with the values of all pairs on the clock of most of them.

    Times are FILETIME or another absolute clock if their numbers say so, otherwise milliseconds.
    """
    rates: list[Rate] = []
    start: float | None = None
    read = [numeric_clock(column.values, None) for column in table.columns[0::2]]
    absolute = [clock.base_s for clock in read if clock.base_s is not None]
    if len(absolute) == len(read):
        start = min(absolute)
    for time, value, clock in zip(table.columns[0::2], table.columns[1::2], read, strict=True):
        seconds = time.values / 1000.0
        if start is not None and clock.base_s is not None:
            seconds = clock.seconds + (clock.base_s - start)
        known = np.isfinite(seconds)
        if value.kind == "number" and known.sum() > 1:
            rates.append(Rate(seconds[known], (Column(value.header, value.values[known], value.unit),)))
    if not rates:
        return table
    time_s, columns, told = one_clock(rates, table.file)
    moment = None if start is None else np.datetime64(round(start * 1e6), "us")
    return replace(table, columns=columns, findings=(*table.findings, *told), lines=None, time_s=time_s, start=moment)


_LONGEST_LINE = 4_000_000
_HEAD_LINES = 6_000

_Pairs: TypeAlias = tuple[list[str], list[str | None]]


@dataclass(frozen=True)
class _Sheet:
    """The beginning of the file as cells, the dialect, and where things stand."""

    rows: list[list[str]]
    raw: list[str]
    dialect: Dialect
    kinds: list[str]
    layout: Layout


def read_delimited(path: Path, data: bytes, overrides: Overrides) -> list[Table]:
    """The one table of a text file."""
    where = path.name
    text = decoded(data, where, overrides.encoding)
    _refuse_markup(text.utf8, where)
    declared, utf8, skipped = _declared_separator(text.utf8)
    utf8, joined = _quoted_line_ends(utf8)
    skipped += joined
    sheet = _sheet(utf8, overrides, declared if overrides.separator is None else overrides.separator, skipped, where)
    offset = 0
    for _ in range(sheet.layout.first):
        offset = utf8.find(b"\n", offset) + 1
    found = sheet.layout
    headings = [sheet.raw[i] for i in (found.above, found.names, found.units, found.description) if i is not None]
    pairs = paired_headings(sheet.rows[: sheet.layout.first], sheet.dialect.n_columns)
    headers, units, descriptions, n_columns, header_findings = _headers(sheet, pairs, where)
    samples = body(
        utf8[offset:],
        sheet.layout.first + 1 + skipped,
        sheet.dialect,
        headings,
        where,
        remarks_last=sheet.kinds[-1] in ("text", "empty") and n_columns == sheet.dialect.n_columns,
    )
    checked_size(len(samples.lines) * n_columns, where)
    cells = _cells(samples.text, samples.separator, sheet.dialect, where)
    columns: list[Column] = []
    findings = [*text.findings, *header_findings, *samples.findings]
    numbers: list[str] = []
    unnamed: list[int] = []
    for position in range(len(cells)):
        values, notes = numbers_or_text(cells[position], sheet.dialect.decimal)
        if position >= n_columns:
            if not pd.isna(values).all():
                unnamed.append(position)
            continue
        header = headers[position]
        if header == f"col{position + 1}" and sheet.layout.names is not None and pd.isna(values).all():
            continue  # neither a name nor a value: a separator at the beginning of every line
        findings += column_findings(header, notes, samples.lines, where)
        columns.append(Column(header, values, units[position] or notes.unit, notes.breaks, descriptions[position]))
        if values.dtype.kind == "f" and len(numbers) < 4000:
            numbers += [c for c in cells[position][:200].to_pylist() if c]
    if unnamed:
        raise _unnamed_columns(sheet, n_columns, unnamed, where)
    if overrides.decimal is None:
        findings += decimal_doubts([n.strip(' "') for n in numbers], sheet.dialect, where)
    first_line = sheet.layout.first + 1 + skipped
    reading = reading_of(
        "delimited",
        encoding=text.encoding,
        separator=sheet.dialect.shown_separator,
        decimal=sheet.dialect.decimal,
        skipped_rows=skipped + (sheet.layout.first if sheet.layout.names is None else sheet.layout.names),
        unit_row=sheet.layout.units is not None,
        header_row=None if sheet.layout.names is None else sheet.layout.names + 1 + skipped,
        first_data_row=first_line,
        **_stated_period(sheet),
    )
    if sheet.layout.names is None:
        findings.append(no_header_finding(where, headers))
    table = Table(path.stem, path, tuple(columns), reading, tuple(findings), samples.lines)
    return [table if pairs is None else on_one_clock(table)]


_STATED = (
    r"(?:sampl|scan|log|record|mess|abtast|acqui|échantillon|采样|記録|опрос)[^\d\n]{0,20}?"
    r"(?:interval|period|rate|freq|fréq|step|zeit|间隔|周期|频率|間隔|период|интервал|частот)[^\d\n]{0,20}?"
)
_NUMBER = r"(?P<number>\d+(?:[.,]\d+)?)"
_PERIOD = re.compile(rf"{_STATED}{_NUMBER}[\s\"';,\t\[(]*(?P<unit>[^\W\d_]+)[\])\s\"';,\t]*$", re.IGNORECASE)
_PERIOD_UNIT_FIRST = re.compile(
    rf"{_STATED}[\[(](?P<unit>[^\W\d_]+)[\])][^\d\n]{{0,9}}{_NUMBER}[\s\"';,\t]*$", re.IGNORECASE
)
_RATE = re.compile(r"rate|freq|fréq|频率|частот", re.IGNORECASE)


def _stated_period(sheet: _Sheet) -> dict[str, float]:
    """The sampling interval [s] that a line above the header states: ``Sampling interval,500 ms``, or a rate in Hz."""
    above = sheet.layout.first if sheet.layout.names is None else sheet.layout.names
    for line in sheet.raw[:above]:
        match = _PERIOD.search(line) or _PERIOD_UNIT_FIRST.search(line)
        unit = None if match is None else parse_unit(match["unit"])
        if match is None or unit is None:
            continue
        number = float(match["number"].replace(",", "."))
        is_rate = bool(_RATE.search(line))
        if number > 0 and same_dimension(unit, "Hz" if is_rate else "s"):
            value = float(convert(np.array([number]), unit, "Hz" if is_rate else "s")[0])
            return {"stated_period_s": 1.0 / value if is_rate else value}
    return {}


def _refuse_markup(utf8: bytes, where: str) -> None:
    start = utf8[:400].lstrip().lower()
    if start.startswith((b"<!doctype", b"<html", b"<?xml", b"<table", b"<svg", b"{", b"[{", b"%pdf", b"{\\rtf")):
        raise ReadError(
            "a web page, XML, JSON or PDF document",
            expected="a table with one row per sample",
            where=where,
            advice="open it in the program that wrote it and save it as CSV or xlsx",
        )


def _declared_separator(utf8: bytes) -> tuple[str | None, bytes, int]:
    """The separator of an Excel ``sep=;`` line, the text behind it, and how many lines that is."""
    match = re.match(rb'"?sep=(.)"?[ ]*\n', utf8, re.IGNORECASE)
    if match is None:
        return None, utf8, 0
    mark = match[1].decode("latin-1")
    return (mark if not mark.isalnum() else None), utf8[match.end() :], 1


def _quoted_line_ends(utf8: bytes) -> tuple[bytes, int]:
    """The text with line ends inside quoted header cells as blanks, and how many lines were joined."""
    head = utf8[:100_000].split(b"\n")
    joined = 0
    i = 0
    while i < min(len(head) - 1, 100):
        if head[i].count(b'"') % 2:
            for length in range(2, 7):
                piece = b" ".join(head[i : i + length])
                if piece.count(b'"') % 2 == 0 and i + length < len(head):
                    head[i : i + length] = [piece]
                    joined += length - 1
                    break
        i += 1
    return (b"\n".join(head) + utf8[100_000:], joined) if joined else (utf8, 0)


def _sheet(utf8: bytes, overrides: Overrides, separator: str | None, skipped: int, where: str) -> _Sheet:
    raw = _first_lines(utf8, where)
    told = [line for line in raw if line.strip()]
    if not told:
        raise ReadError(
            "an empty file",
            expected="a header and at least two rows of numbers",
            where=where,
            advice="check whether the logger wrote the file, or leave it out",
        )
    sample = _inner_lines(utf8, raw)
    chosen = dialect(sample, told[:60], where, separator, overrides.decimal)
    if overrides.decimal is None:
        chosen = _with_mark_of_first_rows(chosen, sample, told, separator)
    checked_width(chosen.n_columns, where)
    kinds = column_kinds(
        [cells_of(line, chosen.separator, chosen.quoted) for line in sample], chosen.n_columns, chosen.decimal
    )
    rows: list[list[str]] = []
    for line in raw:
        bare = re.sub(r"^\s*(#|%|//|!)+\s*", "", line) if is_comment(line) else line
        cells = cells_of(bare, chosen.separator, chosen.quoted) if bare.strip() else []
        rows.append(_other_cut(bare, cells, chosen))
    header_row = None if overrides.header_row is None else overrides.header_row - 1 - skipped
    found = layout(rows, kinds, chosen.decimal, header_row, where)
    return _Sheet(rows[: found.first + 1], raw, chosen, kinds, found)


def _with_mark_of_first_rows(chosen: Dialect, sample: list[str], told: list[str], separator: str | None) -> Dialect:
    """The decimal comma if the inner lines, whole numbers all, show no mark, and the first rows have commas only."""
    single = chosen.n_columns == 1 and separator is None
    if chosen.decimal != "." or (chosen.separator == "," and not single):
        return chosen
    cut = ";" if single else chosen.separator
    cells = [cell for line in sample for cell in cells_of(line, cut, chosen.quoted)]
    if any(re.search(r"\d[.,]|[.,]\d", cell) for cell in cells):
        return chosen
    first = [cell for line in told for cell in cells_of(line, cut, chosen.quoted)]
    if any(re.fullmatch(r"[+-]?\d*\.\d+", cell) for cell in first):
        return chosen
    if not any(re.fullmatch(r"[+-]?\d+,\d+", cell) for cell in first):
        return chosen
    return replace(chosen, separator=cut, decimal=",")


def _other_cut(line: str, cells: list[str], chosen: Dialect) -> list[str]:
    """Header lines of blank-separated files may be cut otherwise ("Temp 1<tab>Temp 2", "t, T1, T2")."""
    if chosen.separator not in ("blank", "blanks") or len(cells) == chosen.n_columns or not cells:
        return cells
    for other in ("\t", ",", ";", "blanks", "|", "blank"):
        parts = cells_of(line, other, chosen.quoted)
        if len(parts) == chosen.n_columns:
            return parts
    return cells


def _first_lines(utf8: bytes, where: str) -> list[str]:
    lines: list[str] = []
    offset = 0
    while offset < len(utf8) and len(lines) < _HEAD_LINES:
        end = utf8.find(b"\n", offset)
        end = len(utf8) if end < 0 else end
        if end - offset > _LONGEST_LINE:
            marks = max(utf8.count(mark, offset, end) for mark in (b",", b";", b"\t", b"|", b" "))
            checked_width(marks + 1, where)
            raise ReadError(
                f"a line of {(end - offset) / 1e6:.0f} million characters",
                expected="one short line per sample",
                where=f"{where}, line {len(lines) + 1}",
                advice="export the recording as CSV from the program that wrote it",
            )
        lines.append(utf8[offset:end].decode("utf-8", "replace"))
        offset = end + 1
    return lines


def _inner_lines(utf8: bytes, raw: list[str]) -> list[str]:
    """Lines from inside of the file, where samples are: from its middle and before its end."""
    if len(raw) < _HEAD_LINES:
        told = [line for line in raw if line.strip()]
        usable = [line for line in told if not is_comment(line)] or told
        n = len(usable)
        if n <= 3:
            return usable[-1:] if n < 3 else usable[-2:]
        half = usable[n // 2 :]
        return half[:150] + half[150:][-50:]
    lines: list[str] = []
    for place in (len(utf8) // 2, (len(utf8) * 3) // 4):
        begin = utf8.find(b"\n", place) + 1
        piece = utf8[begin : begin + 200_000].split(b"\n")[:-1][:120]
        lines += [line.decode("utf-8", "replace") for line in piece]
    usable = [line for line in lines if line.strip() and not is_comment(line)]
    return usable or [line for line in raw if line.strip()][-100:]


def _headers(
    sheet: _Sheet, pairs: _Pairs | None, where: str
) -> tuple[list[str], list[str | None], list[str | None], int, list[Finding]]:
    """Header cells, units and descriptions of the columns, the number of columns that count, and what was noticed."""
    n = sheet.dialect.n_columns
    if pairs is not None:
        headers, repeated = unique_headers(pairs[0], where)
        return headers, pairs[1], [None] * n, n, repeated
    if sheet.layout.names is None:
        while n > 1 and sheet.kinds[n - 1] == "empty":
            n -= 1
        return [f"col{k + 1}" for k in range(n)], [None] * n, [None] * n, n, []
    names = sheet.layout.headers(sheet.rows)
    while names and not names[-1]:
        names.pop()
    findings: list[Finding] = []
    # with commas a missing name and an unquoted decimal comma look alike: no guess there
    unnamed_first = len(names) == n - 1 and sheet.kinds[0] == "number" and sheet.kinds[-1] != "empty"
    if unnamed_first and sheet.dialect.separator != "," and _counts_up(sheet):
        names.insert(0, "index")
        told = f"{where} has one name less than columns, and its first column counts the rows: it was read as row "
        told += f"numbers without a name, so {names[1]!r} stands above the second column."
        findings.append(FINDINGS.finding("unnamed-first-column", told, evidence={"names": n - 1, "columns": n}))
    if len(names) > n:
        told = f"The header of {where} names {len(names)} columns, but the lines have {n} cells; "
        told += f"{', '.join(names[n:][:5])} are left out."
        findings.append(FINDINGS.finding("header-too-long", told, evidence={"named": len(names), "cells": n}))
        names = names[:n]
    count = len(names)
    headers, repeated = unique_headers(names, where)
    findings += repeated
    units, descriptions = (_row(sheet, index, count) for index in (sheet.layout.units, sheet.layout.description))
    return headers, units, descriptions, count, findings


def _row(sheet: _Sheet, index: int | None, count: int) -> list[str | None]:
    if index is None:
        return [None] * count
    cells = [cell or None for cell in sheet.rows[index][:count]]
    return cells + [None] * (count - len(cells))


def _counts_up(sheet: _Sheet) -> bool:
    """Whether the cells of the first column count the samples, as a table with unnamed row numbers has it."""
    head = [line for line in sheet.raw[sheet.layout.first : sheet.layout.first + 20] if line.strip()]
    first = [cells_of(line, sheet.dialect.separator, sheet.dialect.quoted)[0].strip('"') for line in head]
    return first in ([str(k) for k in range(len(first))], [str(k + 1) for k in range(len(first))])


def _cells(text: bytes, separator: str, chosen: Dialect, where: str) -> list[pa.ChunkedArray]:
    names = [str(k) for k in range(chosen.n_columns)]
    if not text.strip():
        raise ReadError(
            "no samples below the header",
            expected="at least two rows of numbers",
            where=where,
            advice="check whether the logger wrote any samples, or leave this file out",
        )
    if chosen.n_columns == 1:
        lines = text.decode("utf-8", "replace").split("\n")[:-1]
        return [pa.chunked_array([pa.array(lines, pa.string())])]
    try:
        table = arrow_csv.read_csv(
            pa.BufferReader(text),
            read_options=arrow_csv.ReadOptions(column_names=names, block_size=1 << 24, use_threads=len(text) > 1 << 24),
            parse_options=arrow_csv.ParseOptions(
                delimiter=separator, quote_char='"' if chosen.quoted else False, ignore_empty_lines=False
            ),
            convert_options=arrow_csv.ConvertOptions(
                column_types=dict.fromkeys(names, pa.string()), strings_can_be_null=False, check_utf8=True
            ),
        )
    except (pa.ArrowInvalid, pa.ArrowCapacityError) as error:
        raise ReadError(
            f"lines that cannot be cut into cells ({str(error)[:200]})",
            expected=f"{chosen.n_columns} cells set apart by {chosen.shown_separator!r} on every line",
            where=where,
            advice="check the quotation marks in the file, or export it again",
        ) from error
    return list(table.columns)


def _unnamed_columns(sheet: _Sheet, named: int, unnamed: list[int], where: str) -> ReadError:
    decimal_commas = sheet.dialect.separator == "," and sheet.dialect.decimal == "."
    hint = "the file may use ',' both as separator and as decimal mark: export it with ';' or tab between the columns"
    return ReadError(
        f"{named + len(unnamed)} columns of values under {named} names",
        expected="one name above each column",
        where=f"{where}, line {(sheet.layout.names or 0) + 1}",
        advice=hint if decimal_commas else "complete the header, or name the row that holds the names (--header-row)",
    )
