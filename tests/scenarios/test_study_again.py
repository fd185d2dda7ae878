"""A study is done again: the same bytes from its file alone, also elsewhere; what changed is told."""

from __future__ import annotations

import re
import shutil
from pathlib import Path

import pytest

from selector.cli import exit_status
from selector.shipped import shipped

SELECTED = ("selection.json", "model.json", "report.html")


@pytest.fixture(scope="module")
def world(tmp_path_factory) -> Path:
    """Recordings, and two studies of them."""
    root = tmp_path_factory.mktemp("world")
    shutil.copytree(shipped("patent8"), root / "runs")
    shutil.copytree(shipped("diagnosis"), root / "drifting")
    asked = [
        "--response", "Z", "--lambda", "0.995", "--must", "T1", "--cost", "T3=2", "--never", "T8",
        "--date", "2026-11-20", "--unit", "T1=degC", "--seed", "4", "--tolerance", "0.001",
    ]  # fmt: skip
    assert exit_status(["select", str(root / "runs"), *asked, "--out", str(root / "selected")]) == 0
    compared = ["--machine", str(root / "drifting" / "machine.toml"), "--simulation", str(root / "drifting" / "sim")]
    assert exit_status(["diagnose", str(root / "drifting"), *compared, "--out", str(root / "diagnosed")]) == 0
    return root


def bytes_of(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in folder.iterdir() if path.name != "study.toml"}


@pytest.mark.parametrize(("command", "name"), [("select", "selected"), ("diagnose", "diagnosed")])
def test_the_same_bytes_again_and_in_another_place(world, tmp_path, capsys, command, name):
    first = bytes_of(world / name)
    assert exit_status([command, "--study", str(world / name), "--out", str(world / f"{name} again")]) == 0
    assert "same bytes" in capsys.readouterr().out
    assert bytes_of(world / f"{name} again") == first
    assert (world / f"{name} again" / "study.toml").read_bytes() == (world / name / "study.toml").read_bytes()
    shutil.copytree(world, tmp_path / "moved" / "far away")
    moved = tmp_path / "moved" / "far away" / name / "study.toml"
    assert exit_status([command, "--study", str(moved), "--out", str(tmp_path / "out")]) == 0
    assert bytes_of(tmp_path / "out") == first
    assert str(world.name) not in moved.read_text(encoding="utf-8")


def test_a_study_in_its_own_folder_says_whether_it_came_out_again(world, tmp_path, capsys, monkeypatch):
    monkeypatch.setenv("COLUMNS", "1000")  # lines that no path breaks
    shutil.copytree(world, tmp_path / "here")
    folder = tmp_path / "here" / "selected"
    before = bytes_of(folder)
    assert exit_status(["select", "--study", str(folder)]) == 0
    assert "same bytes" in capsys.readouterr().out
    assert bytes_of(folder) == before
    text = (folder / "study.toml").read_text(encoding="utf-8")
    sha256 = text.partition('"report.html" = "')[2][:64]
    (folder / "study.toml").write_text(text.replace(sha256, "0" * 64), encoding="utf-8")
    assert exit_status(["select", "--study", str(folder), "--json"]) == 0
    assert re.search(r"other bytes .*report\.html", capsys.readouterr().err)


def test_a_changed_recording_ends_with_exit_code_2_unless_it_is_accepted(world, tmp_path, capsys):
    shutil.copytree(world, tmp_path / "here")
    study = tmp_path / "here" / "selected"
    recording = tmp_path / "here" / "runs" / "recording.csv"
    recording.write_bytes(b"\n".join(recording.read_bytes().splitlines()[:-3]) + b"\n")
    out = tmp_path / "out"
    capsys.readouterr()
    assert exit_status(["select", "--study", str(study), "--out", str(out)]) == 2
    told = capsys.readouterr().err
    assert "../runs/recording.csv has changed" in told
    assert "--accept-changes" in told
    assert not out.exists()
    assert exit_status(["select", "--study", str(study), "--accept-changes", "--out", str(out)]) == 0
    told = capsys.readouterr().out
    assert "accepted: ../runs/recording.csv has changed" in told
    assert "other bytes" in told
    # the new study is of the new file
    assert exit_status(["select", "--study", str(out)]) == 0
    assert "other bytes" not in capsys.readouterr().out


def test_results_and_notes_in_the_folder_of_the_recordings_change_nothing(world, tmp_path, capsys):
    runs = tmp_path / "runs"
    shutil.copytree(world / "runs", runs)
    asked = ["select", str(runs), "--response", "Z", "--lambda", "0.995"]
    assert exit_status([*asked, "--out", str(runs)]) == 0
    before = {name: (runs / name).read_bytes() for name in SELECTED}
    (runs / "notes.docx").write_text("mine", encoding="utf-8")
    renamed = runs.rename(tmp_path / "another name")
    capsys.readouterr()
    assert exit_status(["select", "--study", str(renamed), "--out", str(renamed), "--all"]) == 0
    told = capsys.readouterr().out
    assert "same bytes" in told
    assert "notes.docx" in told
    assert {name: (renamed / name).read_bytes() for name in SELECTED} == before


@pytest.mark.parametrize(
    ("more", "said"),
    [
        (["--degree", "2"], "--degree beside --study"),
        (["--response", "Z"], "--response beside --study"),
        (["runs"], "RUN... beside --study"),
        (["--encoding", "utf-8"], "--encoding beside --study"),
        (["--date", "2026-01-01"], "--date beside --study"),
    ],
)
def test_an_option_beside_a_study_is_refused(world, capsys, more, said):
    assert exit_status(["select", "--study", str(world / "selected"), *more]) == 2
    assert said in capsys.readouterr().err


def test_neither_recordings_nor_a_study(capsys):
    assert exit_status(["select"]) == 2
    assert "Missing argument 'RUN...'" in capsys.readouterr().err
    assert exit_status(["select", "r1.csv", "--accept-changes"]) == 2
    assert "without --study" in capsys.readouterr().err


def test_a_study_of_the_other_question(world, capsys):
    assert exit_status(["select", "--study", str(world / "diagnosed")]) == 2
    assert "selector diagnose --study" in capsys.readouterr().err


def test_a_name_that_is_no_text_leaves_the_study_file_out(world, tmp_path, capsys):
    try:
        (tmp_path / "r\udcff1.csv").write_bytes((world / "runs" / "recording.csv").read_bytes())
    except OSError:
        pytest.skip("this file system takes only names that are text")
    machine = ["--machine", str(world / "runs" / "machine.toml")]
    out = tmp_path / "out"
    assert exit_status(["select", str(tmp_path / "r\udcff1.csv"), *machine, "--response", "Z", "--out", str(out)]) == 0
    assert "no study.toml" in capsys.readouterr().out
    assert sorted(path.name for path in out.iterdir()) == sorted(SELECTED)
