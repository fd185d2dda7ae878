"""`selector adapt` from the command line: a whole job, and what cannot be used."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from jsonschema import Draft202012Validator

from selector.cli import exit_status
from selector.controllers import Input, ModelFile, Output, Term, model_json_schema, read_model, sealed
from selector.controllers.guard.decided import TouchCode
from selector.controllers.guard.guarded_model import GuardedModel
from selector.controllers.model_file import equations_sha256, write_model
from selector.readers.touch_off_file import TouchOff, read_touch_offs

MACHINE = (
    '[time]\ncolumn = "time_s"\nunit = "s"\n[channels.T1]\nrole = "temperature"\nunit = "degC"\n'
    '[channels.Z]\nrole = "displacement"\nunit = "um"\naxis = "Z"\n'
)


@pytest.fixture(scope="module")
def shop(tmp_path_factory) -> Path:
    """Five days of a machine that drifts away from its model by a few µm in an hour; a sample every two minutes."""
    folder = tmp_path_factory.mktemp("shop")
    item = Input(name="T1", reference="rise", valid_min=-1.0, valid_max=30.0)
    output = Output(
        name="Z", axis="Z", reference="rise", intercept=0.0, terms=(Term(powers={"T1": 1}, coefficient=3.0),)
    )
    model = ModelFile(name="one", inputs=(item,), outputs=(output,))
    write_model(sealed(model), folder / "m.json")
    (folder / "machine.toml").write_text(MACHINE, encoding="utf-8")
    (folder / "runs").mkdir()
    rng = np.random.default_rng(5)
    for day in range(5):
        time_s = 120.0 * np.arange(241)
        rise = 9.0 * (1.0 - np.exp(-time_s / 3000.0))
        walk = np.r_[0.0, np.cumsum(rng.normal(0.0, 0.6, 240))]
        z_um = 3.0 * rise + walk + rng.normal(0.0, 0.2, 241)
        z_um[0] = 0.0
        table = pd.DataFrame({"time_s": time_s, "T1": 20.0 + rise, "Z": z_um})
        table.round(6).to_csv(folder / "runs" / f"d{day}.csv", index=False)
    return folder


def told(shop: Path, capsys, *words: object) -> dict:
    base = ["adapt", shop / "m.json", shop / "runs", "--machine", shop / "machine.toml", "--json", *words]
    assert exit_status([str(word) for word in base]) == 0
    return json.loads(capsys.readouterr().out)


def refused(shop: Path, capsys, *words: object, runs: str = "runs") -> str:
    base = ["adapt", shop / "m.json", shop / runs, "--machine", shop / "machine.toml", "--json", *words]
    assert exit_status([str(word) for word in base]) == 2
    found = capsys.readouterr()
    assert found.out == ""
    return found.err


def test_a_whole_job(shop, capsys, tmp_path):
    out = tmp_path / "adapted"
    answer = told(shop, capsys, "--every", "1h", "--out", out)
    assert (answer["schema"], answer["kind"], answer["policy"]) == ("selector.adaptation/1", "offset", None)
    assert set(answer["per_run"]) == {f"d{day}" for day in range(5)}
    one = answer["per_run"]["d2"]["Z"]
    assert one["touch_offs"] == 8
    assert {"rmse_um", "max_um", "without_rmse_um", "before_rmse_um"} < set(one)
    overall = answer["overall"]["Z"]
    assert overall["rmse_um"] < overall["without_rmse_um"] < overall["before_rmse_um"]
    assert sorted(path.name for path in out.iterdir()) == ["adaptation.json", "model.json", "report.html"]
    assert json.loads((out / "adaptation.json").read_text()) == answer
    document = json.loads((out / "model.json").read_text())
    Draft202012Validator(model_json_schema()).validate(document)
    (block,) = document["adaptation"]["outputs"]
    assert block["output"] == "Z"
    # planted: 0.6 µm in two minutes, 0.2 µm of noise; five runs tell a variance to some tens of percent
    assert block["offset_um2_per_s"] == pytest.approx(0.36 / 120.0, rel=0.5)
    page = (out / "report.html").read_text()
    assert "Touch-offs" in page
    assert exit_status(["model", "check", str(out / "model.json")]) == 0
    assert "Touch-offs" not in capsys.readouterr().err
    assert exit_status(["model", "card", str(out / "model.json"), "--out", str(tmp_path / "card.html")]) == 0
    capsys.readouterr()
    words = ["apply", out / "model.json", shop / "runs", "--machine", shop / "machine.toml", "--json"]
    assert exit_status(list(map(str, words))) == 0
    assert "adaptation-not-applied" in {one["id"] for one in json.loads(capsys.readouterr().out)["findings"]}


def test_the_control_does_with_touch_offs_what_was_told(shop, capsys, tmp_path):
    out = tmp_path / "adapted"
    answer = told(shop, capsys, "--every", "1h", "--out", out)
    model = read_model(out / "model.json")
    fast = model.model_copy(update={"guard": model.guard.model_copy(update={"recover_after_s": 0.0})})
    table = pd.read_csv(shop / "runs" / "d3.csv")
    guarded, left, previous = GuardedModel(fast), [], 0.0
    for k, (_, reading, z_um) in enumerate(table.itertuples(index=False)):
        is_touch = k > 0 and k % 30 == 0
        shown = {"Z": z_um + previous}
        found = guarded.step(120.0, {"T1": reading}, touch_um=shown, is_touch_valid=is_touch)
        if is_touch:
            assert found.touches["Z"] in (TouchCode.BELIEVED, TouchCode.DOUBTED)
        previous = found.correction_um["Z"]
        left.append(z_um + previous)
    # what all runs taught, the slew limit and the first sample as start: near, not equal
    assert np.sqrt(np.mean(np.square(left))) == pytest.approx(answer["per_run"]["d3"]["Z"]["rmse_um"], rel=0.2)


def test_touch_offs_as_measured_are_those_of_the_recording(shop, capsys, tmp_path):
    rows = ["run,time_s,Z"]
    for day in range(5):
        table = pd.read_csv(shop / "runs" / f"d{day}.csv")
        rows += [f"d{day},{t:g},{z!r}" for t, z in zip(table["time_s"], table["Z"], strict=True) if t and t % 3600 == 0]
    file = tmp_path / "probe.csv"
    file.write_text("\n".join(rows) + "\n", encoding="utf-8")
    answer = told(shop, capsys, "--touch-offs", file)
    every = told(shop, capsys, "--every", "60min")
    assert answer["every_s"] is None
    assert answer["per_run"]["d1"]["Z"]["touch_offs"] == every["per_run"]["d1"]["Z"]["touch_offs"]
    # taught by one schedule instead of four
    assert answer["overall"]["Z"]["rmse_um"] == pytest.approx(every["overall"]["Z"]["rmse_um"], rel=0.1)


def test_a_row_that_stands_twice_counts_once_and_is_told(shop, capsys, tmp_path):
    rows = ["run,time_s,Z"]
    for day in range(5):
        table = pd.read_csv(shop / "runs" / f"d{day}.csv").iloc[30::30]
        rows += [f"d{day},{t:g},{z!r}" for t, z in zip(table["time_s"], table["Z"], strict=True)]
    false = f"d1,{table['time_s'].iloc[3] + 60:g},120.0"
    (tmp_path / "once.csv").write_text("\n".join([*rows, false]) + "\n", encoding="utf-8")
    (tmp_path / "twice.csv").write_text("\n".join([*rows, false, rows[1], false]) + "\n", encoding="utf-8")
    once = told(shop, capsys, "--touch-offs", tmp_path / "once.csv")
    twice = told(shop, capsys, "--touch-offs", tmp_path / "twice.csv")
    copies = [one for one in twice["findings"] if one["id"] == "touch-off-twice"]
    assert [(one["where"]["run"], len(one["evidence"]["times_s"])) for one in copies] == [("d0", 1), ("d1", 1)]
    assert "touch-off-twice" not in {one["id"] for one in once["findings"]}
    # a copy of a false reading would confirm it
    assert twice["per_run"] == once["per_run"]
    assert "touch-off-refused" in {one["id"] for one in once["findings"]}


@pytest.mark.parametrize(("factor", "seconds", "false_ones"), [(0.001, 1, 0), (-1, 1, 0), (1, 60, 0), (1, 1, 2)])
def test_touch_offs_that_are_something_else_than_the_recording_are_told(
    shop, capsys, tmp_path, factor, seconds, false_ones
):
    rows = ["run,time_s,Z"]
    for day in range(5):
        table = pd.read_csv(shop / "runs" / f"d{day}.csv").iloc[30::30]
        for k, (t, z) in enumerate(zip(table["time_s"], table["Z"], strict=True)):
            rows.append(f"d{day},{t / seconds:g},{factor * z + 50 * (k < false_ones)!r}")
    file = tmp_path / "probe.csv"
    file.write_text("\n".join(rows) + "\n", encoding="utf-8")
    answer = told(shop, capsys, "--touch-offs", file)
    contradictions = [one for one in answer["findings"] if one["id"] == "touch-offs-contradict-recording"]
    # readings in mm, of the other sign, times in minutes; two false readings of eight are a matter of the gate
    assert len(contradictions) == (not false_ones)
    if seconds == 1 and not false_ones:
        assert contradictions[0]["evidence"]["ratio"] == pytest.approx(factor)
        assert contradictions[0]["evidence"]["touch_offs"] == 40


def test_touch_offs_of_a_displacement_that_is_noise_contradict_nothing(shop, capsys, tmp_path):
    random, rows = np.random.default_rng(0), ["run,time_s,Z"]
    (tmp_path / "runs").mkdir()
    for day in range(5):
        table = pd.read_csv(shop / "runs" / f"d{day}.csv")
        table["Z"] = random.normal(0.0, 0.3, len(table))
        table.to_csv(tmp_path / "runs" / f"d{day}.csv", index=False)
        rows += [f"d{day},{t:g},{random.normal(0.0, 1.0)!r}" for t in table["time_s"][30::30]]
    (tmp_path / "probe.csv").write_text("\n".join(rows) + "\n", encoding="utf-8")
    words = [shop / "m.json", tmp_path / "runs", "--machine", shop / "machine.toml", "--json"]
    assert exit_status([str(word) for word in ("adapt", *words, "--touch-offs", tmp_path / "probe.csv")]) == 0
    found = {one["id"] for one in json.loads(capsys.readouterr().out)["findings"]}
    assert "touch-offs-contradict-recording" not in found


def test_touch_offs_count_from_the_start_of_the_recording_where_the_gauge_begins_later(shop, capsys, tmp_path):
    (tmp_path / "runs").mkdir()
    rows = ["run,time_s,Z"]
    for day in range(5):
        table = pd.read_csv(shop / "runs" / f"d{day}.csv")
        # the model is right, and the gauge was never zeroed
        table["Z"] = 60.0 + 3.0 * table["T1"].sub(20.0)
        rows += [f"d{day},{t},{table['Z'][t // 120]:.6f}" for t in (1200, 7200, 28800)]
        table["Z"] = table["Z"].where(table["time_s"] >= 3600.0)
        table.to_csv(tmp_path / "runs" / f"d{day}.csv", index=False)
    (tmp_path / "probe.csv").write_text("\n".join(rows) + "\n", encoding="utf-8")
    words = [shop / "m.json", tmp_path / "runs", "--machine", shop / "machine.toml", "--json"]
    assert exit_status([str(word) for word in ("adapt", *words, "--touch-offs", tmp_path / "probe.csv")]) == 0
    answer = json.loads(capsys.readouterr().out)
    assert {of["Z"]["touch_offs"] for of in answer["per_run"].values()} == {2}
    assert answer["overall"]["Z"]["rmse_um"] < 1e-3
    left_out = [one["where"] for one in answer["findings"] if one["id"] == "touch-off-without-prediction"]
    assert [(where["run"], where["from_s"]) for where in left_out] == [(f"d{day}", 1200.0) for day in range(5)]


def test_when_to_probe(shop, capsys):
    answer = told(shop, capsys, "--within", "8")
    policy = answer["policy"]
    assert policy["within_um"] == 8.0
    assert policy["share_within"] >= 0.95
    assert policy["touch_offs_per_day"] > 0.0
    assert answer["every_s"] == policy["every_s"]


def test_the_screen_says_what_to_do(shop, capsys):
    words = ["adapt", shop / "m.json", shop / "runs", "--machine", shop / "machine.toml", "--every", "3600s"]
    assert exit_status(list(map(str, words))) == 0
    said = capsys.readouterr().out
    assert "with a touch-off every 1 h" in " ".join(said.split())


@pytest.mark.parametrize(
    ("words", "says"),
    [
        ((), "one of them"),
        (("--every", "2h", "--within", "5"), "one of them"),
        (("--every", "2"), "a time above 0 with its unit"),
        (("--every", "0h"), "a time above 0 with its unit"),
        (("--every", "two hours"), "a time above 0 with its unit"),
        (("--within", "-3"), "a number of µm above 0"),
        (("--within", "nan"), "a number of µm above 0"),
        (("--touch-offs", "nowhere.csv"), "no such file"),
    ],
)
def test_what_cannot_be_asked(shop, capsys, words, says):
    assert says in " ".join(refused(shop, capsys, *words).split())


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("", "no rows"),
        ("run,time_s,Z\n", "no row below the header"),
        ("run,time_s\nd0,60\n", "no column of a response"),
        ("run,time_s,Q\nd0,60,1\n", "column 'Q'"),
        ("run,Z\nd0,1\n", "0 columns 'time_s'"),
        ("run,time_s,Z\nd9,60,1\n", "one of the runs d0"),
        ("run,time_s,Z\nd0,1e7,1\n", "0 to 28800 s"),
        ("run,time_s,Z\nd0,-5,1\n", "0 to 28800 s"),
        ("run,time_s,Z\nd0,60,many\n", "a number with a decimal point"),
        ("run,time_s,Z\nd0,60,nan\n", "a number with a decimal point"),
        ("run,time_s,Z\nd0,60,1e9\n", "a displacement in µm"),
        ("run,time_s,Z\nd0,60\n", "complete the row"),
    ],
)
def test_touch_off_files_that_cannot_be_used(shop, capsys, tmp_path, text, says):
    file = tmp_path / "probe.csv"
    file.write_text(text, encoding="utf-8")
    said = " ".join(refused(shop, capsys, "--touch-offs", file).split())
    assert says in said
    assert "Traceback" not in said


def test_nothing_is_written_into_a_folder_of_inputs(shop, capsys):
    assert "--out" in refused(shop, capsys, "--every", "1h", "--out", shop / "runs")


def test_the_model_with_adaptation_is_another_program(shop, capsys, tmp_path):
    told(shop, capsys, "--every", "1h", "--out", tmp_path / "adapted")
    before, after = read_model(shop / "m.json"), read_model(tmp_path / "adapted" / "model.json")
    assert equations_sha256(before) != equations_sha256(after)
    changed = {"adaptation": None, "guard_vectors": before.guard_vectors, "digest": before.digest}
    assert after.model_copy(update=changed) == before


def test_a_column_of_touch_offs_may_be_called_like_the_axis(tmp_path):
    (tmp_path / "probe.csv").write_text("run,time_s,z\nd1,60,1.5\n", encoding="utf-8")
    found = read_touch_offs(tmp_path / "probe.csv", {"d1": 100.0}, {"Verlagerung Z": "Z", "Y": "Y"})
    assert found == {"Verlagerung Z": {"d1": (TouchOff(60.0, 1.5),)}}
