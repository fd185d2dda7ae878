"""`selector simulate drive`: what it writes, what it tells, what it refuses, and that other commands read it."""

from __future__ import annotations

import json
import math
import re
import shutil
import sys
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from selector.cli import exit_status
from selector.readers import read
from tests.interruptible import exit_status_interrupted_in

ROOT = Path(__file__).resolve().parents[2]
# those whose courses are recordings beside them run where they are
EXAMPLES = [
    path
    for path in sorted((ROOT / "fixtures" / "drive").glob("*.toml"))
    if 'kind = "column"' not in path.read_text(encoding="utf-8")
]

RIGID = """
[model]
kind = "drive"
name = "a slide"
[run]
period_s = 0.001
[motion]
kind = "moves"
targets_mm = [40.0, 0.0]
feed_mm_per_min = 6000.0
acceleration_m_per_s2 = 2.0
jerk_m_per_s3 = 50.0
dwell_s = 0.1
[axes.X.mechanics]
kind = "rigid"
mass_kg = 95.0
guide_damping_ns_per_m = 200.0
[axes.X.friction]
coulomb_n = 20.0
[axes.X.servo]
position_gain_per_s = 100.0
velocity_gain = 200.0
actuator_gain = 35.0
command_limit = 20.0
sample_s = 0.001
[axes.X.sensing]
current_noise = 0.001
"""

CIRCLE = """
[model]
kind = "drive"
name = "a circle"
[motion]
kind = "circle"
radius_mm = 50.0
feeds_mm_per_min = [3000.0, 6000.0]
[ball_bar]
squareness_um_per_m = 100.0
""" + "".join(
    f"""
[axes.{name}.mechanics]
kind = "rigid"
mass_kg = 95.0
guide_damping_ns_per_m = 200.0
[axes.{name}.servo]
position_gain_per_s = {gain}
velocity_gain = 200.0
actuator_gain = 35.0
"""
    for name, gain in (("X", 100.0), ("Y", 98.0))
)


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("model.toml").write_text(RIGID, encoding="utf-8")
    Path("circle.toml").write_text(CIRCLE, encoding="utf-8")
    return tmp_path


def simulated(capfd, *arguments: str) -> dict:
    """The JSON of a simulation."""
    capfd.readouterr()
    code = exit_status(["simulate", "drive", *arguments, "--json"])
    out, err = capfd.readouterr()
    assert code == 0, err
    return json.loads(out, parse_constant=pytest.fail)


def refused(capfd, *arguments: str) -> str:
    """What stderr says of input that nobody can use."""
    before = sorted(path.name for path in Path.cwd().rglob("*"))
    assert exit_status(["simulate", "drive", *arguments, "--json"]) == 2
    out, err = capfd.readouterr()
    assert out == ""
    for part in ("Where:", "Expected:", "What to do:"):
        assert part in err
    assert "Traceback" not in err
    assert sorted(path.name for path in Path.cwd().rglob("*")) == before, "something was written"
    return err


def test_a_recording_with_its_machine_file_is_written_and_read_back(folder, capfd):
    shown = simulated(capfd, "model.toml", "--out", "run.csv")
    assert (shown["schema"], shown["kind"]) == ("selector.simulation/1", "drive")
    assert shown["files"] == ["run.csv", "run.machine.toml"]
    reading = read([Path("run.csv")], machine=Path("run.machine.toml"))
    assert "SIMULATED" in (reading.machine.machine.name or "")
    assert [channel["name"] for channel in shown["channels"]] == list(reading.recording.names)
    assert all(channel.guessed == () for channel in reading.channels)
    assert {"position_command", "position", "displacement", "current"} <= {c.role for c in reading.recording.channels}
    (run,) = shown["runs"]
    assert run["rows"] == len(reading.recording.frame)
    (axis,) = shown["drive"]["axes"]
    error = pd.read_csv("run.csv")["X_error"].to_numpy()
    (told,) = axis["runs"]
    assert (axis["axis"], axis["unit"], told["run"]) == ("X", "um", "run")
    # the file and the JSON hold the same numbers up to the digits of a float in text
    assert told["max"] == pytest.approx(np.abs(error).max(), rel=1e-12)
    assert told["rms"] == pytest.approx(np.sqrt(np.mean(error**2)), rel=1e-12)
    table = pd.read_csv("run.csv")
    assert table["time_s"][int(np.argmax(np.abs(error)))] == pytest.approx(told["max_at_s"], abs=1e-12)


@pytest.mark.parametrize("example", EXAMPLES, ids=lambda path: path.stem)
def test_every_example_runs_and_is_read_back(example, folder, capfd):
    text = example.read_text(encoding="utf-8")
    # a turn of 100 mm at 100 mm/min takes six minutes of the machine
    text = re.sub(r"feeds_mm_per_min = .*", "feeds_mm_per_min = [5000.0, 8000.0]", text)
    text = re.sub(r"radius_mm = .*", "radius_mm = 40.0", text)
    Path("example.toml").write_text(text, encoding="utf-8")
    is_circle = "feeds_mm_per_min" in text
    shown = simulated(capfd, "example.toml", "--out", "circles" if is_circle else "run.csv")
    assert not [one for one in shown["findings"] if one["level"] != "info"]
    reading = read([Path("circles" if is_circle else "run.csv")], machine=Path(shown["machine_file"]))
    assert [channel["name"] for channel in shown["channels"]] == list(reading.recording.names)
    assert np.isfinite(reading.recording.frame.to_numpy()).all()
    assert (shown["drive"]["ball_bar"] is not None) == is_circle
    for axis in shown["drive"]["axes"]:
        assert axis["loop"]["stable"] is True
        for run in axis["runs"]:
            # an axis follows its command: between a micrometre and some centimetres of lag
            assert 1.0 < run["max"] < 5e4


def test_the_loop_is_told_with_its_poles_and_limits(folder, capfd):
    (axis,) = simulated(capfd, "model.toml", "--out", "run.csv")["drive"]["axes"]
    loop = axis["loop"]
    assert loop["stable"] is True
    assert max(real for real, _ in loop["poles_per_s"]) == pytest.approx(-loop["margin_per_s"], rel=1e-12)
    assert 5 < loop["bandwidth_hz"] < 100
    assert loop["gain_margin_db"] > 6
    # a larger gain by this factor is at the edge: a little below it is stable, a little above it is not
    limit = loop["gain_limits"]["position_gain_per_s"]
    for factor, stable in ((0.99 * limit, True), (1.01 * limit, False)):
        text = RIGID.replace("position_gain_per_s = 100.0", f"position_gain_per_s = {100.0 * factor}")
        Path("other.toml").write_text(text, encoding="utf-8")
        shown = simulated(capfd, "other.toml", "--out", f"{stable}.csv")
        assert shown["drive"]["axes"][0]["loop"]["stable"] is stable
        assert ("unstable-loop" in [one["id"] for one in shown["findings"]]) is not stable


def test_a_loop_that_runs_away_is_refused_with_its_poles_and_the_gain(folder, capfd):
    text = RIGID.replace("position_gain_per_s = 100.0", "position_gain_per_s = 2500.0").replace("command_limit", "#")
    Path("wild.toml").write_text(text.replace("dwell_s = 0.1", "dwell_s = 5.0"), encoding="utf-8")
    said = refused(capfd, "wild.toml", "--out", "run.csv")
    assert "poles at" in said
    assert "position_gain_per_s" in said


def test_the_seed_decides_the_noise_and_nothing_else(folder, capfd):
    for name, seed in (("a", "1"), ("b", "1"), ("c", "2")):
        assert simulated(capfd, "model.toml", "--out", f"{name}.csv", "--seed", seed)["seed"] == int(seed)
    a, b, c = (pd.read_csv(f"{name}.csv") for name in "abc")
    pd.testing.assert_frame_equal(a, b)
    assert (a["X_command"] == c["X_command"]).all()
    assert (a["X_current"] != c["X_current"]).any()


def test_recorded_runs_are_followed_and_give_themselves(folder, capfd):
    quiet = RIGID.replace("current_noise = 0.001", "current_noise = 0.0")
    Path("quiet.toml").write_text(quiet, encoding="utf-8")
    simulated(capfd, "quiet.toml", "--out", "r1.csv")
    shown = simulated(capfd, "quiet.toml", "--inputs", "r1.csv", "--machine", "r1.machine.toml", "--out", "sim")
    assert sorted(Path(file).name for file in shown["files"]) == ["machine.toml", "r1.csv"]
    first, again = pd.read_csv("r1.csv"), pd.read_csv("sim/r1.csv")
    np.testing.assert_array_equal(first["time_s"], again["time_s"])
    # speeds of a recorded command are derived from it: without feed-forward they do not act
    assert np.abs(first["X_table"] - again["X_table"]).max() < 1e-12
    opened = simulated(
        capfd, "quiet.toml", "--inputs", "r1.csv", "--machine", "r1.machine.toml", "--open-loop", "--out", "open.csv"
    )
    assert opened["files"] == ["open.csv", "open.machine.toml"]
    # the recorded output drives the same mass: positions agree to the rounding that adds up over a second
    assert np.abs(first["X_table"] - pd.read_csv("open.csv")["X_table"]).max() < 1e-9


def test_a_ball_bar_test_is_a_folder_of_runs_with_its_quantities_and_causes(folder, capfd):
    shown = simulated(capfd, "circle.toml", "--out", "test")
    assert [run["run"] for run in shown["runs"]] == ["F3000 ccw", "F3000 cw", "F6000 ccw", "F6000 cw"]
    assert Path(shown["machine_file"]).name == "machine.toml"
    bar = shown["drive"]["ball_bar"]
    assert [one["feed_mm_per_min"] for one in bar["quantities"]] == [3000.0, 6000.0]
    deviation = read([Path("test")]).recording.frame["deviation"]
    highest = max(one["both"]["radial_max"]["um"] for one in bar["quantities"])
    # about the least-squares centre, which is a rounding away from the set-up's here
    assert deviation.max() == pytest.approx(highest, abs=0.5)
    fast = bar["causes"]["feeds"][-1]
    found = {(one["cause"], one["axis"]) for one in fast["causes"] if one["found"]}
    assert {("squareness", None), ("gain-mismatch", None)} <= found
    square = next(one for one in fast["causes"] if one["cause"] == "squareness")["amounts"]["squareness"]
    # what was planted, within a hundredth: lags are of second order here
    assert square["value"] == pytest.approx(100.0, rel=0.01)
    # what is told of an axis is about what was recorded of it
    recording = read([Path("test")], machine=Path("test/machine.toml")).recording
    for axis in shown["drive"]["axes"]:
        for run in axis["runs"]:
            error = recording.values(run["run"], [f"{axis['axis']}_error"])[:, 0]
            worst = int(np.argmax(np.abs(error)))
            assert run["max"] == pytest.approx(abs(error[worst]), rel=1e-12)
            assert run["max_at_s"] == pytest.approx(recording.time_s(run["run"])[worst], abs=1e-12)
            assert run["rms"] == pytest.approx(np.sqrt(np.mean(error**2)), rel=1e-12)
            assert np.hypot.reduce(list(run["parts_rms"].values())) == pytest.approx(run["rms"], rel=1e-9)
    lost = next(one for one in fast["causes"] if one["cause"] == "backlash")
    assert "wind-up" in lost["meaning"]
    # one mass has no spring that friction could wind up
    assert lost["wind_up_um"] == 0.0
    assert "folder" in refused(capfd, "circle.toml", "--out", "test.csv")


def test_for_people(folder, capfd):
    assert exit_status(["simulate", "drive", "model.toml", "--out", "run.csv", "--all"]) == 0
    out, err = capfd.readouterr()
    for text in ("a slide", "is off its command", "Tracking error", "bandwidth", "µm", "--machine run.machine.toml"):
        assert text in out
    assert "\x1b" not in out + err
    assert exit_status(["simulate", "drive", "circle.toml", "--out", "test"]) == 0
    out, _ = capfd.readouterr()
    for text in ("ISO 230-4", "squareness", "position gains that differ"):
        assert text in out


BAD = {
    "mass_kg = 95.0": "mass_kg = -95.0",
    'kind = "rigid"': 'kind = "elastic"',
    "coulomb_n": "coulomb_m",
    "sample_s = 0.001": 'sample_s = "fast"',
    'name = "a slide"': 'name = ""',
    "velocity_gain = 200.0": "velocity_gain = nan",
    "[run]": "[rum]",
    "period_s = 0.001": "period_s = 1e-9",
    "targets_mm = [40.0, 0.0]": "targets_mm = []",
}


@pytest.mark.parametrize(("good", "bad"), BAD.items(), ids=BAD.values())
def test_values_that_cannot_be_are_refused_with_their_key(good, bad, folder, capfd):
    assert good in RIGID
    Path("bad.toml").write_text(RIGID.replace(good, bad, 1), encoding="utf-8")
    said = refused(capfd, "bad.toml", "--out", "run.csv")
    assert "bad.toml, key" in said


def test_a_screw_without_lead_is_refused(folder, capfd):
    screw = """kind = "three-mass"
motor_inertia_kg_m2 = 0.003
screw_inertia_kg_m2 = 0.003
table_mass_kg = 500.0
lead_m = 0.0
torsional_stiffness_nm_per_rad = 1e4
axial_stiffness_n_per_m = 1e8
"""
    text = RIGID.replace('kind = "rigid"\nmass_kg = 95.0\n', screw)
    Path("bad.toml").write_text(text, encoding="utf-8")
    assert "key axes.X.mechanics.lead_m" in refused(capfd, "bad.toml", "--out", "run.csv")


HOSTILE = {
    "no TOML": "[model",
    "a key of a million parts": "a" + ".a" * 100_000 + " = 1",
    "nested arrays": "a = " + "[" * 5000 + "]" * 5000,
    "a huge number": "[model]\nkind = 1" + "0" * 5000,
    "not text": "\x00\x01",
}


@pytest.mark.parametrize("text", HOSTILE.values(), ids=HOSTILE)
def test_text_that_is_no_model_file_is_refused(text, folder, capfd):
    Path("bad.toml").write_text(text, encoding="utf-8")
    # reading takes milliseconds; hours would be what these texts are made for
    refused(capfd, "bad.toml", "--out", "run.csv")


def test_a_model_of_another_kind_says_which_command_it_belongs_to(folder, capfd):
    thermal = ROOT / "fixtures" / "thermal" / "headstock.toml"
    assert "simulate thermal" in refused(capfd, str(thermal), "--out", "run.csv")
    assert exit_status(["simulate", "thermal", "model.toml", "--out", "run.csv"]) == 2
    assert "simulate drive" in capfd.readouterr().err


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["nothing.toml", "--out", "run.csv"], "nothing.toml"),
        (["model.toml"], "--out"),
        (["model.toml", "--out", "run.xlsx"], ".csv"),
        (["model.toml", "--out", "model.toml/run.csv"], "model.toml"),
        (["model.toml", "--out", "run.csv", "--seed", "-1"], "--seed"),
        (["model.toml", "--out", "run.csv", "--machine", "model.toml"], "--inputs"),
        (["model.toml", "--out", "run.csv", "--open-loop"], "--inputs"),
        (["model.toml", "--out", "run.csv", "--report", "page.txt"], ".html"),
        (["model.toml", "--out", "sim", "--inputs", "nothing.csv"], "nothing.csv"),
        (["model.toml", "--out", "sim", "--inputs", "day.csv"], "command"),
        (["model.toml", "--out", "day.csv", "--inputs", "day.csv"], "one of the inputs"),
        (["circle.toml", "--out", "circles.csv"], "--out simulated"),
    ],
    ids=lambda value: " ".join(value) if isinstance(value, list) else None,
)
def test_a_command_that_cannot_be_done(arguments, said, folder, capfd):
    Path("day.csv").write_text("time_s,T1\n0,20\n60,21\n120,21.5\n", encoding="utf-8")
    assert said in refused(capfd, *arguments)


def test_nothing_foreign_is_replaced(folder, capfd):
    shutil.copy("model.toml", "run.machine.toml")
    assert "inputs" in refused(capfd, "run.machine.toml", "--out", "run.csv")
    Path("day.csv").write_text("time_s,T1\n0,20\n60,21\n", encoding="utf-8")
    assert "day.csv exists" in refused(capfd, "model.toml", "--out", "day.csv")
    Path("page.html").write_text("<title>Something</title>", encoding="utf-8")
    assert "page of a simulation" in refused(capfd, "model.toml", "--out", "new.csv", "--report", "page.html")
    for seed in ("1", "2"):
        simulated(capfd, "model.toml", "--out", "new.csv", "--seed", seed, "--report", "new.html")


@pytest.mark.skipif(not Path("/dev/null").exists(), reason="no such folder on this system")
def test_devices_are_no_place_for_files(folder, capfd):
    assert "devices" in refused(capfd, "model.toml", "--out", "/dev/run.csv")
    assert "devices" in refused(capfd, "circle.toml", "--out", "/dev/circles")


def test_a_course_from_a_file_beside_the_model(folder, capfd):
    t = np.arange(0.0, 1.0, 0.001)
    s = 30.0 * (1.0 - np.cos(2.0 * math.pi * t))
    pd.DataFrame({"t [s]": t, "s [mm]": s, "n [rpm]": 0.0 * t}).to_csv("course.csv", index=False)
    text = RIGID[: RIGID.index("[motion]")] + RIGID[RIGID.index("[axes.X.mechanics]") :]
    for column in ("s", "q"):
        motion = f'[motion]\nkind = "column"\nfile = "course.csv"\ncolumn = "{column}"\nunit = "mm"\n'
        Path(f"{column}.toml").write_text(text + motion, encoding="utf-8")
    simulated(capfd, "s.toml", "--out", "run.csv")
    np.testing.assert_allclose(pd.read_csv("run.csv")["X_command"], s * 1e-3, atol=1e-12)  # mm to m in double precision
    assert "key motion.column" in refused(capfd, "q.toml", "--out", "other.csv")
    outside = folder.parent / f"{folder.name}.csv"
    shutil.copy("course.csv", outside)
    Path("s.toml").write_text(text + motion.replace("course.csv", f"../{outside.name}"), encoding="utf-8")
    assert f"../{outside.name}" in refused(capfd, "s.toml", "--out", "other.csv")


@pytest.mark.skipif(sys.platform == "win32", reason="Ctrl-C is sent to a process in another way there")
def test_ctrl_c_leaves_nothing_behind(folder, capfd):
    text = RIGID.replace("dwell_s = 0.1", "dwell_s = 40.0\nrepeat = 20").replace("period_s = 0.001", "step_s = 1e-4")
    Path("slow.toml").write_text(text, encoding="utf-8")
    before = sorted(path.name for path in folder.iterdir())
    capfd.readouterr()
    assert exit_status_interrupted_in("simulate_axis", "simulate", "drive", "slow.toml", "--out", "run.csv") == 130
    out, err = capfd.readouterr()
    assert out == ""
    assert "Nothing" in err
    assert sorted(path.name for path in folder.iterdir()) == before


EMPS = ROOT / "fixtures" / "emps"


@pytest.mark.parametrize(
    ("record", "machine", "position_um", "voltage_share", "said"),
    [
        ("DATA_EMPS", "machine", 1.617, 0.0457, ["nothing-added"]),
        ("DATA_EMPS_PULSES", "machine-pulses", 1.939, 0.0513, []),
    ],
)
def test_the_real_drive_is_laid_beside_its_records(record, machine, position_um, voltage_share, said, folder, capfd):
    files = ["--inputs", str(EMPS / f"{record}.mat"), "--machine", str(EMPS / f"{machine}.toml")]
    shown = simulated(capfd, str(EMPS / "emps.toml"), *files, "--out", "closed", "--report", "page.html")
    assert [one["id"] for one in shown["findings"]] == said
    position, output = shown["drive"]["comparison"]
    # as docs/explanation/emps-drive.md has it, and the digits that another rounding of the encoder may move
    assert (position["channel"], position["unit"]) == ("position", "um")
    assert position["rms"] == pytest.approx(position_um, rel=0.01)
    assert output["channel"] == "command"
    assert output["kind"] == ("total" if record.endswith("PULSES") else "output")
    assert output["relative"] == pytest.approx(voltage_share, rel=0.01)
    # the same by hand from the two files
    closed = pd.read_csv(f"closed/{record}.csv")
    recorded = read([EMPS / f"{record}.mat"], machine=EMPS / f"{machine}.toml").recording.values(record, ["position"])
    off = 1e6 * (closed["position"].to_numpy() - recorded[:, 0])
    assert position["rms"] == pytest.approx(np.sqrt(np.mean(off**2)), rel=1e-6)
    assert position["largest"] == pytest.approx(np.abs(off).max(), rel=1e-6)
    assert closed["time_s"][int(np.argmax(np.abs(off)))] == pytest.approx(position["largest_at_s"], abs=1e-9)
    page = re.sub(r"<script.*?</script>", "", Path("page.html").read_text(encoding="utf-8"), flags=re.DOTALL)
    first = re.search(r'<p class="first">(.*?)</p>', page)[1]
    assert "position" in first
    assert f" {position_um:.2f} µm rms" in first
    opened = simulated(capfd, str(EMPS / "emps.toml"), *files, "--open-loop", "--out", "opened")
    # forces of 0.05 N too much or too little are millimetres after seconds
    (free,) = opened["drive"]["comparison"]
    assert 4000 < free["rms"] < 9000


def test_a_motion_of_the_file_is_compared_with_nothing(folder, capfd):
    assert simulated(capfd, "model.toml", "--out", "run.csv")["drive"]["comparison"] is None


def test_differences_are_shown_on_the_screen(folder, capfd):
    simulated(capfd, "model.toml", "--out", "run.csv")
    line = ["simulate", "drive", "model.toml", "--inputs", "run.csv", "--machine", "run.machine.toml", "--out", "again"]
    capfd.readouterr()
    assert exit_status([*line, "--seed", "7"]) == 0
    assert "minus recorded" in capfd.readouterr().out
