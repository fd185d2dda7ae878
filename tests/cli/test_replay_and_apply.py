"""`selector apply` and `selector export --replay` speak of the same recorded displacement, in words that say which."""

from __future__ import annotations

import json
import re
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from selector.cli import exit_status
from selector.controllers import Input, ModelFile, Output, Term, apply_model
from selector.controllers.application import displacement_starts, without_displacement_faults
from selector.controllers.model_file import read_model, write_model
from selector.controllers.replay.replayed import replayed
from selector.controllers.writers.targets import TARGETS
from selector.readers import read


def folder_of(folder: Path, *, start_um: float = 0.0, spike: bool = False) -> tuple[Path, Path, Path]:
    """A model of the rise of one temperature, a noisy recording of it a sample a minute, and its machine file."""
    item = Input(name="T1", reference="rise", valid_min=-1.0, valid_max=30.0, centre=0.0, scale=1.0)
    output = Output(
        name="Z", axis="Z", reference="rise", intercept=0.0, terms=(Term(powers={"T1": 1}, coefficient=3.0),)
    )
    write_model(ModelFile(name="one", inputs=(item,), outputs=(output,)), folder / "m.json")
    noise = np.random.default_rng(5)
    time_s = 60.0 * np.arange(300)
    rise = 9.0 * (1.0 - np.exp(-time_s / 3000.0))
    z_um = start_um + 3.0 * rise + 0.4 * noise.normal(size=300)
    z_um[0] = start_um + 0.6
    if spike:
        z_um[150] += 500.0
    table = pd.DataFrame({"time_s": time_s, "T1": 20.0 + rise + 0.05 * noise.normal(size=300), "Z": z_um})
    table.to_csv(folder / "r.csv", index=False)
    (folder / "machine.toml").write_text(
        '[time]\ncolumn = "time_s"\nunit = "s"\n[channels.T1]\nrole = "temperature"\nunit = "degC"\n'
        '[channels.Z]\nrole = "displacement"\nunit = "um"\n'
    )
    return folder / "m.json", folder / "r.csv", folder / "machine.toml"


def test_of_many_runs_the_screen_has_the_worst_and_all_runs_together(tmp_path, capsys):
    model, first, machine = folder_of(tmp_path)
    table = pd.read_csv(first).iloc[:60]
    files = [str(tmp_path / f"d{k:02d}.csv") for k in range(45)]
    for k, file in enumerate(files):
        # a gain that is off by another part in each run
        table.assign(Z=(1.0 + 0.1 * ((7 * k) % 45)) * table["Z"]).to_csv(file, index=False)
    asked = ["apply", str(model), *files, "--machine", str(machine)]
    assert exit_status(asked) == 0
    shown = capsys.readouterr().out.splitlines()
    assert len(shown) <= 40
    runs = [line.split()[0] for line in shown if re.match(r" d\d\d ", line)]
    assert runs == [f"d{k:02d}" for k in sorted(range(45), key=lambda k: -((7 * k) % 45))[:20]]
    assert any(line.startswith(" all runs") for line in shown)
    assert any("20 largest errors of 45; --all shows all" in line for line in shown)
    assert exit_status([*asked, "--all"]) == 0
    assert len(re.findall(r"(?m)^ d\d\d ", capsys.readouterr().out)) == 45


@pytest.mark.parametrize(("start_um", "spike"), [(0.0, False), (80.0, False), (0.0, True)])
def test_before_is_the_same_to_the_digit(tmp_path, capsys, start_um, spike):
    model, run, machine = folder_of(tmp_path, start_um=start_um, spike=spike)
    assert exit_status(["apply", str(model), str(run), "--machine", str(machine), "--json"]) == 0
    applied = json.loads(capsys.readouterr().out)
    of_apply = applied["overall"]["Z"]
    assert ("gauge-not-zeroed" in {one["id"] for one in applied["findings"]}) == (start_um != 0.0)
    out = tmp_path / "out"
    words = ["export", model, "--for", "python", "--out", out, "--replay", run, "--machine", machine]
    assert exit_status([*map(str, words), "--json"]) == 0
    told = {one["id"]: one for one in json.loads(capsys.readouterr().out)["findings"]}
    assert ("spike" in told) == spike

    source = read([run], machine=machine).recording
    read_back = read_model(model)
    kept, _ = without_displacement_faults(read_back, source)
    export = TARGETS["python"].write(read_back, is_sign_verified=False)
    (of_run,) = replayed(read_back, export.files, kept, TARGETS["python"].parts).runs
    assert of_run.accuracy["Z"].before_rmse_um == of_apply["before_rmse_um"]
    assert of_run.accuracy["Z"].before_max_um == of_apply["before_max_um"]
    # zeroed: the first sample is noise; not zeroed: nearer to its start than the first sample is
    assert abs(displacement_starts(read_back, kept)["r"]["Z"] - start_um) < (0.59 if start_um else 1e-12)


@pytest.mark.parametrize("start_um", [0.0, 80.0])
def test_a_displacement_that_begins_late_is_told_and_counts_from_there(tmp_path, capsys, start_um):
    model, run, machine = folder_of(tmp_path, start_um=start_um)
    table = pd.read_csv(run)
    table["Z"] = table["Z"].where(table.index >= 60)
    (tmp_path / "runs").mkdir()
    run.rename(tmp_path / "runs" / "r.csv")
    table.to_csv(tmp_path / "runs" / "late.csv", index=False)
    words = [str(tmp_path / "runs"), "--machine", str(machine), "--json"]
    assert exit_status(["apply", str(model), *words]) == 0
    applied = json.loads(capsys.readouterr().out)
    out = ["--for", "python", "--out", str(tmp_path / "out"), "--replay"]
    assert exit_status(["export", str(model), *out, *words]) == 0
    exported = json.loads(capsys.readouterr().out)
    for one in (applied, exported):
        assert [of["where"]["run"] for of in one["findings"] if of["id"] == "gauge-begins-late"] == ["late"]
    of_late = applied["per_run"]["late"]["Z"]
    assert of_late["rmse_um"] < 1.0
    # what it moved in the hour before is not in it
    rise_um = 27.0 * (np.exp(-1.2) - np.exp(-0.02 * np.arange(60, 300)))
    assert of_late["before_rmse_um"] == pytest.approx(np.sqrt(np.mean(rise_um**2)), abs=0.4)
    (replayed_late,) = [of for of in exported["replay"]["runs"] if of["run"] == "late"]
    assert replayed_late["before_rmse_um"] == of_late["before_rmse_um"]


def test_the_first_minutes_without_a_correction_are_told(tmp_path, capsys):
    model, run, machine = folder_of(tmp_path)
    words = ["export", model, "--for", "python", "--out", tmp_path / "out", "--replay", run, "--machine", machine]
    assert exit_status([*map(str, words), "--all"]) == 0
    said = " ".join(capsys.readouterr().out.split())
    assert "first 360 s" in said
    assert "Without correction:" in said
    # samples, difference, rms without correction, rms with it, the largest with it, share
    assert re.search(r"r Z \d+ [0-9.]+ [0-9.]+ [0-9.]+ [0-9.]+ [0-9.]+ [0-9.]+ %", said)
    page = (tmp_path / "out" / "commissioning.html").read_text(encoding="utf-8")
    assert "first 360 s" in page
    headings = ["samples", "program − reference", "without correction: rms", "with correction: rms",
                "with correction: largest", "not the whole model"]  # fmt: skip
    assert sorted(headings, key=page.index) == headings
    # a drive waits for nothing
    words[3:6] = ["rexroth", "--out", tmp_path / "drive"]
    assert exit_status([*map(str, words), "--all"]) == 0
    assert "No correction" not in " ".join(capsys.readouterr().out.split())


def test_the_default_zero_of_apply_model_is_the_same(tmp_path):
    model, run, machine = folder_of(tmp_path)
    source = read([run], machine=machine).recording
    recorded = source.frame["Z"].to_numpy()
    of = apply_model(read_model(model), source).overall["Z"]
    assert of.before_rmse_um == pytest.approx(float(np.sqrt(np.mean(recorded**2))), rel=1e-12)


def test_recordings_of_production_have_no_gauge_and_only_the_sensors_of_the_model(tmp_path, capsys):
    model, file, machine = folder_of(tmp_path)
    whole = pd.read_csv(file)
    with machine.open("a", encoding="utf-8") as told:
        told.write('[channels.T2]\nrole = "temperature"\nunit = "degC"\n')
    day = tmp_path / "day.csv"
    whole[["time_s", "T1"]].to_csv(day, index=False)
    predicted = tmp_path / "predicted.csv"
    asked = ["apply", str(model), str(day), "--machine", str(machine), "--json"]
    assert exit_status([*asked, "--out", str(predicted)]) == 0
    said = json.loads(capsys.readouterr().out)
    assert said["overall"]["Z"]["rmse_um"] is None
    [lacking] = [one for one in said["findings"] if one["id"] == "channels-lacking"]
    assert lacking["evidence"]["channels"] == ["Z", "T2"]
    assert pd.read_csv(predicted)["Z"].notna().all()
    words = ["export", str(model), "--for", "python", "--out", str(tmp_path / "out"), "--replay", str(day)]
    assert exit_status([*words, "--machine", str(machine), "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["replay"]["rows"] == len(whole)
    whole[["time_s", "Z"]].to_csv(day, index=False)
    assert exit_status(asked) == 2
    assert "no column 'T1'" in capsys.readouterr().err
