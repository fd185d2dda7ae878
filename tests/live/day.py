"""Machine time with a fault every minute: `python -m tests.live.day memory 24 SEED`; `opcua` is a real server."""

from __future__ import annotations

import asyncio
import json
import math
import random
import resource
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

from asyncua import ua

from tests.live.plants import beyond_the_guard, plant
from tests.live.test_servers import NODES, OpcUa, end, free_port, process_of

FAULTS = ("killed", "refused", "lying", "bad", "nan", "text", "jump", "silent", "dropping", "held-up", "clock")


class Lathe:
    """Either control, with the same faults."""

    def __init__(self, folder: Path, kind: str) -> None:
        self.is_down, self.arrived, self.plc = False, [], None
        if kind == "memory":
            self.process, self.link, self.clock = plant(folder)
            return
        port = free_port()
        self.process, self.clock = process_of(
            folder, f'kind = "opcua"\nurl = "opc.tcp://127.0.0.1:{port}"\ntimeout_s = 0.1', addresses=NODES
        )
        self.plc = OpcUa(port, self.clock)

    async def start(self) -> None:
        if self.plc is not None:
            await self.plc.start()

    async def fail(self, fault: str) -> None:
        of = self.plc or self.link
        of.is_refusing, of.is_lying = fault == "refused", fault == "lying"
        of.is_silent = of.is_deaf = fault == "silent"
        of.is_dropping = fault == "dropping"
        if self.plc is None:
            self.link.is_cut = fault in ("killed", "dropping")
        elif fault == "killed":
            await self.plc.stop()
            self.is_down = True
        elif self.is_down:
            self.arrived += self.plc.arrived
            self.plc.arrived, self.is_down = [], False
            await self.plc.start()

    async def show(self, value: Any, *, is_bad: bool) -> None:
        if self.plc is None:
            self.link.values["T1"], self.link.quality = value, {"T1": "BadSensorFailure"} if is_bad else {}
        elif not self.is_down:
            code = ua.StatusCodes.BadSensorFailure if is_bad else ua.StatusCodes.Good
            told = ua.DataValue(ua.Variant(value), ua.StatusCode(code))
            await self.plc.server.write_attribute_value(self.plc.nodes["T1"].nodeid, told)


async def day(folder: Path, kind: str, hours: float, seed: int) -> None:
    rng, lathe = random.Random(seed), Lathe(folder, kind)
    await lathe.start()
    process, clock = lathe.process, lathe.clock
    given, memory_mb, fault, ends = {}, [], "", 0
    before, count, corrected, wrong, deviation_um = (-math.inf, 0.0), 0, 0, [], 0.0
    cpu_s, wall_s = time.process_time(), time.monotonic()
    for second in range(int(3600 * hours)):
        if second % 60 == 30:
            fault, ends = rng.choice(FAULTS), second + rng.randint(1, 25)
            await lathe.fail(fault)
            clock.begun_s += rng.choice([-3600.0, 3600.0]) if fault == "clock" else 0.0
            if fault == "held-up":
                await clock.sleep_until(clock.monotonic() + 40.0)
        elif second == ends:
            fault = ""
            await lathe.fail(fault)
        true_degc = 22.0 + 3.0 * math.sin(second / 2000.0)
        value = {"nan": math.nan, "text": "hot", "jump": 9e5}.get(fault, true_degc)
        await lathe.show(value, is_bad=fault == "bad")
        given[clock.monotonic()] = float((await process.step()).correction_um["Z"])
        await clock.sleep_until(clock.monotonic() + 1.0)
        if second % 3600 == 3599 or second + 1 == int(3600 * hours):
            pages = int(Path("/proc/self/statm").read_text().split()[1])
            memory_mb.append(round(pages * resource.getpagesize() / 1e6, 1))
            arrived = lathe.arrived + (lathe.plc or lathe.link).arrived
            count, corrected = count + len(arrived), corrected + sum(value != 0.0 for value in given.values())
            wrong += beyond_the_guard(arrived, before=before)
            deviation_um = max(deviation_um, *(abs(value - given[moment_s]) for moment_s, value in arrived))
            # nothing is kept but the last, so that the memory is that of the process
            before = arrived[-1]
            lathe.arrived.clear()
            (lathe.plc or lathe.link).arrived.clear()
            given.clear()
            spent_s = time.process_time() - cpu_s
            told = {
                "machine_hours": (second + 1) / 3600.0,
                "arrived": count,
                "beyond_the_guard": wrong,
                "largest_deviation_um": deviation_um,
                "memory_mb_each_hour": memory_mb,
                "cpu_share_of_machine_time": spent_s / (second + 1),
                "took_s": time.monotonic() - wall_s,
                "share_corrected": corrected / (second + 1),
                "status": process.status(),
            }
            print(json.dumps(told), flush=True)
    await end(process)


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as name:
        asyncio.run(day(Path(name), sys.argv[1], float(sys.argv[2]), int(sys.argv[3])))
