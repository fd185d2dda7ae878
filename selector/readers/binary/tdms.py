"""NI TDMS and ASAM MDF 3 and 4 → tables."""

import io
from collections.abc import Iterable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa

from selector.errors import ReadError
from selector.findings import Finding
from selector.readers.binary.optional import collect_quietly, optional_module, read_whole, silent
from selector.readers.cells import numbers_or_text
from selector.readers.clock.ticking import Rate, one_clock
from selector.readers.finding_table import FINDINGS
from selector.readers.tables import Column, Overrides, Table, checked_size, checked_width, reading_of, unique_headers


def read_tdms(path: Path, data: bytes, overrides: Overrides) -> list[Table]:
    """The groups of a TDMS file."""
    nptdms = optional_module("nptdms", "a TDMS file", path.name)
    advice = "check whether the recording was closed properly, or export it as CSV"

    def read() -> list[Table]:
        return _tables(nptdms.TdmsFile.read(io.BytesIO(data)), path, overrides)

    return read_whole(read, "a TDMS file", path.name, "a complete TDMS file", advice)


def _tables(file: Any, path: Path, overrides: Overrides) -> list[Table]:
    tables: list[Table] = []
    groups = [g for g in file.groups() if overrides.sheet in (None, g.name)]
    skipped: list[str] = []
    for group in groups:
        channels = [c for c in group.channels() if len(c) > 1]
        checked_width(len(channels), path.name)
        checked_size(sum(len(c) for c in channels), path.name)
        table = _table(channels, path, str(group.name)) if channels else None
        if table is None:
            skipped.append(str(group.name))
        else:
            tables.append(table)
    if not tables:
        raise ReadError(
            f"no group with channels of numbers (groups: {', '.join(g.name for g in file.groups()) or 'none'})",
            expected="at least one group with channels of two or more samples",
            where=path.name,
            advice="check the recording, or name the group (--sheet)",
        )
    if len(tables) == 1:
        return [replace(tables[0], name=path.stem)]
    said = f"{path.name} has {len(tables)} groups of channels; each was read as a run of its own."
    told = FINDINGS.finding("groups-are-runs", said, evidence={"groups": [t.reading["sheet"] for t in tables]})
    first, *others = (replace(t, name=f"{path.stem}_{t.reading['sheet']}") for t in tables)
    return [replace(first, findings=(told, *first.findings)), *others]


def _table(channels: list[Any], path: Path, group: str) -> Table | None:
    headers, findings = unique_headers([str(c.name) for c in channels], path.name)
    by_length: dict[int, list[Column]] = {}
    clocked: list[Rate] = []
    start: np.datetime64 | None = None
    for header, channel in zip(headers, channels, strict=True):
        values = column_values(np.asarray(channel[:]))
        if values is None:
            continue
        unit = channel.properties.get("unit_string") or channel.properties.get("NI_UnitDescription")
        text = channel.properties.get("description") or None
        column = Column(header, values, str(unit) if unit else None, (), str(text) if text else None)
        step = float(channel.properties.get("wf_increment", 0.0) or 0.0)
        if step > 0:
            offset = float(channel.properties.get("wf_start_offset", 0.0) or 0.0)
            ticks = np.arange(len(values), dtype=np.float64)
            clocked.append(Rate(np.asarray(offset + step * ticks, dtype=np.float64), (column,)))
            begun = channel.properties.get("wf_start_time")
            if start is None and isinstance(begun, np.datetime64) and begun > np.datetime64("1905-01-01"):
                start = begun
        else:
            by_length.setdefault(len(values), []).append(column)
    reading = reading_of("tdms", sheet=group)
    if clocked:
        time_s, columns, told = one_clock(clocked, path)
        same = by_length.pop(len(time_s), [])
        findings += [*told, *_left_out(by_length.values(), path)]
        return Table(path.stem, path, (*columns, *same), reading, tuple(findings), None, time_s, start)
    if not by_length:
        return None
    best = by_length.pop(max(by_length, key=lambda n: (len(by_length[n]), n)))
    return Table(path.stem, path, tuple(best), reading, (*findings, *_left_out(by_length.values(), path)))


def _left_out(columns: Iterable[list[Column]], path: Path) -> Iterator[Finding]:
    if names := [column.header for alike in columns for column in alike]:
        told = f"Channels {', '.join(names[:8])} of {path.name} have another number of samples and no clock; they were "
        evidence = {"channels": names}
        yield FINDINGS.finding(
            "other-length", f"{told}left out.", evidence=evidence, action="leave-out-channel", level="warning"
        )


def column_values(values: Any) -> Any:
    """An array of any format's numbers, times or texts as a column holds it, or None for anything else."""
    values = np.asarray(values)
    if values.ndim != 1:
        return None
    if values.dtype.kind in "fiub":
        out = values.astype(np.float64)
        out[~np.isfinite(out)] = np.nan
        return out
    if values.dtype.kind == "M":
        return values.astype("datetime64[ns]")
    if values.dtype.kind == "m":
        return values.astype("timedelta64[ns]").astype(np.float64) / 1e9
    if values.dtype.kind in "OUS":
        texts = [_text(v) for v in values]
        return numbers_or_text(pa.array(texts, pa.string()), ".")[0]
    return None


def _text(value: Any) -> str | None:
    if value is None:
        return None
    text = value.decode("utf-8", "replace") if isinstance(value, bytes) else str(value)
    return text.encode("utf-8", "replace").decode()


def read_mdf(path: Path, data: bytes, overrides: Overrides) -> list[Table]:
    """The channels of all groups on one clock."""
    asammdf = optional_module("asammdf", "an MDF file", path.name)
    advice = "check whether the measurement was closed properly, or export it as CSV"

    def read() -> list[Table]:
        with silent(), asammdf.MDF(io.BytesIO(data)) as file:
            return [_mdf_table(file, path)]

    try:
        return read_whole(read, "an MDF file", path.name, "a complete MDF 3 or MDF 4 file", advice)
    except ReadError:
        # asammdf closes what it never opened, and fails
        collect_quietly()
        raise


def _mdf_table(file: Any, path: Path) -> Table:
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
    reading = reading_of("mdf", version=str(file.version))
    return Table(path.stem, path, columns, reading, (*findings, *told), None, time_s, start)
