"""`selector simulate gauging`: what it writes, what it tells, what it refuses, and that other commands read it."""

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
from selector.physics.gauging import gauging_summary
from selector.readers import read
from tests.interruptible import exit_status_interrupted_in
from tests.physics.gauging.quick_trials import shorten_trials

ROOT = Path(__file__).resolve().parents[2]
EXAMPLES = sorted((ROOT / "fixtures" / "gauging").glob("*.toml"))

LINE = """
[model]
kind = "gauging"
name = "a gauge as a line"
[run]
parts = 3
seed = 5
[linear]
gain_v_per_um = -0.01
bias_v = 2.0
time_constant_s = 0.1
[relay]
delay_s = 0.02
[grinding]
allowance_um = 40.0
feed_sd = 0.03
[[grinding.stages]]
feed_um_per_s = 20.0
until_um = 15.0
[[grinding.stages]]
feed_um_per_s = 5.0
until_um = 0.0
[noise]
sd_um = 0.3
rate_per_s = 1.0
[tolerance]
lower_um = -1.5
upper_um = 1.5
"""
ONE = LINE.replace("parts = 3", "parts = 1")
QUIET = ONE.replace("sd_um = 0.3", "sd_um = 0.0").replace("feed_sd = 0.03", "feed_sd = 0.0")


@pytest.fixture
def few_sizes(monkeypatch) -> None:
    """A tenth of the parts: what is told is looked at here, how exact it is in tests/physics/gauging."""
    monkeypatch.setattr(gauging_summary, "FEWEST_SIZES", 200)


@pytest.fixture
def folder(tmp_path, monkeypatch) -> Path:
    shorten_trials(monkeypatch)
    monkeypatch.chdir(tmp_path)
    for name, text in (("model", LINE), ("one", ONE), ("quiet", QUIET)):
        (tmp_path / f"{name}.toml").write_text(text, encoding="utf-8")
    return tmp_path


def simulated(capfd, *arguments: str) -> dict:
    """The JSON of a simulation."""
    capfd.readouterr()
    code = exit_status(["simulate", "gauging", *arguments, "--json"])
    out, err = capfd.readouterr()
    assert code == 0, err
    return json.loads(out, parse_constant=pytest.fail)


def refused(capfd, *arguments: str) -> str:
    """What stderr says of input that nobody can use."""
    before = sorted(path.name for path in Path.cwd().rglob("*"))
    assert exit_status(["simulate", "gauging", *arguments, "--json"]) == 2
    out, err = capfd.readouterr()
    assert out == ""
    for part in ("Where:", "Expected:", "What to do:"):
        assert part in err
    assert "Traceback" not in err
    assert sorted(path.name for path in Path.cwd().rglob("*")) == before, "something was written"
    return err


def test_one_part_is_a_file_with_its_machine_file_and_is_read_back(folder, capfd):
    shown = simulated(capfd, "one.toml", "--out", "part.csv")
    assert (shown["schema"], shown["kind"], shown["seed"]) == ("selector.simulation/1", "gauging", 5)
    assert shown["files"] == ["part.csv", "part.machine.toml"]
    reading = read([Path("part.csv")], machine=Path("part.machine.toml"))
    assert "SIMULATED" in (reading.machine.machine.name or "")
    assert [channel["name"] for channel in shown["channels"]] == list(reading.recording.names)
    assert all(channel.guessed == () for channel in reading.channels)
    assert {"size", "voltage", "feed_rate", "state"} == {c.role for c in reading.recording.channels}
    table = pd.read_csv("part.csv")
    (part,), (run,) = shown["gauging"]["parts"], shown["runs"]
    assert (run["run"], run["rows"]) == ("part", len(table))
    # no springs: what is left when the feed stands is the size
    assert part["size_um"] == pytest.approx(table["allowance"].iloc[-1], abs=1e-9)
    # 5 µm/s in mm/min
    assert table["feed"][table["stage"] == 2].unique() == pytest.approx([0.3 * run_pace(table)])
    assert table["feed"].iloc[-1] == table["stage"].iloc[-1] == 0


def run_pace(table: pd.DataFrame) -> float:
    """Feed of this part over the mean one, from its first stage of 20 µm/s."""
    return float(table["feed"].iloc[0]) / 1.2


@pytest.mark.usefixtures("few_sizes")
def test_several_parts_are_a_folder_with_a_file_each(folder, capfd):
    shown = simulated(capfd, "model.toml", "--out", "parts")
    names = [Path(file).name for file in shown["files"]]
    assert names == ["part 1.csv", "part 2.csv", "part 3.csv", "machine.toml"]
    assert [run["run"] for run in shown["runs"]] == ["part 1", "part 2", "part 3"]
    assert read([Path("parts")], machine=Path("parts/machine.toml")).recording.runs == ("part 1", "part 2", "part 3")
    for part, run in zip(shown["gauging"]["parts"], shown["runs"], strict=True):
        assert part["size_um"] == pytest.approx(run["size_um"], abs=1e-12)
    assert "a folder" in refused(capfd, "model.toml", "--out", "parts.csv")


def test_without_noise_the_threshold_of_eq_23_gives_the_wanted_size(folder, capfd):
    told = simulated(capfd, "quiet.toml", "--out", "part.csv")["gauging"]
    assert told["gauge"]["gain_v_per_um"] == -0.01
    # S = K·(x + a·(T_Φ + delay)) + bias
    thresholds = [stage["threshold_v"] for stage in told["stages"]]
    assert thresholds == pytest.approx([2.0 - 0.01 * (15.0 + 20.0 * 0.12), 2.0 - 0.01 * 5.0 * 0.12], rel=1e-12)
    # what is left of the transient of the first stage: 15 µm/s · 0.1 s · exp(−30), of 3 s
    assert told["parts"][0]["size_um"] == pytest.approx(0.0, abs=1e-6)
    assert told["monte_carlo"]["sd_um"] < 1e-9
    assert told["capability"] is None, "sizes that do not differ have no capability"
    assert told["comparison"] is None


def test_sizes_by_monte_carlo_and_formula_agree_within_the_standard_errors(folder, capfd):
    told = simulated(capfd, "model.toml", "--out", "parts")["gauging"]
    drawn, formula = told["monte_carlo"], told["formula"]
    assert drawn["parts"] == 2000
    # of 4 standard errors two in 30 000 are beyond
    assert abs(drawn["mean_um"] - formula["mean_um"]) < 4 * drawn["mean_standard_error_um"]
    assert abs(drawn["sd_um"] - formula["sd_um"]) < 4 * drawn["sd_standard_error_um"]
    # eq. 25 and the spread of the feed, (T_Φ + delay)·0.03·a; noise that comes early adds some percent
    by_hand = math.hypot(0.3 / math.sqrt(1.0 + 1.0 * 0.1), 0.12 * 0.03 * 5.0)
    assert formula["sd_um"] == pytest.approx(by_hand, rel=0.03)
    capable = told["capability"]
    assert capable["cp"] == pytest.approx(3.0 / (6.0 * drawn["sd_um"]), rel=1e-12)
    assert capable["cpk_interval"][0] < capable["cpk"] < capable["cpk_interval"][1]


def test_the_settings_are_those_of_the_curve(folder, capfd):
    told = simulated(capfd, "model.toml", "--out", "parts")["gauging"]
    one = told["trade_off"]
    present, centred, both = one["settings"]
    assert [setting["setting"] for setting in one["settings"]] == ["present", "centred", "best-filter-centred"]
    assert present["bias_um"] == pytest.approx(told["monte_carlo"]["mean_um"] - told["wanted_um"], abs=1e-12)
    assert all(setting["by"] == "Monte Carlo" and len(setting["thresholds_v"]) == 2 for setting in one["settings"])
    # by the slope of the gauge, −0.01 V/µm, to a digit that moves sizes by less than the error of their mean
    error_um = present["bias_standard_error_um"]
    assert centred["threshold_v"] - present["threshold_v"] == pytest.approx(
        0.01 * present["bias_um"], abs=0.01 * error_um
    )
    assert max(abs(centred["bias_um"]), abs(both["bias_um"])) < error_um
    # by 2000 parts; those that were looked at are fewer
    assert both["sd_um"] <= min(one["sd_um"]) * 1.2


@pytest.mark.usefixtures("few_sizes")
@pytest.mark.parametrize("example", EXAMPLES, ids=lambda path: path.stem)
def test_every_example_runs_and_is_read_back(example, folder, capfd):
    # few files; batches with wear stay as they are
    text = re.sub(r"parts = [25]0\b", "parts = 2", example.read_text(encoding="utf-8"))
    Path("example.toml").write_text(text, encoding="utf-8")
    out = "parts" if "parts = " in text else "part.csv"
    shown = simulated(capfd, "example.toml", "--out", out, "--report", "page.html")
    reading = read([Path(out)], machine=Path(shown["machine_file"]))
    assert [channel["name"] for channel in shown["channels"]] == list(reading.recording.names)
    assert all(math.isfinite(part["size_um"]) for part in shown["gauging"]["parts"])
    page = Path("page.html").read_text(encoding="utf-8")
    assert re.search(r'<p class="first">[^<]* [0-9.]+ µm (larger|smaller)', page)
    assert ("Grinding goes from right to left" in page) == ("[transducer" in text)
    assert (shown["gauging"]["characteristic"] is not None) == ("[transducer" in text)


@pytest.mark.usefixtures("few_sizes")
def test_the_seed_decides_the_parts(folder, capfd):
    for name, seed in (("a", "1"), ("b", "1"), ("c", "2")):
        assert simulated(capfd, "one.toml", "--out", f"{name}.csv", "--seed", seed)["seed"] == int(seed)
    a, b, c = (pd.read_csv(f"{name}.csv") for name in "abc")
    pd.testing.assert_frame_equal(a, b)
    assert a["gauge"].iloc[5] != c["gauge"].iloc[5]


@pytest.mark.usefixtures("few_sizes")
def test_recorded_allowances_drive_the_gauge_and_what_it_showed_is_laid_beside(folder, capfd):
    simulated(capfd, "quiet.toml", "--out", "r1.csv")
    shown = simulated(
        capfd, "quiet.toml", "--inputs", "r1.csv", "--machine", "r1.machine.toml", "--out", "sim", "--report", "p.html"
    )
    assert sorted(Path(file).name for file in shown["files"]) == ["machine.toml", "r1.csv"]
    told = shown["gauging"]
    assert told["parts"] is None
    compared = {one["channel"]: one for one in told["comparison"]}
    assert {"gauge", "measured"} <= set(compared)
    recorded, again = pd.read_csv("r1.csv"), pd.read_csv("sim/r1.csv")
    np.testing.assert_array_equal(recorded["time_s"], again["time_s"])
    # the same gauge: what differs are bends of the allowance between two samples, 15 µm/s of them for 0.02 s
    assert compared["measured"]["largest"] < 0.3
    assert compared["measured"]["rms"] == pytest.approx(
        np.sqrt(np.mean((again["measured"] - recorded["measured"]) ** 2)), rel=1e-6, abs=1e-9
    )
    page = Path("p.html").read_text(encoding="utf-8")
    assert "and recorded" in page
    assert re.search(r"<td[^>]*>allowance</td><td>input</td>", page)
    assert not re.search(r"<td[^>]*>measured</td><td>input</td>", page)
    # a gauge that is twice as slow is told from the recorded one
    Path("slow.toml").write_text(QUIET.replace("time_constant_s = 0.1", "time_constant_s = 0.2"), encoding="utf-8")
    slow = simulated(
        capfd, "slow.toml", "--inputs", "r1.csv", "--machine", "r1.machine.toml", "--out", "slow", "--seed", "3"
    )
    off = {one["channel"]: one["largest"] for one in slow["gauging"]["comparison"]}
    # late by another 0.1 s at 20 µm/s
    assert off["measured"] == pytest.approx(2.0, rel=0.1)


def test_for_people(folder, capfd):
    assert exit_status(["simulate", "gauging", "model.toml", "--out", "parts", "--all"]) == 0
    out, err = capfd.readouterr()
    for text in (
        "a gauge as a line", "than wanted on average", "Finished sizes", "Monte Carlo, 2000 parts",
        "95 % interval", "Filter and last threshold", "best filter", "[µm]",
        "--machine parts",
    ):  # fmt: skip
        assert text in out
    assert "\x1b" not in out + err


BAD = {
    "feed_um_per_s = 5.0": "feed_um_per_s = 0.0",
    "time_constant_s = 0.1": "time_constant_s = 0.0",
    "sd_um = 0.3": "sd_um = -0.3",
    "until_um = 15.0": "until_um = 50.0",
    "upper_um = 1.5": "upper_um = -2.5",
    "gain_v_per_um = -0.01": "gain_v_per_um = 0.0",
    "parts = 3": "parts = 0",
    "[run]": "[rum]",
    "[tolerance]": "[thresholds]\nvolts = [1.8]\n[tolerance]",
    "feed_sd = 0.03": "feed_sd = 0.9",
}


@pytest.mark.parametrize(("good", "bad"), BAD.items(), ids=lambda text: text.replace("\n", " "))
def test_values_that_cannot_be_are_refused_with_their_key(good, bad, folder, capfd):
    assert good in LINE
    Path("bad.toml").write_text(LINE.replace(good, bad, 1), encoding="utf-8")
    assert "bad.toml, key" in refused(capfd, "bad.toml", "--out", "parts", "--report", "page.html")


def test_thresholds_beyond_what_the_gauge_gives_are_refused_with_their_key(folder, capfd):
    text = (ROOT / "fixtures" / "gauging" / "interrupted.toml").read_text(encoding="utf-8")
    Path("bad.toml").write_text(f"{text}\n[thresholds]\nvolts = [1.5, 5.0]\n", encoding="utf-8")
    said = refused(capfd, "bad.toml", "--out", "parts")
    assert "bad.toml, key thresholds.volts[2]" in said
    assert "5 V" in said


def test_a_model_of_another_kind_says_which_command_it_belongs_to(folder, capfd):
    thermal = ROOT / "fixtures" / "thermal" / "headstock.toml"
    assert "simulate thermal" in refused(capfd, str(thermal), "--out", "run.csv")
    assert exit_status(["simulate", "drive", "model.toml", "--out", "run.csv"]) == 2
    assert "simulate gauging" in capfd.readouterr().err


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["nothing.toml", "--out", "run.csv"], "nothing.toml"),
        (["one.toml"], "--out"),
        (["one.toml", "--out", "run.xlsx"], ".csv"),
        (["one.toml", "--out", "one.toml/run.csv"], "one.toml"),
        (["model.toml", "--out", "quiet.toml"], "quiet.toml"),
        (["one.toml", "--out", "run.csv", "--seed", "-1"], "--seed"),
        (["one.toml", "--out", "run.csv", "--machine", "one.toml"], "--inputs"),
        (["one.toml", "--out", "run.csv", "--report", "page.txt"], ".html"),
        (["one.toml", "--out", "sim", "--inputs", "nothing.csv"], "nothing.csv"),
        (["one.toml", "--out", "sim", "--inputs", "day.csv"], "allowance"),
        (["one.toml", "--out", "day.csv", "--inputs", "day.csv"], "one of the inputs"),
    ],
    ids=lambda value: " ".join(value) if isinstance(value, list) else None,
)
def test_a_command_that_cannot_be_done(arguments, said, folder, capfd):
    Path("day.csv").write_text("time_s,T1\n0,20\n60,21\n120,21.5\n", encoding="utf-8")
    assert said in refused(capfd, *arguments)


@pytest.mark.usefixtures("few_sizes")
def test_nothing_foreign_is_replaced(folder, capfd):
    shutil.copy("one.toml", "run.machine.toml")
    assert "inputs" in refused(capfd, "run.machine.toml", "--out", "run.csv")
    Path("day.csv").write_text("time_s,T1\n0,20\n60,21\n", encoding="utf-8")
    assert "day.csv exists" in refused(capfd, "one.toml", "--out", "day.csv")
    Path("page.html").write_text("<title>Something</title>", encoding="utf-8")
    assert "page of a simulation" in refused(capfd, "one.toml", "--out", "new.csv", "--report", "page.html")
    for seed in ("1", "2"):
        simulated(capfd, "one.toml", "--out", "new.csv", "--seed", seed, "--report", "new.html")


@pytest.mark.skipif(sys.platform == "win32", reason="Ctrl-C is sent to a process in another way there")
def test_ctrl_c_leaves_nothing_behind(folder, capfd):
    # 80 million samples of parts
    text = LINE.replace("parts = 3", "parts = 100000\nperiod_s = 0.01")
    Path("slow.toml").write_text(text, encoding="utf-8")
    before = sorted(path.name for path in folder.iterdir())
    capfd.readouterr()
    assert exit_status_interrupted_in("finished_sizes", "simulate", "gauging", "slow.toml", "--out", "parts") == 130
    out, err = capfd.readouterr()
    assert out == ""
    assert "Nothing" in err
    assert sorted(path.name for path in folder.iterdir()) == before


@pytest.mark.usefixtures("few_sizes")
def test_recorded_columns_are_what_the_model_file_says_whatever_was_guessed(folder, capfd):
    simulated(capfd, "quiet.toml", "--out", "r1.csv")
    table = pd.read_csv("r1.csv")
    said = '[recorded]\nallowance = "Rest"\ngauge = "Uhr"\n'
    Path("named.toml").write_text(QUIET + said, encoding="utf-8")
    for number, (heads, factor) in enumerate(
        {("Rest [um]", "Uhr [V]"): 1.0, ("Rest [mm]", "Uhr [mV]"): 1e-3, ("Rest", "Uhr"): 1.0}.items()
    ):
        volts = table["gauge"] * (1000.0 if "mV" in heads[1] else 1.0)
        other = pd.DataFrame({"time [s]": table["time_s"], heads[0]: table["allowance"] * factor, heads[1]: volts})
        other.to_csv("other.csv", index=False)
        shown = simulated(capfd, "named.toml", "--inputs", "other.csv", "--out", f"sim {number}")
        (one,) = shown["gauging"]["comparison"]
        # as when the recording says itself what its channels are
        assert (one["channel"], one["largest"] < 0.003) == ("Uhr", True), heads


@pytest.mark.usefixtures("few_sizes")
def test_where_only_the_feed_was_recorded_the_gauge_says_where_it_begins(folder, capfd):
    simulated(capfd, "quiet.toml", "--out", "r1.csv")
    table = pd.read_csv("r1.csv")[["time_s", "feed", "gauge"]]
    # 7 µm more than the file has
    table["gauge"] -= 0.01 * 7.0
    table.to_csv("fed.csv", index=False)
    shown = simulated(capfd, "quiet.toml", "--inputs", "fed.csv", "--out", "sim")
    told = {one["id"]: one for one in shown["findings"]}
    # no noise: what is left is that the feed is held from sample to sample
    assert told["start-from-gauge"]["evidence"]["begins_um"] == pytest.approx(47.0, abs=0.1)
    table[["time_s", "feed"]].to_csv("feed.csv", index=False)
    alone = simulated(capfd, "quiet.toml", "--inputs", "feed.csv", "--out", "alone")
    assert "start-from-file" in {one["id"] for one in alone["findings"]}
    assert pd.read_csv("alone/feed.csv")["allowance"].iloc[0] == 40.0
