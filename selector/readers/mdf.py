"""ASAM MDF 3 and 4 → a table."""

from __future__ import annotations

import io
from pathlib import Path
from typing import Any

import numpy as np

from selector.errors import InputError, ReadError
from selector.readers.optional import collect_quietly, optional_module, quiet, silent
from selector.readers.rates import Rate, one_clock
from selector.readers.tables import Column, Overrides, Table, checked_size, checked_width, unique_headers
from selector.readers.tdms import column_values


def read_mdf(path: Path, data: bytes, overrides: Overrides) -> list[Table]:
    """The channels of all groups on one clock.

    Raises
    ------
    ReadError
        The file is damaged or has no channel of numbers.
    """
    asammdf = optional_module("asammdf", "an MDF file", path.name)
    try:
        with quiet(), silent(), asammdf.MDF(io.BytesIO(data)) as file:
            return [_table(file, path)]
    except (InputError, MemoryError):
        raise
    except Exception as error:
        reason = f"{type(error).__name__}: {str(error)[:120]}"
    collect_quietly()
    raise ReadError(
        f"an MDF file that cannot be read ({reason})",
        expected="a complete MDF 3 or MDF 4 file",
        where=path.name,
        advice="check whether the measurement was closed properly, or export it as CSV",
    )


def _table(file: Any, path: Path) -> Table:
    rates: list[Rate] = []
    n_channels = 0
    signals: list[tuple[str, Any]] = []
    for group, content in enumerate(file.groups):
        n_channels += len(content.channels)
        checked_width(n_channels, path.name)
        cycles = int(getattr(content.channel_group, "cycles_nr", 0))
        checked_size(cycles * max(len(content.channels), 1), path.name)
        master = file.masters_db.get(group)
        for index, channel in enumerate(content.channels):
            if index == master:
                continue
            signal = file.get(group=group, index=index, raw=False, ignore_invalidation_bits=False)
            if len(signal.timestamps) > 1:
                signals.append((str(channel.name), signal))
    headers, findings = unique_headers([name for name, _ in signals], path.name)
    for header, (_, signal) in zip(headers, signals, strict=True):
        values = column_values(signal.samples)
        if values is None:
            continue
        if signal.invalidation_bits is not None and values.dtype.kind == "f":
            values[np.asarray(signal.invalidation_bits, dtype=bool)] = np.nan
        column = Column(header, values, signal.unit or None, (), signal.comment or None)
        rates.append(Rate(np.asarray(signal.timestamps, dtype=np.float64), (column,)))
    if not rates:
        raise ReadError(
            "no channel with two or more samples",
            expected="channels of numbers with a time channel",
            where=path.name,
            advice="check the recording, or export it as CSV",
        )
    time_s, columns, told = one_clock(rates, path)
    begun = getattr(file, "start_time", None)
    start = None
    if begun is not None and begun.year > 1980:
        if begun.tzinfo is not None:
            begun = begun.replace(tzinfo=None)
        start = np.datetime64(begun)
    reading = {
        "format": "mdf", "encoding": None, "separator": None, "decimal": None, "skipped_rows": 0, "unit_row": False,
        "version": str(file.version),
    }  # fmt: skip
    return Table(path.stem, path, columns, reading, (*findings, *told), None, time_s, start)
