"""`selector report`: the same page from the results on disk, several in one, and nothing from a file that is none."""

from __future__ import annotations

import json
import re
import shutil
from pathlib import Path

import pytest

from selector.cli import exit_status
from selector.shipped import shipped


@pytest.fixture(scope="module")
def world(tmp_path_factory) -> Path:
    """A selection, a diagnosis and a prediction with their recordings."""
    root = tmp_path_factory.mktemp("world")
    shutil.copytree(shipped("patent8"), root / "runs")
    shutil.copytree(shipped("diagnosis"), root / "drifting")
    duty = shipped("patent8").parent / "dutycycle"
    assert exit_status(["select", str(root / "runs"), "--response", "Z", "--out", str(root / "selected")]) == 0
    compared = ["--machine", str(root / "drifting" / "machine.toml"), "--simulation", str(root / "drifting" / "sim")]
    assert exit_status(["diagnose", str(root / "drifting"), *compared, "--out", str(root / "diagnosed")]) == 0
    cycle = ["--cycle", str(duty / "cycles" / "five_operations.csv"), "--operations", "60,60,60,60,60"]
    tests = [str(duty / "tests"), "--machine", str(duty / "machine.toml"), "--tolerance", "10"]
    assert exit_status(["predict", *tests, *cycle, "--out", str(root / "predicted")]) == 0
    return root


@pytest.mark.parametrize("name", ["selected", "diagnosed"])
def test_the_same_page_again(world, tmp_path, capsys, name):
    assert exit_status(["report", str(world / name), "-o", str(tmp_path / "again.html")]) == 0
    assert "left out" not in capsys.readouterr().out
    assert (tmp_path / "again.html").read_bytes() == (world / name / "report.html").read_bytes()


def test_results_alone_say_what_is_left_out(world, tmp_path, capsys, monkeypatch):
    monkeypatch.setenv("COLUMNS", "1000")  # lines that no path breaks
    for name, file in {
        "selected": "selection.json",
        "diagnosed": "diagnosis.json",
        "predicted": "prediction.json",
    }.items():
        shutil.copy(world / name / file, tmp_path / file)
    alone = [str(tmp_path / file) for file in ("selection.json", "diagnosis.json", "prediction.json")]
    assert exit_status(["report", *alone, "-o", str(tmp_path / "a.html"), "--title", "Three"]) == 0
    told = capsys.readouterr().out
    assert "selection.json: left out:" in told
    assert "diagnosis.json: left out:" in told
    page = (tmp_path / "a.html").read_text(encoding="utf-8")
    assert "<title>Three</title>" in page
    assert page.count("What this page leaves out") == 2
    headline = json.loads((tmp_path / "diagnosis.json").read_text(encoding="utf-8"))["headline"]
    assert headline.split(":")[0] in page
    assert exit_status(["report", *alone, "-o", str(tmp_path / "b.html"), "--title", "Three"]) == 0
    assert (tmp_path / "a.html").read_bytes() == (tmp_path / "b.html").read_bytes()


def test_several_results_are_one_page_whose_places_have_one_name_each(world, tmp_path, capsys):
    results = [str(world / name) for name in ("selected", "diagnosed", "selected", "predicted")]
    results.append(str(world / "selected" / "model.json"))
    assert exit_status(["report", *results, "-o", str(tmp_path / "all.html")]) == 0
    page = (tmp_path / "all.html").read_text(encoding="utf-8")
    content = page.partition("<body>")[2].partition("\n<script>")[0]
    ids = re.findall(r'<[^<>]* id="([^"]*)"', content)
    assert len(ids) > 20
    assert len(ids) == len(set(ids))
    assert set(re.findall(r'<[^<>]* href="#([^"]*)"', content)) <= set(ids)
    assert page.count("<html") == 1
    assert len(re.findall(r"<script>", page)) == 2
    assert not re.search(r'(?:src|href)="(?:https?:)?//', content)


def test_a_changed_recording_is_not_read(world, tmp_path, capsys):
    shutil.copytree(world, tmp_path / "here")
    with (tmp_path / "here" / "runs" / "recording.csv").open("a", encoding="utf-8") as file:
        file.write("\n")
    assert exit_status(["report", str(tmp_path / "here" / "selected"), "-o", str(tmp_path / "a.html")]) == 0
    assert "recording.csv has changed" in capsys.readouterr().out
    assert (tmp_path / "a.html").stat().st_size > 1e6


def refused(capsys, path: Path, out: Path) -> str:
    capsys.readouterr()
    assert exit_status(["report", str(path), "-o", str(out)]) == 2
    told = capsys.readouterr().err
    assert "Traceback" not in told
    assert not out.exists()
    return told


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (b"", "ends in the middle"),
        (b'{"schema": "selector.selection/1", "sensors": [', "ends in the middle"),
        (b'{"schema": "selector.selection/2"}', "selector.selection/2"),
        (b'{"schema": ["selector.selection/1"]}', "schema"),
        (b"[]", "no field 'schema'"),
        (b'{"schema": "selector.selection/1", "lambda": 1e400}', "1e400"),
        (b'{"schema": "selector.selection/1", "lambda": NaN}', "NaN"),
        (b'{"schema": "selector.selection/1", "schema": 1}', "more than once"),
        (b'{"schema": "selector.selection/1", "lambda": 123456789012345678901234567890}', "integer"),
        (b"[" * 200_000, "nested too deep"),
        (b'{"a":' * 100_000, "nested too deep"),
        (b'{"schema": "selector.selection/1"}', "no field 'sensors'"),
        (b'{"schema": "selector.diagnosis/1", "verdict": 3}', "verdict"),
        (b'{"schema": "selector.prediction/1", "method": "modal", "time_s": [1], "displacement_um": {"Z": []}}',
         "contradict"),
        (b'{"schema": "selector.model/1"}', "model"),
        (b"\xff\xfe{}", "UTF-8"),
    ],
)  # fmt: skip
def test_hostile_and_cut_off_results_end_with_a_message(tmp_path, capsys, content, said):
    path = tmp_path / "selection.json"
    path.write_bytes(content)
    assert said in refused(capsys, path, tmp_path / "out.html")


def test_a_cut_off_selection_ends_with_a_message_wherever_it_was_cut(world, tmp_path, capsys):
    whole = (world / "selected" / "selection.json").read_bytes()
    for share in (0.01, 0.3, 0.9, 0.999):
        path = tmp_path / "selection.json"
        path.write_bytes(whole[: int(share * len(whole))])
        refused(capsys, path, tmp_path / "out.html")


def test_what_is_no_result(tmp_path, world, capsys):
    (tmp_path / "empty").mkdir()
    assert "without results" in refused(capsys, tmp_path / "empty", tmp_path / "out.html")
    shutil.copy(world / "selected" / "study.toml", tmp_path / "empty" / "study.toml")
    assert "selector select --study" in refused(capsys, tmp_path / "empty", tmp_path / "out.html")
    assert "nothing.json" in refused(capsys, tmp_path / "nothing.json", tmp_path / "out.html")


def test_a_result_is_not_replaced_by_its_report(world, tmp_path, capsys):
    shutil.copytree(world / "selected", tmp_path / "selected")
    path = tmp_path / "selected" / "selection.json"
    assert exit_status(["report", str(path), "-o", str(path)]) == 2
    assert "selection.json" in capsys.readouterr().err
    assert exit_status(["report", str(path), "-o", str(tmp_path / "selected")]) == 2
    assert "folder" in capsys.readouterr().err
