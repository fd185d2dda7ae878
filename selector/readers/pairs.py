"""Text in which every channel brings its own time column, as TwinCAT Scope exports it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from selector.readers.numeric_clock import numeric_clock
from selector.readers.rates import Rate, one_clock
from selector.readers.tables import Column, Table
from selector.units import parse_unit

_UNIT_LABELS = ("unit", "einheit")


def paired_headings(rows: Sequence[Sequence[str]], n_columns: int) -> tuple[list[str], list[str | None]] | None:
    """Names and units if the header rows say ``Name, T1, Name, T2, ...``: the columns are time, value, time, value.

    Parameters
    ----------
    rows : sequence of rows of cells
        Those above the first sample.
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
