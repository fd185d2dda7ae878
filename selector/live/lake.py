"""A lake of Parquet that a killed process cannot damage: ``machine=NAME/month=YYYY-MM/``, a file a day in the end."""

import io as memory
import re
from collections.abc import Iterable
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq

from selector.atomic_file import write_whole
from selector.live.io_file import TIMES, IoFile
from selector.live.links import History, Tell
from selector.readers.machine_file import ChannelSection, Machine, MachineSection, TimeSection, machine_text
from selector.units import CANONICAL_UNITS

FLUSH_S = 10.0  #: So much is lost at most when the process is killed, and the server keeps nothing
SEGMENT_S = 600.0  #: A file grows for so long before the next is begun

_SEGMENT = re.compile(r"\d{4}-\d\d-\d\dT\d{6}\.\d{6}Z\.parquet")


class Lake:
    """What one machine says, a row a period. Files are replaced whole; until then the old one is there."""

    def __init__(self, folder: Path, io: IoFile, tell: Tell) -> None:
        """The lake in `folder`. Raises OptionError or OSError: it cannot be written to."""
        self.folder, self._tell = folder / f"machine={io.machine}", tell
        self._rows: list[tuple[float, ...]] = []
        self._segment_s = self._flushed_s = 0.0
        self._schema = pa.schema(
            [
                *(pa.field(name, pa.timestamp("us", "UTC")) for name in TIMES),
                *(
                    pa.field(name, pa.float64(), metadata=_said(CANONICAL_UNITS[of.role], of.role, of.place, of.axis))
                    for name, of in io.channels.items()
                ),
            ]
        )
        self.folder.mkdir(parents=True, exist_ok=True)
        sections = {
            name: ChannelSection(role=of.role, unit=CANONICAL_UNITS[of.role], place=of.place, axis=of.axis)
            for name, of in io.channels.items()
        }
        said = Machine(
            machine=MachineSection(name=io.machine), time=TimeSection(column="time", unit="datetime"), channels=sections
        )
        write_whole(self.folder / "machine.toml", machine_text(said).encode())

    def last_s(self) -> float | None:
        """The time of the newest row on disk [s since 1970]."""
        files = [path for path in self.folder.glob("month=*/*.parquet") if not path.name.startswith(".")]
        newest = max(files, key=lambda path: path.name.replace(".parquet", "T~"), default=None)
        days = [path for path in files if newest is not None and path.name[:10] == newest.name[:10]]
        ends = [frame["time"].max().timestamp() for frame in map(self._frame, days) if frame is not None and len(frame)]
        return max(ends, default=None)

    def append(self, time_s: float, source_s: float | None, received_s: float, values: Iterable[float]) -> None:
        """One row, on disk within `FLUSH_S`."""
        if self._rows and (received_s - self._segment_s > SEGMENT_S or _day(time_s) != _day(self._rows[0][0])):
            self.flush()
            self._rows.clear()
        if not self._rows:
            self._segment_s = received_s
        self._rows.append((time_s, np.nan if source_s is None else source_s, received_s, *values))
        # a file of one row is no recording
        if abs(received_s - self._flushed_s) >= FLUSH_S and len(self._rows) > 1:
            self.flush()
            self._flushed_s = received_s

    def flush(self) -> None:
        """Write the rows that are only in memory."""
        if self._rows:
            self._write(self._segment(self._rows[0][0]), self._framed(self._rows))

    def fill(self, rows: Iterable[tuple[float, ...]]) -> int:
        """Rows of a gap, in the places that are empty; how many."""
        given = sorted(rows)
        for day in sorted({_day(row[0]) for row in given}):
            self._merge(day, self._framed([row for row in given if _day(row[0]) == day]))
        return len(given)

    def close_days(self, now_s: float | None = None) -> None:
        """One file for each day that is over at `now_s`; without it, for each day, and the growing file ends."""
        if now_s is None:
            self.flush()
            self._rows.clear()
        days = {path.name[:10] for path in self.folder.glob("month=*/*T*.parquet") if _SEGMENT.fullmatch(path.name)}
        for day in sorted(days if now_s is None else days - {_day(now_s)}):
            self._merge(day)

    def _merge(self, day: str, more: pd.DataFrame | None = None) -> None:
        whole = self.folder / f"month={day[:7]}" / f"{day}.parquet"
        growing = self._segment(self._rows[0][0]) if self._rows else None
        segments = [
            path for path in whole.parent.glob(f"{day}T*.parquet") if _SEGMENT.fullmatch(path.name) and path != growing
        ]
        read = {path: self._frame(path) for path in (whole, *sorted(segments)) if path.exists()}
        frames = [frame for frame in (*read.values(), more) if frame is not None]
        if growing is not None and _day(self._rows[0][0]) == day and more is not None:
            # what the growing file has not yet, a row that it has would stand there twice
            frames[-1] = more[~more["time"].isin(self._framed(self._rows)["time"])]
        if not frames or (whole in read and read[whole] is None):
            return
        # of two rows of the same time each gives what the other lacks; a killed merge leaves such rows
        merged = pd.concat(frames).groupby("time", as_index=False, sort=True).first()
        self._write(whole, merged)
        for path in segments:
            if read[path] is not None:
                path.unlink(missing_ok=True)

    def _frame(self, path: Path) -> pd.DataFrame | None:
        try:
            return pq.ParquetFile(path).read().to_pandas()
        except (OSError, pa.ArrowException) as error:
            self._tell("file-unreadable", file=str(path), error=str(error)[:200])
            return None

    def _write(self, path: Path, frame: pd.DataFrame) -> None:
        path.parent.mkdir(exist_ok=True)
        names = [name for name in self._schema.names if name in frame]
        # channels that an earlier IO file had stay
        others = [name for name in frame if name not in self._schema.names]
        fields = [self._schema.field(name) for name in names] + [pa.field(name, pa.float64()) for name in others]
        out = memory.BytesIO()
        pq.write_table(pa.Table.from_pandas(frame[names + others], pa.schema(fields), preserve_index=False), out)
        write_whole(path, out.getvalue())

    def _framed(self, rows: list[tuple[float, ...]]) -> pd.DataFrame:
        frame = pd.DataFrame(rows, columns=self._schema.names)
        for name in TIMES:
            micro = (frame[name] * 1e6).round()
            frame[name] = pd.to_datetime(micro.astype("Int64"), unit="us", utc=True).astype("datetime64[us, UTC]")
        return frame

    def _segment(self, time_s: float) -> Path:
        moment = datetime.fromtimestamp(time_s, UTC)
        return self.folder / f"month={moment:%Y-%m}" / f"{moment:%Y-%m-%dT%H%M%S.%f}Z.parquet"


def _day(time_s: float) -> str:
    return f"{datetime.fromtimestamp(time_s, UTC):%Y-%m-%d}"


def _said(unit: str, role: str, place: str | None, axis: str | None) -> dict[str, str]:
    said = {"unit": unit, "role": role, "place": place, "axis": axis}
    return {key: value for key, value in said.items() if value is not None}


def gap_rows(
    history: History, names: list[str], since_s: float, until_s: float, period_s: float, now_s: float
) -> list[tuple[float, ...]]:
    """What servers kept of a gap, in rows of the lake; a value holds until the next. `history`: channel → values.

    Times are multiples of `period_s` after `since_s` and before `until_s`.
    """
    ticks = np.arange(np.floor(since_s / period_s) + 1.0, np.ceil(until_s / period_s)) * period_s
    columns, source_s = [], np.full(len(ticks), np.nan)
    for name in names:
        kept = history.get(name, [])
        moments, values = np.array([one[0] for one in kept]), np.array([np.nan, *(one[1] for one in kept)])
        at = np.searchsorted(moments, ticks, side="right")
        columns.append(values[at])
        source_s = np.fmax(source_s, np.array([np.nan, *moments])[at])
    block = np.column_stack([ticks, source_s, np.full(len(ticks), now_s), *columns])
    return [tuple(row) for row in block if np.isfinite(row[3:]).any()]
