"""`selector ballbar`: a file in, causes out, the same in JSON, folder and screen; unusable files end with 2."""

from __future__ import annotations

import json

import pytest

from selector.cli import exit_status
from tests.physics.drive.planted_circles import PlantedCircles

SHARE = 0.1
"""An error of a tenth of its size is what a planted cause may have."""


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    return PlantedCircles(5).write(tmp_path_factory.mktemp("ballbar") / "test.txt")


def test_planted_causes_come_out(written, tmp_path, capsys):
    out = tmp_path / "answer"
    assert exit_status(["ballbar", str(written), "--lead", "X=10", "--lead", "y=10", "--out", str(out), "--json"]) == 0
    said = json.loads(capsys.readouterr().out)
    assert said == json.loads((out / "ballbar.json").read_text(encoding="utf-8"))
    assert said["schema"] == "selector.ballbar/1"
    assert (said["radius_mm"], said["axes"], len(said["circles"])) == (100.0, ["X", "Y"], 4)
    assert [one["feed_mm_per_min"] for one in said["quantities"]] == [1000.0, 3000.0]
    for name, size in PlantedCircles(5).expected().items():
        assert said["causes"]["through_feeds"][name]["value"] == pytest.approx(size, rel=SHARE), name
    lost = [one for one in said["causes"]["feeds"][0]["causes"] if one["cause"] == "backlash"]
    assert len(lost) == 2
    # only a model knows its own wind-up
    assert not any("wind_up_um" in one for one in lost)
    assert "scatterpolar" in (out / "report.html").read_text(encoding="utf-8")


def test_what_a_control_needs_is_a_table(written, tmp_path, capsys):
    out = tmp_path / "answer"
    assert exit_status(["ballbar", str(written), "--reset-time", "X=125", "--out", str(out), "--json"]) == 0
    said = json.loads(capsys.readouterr().out)["compensation"]
    planted = PlantedCircles(5).drawn()
    for axis in "XY":
        assert said["backlash"][axis]["value"] == pytest.approx(planted[f"backlash {axis}"], rel=SHARE)
    # the axis with the higher gain is ahead
    assert said["delay"]["axis"] == max("XY", key=lambda axis: planted[f"gain {axis}"])
    assert {one["axis"] for one in said["pulses"] if one["amplitude"] is not None} == {"X"}
    assert "speed pulse of X" in (out / "report.html").read_text(encoding="utf-8")


def test_the_screen_says_how_round_and_why(written, capsys):
    assert exit_status(["ballbar", str(written)]) == 0
    said = capsys.readouterr().out
    for word in ("ISO 230-4", "Causes at 3000 mm/min", "Through all feeds", "squareness"):
        assert word in said


@pytest.mark.parametrize(
    ("words", "named"),
    [
        (["--axes", "X"], "--axes X"),
        (["--radius", "0"], "--radius 0"),
        (["--lead", "X"], "--lead X"),
        (["--lead", "Z=10"], "leads"),
        (["--reset-time", "Z=10"], "--reset-time Z"),
        (["--reset-time", "X=-1"], "--reset-time X=-1"),
        (["--feed", "1000"], "one trace counter-clockwise and one clockwise"),
    ],
)
def test_what_cannot_be_asked_ends_with_2(written, tmp_path, capsys, words, named):
    out = tmp_path / "answer"
    assert exit_status(["ballbar", str(written), "--out", str(out), *words]) == 2
    said = capsys.readouterr()
    assert named in said.err
    assert "Traceback" not in said.err
    assert not out.exists()


def test_one_direction_is_not_enough(tmp_path, capsys):
    path = tmp_path / "one.csv"
    path.write_text("angle_deg,deviation_um\n" + "".join(f"{a},{a % 7}\n" for a in range(360)), encoding="utf-8")
    assert exit_status(["ballbar", str(path), "--radius", "100", "--feed", "1000"]) == 2
    assert "both directions" in capsys.readouterr().err
