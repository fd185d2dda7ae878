"""Parquet, Feather and Arrow files → a table in memory. See `selector.readers.stream` for files that do not fit."""

from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.feather as feather
import pyarrow.parquet as pq
from numpy.typing import NDArray

from selector.errors import InputError, ReadError
from selector.readers.cells import numbers_or_text
from selector.readers.finding_table import FINDINGS
from selector.readers.tables import Column, Overrides, Table, checked_size, checked_width, reading_of, unique_headers


def read_parquet(path: Path, data: bytes, overrides: Overrides) -> list[Table]:
    """The one table of a Parquet or Feather file."""
    try:
        return [_table(path, data)]
    except (InputError, MemoryError):
        raise
    except Exception as error:
        raise damaged(path.name, error) from error


def _table(path: Path, data: bytes) -> Table:
    if data[:4] == b"PAR1":
        with pq.ParquetFile(path) as file:
            checked_width(len(file.schema_arrow), path.name)
            checked_size(file.metadata.num_rows * len(file.schema_arrow), path.name)
            table, form = file.read(), "parquet"
    else:
        table, form = feather.read_table(path, memory_map=False), "feather"
    checked_width(table.num_columns, path.name)
    return table_of(path, table, form)


def table_of(path: Path, table: pa.Table, form: str) -> Table:
    """The columns of numbers, times and texts; what else there is is told."""
    headers, findings = unique_headers([str(n) for n in table.column_names], path.name)
    columns: list[Column] = []
    left: list[str] = []
    utc: list[str] = []
    for position, header in enumerate(headers):
        field = table.schema.field(position)
        try:
            values = column_of(table.column(position))
        except (pa.ArrowException, ValueError, OverflowError):
            values = None
        if values is None:
            left.append(header)
            continue
        if pa.types.is_timestamp(field.type) and field.type.tz is not None:
            utc.append(header)
        columns.append(Column(header, values, _unit(field)))
    if left:
        told = f"Columns {', '.join(left[:8])} of {path.name} hold no plain numbers, times or texts; "
        told += "they were left out."
        findings.append(FINDINGS.finding("nested-columns", told, evidence={"columns": left[:50]}))
    return Table(path.stem, path, tuple(columns), reading_of(form, utc_columns=utc), tuple(findings))


def damaged(where: str, error: Exception) -> ReadError:
    """A Parquet or Feather file that cannot be opened."""
    return ReadError(
        f"a Parquet or Feather file that cannot be read "
        f"({str(error).splitlines()[0][:160] if str(error) else error!r})",
        expected="a complete file",
        where=where,
        advice="the file was probably cut off while it was written: write it again",
    )


def _unit(field: pa.Field) -> str | None:
    metadata = field.metadata or {}
    for key in (b"unit", b"units", b"unit_string"):
        if key in metadata:
            text: str = metadata[key].decode("utf-8", "replace")
            return text
    return None


def column_of(column: pa.ChunkedArray | pa.Array) -> NDArray[Any] | None:
    """Values as a table holds them, or None for nested types."""
    kind = column.type
    if pa.types.is_dictionary(kind):
        column = pc.cast(column, kind.value_type)
        kind = column.type
    if pa.types.is_boolean(kind):
        column, kind = pc.cast(column, pa.uint8()), pa.uint8()
    if pa.types.is_integer(kind) or pa.types.is_floating(kind) or pa.types.is_decimal(kind):
        values = np.array(_numpy(pc.cast(column, pa.float64(), safe=False)), dtype=np.float64)
        values[~np.isfinite(values)] = np.nan
        return values
    if pa.types.is_timestamp(kind) or pa.types.is_date(kind):
        moments = pc.cast(column, pa.timestamp("ns", getattr(kind, "tz", None)))
        return np.array(_numpy(moments), dtype="datetime64[ns]")
    if pa.types.is_duration(kind):
        ticks = pc.cast(pc.cast(column, pa.duration("ns")), pa.int64())
        return np.array(_numpy(ticks), dtype=np.float64) / 1e9
    if pa.types.is_time(kind):
        column, kind = pc.cast(column, pa.string()), pa.string()
    if pa.types.is_string(kind) or pa.types.is_large_string(kind):
        return numbers_or_text(pc.cast(column, pa.string()), ".")[0]
    if pa.types.is_null(kind):
        return np.full(len(column), np.nan)
    return None


def _numpy(column: pa.ChunkedArray | pa.Array) -> NDArray[Any]:
    values: NDArray[Any] = (
        column.to_numpy() if isinstance(column, pa.ChunkedArray) else column.to_numpy(zero_copy_only=False)
    )
    return values
