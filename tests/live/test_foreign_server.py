"""OPC UA by other hands: node-opcua, where it is installed (`npm install node-opcua`, and NODE_PATH)."""

from __future__ import annotations

import asyncio
import shutil
import subprocess
from pathlib import Path

import pytest

from tests.live.plants import beyond_the_guard
from tests.live.test_servers import OPEN_S, end, free_port, go, process_of, told

SERVER = Path(__file__).with_name("foreign_server.js")
NODES = tuple(f"ns=1;s={name}" for name in ("T1", "T2", "Z"))
FLOAT32 = 1e-6  # a Float holds -8 with 5e-7


def installed() -> bool:
    node = shutil.which("node")
    return (
        node is not None and subprocess.run([node, "-e", "require('node-opcua')"], capture_output=True).returncode == 0
    )


class Foreign:
    """The server as a process."""

    def __init__(self, port, clock):
        self.port, self.clock, self.arrived = port, clock, []

    async def start(self):
        self.run = await asyncio.create_subprocess_exec(
            "node", str(SERVER), str(self.port), stdin=subprocess.PIPE, stdout=subprocess.PIPE
        )
        self.up, self.done = asyncio.Event(), asyncio.Event()
        self.listening = asyncio.create_task(self._listen())
        await asyncio.wait_for(self.up.wait(), 120)

    async def _listen(self):
        while line := (await self.run.stdout.readline()).decode().split():
            if line[0] == "arrived":
                assert line[1] == "Float"
                self.arrived.append((self.clock.monotonic(), float(line[2])))
            elif line[0] == "started":
                self.up.set()
            elif line[0] == "done":
                self.done.set()

    async def tell(self, line):
        self.done.clear()
        self.run.stdin.write(f"{line}\n".encode())
        await self.done.wait()

    async def kill(self):
        self.run.kill()
        await self.run.wait()
        await self.listening


def test_node_opcua(tmp_path):
    if not installed():
        pytest.skip("node-opcua is not installed")
    port = free_port()
    process, clock = process_of(
        tmp_path, f'kind = "opcua"\nurl = "opc.tcp://127.0.0.1:{port}"\n{OPEN_S}', addresses=NODES
    )
    plc = Foreign(port, clock)

    async def work():
        await plc.start()
        await go(process, clock, 12)
        await plc.tell("T1 24.0")
        await go(process, clock, 30)
        assert process.status()["mismatches"] == 0
        assert plc.arrived[-1][1] == pytest.approx(-8.0)
        await plc.tell("bad 1")
        await go(process, clock, 25)
        assert process.status()["sensors"] == {"T1": "MISSING"}
        assert plc.arrived[-1][1] == 0.0
        await plc.tell("bad 0")
        await go(process, clock, 40)
        assert plc.arrived[-1][1] == pytest.approx(-8.0)
        await plc.tell("refusing 1")
        count = len(plc.arrived)
        await go(process, clock, 15)
        assert len(plc.arrived) == count
        assert "BadUserAccessDenied" in told(tmp_path)
        await plc.tell("refusing 0")
        await go(process, clock, 40)
        assert plc.arrived[-1][1] == pytest.approx(-8.0)
        # somebody else writes: what stands there is not what was written
        process.links["plc"].write, plain = plc_writes_something_else(process, plc)
        await go(process, clock, 1)
        process.links["plc"].write = plain
        assert process.status()["mismatches"] == 1
        await go(process, clock, 2)
        assert plc.arrived[-1][1] == 0.0
        await plc.kill()
        await go(process, clock, 15)
        before, plc.arrived = plc.arrived, []
        await plc.start()
        await plc.tell("T1 24.0")
        await go(process, clock, 90)
        assert plc.arrived[0][1] == 0.0
        assert plc.arrived[-1][1] == pytest.approx(-8.0)
        # the clock may have gone on by a second before a line of the other process is read
        late_s = 1.0 + FLOAT32
        assert beyond_the_guard(before, late_s=late_s) == beyond_the_guard(plc.arrived, late_s=late_s) == []
        await end(process)
        await plc.kill()

    asyncio.run(work())


def plc_writes_something_else(process, plc):
    plain = process.links["plc"].write

    async def write(values):
        await plain(values)
        await plc.tell("Z 55.5")

    return write, plain
