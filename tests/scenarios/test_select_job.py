"""The main job through the command line: shipped recordings to selection.json, model.json and a report."""

from __future__ import annotations

import hashlib
import json
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from selector.cli import exit_status
from selector.exporting import ExportOptions, export_model
from selector.shipped import shipped

NAMES = ["model.json", "report.html", "selection.json", "study.toml"]
PATENT = [str(shipped("patent8")), "--response", "Z", "--response", "Y", "--lambda", "0.995"]


def selection(capsys: pytest.CaptureFixture[str], *arguments: str) -> dict:
    assert exit_status(["select", *arguments, "--json"]) == 0
    return json.loads(capsys.readouterr().out, parse_constant=lambda name: pytest.fail(f"{name} is no JSON"))


def test_patent_example(capsys):
    found = selection(capsys, *PATENT, "--must", "T1", "--must", "T3", "--tolerance", "0.001")
    assert found["schema"] == "selector.selection/1"
    assert found["lambda"] == 0.995
    assert found["rounds"][0]["groups"] == [["T1", "T2", "T4", "T8"], ["T3", "T5", "T6", "T7"]]
    assert found["chosen"]["sensors"] == ["T1", "T3"]
    printed = {"Z": (-1.871, 6.0476, 2.6667), "Y": (0.5703, 4.7292, -0.5908)}
    for name, numbers in printed.items():
        model = found["models"][name]
        slopes = {tuple(term["powers"]): term["coefficient"] for term in model["terms"]}
        # the patent prints four decimals; the reconstruction has its models to 1e-9
        assert (model["intercept"], slopes[("T1",)], slopes[("T3",)]) == pytest.approx(numbers, abs=5e-5)
        assert (round(model["r2"], 4), round(model["adjusted_r2"], 4)) == (0.9989, 0.9988)


def test_every_combination_of_few_representatives_is_listed(capsys):
    found = selection(capsys, str(shipped("patent8")), "--response", "Z", "--lambda", "0.9985")
    names = found["rounds"][0]["representatives"]
    listed = {tuple(one["sensors"]) for one in found["combinations"]}
    assert len(names) == 5
    assert len(listed) == 2**5 - 1
    assert all(
        {"sensors", "response", "r2", "adjusted_r2", "heldout_rmse_um"} <= set(one) for one in found["combinations"]
    )


def test_results_are_written_together_and_bit_for_bit_again(tmp_path, capsys):
    hashes = []
    for folder in (tmp_path / "a", tmp_path / "b"):
        assert exit_status(["select", *PATENT, "--out", str(folder), "--json"]) == 0
        printed = capsys.readouterr().out
        assert sorted(path.name for path in folder.iterdir()) == NAMES
        assert (folder / "selection.json").read_text(encoding="utf-8") == printed
        hashes.append([hashlib.sha256(path.read_bytes()).hexdigest() for path in sorted(folder.iterdir())])
    assert hashes[0] == hashes[1]
    assert exit_status(["model", "check", str(tmp_path / "a" / "model.json")]) == 0


def test_the_model_applies_to_its_own_recording_as_it_was_fitted(tmp_path, capsys):
    folder = tmp_path / "study"
    assert exit_status(["select", *PATENT, "--out", str(folder)]) == 0
    capsys.readouterr()
    assert exit_status(["apply", str(folder / "model.json"), str(shipped("patent8")), "--json"]) == 0
    applied = json.loads(capsys.readouterr().out)
    chosen = json.loads((folder / "selection.json").read_text(encoding="utf-8"))
    for name in ("Z", "Y"):
        # two programs sum 97 squares in another order
        assert applied["overall"][name]["rmse_um"] == pytest.approx(chosen["models"][name]["rmse_um"], rel=1e-9)


@pytest.fixture(scope="module")
def runs(tmp_path_factory) -> Path:
    """Four runs of six sensors that share two modes, and a displacement of two of them with a slow mode."""
    folder = tmp_path_factory.mktemp("runs")
    rng = np.random.default_rng(5)
    t = np.arange(0.0, 300.0)
    for k in range(4):
        speed = np.repeat(rng.integers(0, 3, 10), 30) * 1000.0
        fast, slow = np.zeros(300), np.zeros(300)
        for i in range(1, 300):
            fast[i] = fast[i - 1] + (speed[i] / 300.0 - fast[i - 1]) / 15.0
            slow[i] = slow[i - 1] + (fast[i] - slow[i - 1]) / 90.0
        share = np.linspace(1.0, 0.0, 6)
        temperatures = 21.0 + np.outer(fast, share) + np.outer(slow, 1 - share) + 0.02 * rng.normal(size=(300, 6))
        table = pd.DataFrame(np.round(temperatures, 2), columns=[f"T{j + 1}" for j in range(6)])
        table.insert(0, "t_min", t)
        table["S_rpm"] = speed
        table["Z_um"] = np.round(4.0 * fast + 3.0 * slow + 0.3 * rng.normal(size=300), 2)
        table.to_csv(folder / f"r{k + 1}.csv", index=False)
    return folder


def test_runs_of_one_file_are_no_copies_of_each_other(runs, tmp_path, capsys):
    tables = {path.stem: pd.read_csv(path) for path in sorted(runs.iterdir())}
    pd.concat([table.assign(run=name) for name, table in tables.items()]).to_csv(tmp_path / "all.csv", index=False)
    with pd.ExcelWriter(tmp_path / "all.xlsx") as workbook:
        for name, table in tables.items():
            table.to_excel(workbook, sheet_name=name, index=False)
    (tmp_path / "again.xlsx").write_bytes((tmp_path / "all.xlsx").read_bytes())
    apart = selection(capsys, str(runs))
    for names in (["all.csv"], ["all.xlsx"], ["all.xlsx", "again.xlsx"]):
        found = selection(capsys, *(str(tmp_path / name) for name in names))
        here, there = (next(iter(one["models"].values())) for one in (found, apart))
        assert here["heldout_rmse_um"] == pytest.approx(there["heldout_rmse_um"], rel=1e-9)
        copies = [one["evidence"]["original"] for one in found["findings"] if one["id"] == "same-file-twice"]
        assert copies == ([f"all_r{k}" for k in range(1, 5)] if len(names) > 1 else [])


@pytest.mark.parametrize(
    "options",
    [
        ["--degree", "2", "--interactions"],
        ["--memory"],
        ["--ridge"],
        ["--reference", "absolute"],
        ["--rounds", "2"],
        ["--absolute-similarity"],
        ["--grouping", "cmeans"],
        ["--must", "T6", "--never", "T1", "--cost", "T2=3", "--max-sensors", "2"],
        ["--condition", "r1=a", "--condition", "r2=a"],
        ["--tolerance", "0.01"],
    ],
)
def test_options(runs, capsys, options):
    found = selection(capsys, str(runs), *options)
    model = found["models"]["Z_um" if "Z_um" in found["models"] else "Z"]
    baseline = next(iter(found["proof"]["baselines_um"].values()))["none"]
    # the displacement spans tens of micrometres and the noise is 0.3: any sensible model takes off nine tenths
    assert model["heldout_rmse_um"] < 0.1 * baseline
    if "--must" in options:
        assert "T6" in found["chosen"]["sensors"]
        assert "T1" not in found["sensors"]
        assert len(found["chosen"]["sensors"]) <= 2
    fuzzy = found.get("fuzzy")
    assert (fuzzy is not None) == ("cmeans" in options)
    if fuzzy is not None:
        assert np.sum(fuzzy["memberships"], axis=1) == pytest.approx(1.0)
        assert np.shape(fuzzy["memberships"]) == (len(found["sensors"]), len(found["rounds"][0]["groups"]))
        assert fuzzy["fpc"] == next(one["fpc"] for one in found["screenings"] if one["chosen"])


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["--lambda", "1.5"], "from 0 to 1"),
        (["--grouping", "kmeans"], "closure or cmeans"),
        (["--grouping", "cmeans", "--lambda", "0.9"], "--lambda"),
        (["--grouping", "cmeans", "--rounds", "2"], "--rounds"),
        (["--lambda", "nan"], "from 0 to 1"),
        (["--lambda", "much"], "a number from 0 to 1, or auto"),
        (["--must", "T99"], "T99"),
        (["--must", "T1", "--never", "T1"], "at most one"),
        (["--response", "T1"], "displacement"),
        (["--degree", "4"], "1 to 3"),
        (["--max-sensors", "0"], "at least 1"),
        (["--cost", "T1=-1"], "0 or more"),
        (["--tolerance", "-1"], "0 or more"),
        (["--condition", "r9=a"], "r9"),
        (["--reference", "zero"], "rise"),
        (["--seed", "-1"], "0"),
        (["--date", "yesterday"], "YYYY-MM-DD"),
        (
            ["--never", "T1", "--never", "T2", "--never", "T3", "--never", "T4", "--never", "T5", "--never", "T6"],
            "every",
        ),
    ],
)
def test_unusable_options(runs, tmp_path, capsys, options, said):
    out = tmp_path / "out"
    assert exit_status(["select", str(runs), *options, "--out", str(out), "--json"]) == 2
    captured = capsys.readouterr()
    assert captured.out == ""
    assert said in captured.err
    assert "What to do" in captured.err
    assert not out.exists()


def test_what_a_control_leaves_that_loses_readings_is_what_the_replay_of_its_program_says(runs, tmp_path, capsys):
    recordings, rng = tmp_path / "runs", np.random.default_rng(1)
    recordings.mkdir()
    for file in sorted(runs.glob("*.csv")):
        table = pd.read_csv(file)
        for name in (f"T{k}" for k in range(1, 7)):
            table.loc[rng.random(len(table)) < 0.05, name] = np.nan
        table.to_csv(recordings / file.name, index=False)
    study = tmp_path / "study"
    assert exit_status(["select", str(recordings), "--out", str(study), "--json"]) == 0
    [told] = [one for one in json.loads(capsys.readouterr().out)["findings"] if one["id"] == "lost-readings-cost"]
    assert any("lost-readings-cost" in text for text in [(study / "selection.json").read_text(encoding="utf-8")])
    proof = export_model(study / "model.json", "python", tmp_path / "out", ExportOptions(replay=[recordings])).replay
    squares = {name: [] for name in told["evidence"]["program_rmse_um"]}
    for run in proof.runs:
        for name, of in run.accuracy.items():
            squares[name].append((of.rmse_um**2, of.n_samples))
    for name, parts in squares.items():
        left_um = np.sqrt(np.average([one for one, _ in parts], weights=[n for _, n in parts]))
        # the same sums in another order
        assert told["evidence"]["program_rmse_um"][name] == pytest.approx(left_um, rel=1e-9)
        assert told["evidence"]["filled_rmse_um"][name] < 0.5 * left_um


def test_whole_readings_cost_nothing(runs, capsys):
    assert "lost-readings-cost" not in {one["id"] for one in selection(capsys, str(runs))["findings"]}


def test_out_that_is_a_file_is_refused_before_the_work(runs, tmp_path, capsys):
    (tmp_path / "out").write_text("mine", encoding="utf-8")
    assert exit_status(["select", str(runs), "--out", str(tmp_path / "out")]) == 2
    assert (tmp_path / "out").read_text(encoding="utf-8") == "mine"
    assert "file" in capsys.readouterr().err


def test_a_stream_gives_the_same_sensors(runs, tmp_path, capsys, monkeypatch):
    folder = tmp_path / "parquet"
    assert exit_status(["convert", str(runs), "--out", str(folder), "--format", "parquet"]) == 0
    capsys.readouterr()
    whole = selection(capsys, str(folder))
    monkeypatch.setattr("selector.readers.stream.LARGE_BYTES", 1000)
    files = [str(path) for path in sorted(folder.glob("*.parquet"))]
    pieces = selection(capsys, *files, "--machine", str(folder / "machine.toml"))
    assert pieces["chosen"]["sensors"] == whole["chosen"]["sensors"]
    name = next(iter(whole["models"]))
    assert pieces["models"][name]["heldout_rmse_um"] == pytest.approx(
        whole["models"][name]["heldout_rmse_um"], rel=1e-9
    )
    assert any(finding["id"] == "read-in-pieces" for finding in pieces["findings"])
