"""A day of machine time beside a real OPC UA server, a fault every minute: `python -m tests.live.day [HOURS]`."""

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

from asyncua import ua

from tests.live.plants import beyond_the_guard
from tests.live.test_servers import NODES, OpcUa, end, free_port, process_of

FAULTS = ("killed", "refused", "lying", "bad", "nan", "text", "jump", "silent", "dropping", "held-up", "clock")


def resident_mb() -> float:
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return pages * resource.getpagesize() / 1e6


async def day(folder: Path, hours: float) -> dict[str, object]:
    port, rng = free_port(), random.Random(3)
    process, clock = process_of(
        folder, f'kind = "opcua"\nurl = "opc.tcp://127.0.0.1:{port}"\ntimeout_s = 0.4', addresses=NODES
    )
    plc = await OpcUa(port, clock).start()
    arrived, given, memory_mb, fault, ends, is_down = [], [], [], "", 0, False
    cpu_s, wall_s = time.process_time(), time.monotonic()
    for second in range(int(3600 * hours)):
        if second % 60 == 30:
            fault, ends = rng.choice(FAULTS), second + rng.randint(1, 25)
            plc.is_refusing, plc.is_lying, plc.silent_s = (
                fault == "refused",
                fault == "lying",
                2.0 * (fault == "silent"),
            )
            if fault == "killed":
                await plc.stop()
                is_down = True
            clock.begun_s += rng.choice([-3600.0, 3600.0]) if fault == "clock" else 0.0
            if fault == "held-up":
                await clock.sleep_until(clock.monotonic() + 40.0)
        elif second == ends:
            fault = ""
            plc.is_refusing = plc.is_lying = plc.is_silent = plc.is_dropping = False
            if is_down:
                arrived += plc.arrived
                plc.arrived, is_down = [], False
                await plc.start()
        if not is_down:
            true_degc = 22.0 + 3.0 * math.sin(second / 2000.0)
            said = {"bad": true_degc, "nan": math.nan, "text": "hot", "jump": 9e5}.get(fault, true_degc)
            code = ua.StatusCodes.BadSensorFailure if fault == "bad" else ua.StatusCodes.Good
            value = ua.DataValue(ua.Variant(said), ua.StatusCode(code))
            await plc.server.write_attribute_value(plc.nodes["T1"].nodeid, value)
        given.append((clock.monotonic(), float((await process.step()).correction_um["Z"])))
        await clock.sleep_until(clock.monotonic() + 1.0)
        if second % 3600 == 3599:
            memory_mb.append(round(resident_mb(), 1))
            process._keep()
    cpu_s, wall_s = time.process_time() - cpu_s, time.monotonic() - wall_s
    arrived += plc.arrived
    await end(process)
    if not is_down:
        await plc.stop()
    at = dict(given)
    return {
        "machine_hours": hours,
        "arrived": len(arrived),
        "beyond_the_guard": beyond_the_guard(arrived),
        # what came too late, because the server was silent, was given a step earlier
        "largest_deviation_um": max(
            min(abs(value - at.get(moment_s - late_s, math.inf)) for late_s in range(6)) for moment_s, value in arrived
        ),
        "memory_mb_each_hour": memory_mb,
        "cpu_share_of_machine_time": cpu_s / (3600 * hours),
        "took_s": wall_s,
        "share_corrected": sum(value != 0.0 for _, value in given) / len(given),
        "status": process.status(),
    }


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as name:
        print(json.dumps(asyncio.run(day(Path(name), float(sys.argv[1]) if len(sys.argv) > 1 else 24.0)), indent=1))
