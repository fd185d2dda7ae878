"""The lake: what is on disk after a kill, gaps that servers remember, days that close, who reads it."""

from __future__ import annotations

import asyncio
import json
import subprocess
import sys
import time

import numpy as np
import pandas as pd
import pyarrow.parquet as pq
import pytest

from selector.cli import exit_status
from selector.live.collecting import Collection, gap_rows
from selector.live.io_file import read_io
from selector.live.links import FastClock, Sample
from selector.readers import read
from tests.live.plants import io_text

BEGUN_S = 1_772_359_200.0  # 2026-03-01T10:00:00Z

IO = """
machine = "lathe-3"
period_s = 1.0
[connections.agent]
kind = "{kind}"
url = "{url}"
timeout_s = 5.0
[channels.T1]
at = "agent"
address = "t1"
unit = "degF"
place = "lower bearing"
[channels.Z]
at = "agent"
address = "z"
role = "displacement"
unit = "um"
axis = "Z"
"""


class Remembering:
    """A server with a buffer: a value a second, by a clock that is behind."""

    def __init__(self, clock, behind_s=0.0):
        self.clock, self.behind_s, self.is_cut = clock, behind_s, False

    async def open(self):
        if self.is_cut:
            raise ConnectionRefusedError

    def value(self, server_s):
        return {"t1": 68.0 + 1.8 * ((server_s + self.behind_s) % 600 // 10) / 10, "z": (server_s + self.behind_s) % 97}

    async def read(self, addresses):
        await self.open()
        server_s = self.clock.wall() - self.behind_s
        return {name: Sample(self.value(server_s)[name], source_s=server_s, age_s=0.0) for name in addresses}

    async def history(self, addresses, since_s, until_s):
        await self.open()
        moments = np.arange(np.ceil(since_s), np.floor(until_s) + 1)
        return {name: [(float(m), self.value(m)[name]) for m in moments] for name in addresses}

    async def close(self):
        pass


def collection(folder, begun_s=BEGUN_S, behind_s=0.0):
    path = folder / "io.toml"
    # never opened: an agent in memory takes its place
    path.write_text(IO.format(kind="mtconnect", url="http://agent"), "utf-8")
    clock = FastClock(begun_s)
    made = Collection(read_io(path), clock, folder / "lake")
    server = Remembering(clock, behind_s)
    made._links["agent"].link = server
    return made, server


def frames(folder):
    return {path: pq.ParquetFile(path).read().to_pandas() for path in sorted(folder.rglob("*.parquet"))}


def whole(folder):
    frame = pd.concat(frames(folder).values()).sort_values("time")
    assert not frame["time"].duplicated().any()
    return frame


def test_rows_are_in_canonical_units_and_say_what_they_are(tmp_path):
    made, _ = collection(tmp_path)
    done = asyncio.run(made.run(1500))
    assert done["rows"] == 1500
    files = frames(tmp_path / "lake")
    assert all(path.parent.name == "month=2026-03" and path.parent.parent.name == "machine=lathe-3" for path in files)
    # segments of ten minutes are one file in the end
    assert [path.name for path in files] == ["2026-03-01.parquet"]
    frame = whole(tmp_path / "lake")
    assert len(frame) == 1500
    assert frame["T1"].iloc[605] == pytest.approx(20.0)
    schema = pq.read_schema(next(iter(files)))
    assert schema.field("T1").metadata == {b"unit": b"degC", b"role": b"temperature", b"place": b"lower bearing"}
    assert schema.field("Z").metadata == {b"unit": b"um", b"role": b"displacement", b"axis": b"Z"}
    reading = read([tmp_path / "lake"])
    assert reading.recording.frame.shape == (1500, 2)
    assert {c.name: (c.role, c.place, c.axis) for c in reading.recording.channels} == {
        "T1": ("temperature", "lower bearing", None), "Z": ("displacement", None, "Z"),
    }  # fmt: skip


def test_days_close_into_one_file_each(tmp_path):
    made, _ = collection(tmp_path, begun_s=BEGUN_S + 14 * 3600 - 900)  # a quarter of an hour before midnight
    asyncio.run(made.run(1800))
    names = [path.name for path in frames(tmp_path / "lake")]
    assert names == ["2026-03-01.parquet", "2026-03-02.parquet"]
    assert len(whole(tmp_path / "lake")) == 1800


@pytest.mark.parametrize("behind_s", [0.0, 250.0])
def test_a_gap_is_filled_from_what_the_server_remembers(tmp_path, behind_s):
    made, server = collection(tmp_path, behind_s=behind_s)

    async def work():
        for second in range(120):
            server.is_cut = 40 <= second < 80
            await made.step()
            await made._clock.sleep_until(made._clock.monotonic() + 1.0)
        await asyncio.gather(*made._filling)
        made._lake.flush()

    asyncio.run(work())
    frame = whole(tmp_path / "lake")
    seconds = frame["time"].astype("int64") / 1e6 - BEGUN_S
    assert list(seconds) == list(range(120))
    assert list(frame["Z"]) == [(BEGUN_S + second) % 97 for second in range(120)]
    received = frame["received"].astype("int64") / 1e6 - BEGUN_S
    assert (received - seconds).iloc[60] > 20.0
    assert (received - seconds).iloc[100] == 0.0
    source = frame["source_time"].astype("int64") / 1e6 - BEGUN_S
    assert (seconds - source).unique() == pytest.approx(behind_s)


def test_a_second_start_fills_what_the_first_had_not_written(tmp_path):
    made, _ = collection(tmp_path)

    async def killed():
        for _ in range(115):
            await made.step()
            await made._clock.sleep_until(made._clock.monotonic() + 1.0)

    asyncio.run(killed())  # nothing is flushed, as by kill -9, which ends the lock
    made._lock.close()
    (name,) = (path.name for path in frames(tmp_path / "lake"))
    assert name == "2026-03-01T100000.000000Z.parquet"
    assert 105 <= len(whole(tmp_path / "lake")) < 115
    again, _ = collection(tmp_path, begun_s=BEGUN_S + 300.0)
    asyncio.run(again.run(50))
    frame = whole(tmp_path / "lake")
    assert len(frame) == 350
    assert list(frame["Z"]) == [(BEGUN_S + second) % 97 for second in range(350)]


def test_a_damaged_file_is_told_and_left_alone(tmp_path):
    made, _ = collection(tmp_path)
    asyncio.run(made.run(30))
    (path,) = frames(tmp_path / "lake")
    bad = path.with_name("2026-03-01T090000.000000Z.parquet")
    bad.write_bytes(path.read_bytes()[:500])
    again, _ = collection(tmp_path, begun_s=BEGUN_S + 86400.0)
    asyncio.run(again.run(10))
    assert bad.stat().st_size == 500
    assert "file-unreadable" in (tmp_path / "lake/machine=lathe-3/journal/journal.jsonl").read_text()
    assert len(pq.read_table(path.with_name("2026-03-01.parquet"))) >= 30


def test_values_hold_until_the_next_and_nothing_is_invented_before_the_first():
    history = {"a": [(10.0, 1.0), (12.5, 2.0)], "b": []}
    rows = gap_rows(history, ["a", "b"], 8.0, 15.0, 1.0, 99.0)
    assert [(row[0], row[1], row[3]) for row in rows] == [
        (10.0, 10.0, 1.0), (11.0, 10.0, 1.0), (12.0, 10.0, 1.0), (13.0, 12.5, 2.0), (14.0, 12.5, 2.0),
    ]  # fmt: skip
    assert all(np.isnan(row[4]) and row[2] == 99.0 for row in rows)


def test_killed_at_any_moment_the_lake_can_be_read(tmp_path, capsys):
    rows = "\n".join(f"{0.01 * k},{68 + 0.001 * k},{k % 50}" for k in range(100_000))
    (tmp_path / "day.csv").write_text(f"time_s,t1,z\n{rows}\n")
    text = IO.format(kind="file", url="day.csv").replace("period_s = 1.0", "period_s = 0.02")
    (tmp_path / "io.toml").write_text(text, "utf-8")
    run = subprocess.Popen(
        [sys.executable, "-m", "selector", "collect", str(tmp_path / "io.toml"), "--out", str(tmp_path / "lake")],
        stdout=subprocess.DEVNULL,
    )
    try:
        # the first file is written at the second row
        while not list((tmp_path / "lake").rglob("*Z.parquet")):
            assert run.poll() is None
            time.sleep(0.1)
    finally:
        run.kill()
        run.wait()
    before = len(whole(tmp_path / "lake"))
    assert before > 1
    left = [path.name for path in (tmp_path / "lake").rglob("*") if path.is_file()]
    assert all(name.endswith((".parquet", ".toml", ".jsonl")) or name.startswith(".") for name in left)
    arguments = ["collect", str(tmp_path / "io.toml"), "--out", str(tmp_path / "lake"), "--cycles", "120", "--json"]
    assert exit_status(arguments) == 0
    capsys.readouterr()
    assert exit_status(["describe", str(tmp_path / "lake"), "--json"]) == 0
    described = json.loads(capsys.readouterr().out)
    assert {c["name"]: (c["role"], c["unit"]) for c in described["channels"]} == {
        "T1": ("temperature", "degC"), "Z": ("displacement", "um"),
    }  # fmt: skip
    assert sum(run["rows"] for run in described["runs"]) == len(whole(tmp_path / "lake")) > before


def test_a_lake_of_two_machines_asks_for_one(tmp_path, capsys):
    for name in ("a", "b"):
        (tmp_path / f"machine={name}" / "month=2026-03").mkdir(parents=True)
    assert exit_status(["describe", str(tmp_path)]) == 2
    assert "machine=a, machine=b" in capsys.readouterr().err


def test_what_is_refused_leaves_no_lake_behind(tmp_path, capsys):
    (tmp_path / "io.toml").write_text(io_text('kind = "file"\nurl = "no.csv"'), "utf-8")
    assert exit_status(["collect", str(tmp_path / "io.toml"), "--out", str(tmp_path / "lake")]) == 2
    assert "no such file" in capsys.readouterr().err
    assert not (tmp_path / "lake").exists()


def test_a_late_period_and_one_in_time_are_not_two_rows_of_one_moment(tmp_path):
    made, _ = collection(tmp_path)

    async def work():
        for moment_s in (0.0, 1.6, 2.0, 3.0):
            await made._clock.sleep_until(moment_s)
            await made.step()

    asyncio.run(work())
    # what a killed process leaves is not merged any more
    assert made._rows == 3


def test_a_process_that_begins_again_in_the_same_period_writes_no_second_row_of_it(tmp_path):
    first = collection(tmp_path)[0]
    assert asyncio.run(first.run(3))["rows"] == 3
    # the last row is of the second moment after the first
    assert asyncio.run(collection(tmp_path, BEGUN_S + 2.2)[0].run(2))["rows"] == 1
