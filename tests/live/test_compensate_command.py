"""`compensate` through the command line: a recorded day as files, and what is refused."""

from __future__ import annotations

import asyncio
import csv
import json
import os
import signal
import subprocess
import sys
from contextlib import closing

import pytest

from selector.cli import exit_status
from selector.controllers import sealed
from selector.controllers.model_file import write_model
from selector.live.compensating import Compensation
from selector.live.io_file import read_io
from selector.live.journal import Journal
from selector.live.links import FastClock
from tests.live.plants import beyond_the_guard, model
from tests.patience import PATIENCE_S

IO = """
period_s = 1.0
[connections.day]
kind = "file"
url = "day.csv"
[connections.program]
kind = "file"
url = "given.csv"
[channels.T1]
at = "day"
address = "PT1"
unit = "degF"
[channels.T2]
at = "day"
address = "PT2"
[outputs.Z]
at = "program"
address = "Z"
unit = "mm"
"""


@pytest.fixture
def folder(tmp_path):
    write_model(sealed(model()), tmp_path / "model.json")
    (tmp_path / "io.toml").write_text(IO, "utf-8")
    rows = [[second, 68.0 + 1.8 * min(0.05 * second, 5.0), 20.0] for second in range(200)]
    with (tmp_path / "day.csv").open("w", newline="") as file:
        csv.writer(file).writerows([["time_s", "PT1", "PT2"], *rows])
    return tmp_path


def command(folder, *more):
    return exit_status(
        ["compensate", str(folder / "model.json"), "--io", str(folder / "io.toml"), "--out", str(folder / "out"), *more]
    )


def test_a_recorded_day(folder, capsys):
    assert command(folder, "--fast", "--json") == 0
    status = json.loads(capsys.readouterr().out)
    assert status["schema"] == "selector.compensation/1"
    with (folder / "given.csv").open() as file:
        arrived = [(float(row["time_s"]), float(row["Z"])) for row in csv.DictReader(file)]
    assert beyond_the_guard(arrived, unit=1e-3) == []
    # 5 K at 2 um/K, in mm, and at the end back to zero
    assert min(value for _, value in arrived) == pytest.approx(-0.01)
    assert arrived[-1][1] == 0.0
    # at the end ramped, not dropped: no step beyond 0.5 um in a second
    assert 0.0 < -arrived[-2][1] <= 0.5e-3 + 1e-12
    assert status["rows_out"] == status["rows_confirmed"] == len(arrived)
    assert {path.name for path in (folder / "out").iterdir()} == {
        ".lock", "journal.jsonl", "kept.json", "metrics.prom", "status.html", "status.json",
    }  # fmt: skip
    page = (folder / "out" / "status.html").read_text("utf-8")
    for words in ("not a safety function", "<th>correction<td>Z 0 µm", "<th>follows<td>switched off", "all are well"):
        assert words in page
    assert f"selector_live_cycles {len(arrived)}.0" in (folder / "out" / "metrics.prom").read_text("utf-8")


HOLDING = """
import sys, time
from pathlib import Path
from selector.live.journal import Journal
from selector.live.links import FastClock
lock = Journal(Path(sys.argv[1]), FastClock()).locked()
print("locked", flush=True)
time.sleep(600)
"""


@pytest.mark.parametrize("name", ["compensate", "collect"])
def test_a_folder_is_for_one_process_until_that_dies(folder, capsys, name):
    place = folder / "out" if name == "compensate" else folder / "out" / "machine=machine" / "journal"
    (folder / "given.csv").write_text("time_s,Z\n", "utf-8")

    def ask():
        if name == "compensate":
            return command(folder, "--fast")
        return exit_status(["collect", str(folder / "io.toml"), "--out", str(folder / "out"), "--cycles", "1"])

    with subprocess.Popen([sys.executable, "-c", HOLDING, str(place)], stdout=subprocess.PIPE) as other:
        try:
            assert other.stdout.readline() == b"locked\n"
            assert ask() == 2
            said = capsys.readouterr().err
            # the other one's machine file is not touched, either
            assert [path.name for path in place.iterdir()] == [".lock"]
            assert name == "compensate" or not (place.parent / "machine.toml").exists()
        finally:
            other.kill()
    assert "another process" in said
    assert str(place) in said
    assert not (place / "journal.jsonl").exists()
    assert ask() == 0


@pytest.mark.parametrize("content", [b"no lock at all" * 400, None], ids=["bytes", "folder"])
def test_a_lock_that_cannot_be_had_is_told(folder, capsys, content):
    lock = folder / "out" / ".lock"
    lock.parent.mkdir()
    lock.mkdir() if content is None else lock.write_bytes(content)
    assert command(folder, "--fast") == 2
    said = capsys.readouterr().err
    assert "another process" not in said
    assert "delete .lock" in said


def test_a_lock_needs_no_room_on_a_full_disk(folder):
    with closing(Journal(folder / "out", FastClock()).locked()):
        # the journal of a transaction would be the first byte
        assert [(path.name, path.stat().st_size) for path in (folder / "out").iterdir()] == [(".lock", 0)]


@pytest.mark.skipif(os.name != "posix", reason="Ctrl-C ends at once elsewhere")
def test_a_second_ctrl_c_does_not_say_that_nothing_was_written(folder, capsys, monkeypatch):
    async def run(process, cycles):
        for _ in range(2):
            os.kill(os.getpid(), signal.SIGINT)
            await asyncio.sleep(0.01)
        await asyncio.sleep(PATIENCE_S)

    monkeypatch.setattr(Compensation, "run", run)
    assert command(folder) == 130
    said = capsys.readouterr().err
    # something was written, and to what
    assert "control" in said
    assert "Nothing" not in said


def test_rows_that_are_broken_are_no_readings_and_end(folder, capsys):
    text = (folder / "day.csv").read_text("utf-8")
    broken = text.replace("\n50,", "\nnoon,").replace("\n60,", '\n60\n"\n').replace("\n70,", "\n70,,\n71,")
    (folder / "day.csv").write_text(broken + "9" * 200_000, "utf-8")
    assert command(folder, "--fast", "--json") == 0
    assert 50 < json.loads(capsys.readouterr().out)["cycles"] < 300
    (folder / "day.csv").write_text(text.replace(",", ";").replace(".", ","), "utf-8")
    before = sorted((folder / "out").iterdir())
    assert command(folder, "--fast") == 2
    said = capsys.readouterr().err
    assert "a file with other columns: time_s;PT1" in said
    assert "CSV with commas and columns time_s, PT1" in said
    assert sorted((folder / "out").iterdir()) == before


def test_a_day_whose_times_go_back_is_refused(folder, capsys):
    text = (folder / "day.csv").read_text("utf-8")
    # two rows of one moment go on; a second run below the first does not
    (folder / "day.csv").write_text(text.replace("\n50,", "\n49,"), "utf-8")
    assert command(folder, "--fast") == 0
    before = (folder / "given.csv").read_bytes()
    (folder / "day.csv").write_text(text.replace("\n50,", "\nnoon,\n48.5,"), "utf-8")
    capsys.readouterr()
    assert command(folder, "--fast") == 2
    said = " ".join(capsys.readouterr().err.split())
    assert "time_s goes back from 49 to 48.5" in said
    assert "day.csv" in said
    assert (folder / "given.csv").read_bytes() == before


@pytest.mark.parametrize(
    ("old", "new", "told"),
    [
        ('"day.csv"', '"no.csv"', "no such file"),
        ("[channels.T1]", "[channels.T9]", "'T1'"),
        ('at = "program"', 'at = "nowhere"', "nowhere"),
        ('unit = "mm"', 'unit = "furlong"', "furlong"),
        ('unit = "degF"', 'unit = "mm"', "does not fit role"),
        ('kind = "file"\nurl = "given.csv"', 'kind = "mtconnect"\nurl = "http://agent"', "MTConnect"),
        ('url = "given.csv"', 'url = "opc.tcp://me:secret@plc"', "password_env"),
        ("period_s = 1.0", "period_s = 0", "period_s"),
        ("period_s = 1.0", "period_s = 6", "stale_after_s = 5"),
        ("period_s = 1.0", "period_s = 1e-9", "0.001"),
        ('address = "PT2"', 'address = "PT1"', "'PT1' for both T1 and T2"),
        ('url = "given.csv"', 'url = "day.csv"', "other columns"),
        ('address = "PT1"', 'address = "PT7"', "columns time_s, PT7"),
        ('kind = "file"\nurl = "day.csv"', 'kind = "opcua"\nurl = "opc.tcp://plc:4840"', "key channels.T1\n"),
        ('at = "program"', 'at = "day"', "other columns"),
        ("period_s = 1.0", "perid_s = 1.0", "period_s"),
        ("period_s = 1.0", 'period_s = 1.0\nmachine = "lathe 3"', "letters, digits"),
        ("[outputs.Z]", "[outputs.Q]", "'Z'"),
    ],
)
def test_an_io_file_that_cannot_be_used(folder, capsys, old, new, told):
    text = (folder / "io.toml").read_text("utf-8")
    assert old in text
    (folder / "io.toml").write_text(text.replace(old, new, 1), "utf-8")
    assert command(folder, "--fast") == 2
    error = capsys.readouterr().err
    assert told in error
    assert "secret@" not in error
    assert not (folder / "given.csv").exists()
    assert not (folder / "out").exists()


def test_a_password_is_a_secret(folder, capsys, monkeypatch):
    text = (folder / "io.toml").read_text("utf-8").replace('url = "day.csv"', 'url = "day.csv"\nuser = "me"\n{}')
    secret = folder / "secret"
    secret.write_text("s3cret\n", "utf-8")
    secret.chmod(0o644)
    (folder / "io.toml").write_text(text.format('password_file = "secret"'), "utf-8")
    if os.name == "posix":
        assert command(folder, "--fast") == 2
        assert "chmod 600" in capsys.readouterr().err
    secret.chmod(0o600)
    assert read_io(folder / "io.toml", model()).connections["day"].password() == "s3cret"
    (folder / "io.toml").write_text(text.format('password_env = "LATHE_PASSWORD"'), "utf-8")
    assert command(folder, "--fast") == 2
    assert "LATHE_PASSWORD" in capsys.readouterr().err
    monkeypatch.setenv("LATHE_PASSWORD", "other")
    assert read_io(folder / "io.toml", model()).connections["day"].password() == "other"
