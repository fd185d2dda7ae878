"""Real servers that fail: OPC UA in this process, mosquitto, an MTConnect agent; what arrives, and what is told."""

from __future__ import annotations

import asyncio
import json
import shutil
import socket
import struct
import subprocess
import tempfile
import threading
import time
from contextlib import asynccontextmanager, contextmanager
from datetime import UTC, datetime, timedelta
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path

import aiomqtt
import pytest
from asyncua import Server, ua

from selector.controllers.replay import compiled
from selector.live.compensating import Compensation
from selector.live.hal import HalLink
from selector.live.io_file import Connection, read_io
from selector.live.links import FastClock
from selector.live.mtconnect import MTConnectLink
from tests.live.plants import beyond_the_guard, io_text, model

OPEN_S = "timeout_s = 5.0"
NODES = ("ns=2;s=T1", "ns=2;s=T2", "ns=2;s=Z")


def free_port():
    with socket.socket() as sock:
        sock.bind(("127.0.0.1", 0))
        return sock.getsockname()[1]


def process_of(folder, connection, **options):
    path = folder / "io.toml"
    path.write_text(io_text(connection, **options), "utf-8")
    clock = FastClock(1_700_000_000.0)
    return Compensation(model(), read_io(path, model()), clock, folder / "out"), clock


async def go(process, clock, seconds, each=None):
    for second in range(seconds):
        if each is not None:
            await each(second)
        await process.step()
        await clock.sleep_until(clock.monotonic() + 1.0)


async def end(process):
    for link in process.links.values():
        await link.close()


class OpcUa:
    """A server with two thermometers and a correction, which notes every value that was written to it."""

    def __init__(self, port, clock=None, kind=ua.VariantType.Double):
        self.port, self.clock, self.kind, self.arrived = port, clock, kind, []
        self.is_refusing, self.is_lying, self.is_silent, self.is_dropping = False, False, False, False

    async def start(self):
        self.server = Server()
        await self.server.init()
        self.server.set_endpoint(f"opc.tcp://127.0.0.1:{self.port}")
        await self.server.register_namespace("lathe")
        self.nodes = {}
        for name in ("T1", "T2", "Z"):
            kind = self.kind if name == "Z" else ua.VariantType.Double
            value = 20.0 if name != "Z" else 0.0 if kind in (ua.VariantType.Double, ua.VariantType.Float) else 0
            self.nodes[name] = await self.server.nodes.objects.add_variable(
                ua.NodeId(name, 2), ua.QualifiedName(name, 2), value, kind
            )
        await self.nodes["Z"].set_writable()
        await self.server.start()
        plain = self.server.iserver.attribute_service.write

        async def noted(params, *args, **kwargs):
            if all(one.NodeId != self.nodes["Z"].nodeid for one in params.NodesToWrite):
                return await plain(params, *args, **kwargs)
            if self.is_refusing:
                return [ua.StatusCode(ua.StatusCodes.BadNotWritable) for _ in params.NodesToWrite]
            if self.is_dropping:
                await asyncio.sleep(1.0)
                return [ua.StatusCode(ua.StatusCodes.BadTimeout) for _ in params.NodesToWrite]
            codes = await plain(params, *args, **kwargs)
            for one, code in zip(params.NodesToWrite, codes, strict=True):
                if code.is_good() and one.NodeId == self.nodes["Z"].nodeid and self.clock is not None:
                    self.arrived.append((self.clock.monotonic(), one.Value.Value.Value))
                    if self.is_lying and one.Value.Value.Value:
                        # the lower half of an LREAL, taken for a REAL
                        half = struct.unpack("<f", struct.pack("<d", one.Value.Value.Value)[:4])[0]
                        await self.server.write_attribute_value(one.NodeId, ua.DataValue(ua.Variant(half)))
            if self.is_silent:
                await asyncio.sleep(1.0)
            return codes

        self.server.iserver.attribute_service.write = noted
        return self

    async def stop(self):
        await self.server.stop()


@asynccontextmanager
async def opcua_plant(tmp_path, kind=ua.VariantType.Double, addresses=NODES):
    port = free_port()
    process, clock = process_of(
        tmp_path, f'kind = "opcua"\nurl = "opc.tcp://127.0.0.1:{port}"\n{OPEN_S}', addresses=addresses
    )
    plc = await OpcUa(port, clock, kind).start()
    try:
        yield process, clock, plc
    finally:
        await end(process)
        await plc.stop()


def told(tmp_path):
    return (tmp_path / "out" / "journal.jsonl").read_text("ascii")


@pytest.mark.parametrize("kind", [ua.VariantType.Double, ua.VariantType.Float])
def test_opcua_is_corrected_in_its_own_type(tmp_path, kind):
    async def work():
        async with opcua_plant(tmp_path, kind) as (process, clock, plc):
            await go(process, clock, 10)
            await plc.nodes["T1"].write_value(24.05)
            await go(process, clock, 30)
            held = await plc.nodes["Z"].read_data_value()
            assert held.Value.VariantType is kind
            assert held.Value.Value == pytest.approx(-8.1)
            assert beyond_the_guard(plc.arrived) == []
            assert process.status()["rows_confirmed"] == 40
            assert process.status()["mismatches"] == 0

    asyncio.run(work())


def test_opcua_quality_killed_and_restarted(tmp_path):
    async def work():
        async with opcua_plant(tmp_path) as (process, clock, plc):
            await go(process, clock, 10)
            await plc.nodes["T1"].write_value(24.0)
            await go(process, clock, 30)
            bad = ua.DataValue(ua.Variant(24.0, ua.VariantType.Double), ua.StatusCode(ua.StatusCodes.BadSensorFailure))
            await plc.nodes["T1"].write_value(bad)
            await go(process, clock, 30)
            assert process.status()["sensors"] == {"T1": "MISSING"}
            assert plc.arrived[-1][1] == 0.0
            await plc.nodes["T1"].write_value(24.0)
            await go(process, clock, 40)
            assert plc.arrived[-1][1] == pytest.approx(-8.0)
            await plc.stop()
            await go(process, clock, 15)
            assert process.given.correction_um == {"Z": 0.0}
            before = plc.arrived
            plc.arrived = []
            await plc.start()
            await plc.nodes["T1"].write_value(24.0)
            await go(process, clock, 60)
            assert plc.arrived[0][1] == 0.0
            assert plc.arrived[-1][1] == pytest.approx(-8.0)
            assert beyond_the_guard(before) == beyond_the_guard(plc.arrived) == []
            assert told(tmp_path).count('"connection-lost"') >= 1

    asyncio.run(work())


def test_opcua_refuses_the_write(tmp_path):
    async def work():
        async with opcua_plant(tmp_path) as (process, clock, plc):
            plc.is_refusing = True
            await go(process, clock, 30)
            assert plc.arrived == []
            assert process.status()["rows_out"] == 0
            assert "BadNotWritable" in told(tmp_path)

    asyncio.run(work())


@pytest.mark.parametrize("kind", [ua.VariantType.Boolean, ua.VariantType.Int16])
def test_opcua_output_that_is_no_real(tmp_path, kind):
    async def work():
        async with opcua_plant(tmp_path, kind) as (process, clock, plc):
            await go(process, clock, 10)
            await plc.nodes["T1"].write_value(24.0)
            await go(process, clock, 20)
            assert {value for _, value in plc.arrived} <= {0}
            assert kind.name in told(tmp_path)
            assert "Float or Double" in told(tmp_path)

    asyncio.run(work())


@pytest.mark.parametrize("slip", [0, 2])
def test_a_node_that_is_not_there_is_told_once_with_what_is_offered(tmp_path, slip):
    wrong = tuple(f"{name}emp" if k == slip else name for k, name in enumerate(NODES))

    async def work():
        async with opcua_plant(tmp_path, addresses=wrong) as (process, clock, plc):
            await go(process, clock, 60)
            # a connection whose output is not there is opened again and again
            assert told(tmp_path).count('"node-unknown"') == 1
            one = next(json.loads(line) for line in told(tmp_path).splitlines() if "node-unknown" in line)
            assert one["asked"] == wrong[slip]
            assert one["offered"].split(", ")[0] == NODES[slip]
            assert plc.arrived == [] if slip == 2 else process.status()["sensors"] == {"T1": "MISSING"}
            assert ("BadNodeIdUnknown" in told(tmp_path)) == (slip == 2)

    asyncio.run(work())


def test_opcua_history_is_read_where_it_is_kept(tmp_path):
    async def work():
        async with opcua_plant(tmp_path) as (process, _, plc):
            await plc.server.historize_node_data_change(plc.nodes["T1"], count=100)
            begun = datetime(2026, 3, 1, 10, tzinfo=UTC)
            for second in range(10):
                told = ua.DataValue(ua.Variant(20.0 + second), SourceTimestamp=begun + timedelta(seconds=second))
                await plc.nodes["T1"].write_value(told)
            await asyncio.sleep(0.5)
            link = process.links["plc"]
            found = await link.history(NODES[:2], begun.timestamp() + 3.0, begun.timestamp() + 6.0)
            assert found[NODES[0]] == [(begun.timestamp() + s, 20.0 + s) for s in range(3, 7)]
            # T2 has none, and that is no reason to lose the server
            assert found.get(NODES[1], []) == []
            assert link.is_open

    asyncio.run(work())


@pytest.fixture(scope="module")
def mosquitto():
    program = shutil.which("mosquitto") or shutil.which("mosquitto", path="/usr/sbin")
    if program is None:
        pytest.skip("mosquitto is not installed")
    return program


@contextmanager
def broker(program, folder, port):
    config = folder / "mosquitto.conf"
    config.write_text(f"listener {port} 127.0.0.1\nallow_anonymous true\npersistence false\n", "utf-8")
    run = subprocess.Popen([program, "-c", str(config)], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    try:
        for _ in range(200):
            with socket.socket() as sock:
                if sock.connect_ex(("127.0.0.1", port)) == 0:
                    break
            time.sleep(0.05)
        yield run
    finally:
        run.kill()
        run.wait()


def test_mqtt_silence_hostile_payloads_and_a_killed_broker(tmp_path, mosquitto):
    port = free_port()
    process, clock = process_of(
        tmp_path,
        f'kind = "mqtt"\nurl = "mqtt://127.0.0.1:{port}"\n{OPEN_S}',
        addresses=("lathe/t#bearing.T1", "lathe/T2", "lathe/z"),
    )
    arrived = []

    async def lathe(client):
        async for message in client.messages:
            arrived.append((clock.monotonic(), float(message.payload)))

    async def say(client, bearing, second=b"20.0"):
        await client.publish(
            "lathe/t", bearing if isinstance(bearing, bytes) else json.dumps({"bearing": {"T1": bearing}}), qos=1
        )
        await client.publish("lathe/T2", second, qos=1)

    async def work():
        with broker(mosquitto, tmp_path, port):
            async with aiomqtt.Client("127.0.0.1", port) as client:
                # nobody knows how old it is
                await client.publish("lathe/t", b'{"bearing": {"T1": 29.0}}', qos=1, retain=True)
                await client.subscribe("lathe/z")
                listening = asyncio.create_task(lathe(client))
                await go(process, clock, 3)
                assert process.status()["sensors"] == {"T1": "MISSING", "T2": "MISSING"}
                await go(process, clock, 12, lambda _: say(client, 20.0))
                await go(process, clock, 40, lambda _: say(client, 24.0))
                assert process.given.correction_um["Z"] == pytest.approx(-8.0)
                for hostile in (
                    b"\xff\xfe",
                    b"[" * 60_000,
                    b'{"bearing": []}',
                    b'{"bearing": {"T1": "' + b"9" * 70_000,
                ):
                    await go(process, clock, 6, lambda _, text=hostile: say(client, text))
                    assert process.status()["sensors"] == {"T1": "MISSING"}
                await go(process, clock, 30, lambda _: say(client, 24.0))
                assert process.given.correction_um["Z"] == pytest.approx(-8.0)
                # silence: what was said last is too old
                await go(process, clock, 40)
                assert process.status()["sensors"] == {"T1": "MISSING", "T2": "MISSING"}
                assert process.given.correction_um["Z"] == 0.0
                listening.cancel()
        await go(process, clock, 15)
        assert process.status()["connections"] == {"plc": "lost"}
        with broker(mosquitto, tmp_path, port):
            async with aiomqtt.Client("127.0.0.1", port) as client:
                await client.subscribe("lathe/z")
                listening = asyncio.create_task(lathe(client))
                await go(process, clock, 60, lambda _: say(client, 24.0))
                assert process.given.correction_um["Z"] == pytest.approx(-8.0)
                assert arrived[-1][1] == pytest.approx(-8.0)
                listening.cancel()
        assert beyond_the_guard(arrived, late_s=1.0) == []
        await end(process)

    asyncio.run(work())


AGENT = """<?xml version="1.0" encoding="UTF-8"?>
<MTConnectStreams xmlns="urn:mtconnect.org:MTConnectStreams:1.7">
<Header creationTime="2026-03-01T10:00:{second:02d}Z" instanceId="7" bufferSize="64"
 firstSequence="{first}" lastSequence="{last}" nextSequence="{next}"/>
<Streams><DeviceStream name="lathe-3" uuid="u"><ComponentStream component="Spindle" name="S" componentId="s">
<Samples>{samples}</Samples></ComponentStream></DeviceStream></Streams></MTConnectStreams>"""
OBSERVED = (
    '<Temperature dataItemId="{item}" timestamp="2026-03-01T10:00:{second:02d}Z" sequence="{k}">{text}</Temperature>'
)


class Agent:
    """A small agent: a buffer of observations, current and sample; `broken` is sent in the place of an answer."""

    def __init__(self):
        self.buffer, self.broken = [], None
        agent = self

        class Handler(BaseHTTPRequestHandler):
            def do_GET(self):
                content = agent.answer(self.path)
                self.send_response(200)
                self.send_header("Content-Length", str(len(content)))
                self.end_headers()
                self.wfile.write(content)

            def log_message(self, *_):
                pass

        self.server = ThreadingHTTPServer(("127.0.0.1", 0), Handler)
        self.url = f"http://127.0.0.1:{self.server.server_port}"
        threading.Thread(target=self.server.serve_forever, daemon=True).start()

    def observe(self, second, item, text):
        self.buffer.append((len(self.buffer) + 1, second, item, text))

    def answer(self, path):
        if self.broken is not None:
            return self.broken
        shown, following = self.buffer, len(self.buffer) + 1
        if path.startswith("/sample"):
            start = int(path.partition("from=")[2].partition("&")[0])
            # a page is small here
            shown = [one for one in self.buffer if one[0] >= start][:7]
            following = shown[-1][0] + 1 if shown else start
        else:
            shown = list({one[2]: one for one in self.buffer}.values())
        samples = "".join(OBSERVED.format(k=k, second=s, item=i, text=t) for k, s, i, t in shown)
        second = max((one[1] for one in self.buffer), default=0)
        return AGENT.format(second=second, first=1, last=len(self.buffer), next=following, samples=samples).encode()

    def close(self):
        self.server.shutdown()
        self.server.server_close()


@pytest.fixture
def agent():
    running = Agent()
    yield running
    running.close()


def test_mtconnect_is_read_and_what_is_unavailable_is_missing(tmp_path, agent):
    path = tmp_path / "io.toml"
    text = io_text(f'kind = "mtconnect"\nurl = "{agent.url}"\n{OPEN_S}').replace(
        '[outputs.Z]\nat = "plc"', '[connections.file]\nkind = "file"\nurl = "z.csv"\n[outputs.Z]\nat = "file"'
    )
    path.write_text(text, "utf-8")
    clock = FastClock()
    process = Compensation(model(), read_io(path, model()), clock, tmp_path / "out")
    agent.observe(0, "T1", "20.0")
    agent.observe(0, "T2", "20.0")

    async def work():
        await go(process, clock, 12)
        agent.observe(10, "T1", "24.0")
        await go(process, clock, 40)
        assert process.given.correction_um["Z"] == pytest.approx(-8.0)
        agent.observe(20, "T1", "UNAVAILABLE")
        await go(process, clock, 30)
        assert process.status()["sensors"] == {"T1": "MISSING"}
        agent.observe(30, "T1", "24.0")
        await go(process, clock, 30)
        for broken in (b"", b"<html/>", b'<!DOCTYPE x [<!ENTITY a "aa">]><MTConnectStreams>&a;</MTConnectStreams>'):
            agent.broken = broken
            await go(process, clock, 8)
            assert process.status()["connections"]["plc"] == "lost"
            agent.broken = None
            await go(process, clock, 20)
            assert process.status()["connections"]["plc"] == "open"
        await end(process)

    asyncio.run(work())


@pytest.mark.parametrize("encoding", ["utf-8", "utf-16"])
def test_mtconnect_has_no_document_type_in_any_encoding(agent, encoding):
    head = f'<?xml version="1.0" encoding="{encoding}"?><!DOCTYPE x [<!ENTITY a "21.5">]>'
    agent.broken = f'{head}<MTConnectStreams><S dataItemId="T1">&a;</S></MTConnectStreams>'.encode(encoding)
    link = MTConnectLink(Connection(kind="mtconnect", url=agent.url, timeout_s=60.0))
    with pytest.raises(ValueError, match="document type"):
        asyncio.run(link.read(["T1"]))


def test_mtconnect_history_is_read_page_by_page(agent):
    for second in range(30):
        agent.observe(second, "T1", str(20.0 + second))
    link = MTConnectLink(Connection(kind="mtconnect", url=agent.url, timeout_s=60.0))
    begun_s = 1772359200.0  # 2026-03-01T10:00:00Z
    found = asyncio.run(link.history(["T1"], begun_s + 5.0, begun_s + 24.0))
    assert found == {"T1": [(begun_s + s, 20.0 + s) for s in range(5, 25)]}


@pytest.mark.skipif(shutil.which("halrun") is None, reason="LinuxCNC is not installed")
def test_hal_signals_are_read_and_written(tmp_path, monkeypatch):
    session = "loadrt threads name1=t period1=10000000\n"
    session += "".join(f"newsig {name} {kind}\n" for name, kind in (("T1", "float"), ("T2", "float"), ("Z", "float")))
    session += "newsig beat s32\nsets T1 20\nsets T2 20\nstart\nloadusr -w sh wait.sh\n"
    control = '[control]\nheartbeat = { at = "plc", address = "beat" }'
    process, clock = process_of(tmp_path, f'kind = "hal"\nurl = "hal"\n{OPEN_S}', control=control)
    # where nobody, as whom its realtime part runs for root, comes in
    with compiled.single_session(), tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        folder.chmod(0o777)
        for variable, value in compiled.environment(folder).items():
            monkeypatch.setenv(variable, value)
        (folder / "wait.sh").write_text("until [ -e over ]; do sleep 0.1; done", "ascii")
        (folder / "session.hal").write_text(session, "ascii")
        run = subprocess.Popen(
            ["halrun", "session.hal"], cwd=folder, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
        )

        def halcmd(*words):
            return subprocess.run(["halcmd", "-s", *words], capture_output=True, text=True, check=False).stdout.strip()

        async def work():
            for _ in range(300):
                if halcmd("gets", "Z") != "":
                    break
                await asyncio.sleep(0.05)
            await go(process, clock, 10)
            halcmd("sets", "T1", "24")
            await go(process, clock, 25)
            assert float(halcmd("gets", "Z")) == pytest.approx(-8.0)
            assert halcmd("gets", "beat") == "35"
            assert process.status()["mismatches"] == 0
            halcmd("sets", "T1", "nan")
            await go(process, clock, 20)
            assert process.status()["sensors"] == {"T1": "MISSING"}
            assert float(halcmd("gets", "Z")) == 0.0

        try:
            asyncio.run(work())
        finally:
            # the session lasts as long as there is no such file
            (folder / "over").write_text("yes", "ascii")
            run.wait(60)
    assert process.status()["connections"] == {"plc": "open"}
    # a name is a name, and no other command
    with pytest.raises(ValueError, match="no name of HAL"):
        asyncio.run(HalLink().write({"Z 1\nsets T1": 0.0}))
