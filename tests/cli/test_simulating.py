"""`selector simulate thermal`: what it writes, what it refuses, and that other commands read it."""

from __future__ import annotations

import json
import shutil
import sys
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from selector.cli import exit_status
from selector.readers import read
from selector.telling import page as telling_page
from tests.interruptible import exit_status_interrupted_in

ROOT = Path(__file__).resolve().parents[2]
# candidates.toml is simulated by tests/scenarios/test_placement_job.py, c-frame.toml by the page of models of machines,
# which tests/docs/test_snippets.py goes through
EXAMPLES = sorted(
    path for path in (ROOT / "fixtures" / "thermal").glob("*.toml") if path.stem not in ("candidates", "c-frame")
)

ONE_NODE = """
[model]
kind = "network"
name = "one node"
[run]
duration_min = 30
[conditions]
spindle_speed_rpm = 1000
[nodes.block]
heat_capacity_j_per_k = 2e4
expansion_um_per_k = { Z = 3.0 }
[films.air]
area_m2 = { block = 0.5 }
still_w_per_m2_k = 20.0
[sources.bearing]
shares = { block = 1.0 }
speed_w = 100.0
[[sensors]]
name = "T1"
at = "block"
noise_k = 0.02
[[gauges]]
name = "Z"
noise_um = 0.2
"""


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("model.toml").write_text(ONE_NODE, encoding="utf-8")
    Path("more.csv").write_text("time_s,spindle_speed\n0,1000\n600,0\n", encoding="utf-8")
    Path("cycle.csv").write_text("time_s,spindle_speed\n0,1000\n600,0\n900,2000\n1200,0\n", encoding="utf-8")
    return tmp_path


def simulated(capfd, *arguments: str) -> dict:
    """The JSON of a simulation."""
    capfd.readouterr()
    code = exit_status(["simulate", "thermal", *arguments, "--json"])
    out, err = capfd.readouterr()
    assert (code, err) == (0, "")
    return json.loads(out, parse_constant=pytest.fail)


def refused(capfd, *arguments: str) -> str:
    """What stderr says of input that nobody can use."""
    before = sorted(path.name for path in Path.cwd().rglob("*"))
    assert exit_status(["simulate", "thermal", *arguments, "--json"]) == 2
    out, err = capfd.readouterr()
    assert out == ""
    assert "What to do" in err
    assert "Traceback" not in err
    assert sorted(path.name for path in Path.cwd().rglob("*")) == before, "something was written"
    return err


@pytest.mark.parametrize("example", EXAMPLES, ids=lambda path: path.stem)
def test_every_example_runs_and_is_read_back(example, folder, capfd):
    shown = simulated(capfd, str(example), "--out", "run.csv", "--report", "page.html")
    assert shown["schema"] == "selector.simulation/1"
    assert shown["files"] == ["run.csv", "run.machine.toml"]
    assert shown["machine_file"] == "run.machine.toml"
    assert shown["findings"] == []
    reading = read([Path("run.csv")], machine=Path("run.machine.toml"))
    assert "SIMULATED" in (reading.machine.machine.name or "")
    assert [channel["name"] for channel in shown["channels"]] == list(reading.recording.names)
    assert all(channel.guessed == () for channel in reading.channels)
    assert np.isfinite(reading.recording.frame.to_numpy()).all()
    assert {"spindle_speed", "displacement"} <= {channel.role for channel in reading.recording.channels}
    assert reading.recording.with_role("displacement")
    (run,) = shown["runs"]
    assert run["rows"] == len(reading.recording.frame)
    assert run["balance"] is None or run["balance"]["missing_share"] < 1e-9
    # a body of finite elements has a surface
    has_surface = "the surface is up to" in Path("page.html").read_text(encoding="utf-8")
    assert has_surface == (example.stem == "field")
    # the hottest displacement of an example is of the order that machine tools have
    assert 10.0 < max(c["max"] for c in shown["channels"] if c["role"] == "displacement") < 300.0


def test_the_files_are_the_plain_form_that_convert_writes(folder, capfd):
    simulated(capfd, "model.toml", "--out", "run.csv")
    assert exit_status(["convert", "run.csv", "--machine", "run.machine.toml", "--out", "again"]) == 0
    assert Path("again/run.csv").read_bytes() == Path("run.csv").read_bytes()
    assert Path("again/machine.toml").read_bytes() == Path("run.machine.toml").read_bytes()


def test_the_seed_decides_the_noise_and_nothing_else(folder, capfd):
    for name, seed in (("a", "1"), ("b", "1"), ("c", "2")):
        simulated(capfd, "model.toml", "--out", f"{name}.csv", "--seed", seed)
    a, b, c = (pd.read_csv(f"{name}.csv") for name in "abc")
    pd.testing.assert_frame_equal(a, b)
    assert (a["spindle_speed"] == c["spindle_speed"]).all()
    assert (a["T1"] != c["T1"]).any()
    # six standard deviations of the noise of a difference
    assert np.abs(a["T1"] - c["T1"]).max() < 6 * 0.02 * np.sqrt(2)


def test_a_duty_cycle_takes_the_place_of_the_schedule(folder, capfd):
    shown = simulated(capfd, "model.toml", "--out", "run.csv", "--cycle", "cycle.csv")
    table = pd.read_csv("run.csv")
    assert shown["runs"][0]["duration_s"] == table["time_s"].iloc[-1] == 1200.0
    held = np.select([table["time_s"] < 600, table["time_s"] < 900], [1000.0, 0.0], 2000.0)
    np.testing.assert_array_equal(table["spindle_speed"], held)


def test_recorded_runs_drive_the_model(folder, capfd):
    Path("runs").mkdir()
    for name, minutes in (("r1", 20), ("r2", 30)):
        t = np.arange(0.0, minutes * 60.0, 45.0)
        speed = np.where(t < 600, 1500.0, 0.0)
        table = pd.DataFrame({"t [s]": t, "n [rpm]": speed, "hall [degC]": 20 + t / 3600, "gauge Z [um]": 0 * t})
        table.to_csv(f"runs/{name}.csv", index=False)
    shown = simulated(capfd, "model.toml", "--out", "sim", "--inputs", "runs")
    assert sorted(Path(file).name for file in shown["files"]) == ["machine.toml", "r1.csv", "r2.csv"]
    assert [run["run"] for run in shown["runs"]] == ["r1", "r2"]
    assert shown["seed"] is None
    recorded, model = read([Path("runs")]).recording, read([Path("sim")]).recording
    shared = set(recorded.names) & set(model.names)
    assert shared == set(recorded.names)
    for run in recorded.runs:
        np.testing.assert_array_equal(recorded.time_s(run), model.time_s(run))
        for name in recorded.with_role("spindle_speed", "ambient"):
            np.testing.assert_array_equal(recorded.values(run, [name]), model.values(run, [name]))
    (z,) = recorded.with_role("displacement")
    assert model.values("r2", [z]).max() > 1.0
    single = simulated(capfd, "model.toml", "--out", "one.csv", "--inputs", "runs/r1.csv")
    assert single["files"] == ["one.csv", "one.machine.toml"]
    assert Path("one.csv").read_bytes() == Path("sim/r1.csv").read_bytes()
    # once more into the folder that is there
    assert simulated(capfd, "model.toml", "--out", "sim", "--inputs", "runs")["files"] == shown["files"]


def test_a_simulation_that_drives_the_model_gives_itself(folder, capfd):
    # finite elements are the same code behind matrices that take seconds to make and to step
    for example in (path for path in EXAMPLES if path.stem not in ("field", "c-frame")):
        simulated(capfd, str(example), "--out", "run.csv", "--seed", "1")
        simulated(capfd, str(example), "--out", "sim", "--inputs", "run.csv", "--machine", "run.machine.toml")
        noisy, clean = pd.read_csv("run.csv"), pd.read_csv("sim/run.csv")
        machine = read([Path("run.csv")], machine=Path("run.machine.toml"))
        for channel in machine.channels:
            difference = np.abs(noisy[channel.column] - clean[channel.column])
            # inputs exactly; readings within six standard deviations and a step of the coarsest instrument here
            limit = {"temperature": 0.5, "displacement": 2.5}.get(channel.role, 0.0)
            assert difference.max() <= limit, channel.name


def test_a_course_from_a_file_beside_the_model(folder, capfd):
    Path("data").mkdir()
    t = np.arange(0.0, 40.0, 1.0)
    table = pd.DataFrame({"t [min]": t, "hall [degF]": 68.0 + t / 10})
    table.to_csv("data/day.csv", index=False)
    text = ONE_NODE.replace("= 1000\n", '= 1000\nambient_degc = { file = "data/day.csv", column = "hall" }\n')
    Path("day.toml").write_text(text, encoding="utf-8")
    simulated(capfd, "day.toml", "--out", "run.csv")
    hall = pd.read_csv("run.csv")["ambient"]
    np.testing.assert_allclose(hall, 20.0 + t[: len(hall)] / 18.0, atol=1e-9)  # °F to °C in double precision


@pytest.mark.parametrize(
    ("file", "column"),
    [("../day.csv", "hall"), ("/etc/hostname", "hall"), ("link.csv", "hall"), ("nothing.csv", "hall"),
     ("cycle.csv", "hall"), ("model.toml", "hall"), (".", "hall")],
)  # fmt: skip
def test_a_course_from_elsewhere_is_refused(file, column, folder, capfd):
    outside = folder.parent / f"{folder.name}-outside.csv"
    outside.write_text("time_s,hall\n0,20\n60,21\n", encoding="utf-8")
    Path("link.csv").symlink_to(outside)
    text = ONE_NODE.replace("= 1000\n", f'= 1000\nambient_degc = {{ file = "{file}", column = "{column}" }}\n')
    Path("day.toml").write_text(text, encoding="utf-8")
    refused(capfd, "day.toml", "--out", "run.csv")


def test_names_that_a_spreadsheet_would_run_are_written_harmlessly(folder, capfd):
    text = ONE_NODE.replace('name = "T1"', "name = '=cmd|/c calc!A1'").replace('"one node"', '"=1+1"')
    Path("formula.toml").write_text(text, encoding="utf-8")
    shown = simulated(capfd, "formula.toml", "--out", "run.csv")
    header = Path("run.csv").read_text(encoding="utf-8").splitlines()[0]
    assert not any(cell.startswith(("=", "+", "-", "@")) for cell in header.split(","))
    reading = read([Path("run.csv")], machine=Path("run.machine.toml"))
    assert "=cmd|/c calc!A1" in reading.recording.names
    assert shown["channels"][2]["name"] == "=cmd|/c calc!A1"


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["nothing.toml", "--out", "run.csv"], "nothing.toml"),
        ([".", "--out", "run.csv"], "a folder"),
        (["cycle.csv", "--out", "run.csv"], "TOML"),
        (["model.toml"], "--out"),
        (["model.toml", "--out", "run.xlsx"], ".csv"),
        (["model.toml", "--out", "."], ".csv"),
        (["model.toml", "--out", "model.toml/run.csv"], "model.toml"),
        (["model.toml", "--out", "run.csv", "--seed", "-1"], "--seed"),
        (["model.toml", "--out", "run.csv", "--cycle", "nothing.csv"], "nothing.csv"),
        (["model.toml", "--out", "run.csv", "--cycle", "model.toml"], "model.toml"),
        (["model.toml", "--out", "cycle.csv", "--cycle", "cycle.csv"], "one of the inputs"),
        (["model.toml", "--out", "run.csv", "--machine", "model.toml"], "--inputs"),
        (["model.toml", "--out", "sim", "--inputs", "cycle.csv", "--cycle", "cycle.csv"], "leave one out"),
        (["model.toml", "--out", "sim", "--inputs", "nothing.csv"], "nothing.csv"),
        (["model.toml", "--out", "cycle.csv", "--inputs", "cycle.csv"], "one of the inputs"),
        (["model.toml", "--out", "cycle.csv", "--inputs", "."], "--out simulated"),
        (["model.toml", "--out", "model.toml", "--inputs", "cycle.csv"], "folder"),
        (["model.toml", "--out", ".", "--inputs", "cycle.csv"], "one of the inputs"),
    ],
    ids=lambda value: " ".join(value) if isinstance(value, list) else None,
)
def test_a_command_that_cannot_be_done(arguments, said, folder, capfd):
    assert said in refused(capfd, *arguments)


def test_the_model_file_is_never_replaced(folder, capfd):
    shutil.copy("model.toml", "run.machine.toml")
    assert "inputs" in refused(capfd, "run.machine.toml", "--out", "run.csv")
    shutil.copy("model.toml", "model.csv")
    assert "inputs" in refused(capfd, "model.csv", "--out", "model.csv")


def test_what_was_measured_is_never_replaced(folder, capfd):
    measured = "time_s,T1\n0,20\n60,21\n"
    Path("day.csv").write_text(measured, encoding="utf-8")
    assert "day.csv exists" in refused(capfd, "model.toml", "--out", "day.csv")
    Path("day.machine.toml").write_text('[machine]\nname = "lathe"\n', encoding="utf-8")
    assert "day.csv exists" in refused(capfd, "model.toml", "--out", "day.csv")
    Path("runs").mkdir()
    Path("runs/cycle.csv").write_text(measured, encoding="utf-8")
    assert "cycle.csv exists" in refused(capfd, "model.toml", "--inputs", "cycle.csv", "--out", "runs")
    Path("page.html").write_text("<title>Something</title>", encoding="utf-8")
    assert "page of a simulation" in refused(capfd, "model.toml", "--out", "run.csv", "--report", "page.html")
    assert Path("day.csv").read_text(encoding="utf-8") == measured
    assert Path("runs/cycle.csv").read_text(encoding="utf-8") == measured
    for seed in ("1", "2"):
        simulated(capfd, "model.toml", "--out", "run.csv", "--seed", seed)


@pytest.mark.parametrize("error", [KeyboardInterrupt, OSError])
@pytest.mark.parametrize("late", [False, True])
def test_a_page_that_fails_leaves_no_recording(late, error, folder, capfd, monkeypatch):
    simulated(capfd, "model.toml", "--out", "old.csv")
    old = {path.name: path.read_bytes() for path in folder.iterdir()}
    if late:
        moved = Path.replace

        def stops(path, target):
            if Path(target).name.endswith("machine.toml") and path.parent.name.endswith(".part"):
                monkeypatch.setattr(Path, "replace", moved)
                raise error
            return moved(path, target)

        # the last of the files cannot take its place
        monkeypatch.setattr(Path, "replace", stops)
    else:

        def fails(*_):
            raise error

        monkeypatch.setattr(telling_page, "write_account", fails)
    line = ["simulate", "thermal", "model.toml", "--seed", "7", "--out", "old.csv", "--report", "pages/a.html"]
    assert exit_status(line) == (130 if error is KeyboardInterrupt else 2)
    assert {path.name: path.read_bytes() for path in folder.iterdir()} == old


@pytest.mark.skipif(not Path("/dev/null").exists(), reason="no such folder on this system")
def test_devices_are_no_place_for_files(folder, capfd):
    assert "devices" in refused(capfd, "model.toml", "--out", "/dev/stdout.csv")


def test_a_column_for_the_speed(folder, capfd):
    Path("day.csv").write_text("time_s,n [rpm],Z [um]\n0,1000,0\n600,0,3\n1800,0,5\n", encoding="utf-8")
    for column in ("nope", "n", "Z"):
        text = ONE_NODE.replace("rpm = 1000\n", f'rpm = {{ file = "day.csv", column = "{column}" }}\n')
        Path(f"{column}.toml").write_text(text, encoding="utf-8")
    said = refused(capfd, "nope.toml", "--out", "run.csv")
    assert "key conditions.spindle_speed_rpm.column" in said
    assert "--role" not in said
    assert simulated(capfd, "n.toml", "--out", "run.csv")["findings"] == []
    refused(capfd, "Z.toml", "--out", "other.csv")


def test_a_run_shorter_than_a_period_is_refused(folder, capfd):
    Path("short.toml").write_text(ONE_NODE.replace("duration_min = 30", "duration_min = 0.5"), encoding="utf-8")
    assert "run.duration_min" in refused(capfd, "short.toml", "--out", "run.csv")
    Path("brief.csv").write_text("time_s,spindle_speed\n0,1000\n30,0\n", encoding="utf-8")
    assert "brief.csv" in refused(capfd, "model.toml", "--out", "run.csv", "--cycle", "brief.csv")


def test_for_people(folder, capfd):
    assert exit_status(["simulate", "thermal", "model.toml", "--out", "run.csv", "--all"]) == 0
    out, err = capfd.readouterr()
    for text in ("Simulation: one node", "warms most", "T1", "highest", "--machine run.machine.toml"):
        assert text in out
    assert "\x1b" not in out + err


@pytest.mark.skipif(sys.platform == "win32", reason="Ctrl-C is sent to a process in another way there")
def test_ctrl_c_leaves_nothing_behind(folder, capfd):
    text = ONE_NODE.replace("duration_min = 30", "duration_min = 900000\nperiod_s = 60\nstep_s = 60")
    slow = text.replace("speed_w = 100.0", 'speed_w = 100.0\nsoftening_per_k = 0.01\nat = "block"')
    Path("slow.toml").write_text(slow, encoding="utf-8")
    before = sorted(path.name for path in folder.iterdir())
    capfd.readouterr()
    assert exit_status_interrupted_in("simulate_heat", "simulate", "thermal", "slow.toml", "--out", "run.csv") == 130
    out, err = capfd.readouterr()
    assert out == ""
    assert "Nothing" in err
    assert sorted(path.name for path in folder.iterdir()) == before
