"""A network that is cut: nothing is refused and nobody hangs up, packets are only no longer there."""

from __future__ import annotations

import asyncio
import json
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from tests.live.plants import beyond_the_guard
from tests.live.test_servers import NODES, OpcUa, end, go, process_of, told

PORT, QUICKLY = 48_400, "timeout_s = 0.5"


def _network(state):
    subprocess.run(["ip", "link", "set", "lo", state], check=True)


async def _cut_and_mended(folder):
    url = f'kind = "opcua"\nurl = "opc.tcp://127.0.0.1:{PORT}"\n{QUICKLY}'
    process, clock = process_of(folder, url, addresses=NODES)
    plc = await OpcUa(PORT, clock).start()
    await go(process, clock, 10)
    await plc.nodes["T1"].write_value(24.05)
    await go(process, clock, 40)
    before = len(plc.arrived)
    _network("down")
    await go(process, clock, 12)
    during = process.status()["connections"], process.given.correction_um, len(plc.arrived)
    _network("up")
    await asyncio.sleep(1.0)
    await go(process, clock, 120)
    last = (await plc.nodes["Z"].read_data_value()).Value.Value
    await end(process)
    await plc.stop()
    return {
        "before": before,
        "during": during,
        "after": len(plc.arrived),
        "last_um": last,
        "beyond": beyond_the_guard(plc.arrived),
    }


def test_a_cut_network_gives_nothing_and_a_mended_one_goes_on_within_the_guard(tmp_path):
    """In a namespace of its own, so that no other network is touched."""
    own = ["unshare", "--map-root-user", "--net"]
    if any(shutil.which(name) is None for name in ("unshare", "ip")):
        pytest.skip("unshare and ip are not there: network namespaces are of Linux")
    if subprocess.run([*own, "ip", "link", "set", "lo", "up"], capture_output=True).returncode:
        pytest.skip("this user may not make a network namespace")
    ran = subprocess.run(
        [*own, sys.executable, "-m", "tests.live.test_network_cut", str(tmp_path)],
        capture_output=True, text=True, timeout=120, cwd=Path(__file__).parents[2],
    )  # fmt: skip
    assert ran.returncode == 0, ran.stderr[-2000:]
    found = json.loads(ran.stdout.splitlines()[-1])
    connections, given_um, during = found["during"]
    assert during == found["before"]
    assert connections != {"plc": "open"}
    assert given_um == {"Z": 0.0}
    assert found["after"] > during
    assert found["last_um"] == pytest.approx(-8.1)
    assert found["beyond"] == []
    assert "connection-lost" in told(tmp_path)


if __name__ == "__main__":
    _network("up")
    print(json.dumps(asyncio.run(_cut_and_mended(Path(sys.argv[1])))))
