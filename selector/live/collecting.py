"""The same sources, kept: a row a period into the lake, and gaps filled from what the servers still have."""

import asyncio
import math
from pathlib import Path
from typing import Any

import numpy as np

from selector.live.compensating import Readings, is_over
from selector.live.io_file import IoFile
from selector.live.journal import Journal
from selector.live.lake import Lake
from selector.live.links import Clock, History, LostError, supervised_links
from selector.readers.machine_file import ChannelSection
from selector.units import CANONICAL_UNITS


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
        """`folder` is the lake. Raises OptionError: another process has it, or it cannot be written to."""
        # outputs and heartbeat are not opened: this process only reads
        control = io.control.model_copy(update={"heartbeat": None})
        self._io, self._clock = io.model_copy(update={"outputs": {}, "control": control}), clock
        self._journal = Journal(folder / f"machine={io.machine}" / "journal", clock)
        self._links = supervised_links(self._io, clock, self._journal.tell)
        self._readings = Readings(self._io, self._links, clock, hold_s=0.0)
        sections = {
            name: ChannelSection(role=of.role, unit=CANONICAL_UNITS[of.role], place=of.place, axis=of.axis)
            for name, of in io.channels.items()
        }
        # before the lake: that writes its machine file
        self._lock = self._journal.locked()
        self._lake = Lake(folder, io.machine, sections, self._journal.tell)
        self.is_stopping = False
        self._rows = self._filled = 0
        self._row_s = last_s = self._lake.last_s()
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
            self._lock.close()
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
        # a period that came late and one in time may be one moment of the lake
        if not all(map(math.isnan, values)) and time_s != self._row_s:
            self._row_s = time_s
            sources = [source for _, source in samples.values() if source is not None]
            self._lake.append(time_s, max(sources, default=None), wall_s, values)
            self._rows += 1
        for name in self._readings.answered:
            heard_s = self._heard_s[name]
            if heard_s is not None and 1.5 * period_s < wall_s - heard_s:
                since_s = max(heard_s, wall_s - LONGEST_GAP_S)
                ahead_s = wall_s - self._readings.server_s(name, wall_s)
                task = asyncio.create_task(self._fill(name, since_s, time_s, ahead_s))
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
