"""What every server is to the loop: numbers with their quality in, numbers out, lost and found again."""

import asyncio
import contextlib
import csv
import math
import time
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any, Protocol

from selector.errors import OptionError
from selector.live.io_file import Connection, IoFile

LARGEST = 1e30  #: A larger number from a server is none.
LONGEST_OPENING_S = 10.0
LONGEST_RETRY_S = 10.0

Tell = Callable[..., None]  #: ``tell(event, **what)``: how anything is reported to the journal.
History = dict[str, list[tuple[float, float]]]  #: Address → (source time [s since 1970], value), the oldest first.


@dataclass(frozen=True)
class Sample:
    """One value as a server gave it."""

    value: float  #: NaN: none
    quality: str = "good"  #: Else what the server says of it
    source_s: float | None = None  #: When it was measured, by the server's clock [s since 1970]
    age_s: float | None = None  #: How old it is by that same clock [s]


def number_in(value: Any) -> float:
    """The number that a server sent, NaN for whatever is none: texts, lists, what is too large.

    >>> number_in("21.5"), number_in(True), number_in([1]), number_in(1e300)
    (21.5, 1.0, nan, nan)
    """
    if not isinstance(value, int | float | str) or (isinstance(value, str) and (len(value) > 64 or "_" in value)):
        return math.nan
    try:
        number = float(value)
    except (ValueError, OverflowError):
        return math.nan
    return number if abs(number) < LARGEST else math.nan


class RealClock:
    """The clock of this computer."""

    def monotonic(self) -> float:
        """Seconds that nobody puts back."""
        return time.monotonic()

    def wall(self) -> float:
        """Seconds since 1970, which somebody may put."""
        return time.time()

    async def sleep_until(self, moment_s: float) -> None:
        """Until `monotonic` is that."""
        await asyncio.sleep(max(0.0, moment_s - time.monotonic()))


class FastClock:
    """Time that passes as fast as it can be computed, from `begun_s` [s since 1970] on."""

    def __init__(self, begun_s: float = 0.0) -> None:
        self._now_s, self.begun_s = 0.0, begun_s

    def monotonic(self) -> float:
        """See `RealClock`."""
        return self._now_s

    def wall(self) -> float:
        """See `RealClock`."""
        return self.begun_s + self._now_s

    async def sleep_until(self, moment_s: float) -> None:
        """See `RealClock`."""
        self._now_s = max(self._now_s, moment_s)
        await asyncio.sleep(0)


Clock = RealClock | FastClock  #: Time as the loop sees it.


class Link(Protocol):
    """A connection to one server. Every call may raise what it likes: then the connection counts as lost."""

    async def open(self) -> None:
        """Connect; what the server says of its types is looked at here."""
        return

    async def read(self, addresses: Iterable[str]) -> dict[str, Sample]:
        """What stands at these addresses now; what the server does not have is left away."""

    async def write(self, values: Mapping[str, float]) -> None:
        """Ends when the server has confirmed all of it."""

    async def history(self, addresses: Iterable[str], since_s: float, until_s: float) -> History:
        """What the server has kept between two moments [s since 1970]; empty where it keeps nothing."""
        return {}

    async def close(self) -> None:
        """Let go."""
        return


class LostError(Exception):
    """A server does not answer, or refuses."""


class Supervised:
    """A link that is opened again when it was lost, without ever holding up the loop for longer than its timeout."""

    def __init__(self, name: str, link: Link, timeout_s: float, clock: Clock, tell: Tell) -> None:
        self.name, self.link, self.is_open = name, link, False
        self._timeout_s, self._clock, self._tell = timeout_s, clock, tell
        self._opening: asyncio.Task[None] | None = None
        self._not_before_s, self._wait_s, self._began_s = -math.inf, 0.5, 0.0
        self._told = ""

    async def read(self, addresses: Iterable[str]) -> dict[str, Sample]:
        """See `Link`. Raises LostError."""
        return await self._call(lambda: self.link.read(addresses))

    async def write(self, values: Mapping[str, float]) -> None:
        """See `Link`. Raises LostError."""
        await self._call(lambda: self.link.write(values))

    async def history(self, addresses: Iterable[str], since_s: float, until_s: float) -> History:
        """See `Link`. Raises LostError."""
        return await self._call(lambda: self.link.history(addresses, since_s, until_s), 30.0)

    async def close(self) -> None:
        """Let go, whatever the server says to it."""
        if self._opening is not None:
            self._opening.cancel()
            with contextlib.suppress(asyncio.CancelledError, Exception):
                await self._opening
            self._opening = None
        with contextlib.suppress(Exception):
            await asyncio.wait_for(self.link.close(), self._timeout_s)
        self.is_open = False

    async def _call(self, ask: Callable[[], Any], timeout_s: float | None = None) -> Any:
        await self._require_open()
        try:
            return await asyncio.wait_for(ask(), timeout_s or self._timeout_s)
        except Exception as error:
            raise await self._lost(error) from error

    async def _require_open(self) -> None:
        if self.is_open:
            return
        if self._opening is None:
            if self._clock.monotonic() < self._not_before_s:
                raise LostError(f"{self.name} is not connected")
            self._opening, self._began_s = asyncio.create_task(self.link.open()), time.monotonic()
        await asyncio.wait({self._opening}, timeout=self._timeout_s)
        if not self._opening.done():
            if time.monotonic() - self._began_s > LONGEST_OPENING_S:
                raise await self._lost(TimeoutError("no answer to the opening"))
            raise LostError(f"{self.name} is being connected")
        task, self._opening = self._opening, None
        if (error := task.exception()) is not None:
            raise await self._lost(error)
        self.is_open, self._wait_s, self._told = True, 0.5, ""
        self._tell("connected", connection=self.name)

    async def _lost(self, error: BaseException) -> LostError:
        said = f"{type(error).__name__}: {error}"[:300]
        # the same refusal is told once, not at every attempt
        if said != self._told:
            self._told = said
            self._tell("connection-lost", connection=self.name, error=said)
        await self.close()
        self._not_before_s = self._clock.monotonic() + self._wait_s
        self._wait_s = min(2.0 * self._wait_s, LONGEST_RETRY_S)
        return LostError(f"{self.name}: {said}")


class FileLink(Link):
    """A CSV with ``time_s`` and a column an address, read as time passes; outputs are appended to one like it."""

    def __init__(self, path: str, writes: Iterable[str], clock: Clock) -> None:
        self._path, self._writes, self._clock = Path(path), tuple(writes), clock
        self._began_s: float | None = None
        self._file: Any = None
        self._rows: Any = None
        self._next: dict[str, str] | None = None
        self._now: dict[str, str] = {}

    @property
    def is_over(self) -> bool:
        """Whether its last row has been read."""
        return self._file is not None and not self._writes and self._next is None

    async def open(self) -> None:
        """See `Link`."""
        if self._began_s is None:
            self._began_s = self._clock.monotonic()
        mode, encoding = ("a+", "utf-8") if self._writes else ("r", "utf-8-sig")
        self._file = self._path.open(mode, encoding=encoding, errors="replace", newline="")
        if self._writes:
            if self._file.tell() == 0:
                self._append(["time_s", *self._writes])
            return
        self._rows = _timed(self._file)
        self._next = next(self._rows, None)

    async def read(self, addresses: Iterable[str]) -> dict[str, Sample]:
        """See `Link`."""
        if self._writes:
            self._file.seek(max(0, self._file.seek(0, 2) - 4096))
            cells = next(csv.reader([self._file.read().splitlines()[-1]]))
            self._now = dict(zip(("time_s", *self._writes), cells, strict=True))
        passed_s = self._clock.monotonic() - (self._began_s or 0.0)
        while self._next is not None and number_in(self._next["time_s"]) <= passed_s:
            self._now, self._next = self._next, next(self._rows, None)
        return {name: Sample(number_in(self._now[name])) for name in addresses if name in self._now}

    async def write(self, values: Mapping[str, float]) -> None:
        """See `Link`."""
        passed_s = self._clock.monotonic() - (self._began_s or 0.0)
        self._append([repr(passed_s), *(repr(values.get(name, 0.0)) for name in self._writes)])

    def _append(self, cells: list[str]) -> None:
        csv.writer(self._file, lineterminator="\n").writerow(cells)
        self._file.flush()

    async def close(self) -> None:
        """See `Link`."""
        if self._file is not None:
            self._file.close()


def _timed(file: Iterable[str]) -> Iterator[dict[str, str]]:
    """Rows that have a time, up to where it is no CSV any more."""
    with contextlib.suppress(csv.Error):
        yield from (row for row in csv.DictReader(file) if math.isfinite(number_in(row["time_s"])))


def supervised_links(io: IoFile, clock: Clock, tell: Tell) -> dict[str, Supervised]:
    """A link for each connection of an IO file. Raises ModuleNotFoundError: the extra ``live`` is not installed."""
    return {
        name: Supervised(name, _link(one, io, name, clock, tell), one.timeout_s, clock, tell)
        for name, one in io.connections.items()
    }


def _link(connection: Connection, io: IoFile, name: str, clock: Clock, tell: Tell) -> Link:
    writes = io.writes(name)
    if connection.kind == "file":
        _require_table(connection.url, writes, io.reads(name), f"connection {name}: {connection.url}")
        return FileLink(connection.url, writes, clock)
    # heavy, and extras
    if connection.kind == "opcua":
        from selector.live.opcua import OpcUaLink

        return OpcUaLink(connection, io.reads(name), writes, io.counts(name), tell)
    if connection.kind == "mqtt":
        from selector.live.mqtt import MqttLink

        backs = [one.read_back for one in io.outputs.values() if one.at == name and one.read_back is not None]
        return MqttLink(connection, (*io.reads(name), *backs), writes, clock)
    if connection.kind == "mtconnect":
        from selector.live.mtconnect import MTConnectLink

        return MTConnectLink(connection)
    from selector.live.hal import HalLink

    return HalLink()


def _require_table(path: str, writes: tuple[str, ...], reads: tuple[str, ...], where: str) -> None:
    """Ends with an error unless this is a CSV with ``time_s`` and all of `reads`, or new, empty or one of `writes`.

    What is read is played as time passes, and must not go back in it.
    """
    is_there, head, back = Path(path).is_file(), list[str](), None
    if is_there:
        with Path(path).open(encoding="utf-8-sig", errors="replace", newline="") as file:
            head = next(csv.reader([file.readline(100_000)]), [])
            if not writes and "time_s" in head:
                file.seek(0)
                times = (number_in(row["time_s"]) for row in _timed(file))
                back = next((pair for pair in pairwise(times) if pair[1] < pair[0]), None)
    wanted = ["time_s", *(writes or reads)]
    if not (head in ([], wanted) if writes else set(wanted) <= set(head)):
        raise OptionError(
            f"a file with other columns: {', '.join(head)[:200] or 'none'}" if is_there else "no such file",
            expected=f"{'no file yet, or a' if writes else 'a'} CSV with commas and columns {', '.join(wanted)[:200]}",
            where=where,
            advice="name another file for the outputs, or move this one away" if writes else "correct url or addresses",
        )
    if back is not None:
        raise OptionError(
            f"time_s goes back from {back[0]:g} to {back[1]:g}",
            expected="times that never decrease: the rows are played as time passes",
            where=where,
            advice="sort the rows by time_s; of runs one below the other, play one, or let their times go on",
        )
