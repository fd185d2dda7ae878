"""The same sources, kept: a row a period into the lake, and gaps filled from what the servers still have.

The lake is of Parquet and no killed process can damage it: ``machine=NAME/month=YYYY-MM/``, a file a day in the end.
"""

import asyncio
import io as memory
import math
import re
from collections.abc import Iterable
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq

from selector.atomic_file import write_whole
from selector.live.compensating import Readings, is_over
from selector.live.io_file import TIMES, IoFile
from selector.live.journal import Journal
from selector.live.links import Clock, History, LostError, Tell, supervised_links
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


LONGEST_GAP_S = 7 * 86400.0
BEFORE_GAP_S = 3600.0  #: So long before a gap values are asked for: what did not change since holds in the gap.


class Collection:
    """Channels of an IO file on their way into a lake; nothing is written to a control."""

    def __init__(self, io: IoFile, clock: Clock, folder: Path) -> None:
        """`folder` is the lake. Raises OptionError: it cannot be written to."""
        # outputs are not opened: this process only reads
        self._io, self._clock = io.model_copy(update={"outputs": {}, "control": io.control.without_heartbeat()}), clock
        self._journal = Journal(folder / f"machine={io.machine}" / "journal", clock)
        self._links = supervised_links(self._io, clock, self._journal.tell)
        self._readings = Readings(self._io, self._links, clock, hold_s=0.0)
        self._lake = Lake(folder, io, self._journal.tell)
        self.is_stopping = False
        self._rows = self._filled = 0
        last_s = self._lake.last_s()
        self._heard_s = {name: last_s for name in self._links if self._io.reads(name)}
        self._filling: set[asyncio.Task[None]] = set()

    async def run(self, cycles: int | None = None) -> dict[str, Any]:
        """Until it is stopped, files have ended, or so many periods are done."""
        self._journal.tell("started", machine=self._io.machine, period_s=self._io.period_s)
        self._lake.close_days()
        today = int(self._clock.wall() // 86400)
        next_s, count = self._clock.monotonic(), 0
        try:
            while not (self.is_stopping or count == cycles or is_over(self._io, self._links)):
                await self.step()
                count += 1
                if int(self._clock.wall() // 86400) != today:
                    today = int(self._clock.wall() // 86400)
                    self._lake.close_days(self._clock.wall())
                next_s = max(next_s + self._io.period_s, self._clock.monotonic())
                await self._clock.sleep_until(next_s)
            await asyncio.gather(*self._filling)
        finally:
            for task in self._filling:
                task.cancel()
            self._lake.close_days()
            for link in self._links.values():
                await link.close()
            self._journal.tell("stopped", rows=self._rows, filled=self._filled)
        return {
            "schema": "selector.collection/1",
            "machine": self._io.machine,
            "folder": str(self._lake.folder),
            "rows": self._rows,
            "filled": self._filled,
        }

    async def step(self) -> None:
        """One row, and a look at what is missing before it."""
        samples = await self._readings.samples()
        wall_s, period_s = self._clock.wall(), self._io.period_s
        time_s = round(wall_s / period_s) * period_s
        values = [value for value, _ in samples.values()]
        if not all(map(math.isnan, values)):
            sources = [source for _, source in samples.values() if source is not None]
            self._lake.append(time_s, max(sources, default=None), wall_s, values)
            self._rows += 1
        for name in self._readings.answered:
            heard_s = self._heard_s[name]
            if heard_s is not None and 1.5 * period_s < wall_s - heard_s:
                since_s = max(heard_s, wall_s - LONGEST_GAP_S)
                task = asyncio.create_task(
                    self._fill(name, since_s, time_s, wall_s - self._readings.server_s(name, wall_s))
                )
                self._filling.add(task)
                task.add_done_callback(self._filling.discard)
            self._heard_s[name] = wall_s

    async def _fill(self, connection: str, since_s: float, until_s: float, ahead_s: float) -> None:
        """A gap of one connection, whose clock is so much behind this one."""
        names = [name for name, of in self._io.channels.items() if of.at == connection]
        addresses = self._io.reads(connection)
        try:
            kept = await self._links[connection].history(addresses, since_s - ahead_s - BEFORE_GAP_S, until_s - ahead_s)
        except LostError as error:
            self._journal.tell("gap-not-filled", connection=connection, since_s=since_s, error=str(error))
            return
        history = {
            name: [
                (moment_s + ahead_s, self._readings.canonical(name, value))
                for moment_s, value in kept.get(self._io.channels[name].address, [])
            ]
            for name in names
        }
        rows = gap_rows(history, list(self._io.channels), since_s, until_s, self._io.period_s, self._clock.wall())
        # on this clock are the rows, on its own what the server says
        filled = self._lake.fill((row[0], row[1] - ahead_s, *row[2:]) for row in rows)
        self._filled += filled
        missing = int(np.ceil((until_s - since_s) / self._io.period_s)) - 1
        self._journal.tell("gap", connection=connection, since_s=since_s, until_s=until_s, rows=missing, filled=filled)
