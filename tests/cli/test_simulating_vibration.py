"""`selector simulate vibration`: what it writes, what it tells, what it refuses, and that other commands read it."""

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
EXAMPLES = sorted((ROOT / "fixtures" / "vibration").glob("*.toml"))

TURNED = """
[model]
kind = "vibration"
name = "a small lathe"
[run]
period_s = 0.0005
duration_s = 0.5
seed = 5
[members.workpiece]
mass_kg = 40.0
[members.tool]
mass_kg = 10.0
[members.bed]
mass_kg = 600.0
[[joints]]
between = ["bed", "ground"]
stiffness_n_per_m = 4.0e8
dissipation = 0.6
[[joints]]
between = ["workpiece", "bed"]
stiffness_n_per_m = 1.0e8
dissipation = 0.3
[[joints]]
between = ["tool", "bed"]
stiffness_n_per_m = 4.0e6
dissipation = 0.3
[shafts.spindle]
rpm = 600.0
[sources.motor]
member = "tool"
lines = [{ frequency_hz = 90.0, force_n = 4.0 }, { frequency_hz = 300.0, force_n = 2.0 }]
[sources.spindle]
member = "workpiece"
shaft = "spindle"
lines = [{ order = 2.0, force_n = 6.0 }, { order = 1.0, unbalance_kg_m = 0.001 }]
[[chains]]
name = "motor to tool"
range = "low"
sources = ["motor"]
path = ["tool", "bed"]
final = "tool"
[cutting]
shaft = "spindle"
diameter_mm = 60.0
feed_mm_per_rev = 0.2
force_coefficient = 243.0
depth_exponent = 0.9
feed_exponent = 0.6
speed_exponent = -0.3
[sensing]
noise_um = 0.01
"""


@pytest.fixture
def folder(tmp_path, monkeypatch) -> Path:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "model.toml").write_text(TURNED, encoding="utf-8")
    return tmp_path


def simulated(capfd, *arguments: str) -> dict:
    """The JSON of a simulation."""
    capfd.readouterr()
    code = exit_status(["simulate", "vibration", *arguments, "--json"])
    out, err = capfd.readouterr()
    assert code == 0, err
    return json.loads(out, parse_constant=pytest.fail)


def refused(capfd, *arguments: str) -> str:
    """What stderr says of input that nobody can use."""
    before = sorted(path.name for path in Path.cwd().rglob("*"))
    assert exit_status(["simulate", "vibration", *arguments, "--json"]) == 2
    out, err = capfd.readouterr()
    assert out == ""
    for part in ("Where:", "Expected:", "What to do:"):
        assert part in err
    assert "Traceback" not in err
    assert sorted(path.name for path in Path.cwd().rglob("*")) == before, "something was written"
    return err


def test_a_recording_with_its_machine_file_is_written_and_read_back(folder, capfd):
    shown = simulated(capfd, "model.toml", "--out", "run.csv")
    assert (shown["schema"], shown["kind"], shown["seed"]) == ("selector.simulation/1", "vibration", 5)
    assert shown["files"] == ["run.csv", "run.machine.toml"]
    reading = read([Path("run.csv")], machine=Path("run.machine.toml"))
    assert "SIMULATED" in (reading.machine.machine.name or "")
    assert [channel["name"] for channel in shown["channels"]] == list(reading.recording.names)
    assert all(channel.guessed == () for channel in reading.channels)
    assert {"displacement", "force", "spindle_speed"} == {c.role for c in reading.recording.channels}
    (run,) = shown["runs"]
    assert (run["rows"], run["duration_s"]) == (1001, 0.5)
    table = pd.read_csv("run.csv")
    np.testing.assert_allclose(table["tool_workpiece"], table["tool"] - table["workpiece"], atol=1e-12)


def test_the_numbers_are_those_of_the_recording_and_of_each_other(folder, capfd):
    quiet = TURNED.replace("noise_um = 0.01", "noise_um = 0.0")
    Path("quiet.toml").write_text(quiet, encoding="utf-8")
    told = simulated(capfd, "quiet.toml", "--out", "run.csv")["vibration"]
    assert (told["method"], told["comparison"], told["shaft_rpm"]) == ("coupled", None, {"spindle": 600.0})
    lines = told["lines"]
    assert [(one["source"], one["frequency_hz"]) for one in lines] == [
        ("spindle", 10.0), ("spindle", 20.0), ("motor", 90.0), ("motor", 300.0),
    ]  # fmt: skip
    # 0.5 s are whole periods of every line, so that the mean squares of the lines add up, but for the last sample
    course = pd.read_csv("run.csv")["tool_workpiece"].to_numpy()[:-1]
    squares = sum(one["motion_um"]["tool_workpiece"] ** 2 / 2.0 for one in lines)
    assert np.mean(course**2) == pytest.approx(squares, rel=1e-9)
    assert told["amplitudes"]["tool_workpiece"]["rms_um"] == pytest.approx(math.sqrt(squares), rel=0.05)
    # 4 phases of 2 sources
    assert told["amplitudes"]["tool"]["realisations"] == 16
    for one, line in zip(told["periodic_errors"], lines, strict=True):
        assert one["kinematic_um"] == pytest.approx(2.0 * line["motion_um"]["tool_workpiece"], rel=1e-9)
        assert one["waves_per_revolution"] == pytest.approx(line["frequency_hz"] / 10.0, rel=1e-12)
        assert one["wavelength_mm"] == pytest.approx(math.pi * 60.0 * 10.0 / line["frequency_hz"], rel=1e-12)
    assert [one["kind"] for one in told["periodic_errors"]] == ["runout", "lobing", "lobing", "waviness"]
    lobes = [one["kinematic_um"] for one in told["periodic_errors"] if one["kind"] == "lobing"]
    assert told["heights"]["lobing"]["kinematic_um"] == pytest.approx(math.hypot(*lobes), rel=1e-12)
    # wavelength 0.8 mm at 600 r/min on 60 mm
    assert told["split_hz"] == pytest.approx(math.pi * 60.0 * 10.0 / 0.8, rel=1e-12)


def test_modes_and_chains_are_told(folder, capfd):
    told = simulated(capfd, "model.toml", "--out", "run.csv")["vibration"]
    assert len(told["modes"]) == 3
    first = told["modes"][0]
    # the tool alone on its joint: √(4e6/10)/2π = 100.7 Hz, the heavy bed takes a percent or two of it
    assert first["frequency_hz"] == pytest.approx(100.7, rel=0.02)
    assert first["shape"]["tool"] == pytest.approx([1.0, 0.0], abs=1e-15)  # rounding of the machine at hand
    assert all(math.hypot(*part) <= 1.0 for one in told["modes"] for part in one["shape"].values())
    (chain,) = told["chains"]
    assert (chain["chain"], chain["source"], chain["final"]) == ("motor to tool", "motor", "tool")
    share = chain["published"]["share_within"]
    assert 0.0 < share < 1.0
    assert chain["published"]["bands_hz"][0][0] == chain["from_hz"]
    motor = next(one for one in told["lines"] if one["frequency_hz"] == 300.0)
    assert motor["chains_um"]["workpiece"] is None
    assert motor["chains_um"]["tool"] == pytest.approx(motor["coupled_um"]["tool"], rel=0.1)


def test_the_method_of_the_file_makes_the_recording(folder, capfd):
    Path("chains.toml").write_text(TURNED.replace("seed = 5", 'seed = 5\nmethod = "chains"'), encoding="utf-8")
    told = simulated(capfd, "chains.toml", "--out", "run.csv")["vibration"]
    assert told["method"] == "chains"
    for one in told["lines"]:
        # where no chain leads there is no motion
        assert one["motion_um"]["tool"] == (one["chains_um"]["tool"] or 0.0)


@pytest.mark.parametrize("example", EXAMPLES, ids=lambda path: path.stem)
def test_every_example_runs_and_is_read_back(example, folder, capfd):
    shown = simulated(capfd, str(example), "--out", "run.csv", "--report", "page.html")
    # of the lathe: eq. 2 of the source makes of inertia forces what no motion can cut, and that is said
    assert {one["id"] for one in shown["findings"] if one["level"] != "info"} <= {"height-beyond-motion"}
    reading = read([Path("run.csv")], machine=Path(shown["machine_file"]))
    assert [channel["name"] for channel in shown["channels"]] == list(reading.recording.names)
    assert np.isfinite(reading.recording.frame.to_numpy()).all()
    page = Path("page.html").read_text(encoding="utf-8")
    assert re.search(r'<p class="first">The (highest periodic error|tool moves)', page)


def test_the_seed_decides_phases_and_noise_and_nothing_else(folder, capfd):
    told = {}
    for name, seed in (("a", "1"), ("b", "1"), ("c", "3")):
        shown = simulated(capfd, "model.toml", "--out", f"{name}.csv", "--seed", seed)
        assert shown["seed"] == int(seed)
        told[name] = shown["vibration"]
    a, b, c = (pd.read_csv(f"{name}.csv") for name in "abc")
    pd.testing.assert_frame_equal(a, b)
    assert (a["motor_force"] != c["motor_force"]).any()
    assert (a["spindle_speed"] == c["spindle_speed"]).all()
    assert told["a"] == told["c"]


def test_recorded_speeds_drive_it_and_what_was_recorded_is_laid_beside_it(folder, capfd):
    Path("faster.toml").write_text(TURNED.replace("rpm = 600.0", "rpm = 900.0"), encoding="utf-8")
    simulated(capfd, "faster.toml", "--out", "r1.csv")
    # the speed alone drives it, not the forces
    recorded = pd.read_csv("r1.csv").drop(columns=["motor_force", "spindle_force"])
    recorded.to_csv("r1.csv", index=False)
    machine = re.sub(r"\[channels\.(motor|spindle)_force\][^\[]*", "", Path("r1.machine.toml").read_text("utf-8"))
    Path("m.toml").write_text(machine, encoding="utf-8")
    shown = simulated(
        capfd, "model.toml", "--inputs", "r1.csv", "--machine", "m.toml", "--out", "sim", "--report", "p.html"
    )
    assert sorted(Path(file).name for file in shown["files"]) == ["machine.toml", "r1.csv"]
    told = shown["vibration"]
    assert told["shaft_rpm"] == {"spindle": pytest.approx(900.0)}
    compared = {one["channel"]: one for one in told["comparison"]}
    assert set(compared) == {"tool", "workpiece", "tool_workpiece"}
    again = pd.read_csv("sim/r1.csv")
    off = again["tool"] - recorded["tool"]
    assert compared["tool"]["rms"] == pytest.approx(np.sqrt(np.mean(off**2)), rel=1e-6, abs=1e-12)
    # the same model, speeds and phases: what differs is the noise of the recording, 0.01 µm to 1/√(2·1001) = 2.2 %;
    # the speed is bridged from rounded corners
    assert compared["tool"]["rms"] == pytest.approx(0.01, rel=0.1)
    assert shown["seed"] is None
    assert "and recorded" in Path("p.html").read_text(encoding="utf-8")


def test_for_people(folder, capfd):
    assert exit_status(["simulate", "vibration", "model.toml", "--out", "run.csv", "--all"]) == 0
    out, err = capfd.readouterr()
    for text in (
        "a small lathe", "Modes of the coupled structure", "Lines of the sources", "16 combinations", "Height by kind",
        "lobing", "Chains against the coupled structure", "--machine run.machine.toml",
    ):  # fmt: skip
        assert text in out
    assert "\x1b" not in out + err


BAD = {
    "mass_kg = 40.0": "mass_kg = -40.0",
    "stiffness_n_per_m = 1.0e8": "stiffness_n_per_m = 0.0",
    "dissipation = 0.6": "dissipation = -0.6",
    "feed_mm_per_rev = 0.2": "feed_mm_per_rev = 0.0",
    'member = "workpiece"': 'member = "chuck"',
    'path = ["tool", "bed"]': 'path = ["tool", "workpiece"]',
    "period_s = 0.0005": "period_s = 0.005",
    "noise_um = 0.01": "noise_um = -1.0",
    "[run]": "[rum]",
}


@pytest.mark.parametrize(("good", "bad"), BAD.items(), ids=BAD.values())
def test_values_that_cannot_be_are_refused_with_their_key(good, bad, folder, capfd):
    assert good in TURNED
    Path("bad.toml").write_text(TURNED.replace(good, bad, 1), encoding="utf-8")
    assert "bad.toml, key" in refused(capfd, "bad.toml", "--out", "run.csv", "--report", "page.html")


def test_a_resonance_that_nothing_damps_is_refused_with_the_file(folder, capfd):
    # the tool on ground alone, and its frequency hit to the last digit
    text = TURNED.replace('between = ["tool", "bed"]', 'between = ["tool", "ground"]')
    text = text.replace(
        "stiffness_n_per_m = 4.0e6\ndissipation = 0.3", f"stiffness_n_per_m = {10.0 * (2 * math.pi * 90.0) ** 2!r}"
    )
    Path("bad.toml").write_text(text[: text.index("[[chains]]")] + text[text.index("[cutting]") :], encoding="utf-8")
    said = refused(capfd, "bad.toml", "--out", "run.csv")
    assert "bad.toml, joints" in said
    assert "90 Hz" in said


def test_a_model_of_another_kind_says_which_command_it_belongs_to(folder, capfd):
    thermal = ROOT / "fixtures" / "thermal" / "headstock.toml"
    assert "simulate thermal" in refused(capfd, str(thermal), "--out", "run.csv")
    assert exit_status(["simulate", "drive", "model.toml", "--out", "run.csv"]) == 2
    assert "simulate vibration" in capfd.readouterr().err


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["nothing.toml", "--out", "run.csv"], "nothing.toml"),
        (["model.toml"], "--out"),
        (["model.toml", "--out", "run.xlsx"], ".csv"),
        (["model.toml", "--out", "model.toml/run.csv"], "model.toml"),
        (["model.toml", "--out", "run.csv", "--seed", "-1"], "--seed"),
        (["model.toml", "--out", "run.csv", "--machine", "model.toml"], "--inputs"),
        (["model.toml", "--out", "run.csv", "--report", "page.txt"], ".html"),
        (["model.toml", "--out", "sim", "--inputs", "nothing.csv"], "nothing.csv"),
        (["model.toml", "--out", "sim", "--inputs", "day.csv"], "spindle"),
        (["model.toml", "--out", "day.csv", "--inputs", "day.csv"], "one of the inputs"),
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


@pytest.mark.skipif(sys.platform == "win32", reason="Ctrl-C is sent to a process in another way there")
def test_ctrl_c_leaves_nothing_behind(folder, capfd):
    # 200 lines that follow a shaft through two million samples
    lines = ", ".join(f"{{ order = {1.0 + k / 100}, force_n = 1.0 }}" for k in range(200))
    text = TURNED.replace("duration_s = 0.5", "duration_s = 900.0").replace(
        "lines = [{ order", f"lines = [{lines}, {{ order"
    )
    text = text.replace("rpm = 600.0", "rpm = [[0.0, 600.0], [900.0, 900.0]]")
    Path("slow.toml").write_text(text, encoding="utf-8")
    before = sorted(path.name for path in folder.iterdir())
    capfd.readouterr()
    assert exit_status_interrupted_in("run_up", "simulate", "vibration", "slow.toml", "--out", "run.csv") == 130
    out, err = capfd.readouterr()
    assert out == ""
    assert "Nothing" in err
    assert sorted(path.name for path in folder.iterdir()) == before
