"""What one machine says, kept in Parquet that no killed process can damage.

``LAKE/machine=NAME/month=YYYY-MM/``, a file a day in the end; role, unit and place of a channel are in its field.
"""

import io as memory
import re
from collections.abc import Iterable, Mapping, Sequence
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq

from selector.atomic_file import write_whole
from selector.errors import OptionError
from selector.live.io_file import TIMES
from selector.live.links import Tell
from selector.readers.files import MACHINE_FILE
from selector.readers.finding_table import CLOCK_BACK
from selector.readers.machine_file import ChannelSection, Machine, MachineSection, TimeSection, machine_text
from selector.readers.machine_file import machine as machine_file
from selector.readers.reading import Reading, channel_section
from selector.readers.window import own_clock_s
from selector.study.study_file import FOLDER
from selector.types import Matrix, Vector

FLUSH_S = 10.0  #: So much is lost at most when the process is killed, and the server keeps nothing
SEGMENT_S = 600.0  #: A file grows for so long before the next is begun

_SEGMENT = re.compile(r"\d{4}-\d\d-\d\dT\d{6}\.\d{6}Z\.parquet")


class Lake:
    """What one machine says, a row a period. Files are replaced whole; until then the old one is there."""

    def __init__(self, folder: Path, machine: str, channels: Mapping[str, ChannelSection], tell: Tell) -> None:
        """The lake in `folder`. Raises OptionError or OSError: it cannot be written to."""
        self.folder, self._tell = folder / f"machine={machine}", tell
        self._rows: list[tuple[float, ...]] = []
        self._segment_s = self._flushed_s = 0.0
        self._names = [*TIMES, *channels]
        self.folder.mkdir(parents=True, exist_ok=True)
        said = self._machine_with(machine, channels)
        self._fields = {name: pa.field(name, pa.float64(), metadata=_said(of)) for name, of in said.channels.items()}
        self._fields |= {name: pa.field(name, pa.timestamp("us", "UTC")) for name in TIMES}
        write_whole(self.folder / MACHINE_FILE, machine_text(said).encode())

    def _machine_with(self, machine: str, channels: Mapping[str, ChannelSection]) -> Machine:
        """The machine file with these channels: what was corrected in it stays, and so do other channels."""
        path = self.folder / MACHINE_FILE
        time = TimeSection(column="time", unit="datetime")
        said = machine_file(path) if path.exists() else Machine(machine=MachineSection(name=machine), time=time)
        for name in said.channels.keys() & channels.keys():
            here, given = said.channels[name], channels[name]
            if (here.role, here.unit) != (given.role, given.unit):
                raise OptionError(
                    f"{name} with the role {given.role} in {given.unit}",
                    expected=f"the role {here.role} in {here.unit}, as it is kept already",
                    where=str(path),
                    advice="give the channel another name; another machine has another name in its machine file",
                )
        return said.model_copy(update={"channels": {**channels, **said.channels}})

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

    def put(self, time_s: Vector, values: Matrix) -> tuple[list[Path], int, int]:
        """Rows of a recording, values (n_rows, n_channels), in the places that are empty.

        `time_s` is counted from 1970 [s]. The files; how many times are new; at how many something else is kept.
        What is being collected meanwhile is left alone.
        """
        frame = pd.DataFrame(values, columns=self._names[len(TIMES) :])
        frame.insert(0, "time", _moments(pd.Series(time_s)))
        files, new, other = [], 0, 0
        for day, part in frame.groupby(frame["time"].dt.strftime("%Y-%m-%d")):
            whole = self._whole(str(day))
            collected = [one for path in self._segments(whole) if (one := self._frame(path)) is not None]
            whole_day = [self._frame(whole)] if whole.exists() else []
            kept = [one for one in (*collected, *whole_day) if one is not None]
            mine = part.groupby("time").first()
            if kept:
                before = pd.concat(kept).groupby("time").first()
                there = before.reindex(index=mine.index, columns=mine.columns)
                other += int(((there != mine) & there.notna() & mine.notna()).any(axis=1).sum())
                mine = mine[~mine.index.isin(pd.concat(collected)["time"])] if collected else mine
                new += int((~mine.index.isin(before.index)).sum())
            else:
                new += len(mine)
            if len(mine):
                self._merge(str(day), mine.reset_index(), segments=())
                files.append(whole)
        return files, new, other

    def close_days(self, now_s: float | None = None) -> None:
        """One file for each day that is over at `now_s`; without it, for each day, and the growing file ends."""
        if now_s is None:
            self.flush()
            self._rows.clear()
        days = {path.name[:10] for path in self.folder.glob("month=*/*T*.parquet") if _SEGMENT.fullmatch(path.name)}
        for day in sorted(days if now_s is None else days - {_day(now_s)}):
            self._merge(day)

    def _whole(self, day: str) -> Path:
        return self.folder / f"month={day[:7]}" / f"{day}.parquet"

    def _segments(self, whole: Path) -> list[Path]:
        """Files of a day beside the one for all of it."""
        return [path for path in whole.parent.glob(f"{whole.stem}T*.parquet") if _SEGMENT.fullmatch(path.name)]

    def _merge(self, day: str, more: pd.DataFrame | None = None, segments: Sequence[Path] | None = None) -> None:
        """Makes one file of a day, of all its segments but the growing one or of these, with more rows."""
        whole = self._whole(day)
        growing = self._segment(self._rows[0][0]) if self._rows else None
        if segments is None:
            segments = [path for path in self._segments(whole) if path != growing]
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
        names = [str(name) for name in frame]
        names.sort(key=lambda name: self._names.index(name) if name in self._names else len(self._names))
        fields = [self._fields.get(name, pa.field(name, pa.float64())) for name in names]
        out = memory.BytesIO()
        pq.write_table(pa.Table.from_pandas(frame[names], pa.schema(fields), preserve_index=False), out)
        write_whole(path, out.getvalue())

    def _framed(self, rows: list[tuple[float, ...]]) -> pd.DataFrame:
        frame = pd.DataFrame(rows, columns=self._names)
        for name in TIMES:
            frame[name] = _moments(frame[name])
        return frame

    def _segment(self, time_s: float) -> Path:
        moment = datetime.fromtimestamp(time_s, UTC)
        return self.folder / f"month={moment:%Y-%m}" / f"{moment:%Y-%m-%dT%H%M%S.%f}Z.parquet"


def _day(time_s: float) -> str:
    return f"{datetime.fromtimestamp(time_s, UTC):%Y-%m-%d}"


def _moments(time_s: pd.Series) -> pd.Series:
    micro = (time_s * 1e6).round().astype("Int64")
    return pd.to_datetime(micro, unit="us", utc=True).astype("datetime64[us, UTC]")


def _said(channel: ChannelSection) -> dict[str, str]:
    said = {"unit": channel.unit, "role": channel.role, "place": channel.place, "axis": channel.axis}
    return {key: value for key, value in said.items() if value is not None}


def kept(reading: Reading, folder: Path) -> tuple[list[Path], int, int]:
    """Puts recordings with date and time into a lake: files; how many times are new; at how many others are kept.

    Rows of a time that is kept already give only what is missing there. A clock without a zone is kept as it is, as
    if it were UTC.

    Raises OptionError: no machine has the recordings, a run has no date, a clock that jumps back or another unit than
    the machine file says, or the lake cannot be read or written.
    """
    name = None if reading.machine is None else reading.machine.machine.name
    if name is None or not re.fullmatch(FOLDER, name):
        found = "recordings of no machine" if name is None else f"a machine called {name!r}"
        advice = 'describe RUN… --write machine.toml writes one; add [machine] with name = "A01", and --machine'
        expected = "a machine file with a name of letters, digits, . _ and - under [machine]"
        raise OptionError(found, expected=expected, where="--lake", advice=advice)
    undated = [run.name for run in reading.runs if run.start is None]
    if undated:
        found = f"{', '.join(undated[:6])} without a date"
        advice = "name the column with the date (--time-column), or convert without --lake"
        raise OptionError(found, expected="recordings with date and time", where="--lake", advice=advice)
    back = next((one for one in reading.findings if one.id == CLOCK_BACK), None)
    if back is not None:
        found = f"{back.where.run}, whose clock jumps back ({back.evidence['cause']})"
        advice = "write the recording with UTC or with the zone at each time, or cut the file there"
        raise OptionError(found, expected="every time once", where="--lake", advice=advice)
    told = next((one.evidence for one in reading.findings if one.evidence.get("believed") == "declared"), None)
    if told is not None:  # what a lake has stays: a month in °F would be one in °C for good
        of, unit, printed = told["channels"], told["asked"], next(iter(told["in_file"]))
        found = f"{', '.join(of)} in {unit} by the machine file, in {printed} by the headers"
        advice = f"say which it is: --unit {of[0]}={printed}, or {unit}, and so for each channel"
        raise OptionError(found, expected="one unit of each channel", where="--lake", advice=advice)
    recording = reading.recording
    sections = {one.name: channel_section(one, one.name, one.unit) for one in recording.channels}
    files: set[Path] = set()
    new = other = 0
    lake = Lake(folder, name, sections, _refuse)
    for run in reading.runs:
        start = datetime.fromisoformat(str(run.start))
        begin_s = (start if start.tzinfo is not None else start.replace(tzinfo=UTC)).timestamp()
        own = [one for one in reading.findings if one.where.run == run.name]
        time_s = begin_s + own_clock_s(recording.time_s(run.name), own, run.period_s)
        written, more, differing = lake.put(time_s, recording.values(run.name, recording.names))
        files |= set(written)
        new, other = new + more, other + differing
    return sorted(files), new, other


def _refuse(event: str, **said: object) -> None:
    raise OptionError(
        f"a file of the lake that cannot be read ({said.get('error', event)})",
        expected="a Parquet file of an earlier day",
        where=str(said.get("file", "--lake")),
        advice="move the file away and convert again",
    )
