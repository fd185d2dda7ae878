"""`selector taps`: a tap test in, fitted joints out, the same in JSON, folder and screen; wrong input ends with 2."""

from __future__ import annotations

import json

import pytest

from selector.cli import exit_status
from selector.physics.vibration.model_file import read_model_file
from tests.physics.vibration.planted_taps import MODEL, drawn

pytest.importorskip("pyuff")

TAPS = MODEL.parent / "taps.uff"
WORDS = ["taps", str(MODEL), str(TAPS), "--point", "2=workpiece", "--point", "3=tool"]


def test_the_joints_come_out(tmp_path, capsys):
    out = tmp_path / "answer"
    assert exit_status([*WORDS, "--out", str(out), "--json"]) == 0
    said = json.loads(capsys.readouterr().out)
    assert said == json.loads((out / "taps.json").read_text(encoding="utf-8"))
    assert said["schema"] == "selector.taps/1"
    assert [(one["of"], one["at"], one["taps"]) for one in said["responses"]] == [
        (of, at, 3) for at in ("tool", "workpiece") for of in ("tool", "workpiece")
    ]
    # how fixtures/make/taps.py drew them
    true = drawn(3).parameters
    assert len(said["parameters"]) == 6
    for one in said["parameters"]:
        assert one["low"] < true[one["name"]].value < one["high"], one["name"]
    assert len(said["modes"]) == 3
    fitted = read_model_file(out / "model.toml")
    assert fitted.joints[2].stiffness_n_per_m == said["parameters"][4]["value"]
    assert fitted.members == read_model_file(MODEL).members
    page = (out / "report.html").read_text(encoding="utf-8")
    assert all(word in page for word in ("by the file", "tool / workpiece", "95 % interval"))


def test_the_screen_says_what_was_fitted(capsys):
    assert exit_status([*WORDS, "--free", "joints.3.stiffness_n_per_m"]) == 0
    said = capsys.readouterr().out
    assert "stiffness of tool – bed" in said
    assert "stiffness of workpiece" not in said


def test_a_point_that_is_left_out_takes_its_taps_along(capsys):
    assert exit_status([*WORDS[:5], "--point", "3=", "--json"]) == 0
    said = json.loads(capsys.readouterr().out)
    assert [(one["of"], one["at"]) for one in said["responses"]] == [("workpiece", "workpiece")]
    (left,) = (one for one in said["findings"] if one["id"] == "uff-left-out")
    # three taps on the tool with two motions each, and its motion in three others
    assert sum(left["evidence"].values()) == 12


@pytest.mark.parametrize(
    ("words", "named"),
    [
        (["--point", "x=tool"], "--point x=tool"),
        (["--point", "4"], "--point 4"),
        (["--point", "3="], "twice"),
        (["--axis", "X"], "another direction"),
        (["--unit", "mm"], "--unit mm"),
        (["--unit", "N/m"], "--unit N/m"),
        (["--unit", "um/kN"], "motion of type 12"),
        (["--band", "400", "20"], "--band 400 20"),
        (["--band", "x", "400"], "--band"),
        (["--band", "9000", "9900"], "lines that count"),
        (["--window", "0"], "--window 0"),
        (["--free", "joints.9.dissipation"], "joints.9.dissipation"),
        (["--out", str(TAPS.parent)], "--out"),
    ],
)
def test_what_cannot_be_asked_ends_with_2(tmp_path, capsys, words, named):
    assert exit_status([*WORDS, *words]) == 2
    said = capsys.readouterr().err
    assert named in said
    assert "Traceback" not in said


def test_another_kind_of_model_or_file_ends_with_2(capsys):
    drive = MODEL.parents[1] / "drive" / "ball-bar.toml"
    elsewhere = [*WORDS[:5], "--point", "3=spindle"]
    other_model, other_file = ["taps", str(drive), *WORDS[2:]], ["taps", str(MODEL), str(drive), *WORDS[3:]]
    for words in (elsewhere, other_model, other_file, WORDS[:3]):
        assert exit_status(words) == 2
    assert "Traceback" not in capsys.readouterr().err
