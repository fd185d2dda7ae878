"""The guarded model as a process beside the control: read, compute, write, read back, at its period."""

import asyncio
import json
import math
import time
from collections import deque
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from selector.controllers.guard.decided import LONGEST_S
from selector.controllers.guard.guarded_model import Corrected, GuardedModel
from selector.controllers.model_file import ModelFile, kept_sha256
from selector.errors import OptionError
from selector.live.io_file import UM_IN, IoFile, LiveChannel
from selector.live.journal import Journal, write_status
from selector.live.links import Clock, FileLink, LostError, Sample, Supervised, supervised_links
from selector.units import CANONICAL_UNITS, convert, unit_for_role

REAL_PRECISION = 1e-6  #: Relative: what a control that keeps a REAL (binary32) may show of an LREAL.
CLOCK_JUMP_S = 2.0
STATUS_EVERY_S = 10.0
HEARTBEATS = 32768  #: An INT of a PLC holds every count below it.


class Readings:
    """The channels of an IO file in canonical units, each with what must be said of it."""

    def __init__(self, io: IoFile, links: Mapping[str, Supervised], clock: Clock, hold_s: float) -> None:
        """`hold_s`: for so long what a server said last counts when it does not answer."""
        self._io, self._links, self._clock, self._hold_s = io, links, clock, hold_s
        self._addresses = {name: io.reads(name) for name in links if io.reads(name)}
        self._scales = {name: _scale(channel) for name, channel in io.channels.items()}
        self._kept: dict[str, tuple[float, float]] = {}
        self.answers = 0  #: Of servers so far
        self.answered: list[str] = []  #: Connections that answered in the last period
        self._server_s: dict[str, float] = {}

    async def samples(self) -> dict[str, tuple[float, float | None]]:
        """Channel → value (NaN: none) and source time [s since 1970], if the server tells one."""
        answers = dict(zip(self._addresses, await asyncio.gather(*map(self._read, self._addresses)), strict=True))
        self.answered = [name for name, answer in answers.items() if answer is not None]
        now_s = self._clock.monotonic()
        found: dict[str, tuple[float, float | None]] = {}
        for name, channel in self._io.channels.items():
            answer = answers[channel.at]
            if answer is None:
                value, since_s = self._kept.get(name, (math.nan, -math.inf))
                found[name] = (value if now_s - since_s <= self._hold_s else math.nan), None
                continue
            sample = answer.get(channel.address, Sample(math.nan, "missing"))
            if sample.source_s is not None and sample.age_s is not None:
                self._server_s[channel.at] = sample.source_s + sample.age_s
            is_good = sample.quality == "good" and (sample.age_s or 0.0) <= self._io.oldest_s(channel)
            value = self.canonical(name, sample.value) if is_good else math.nan
            self._kept[name] = value, now_s
            found[name] = value, sample.source_s
        return found

    def canonical(self, channel: str, value: float) -> float:
        """A value of a server in the canonical unit of its role."""
        factor, zero = self._scales[channel]
        return factor * value + zero

    def server_s(self, connection: str, otherwise: float) -> float:
        """What the clock of a server showed when it last answered [s since 1970]."""
        return self._server_s.get(connection, otherwise)

    async def _read(self, connection: str) -> dict[str, Sample] | None:
        try:
            answer = await self._links[connection].read(self._addresses[connection])
        except LostError:
            return None
        self.answers += 1
        return answer


def _scale(channel: LiveChannel) -> tuple[float, float]:
    """Factor and zero from the unit of the server to the canonical one of the role."""
    if channel.unit is None:
        return 1.0, 0.0
    unit = unit_for_role(channel.unit, channel.role, where="IO file")
    at_0, at_1 = convert(np.array([0.0, 1.0]), unit, CANONICAL_UNITS[channel.role])
    return float(at_1 - at_0), float(at_0)


def is_over(io: IoFile, links: Mapping[str, Supervised]) -> bool:
    """Whether only files are read, and all have ended."""
    read = [of.link for name, of in links.items() if io.reads(name)]
    return all(isinstance(link, FileLink) and link.is_over for link in read)


class _Written:
    """One output at its control: what was written lately, and whether it has arrived."""

    def __init__(self, name: str, io: IoFile) -> None:
        output = io.outputs[name]
        self.at, self.address, self._io = output.at, output.address, io
        self.back = output.read_back or output.address
        self.is_echo = self.back != self.address
        self.factor = UM_IN[output.unit]
        self.lately: deque[tuple[float, float]] = deque(maxlen=10_000)
        self.confirmed_s = -math.inf
        self.mistrusted_until_s = -math.inf

    def write(self, value_um: float, now_s: float) -> float:
        """The value in the unit of the control."""
        while self.lately and now_s - self.lately[0][0] > self._io.stale_after_s:
            self.lately.popleft()
        self.lately.append((now_s, value_um * self.factor))
        return value_um * self.factor

    def arrived(self, value: float, now_s: float) -> bool:
        """Whether what stands at the control may be; an echo may show what was written a little earlier."""
        for moment_s, written in [*reversed(self.lately)][: None if self.is_echo else 1]:
            if abs(value - written) <= REAL_PRECISION * max(abs(value), abs(written), 1e-3 * self.factor):
                self.confirmed_s = moment_s
                return True
        if self.is_echo and now_s - self.confirmed_s <= self._io.stale_after_s:
            return True
        self.mistrusted_until_s = now_s + self._io.mistrust_s
        return False

    def is_trusted(self, now_s: float) -> bool:
        """Whether the control has what it was told."""
        return now_s - self.confirmed_s <= self._io.stale_after_s and now_s >= self.mistrusted_until_s


class Compensation:
    """A model beside its control. Nothing is ever written that the guard did not give in the same step."""

    def __init__(self, model: ModelFile, io: IoFile, clock: Clock, folder: Path) -> None:
        """`folder` receives journal, status page, metrics and start readings. Raises OptionError: it cannot."""
        self._model, self._io, self._clock = model, io, clock
        self.journal = Journal(folder, clock)
        self.links = supervised_links(io, clock, self.journal.tell)
        self._readings = Readings(io, self.links, clock, io.stale_after_s)
        self._guard = GuardedModel(model)
        self._written = {name: _Written(name, io) for name in io.outputs}
        self.is_stopping = False
        self.given: Corrected | None = None  #: Of the last step
        self._counts = dict.fromkeys(("cycles", "rows_out", "rows_confirmed", "mismatches", "late_cycles"), 0)
        self._latencies_s: deque[float] = deque(maxlen=20_000)
        self._last_s: float | None = None
        self._offset_s: float | None = None
        self._alive = (math.nan, -math.inf)
        self._is_armed = False  #: A touch-off may come: its flag was down since the start and since the last one
        self._said: dict[str, Any] = {}
        self._refused = self._not_written = ""
        self._ended: dict[str, str] = {}
        adapted = [] if model.adaptation is None else [of.output for of in model.adaptation.outputs]
        if untouched := [name for name in adapted if io.outputs[name].touch is None]:
            self.journal.tell("no-touch-offs", outputs=untouched, advice="say outputs.NAME.touch in the IO file")
        self._resume()

    async def run(self, cycles: int | None = None) -> dict[str, Any]:
        """Until it is stopped, files that are read have ended, or so many steps are done; then to zero. The status."""
        lock = self.journal.locked()
        self.journal.tell("started", machine=self._io.machine, period_s=self._io.period_s)
        next_s = status_s = self._clock.monotonic()
        end = cycles or math.inf
        # what libraries say in the background belongs into the journal, not on the screen
        asyncio.get_running_loop().set_exception_handler(
            lambda _, told: self.journal.tell("background", error=str(told.get("exception") or told["message"])[:300])
        )
        try:
            while not (self.is_stopping or self._counts["cycles"] >= end or is_over(self._io, self.links)):
                next_s = await self._period(next_s)
                if self._clock.monotonic() >= status_s + STATUS_EVERY_S:
                    status_s = self._clock.monotonic()
                    self._keep()
            await self._to_zero(next_s)
        finally:
            self._ended = {name: "closed" for name, link in self.links.items() if link.is_open}
            for link in self.links.values():
                await link.close()
            self.journal.tell("stopped", **self._counts)
            self._keep()
            lock.close()
        return self.status()

    async def step(self) -> Corrected:
        """One period: read, compute, write, read back."""
        begun_s, now_s = time.perf_counter(), self._clock.monotonic()
        dt_s = 0.0 if self._last_s is None else now_s - self._last_s
        self._last_s = now_s
        self._look_at_clock(now_s)
        values = {name: value for name, (value, _) in (await self._readings.samples()).items()}
        control = self._io.control
        reasons = self._not_ready(values, now_s)
        self._say_change("ready", not reasons, because=", ".join(reasons))
        given = self._guard.step(
            dt_s,
            {item.name: values[item.name] for item in self._model.inputs},
            {axis: values[name] for axis, name in self._io.positions.items()},
            is_ready=not reasons,
            is_wanted=not self.is_stopping and (control.wanted is None or values[control.wanted] > 0.5),
            touch_um=(touches := self._touched(values, is_ready=not reasons)),
            is_touch_valid=bool(touches),
        )
        self.given = given
        self._say_change("mode", int(given.mode))
        self._say_change("touch-offs", self._touches())
        self._say_change(
            "sensors", {i.name: c.name for i, c in zip(self._model.inputs, given.sensors, strict=True) if c}
        )
        self._counts["cycles"] += 1
        await self._write(given, now_s)
        self._latencies_s.append(time.perf_counter() - begun_s)
        await self._read_back()
        return given

    def status(self) -> dict[str, Any]:
        """Numbers and words of now, as the page, the metrics and ``--json`` have them."""
        given = self.given
        latencies_ms = 1e3 * np.array(self._latencies_s or [math.nan])
        return {
            "schema": "selector.compensation/1",
            "time": self._clock.wall(),
            "machine": self._io.machine,
            "ready": int(self._said.get("ready", False)),
            "mode": 0 if given is None else int(given.mode),
            "correction_um": {} if given is None else {k: float(v) for k, v in given.correction_um.items()},
            "sensors": self._said.get("sensors", {}),
            "touch_offs": self._said.get("touch-offs", {}),
            "connections": {
                name: "open" if link.is_open else self._ended.get(name, "lost") for name, link in self.links.items()
            },
            "rows_in": self._readings.answers,
            **self._counts,
            "latency_median_ms": float(np.median(latencies_ms)),
            "latency_999_ms": float(np.quantile(latencies_ms, 0.999)),
            "refused": self._refused,
            "not_written": self._not_written,
        }

    async def _period(self, next_s: float) -> float:
        await self.step()
        next_s += self._io.period_s
        if (now_s := self._clock.monotonic()) > next_s:
            # periods that were missed are not made up for
            self._counts["late_cycles"] += 1
            next_s = now_s
        await self._clock.sleep_until(next_s)
        return next_s

    async def _to_zero(self, next_s: float) -> None:
        """The operator's way out: ramped, as far as the control still listens."""
        self.is_stopping = True
        while self.given is not None and any(self.given.correction_um.values()):
            next_s = await self._period(next_s)

    def _not_ready(self, values: Mapping[str, float], now_s: float) -> list[str]:
        """Why the guard must give nothing."""
        control, reasons = self._io.control, []
        if control.ready is not None and not values[control.ready] > 0.5:
            reasons.append("the control is not ready")
        if control.alive is not None:
            count, since_s = self._alive
            if values[control.alive] != count and not math.isnan(values[control.alive]):
                self._alive = count, since_s = values[control.alive], now_s
            if now_s - since_s > self._io.stale_after_s:
                reasons.append("no heartbeat of the control")
        return reasons + [f"{name} is not read back" for name, of in self._written.items() if not of.is_trusted(now_s)]

    def _touched(self, values: Mapping[str, float], *, is_ready: bool) -> dict[str, float]:
        """Per output what the probe shows [um], in the one period in which it becomes valid.

        A flag that was up at the start, or is up again after its connection was lost, is no second touch-off. While
        the control may have something else than it was told, nothing can be learnt from one.
        """
        valid = self._io.control.touch_valid
        flag = math.nan if valid is None else values[valid]
        self._is_armed |= flag <= 0.5
        outputs = self._io.outputs.items()
        shown = {name: values[of.touch] for name, of in outputs if of.touch and math.isfinite(values[of.touch])}
        if not (flag > 0.5 and self._is_armed and shown):
            return {}
        self._is_armed = False
        self.journal.tell("touch-off", shown_um=shown, taken=is_ready)
        return shown if is_ready else {}

    def _touches(self) -> dict[str, Any]:
        """Per adapted output, what became of its last touch-off, and what all of them taught."""
        codes = {} if self.given is None else self.given.touches
        kept = self._guard.retained if codes else {}
        numbers = {output.name: k for k, output in enumerate(self._model.outputs, 1)}
        return {name: {"last": code.name, "offset_um": kept[f"offset_{numbers[name]}"]} for name, code in codes.items()}

    async def _write(self, given: Corrected, now_s: float) -> None:
        batches: dict[str, dict[str, float]] = {}
        for name, of in self._written.items():
            batches.setdefault(of.at, {})[of.address] = of.write(float(given.correction_um[name]), now_s)
            if (address := self._io.outputs[name].touch_code) is not None:
                batches[of.at][address] = float(given.touches[name])
        if (beat := self._io.control.heartbeat) is not None:
            batches.setdefault(beat.at, {})[beat.address] = float(self._counts["cycles"] % HEARTBEATS)

        async def one(connection: str) -> None:
            try:
                await self.links[connection].write(batches[connection])
                self._counts["rows_out"] += 1
            except LostError as error:
                self._refused = str(error)

        await asyncio.gather(*map(one, batches))

    async def _read_back(self) -> None:
        backs: dict[str, list[str]] = {}
        for of in self._written.values():
            backs.setdefault(of.at, []).append(of.back)

        async def one(connection: str) -> None:
            try:
                answer = await self.links[connection].read(backs[connection])
            except LostError:
                return
            now_s = self._clock.monotonic()
            for name, of in self._written.items():
                sample = answer.get(of.back) if of.at == connection else None
                is_old = sample is None or (sample.age_s or 0.0) > self._io.oldest_s(self._io.outputs[name])
                if sample is None or is_old or sample.quality != "good" or math.isnan(value := sample.value):
                    continue
                if of.arrived(value, now_s):
                    self._counts["rows_confirmed"] += 1
                    self._say_change(f"read-back {name}", "as written")
                    continue
                self._counts["mismatches"] += 1
                written = of.lately[-1][1]
                self._say_change(
                    f"read-back {name}",
                    "something else",
                    written=written,
                    found=value,
                    advice="compare the types on both sides (REAL, LREAL), and look for a second writer",
                )

        await asyncio.gather(*map(one, backs))

    def _look_at_clock(self, now_s: float) -> None:
        offset_s = self._clock.wall() - now_s
        if self._offset_s is not None and abs(offset_s - self._offset_s) > CLOCK_JUMP_S:
            self.journal.tell("clock-jump", by_s=offset_s - self._offset_s)
        self._offset_s = offset_s

    def _say_change(self, what: str, now: Any, **more: Any) -> None:
        if self._said.get(what) != now:
            self._said[what] = now
            self.journal.tell(what, now=now, **more)

    def _resume(self) -> None:
        """What was kept of the same model: start readings, memory, what touch-offs taught."""
        path = self.journal.folder / "kept.json"
        try:
            kept = json.loads(path.read_bytes())
            if kept["model"] != kept_sha256(self._model):
                self.journal.tell("kept-of-another-model", file=str(path))
                return
            self._guard.retain(kept["values"])
            off_s = self._clock.wall() - float(kept["time_s"])
            # a clock that was put back says nothing: as after a long standstill
            self._guard.restart(off_s if off_s >= 0.0 else LONGEST_S)
        except FileNotFoundError:
            return
        except (OSError, ValueError, TypeError, KeyError, OverflowError, RecursionError) as error:
            self.journal.tell("kept-unreadable", file=str(path), error=str(error)[:200])

    def _keep(self) -> None:
        kept = {"model": kept_sha256(self._model), "time_s": self._clock.wall(), "values": self._guard.retained}
        try:
            write_status(self.journal.folder, self.status() | {"not_written": ""}, kept, self._model)
            self._not_written = ""
        except OptionError as error:
            self._not_written = str(error)[:200]
            self.journal.tell("status-not-written", error=self._not_written)
