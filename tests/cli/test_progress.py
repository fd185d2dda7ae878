"""How far long work has come is told to programs line by line, and to nobody who did not ask."""

from __future__ import annotations

import json
import sys
import time

import pytest

from selector.cli import exit_status
from selector.cli.demo import demo
from selector.cli.shared import progress
from selector.cli.shared.progress import VARIABLE, counted_progress, progress_bar
from selector.shipped import shipped


def lines(text: str) -> list[dict]:
    return [json.loads(line) for line in text.splitlines() if line.startswith("{")]


def test_nothing_is_said_without_a_terminal(capfd, monkeypatch):
    monkeypatch.delenv(VARIABLE, raising=False)
    with counted_progress("search") as report, progress_bar() as say:
        report(1, 10, "first")
        report(10, 10)
        say("folds", 0.5)
    assert capfd.readouterr() == ("", "")


def test_a_long_silence_is_broken_where_it_is_asked(capfd, monkeypatch):
    monkeypatch.delenv(VARIABLE, raising=False)
    monkeypatch.setattr(progress, "_LONGEST_SILENCE_S", 0.01)
    with progress_bar(spoken=True) as say:
        time.sleep(0.2)
        say("folds", 0.5)
        time.sleep(0.2)
    said = capfd.readouterr().err
    assert "s  loading\n" in said
    assert "folds, 50 %" in said


def test_a_demo_whose_modules_load_for_long_says_so(capfd, monkeypatch, tmp_path):
    monkeypatch.delenv(VARIABLE, raising=False)
    monkeypatch.setattr(progress, "_LONGEST_SILENCE_S", 0.01)
    # an import that takes a while, and fails: what follows is not needed here
    monkeypatch.setattr(sys, "meta_path", [Slow(), *sys.meta_path])
    monkeypatch.delitem(sys.modules, "selector.audit", raising=False)
    with pytest.raises(ImportError, match="never mind"):
        demo(tmp_path / "demo")
    assert "s  loading\n" in capfd.readouterr().err


class Slow:
    def find_spec(self, name: str, path: object = None, target: object = None) -> None:
        if name == "selector.audit":
            time.sleep(0.2)
            raise ImportError("never mind")


def test_programs_get_lines(capfd, monkeypatch):
    monkeypatch.setenv(VARIABLE, "lines")
    with progress_bar() as say:
        say("reading", 0.0)
        say("folds", 0.5)
        say("folds", 0.500001)  # too soon after the last one
        say("writing", 1.5)
    out, err = capfd.readouterr()
    assert out == ""
    assert lines(err) == [
        {"doing": "reading", "share": 0.0},
        {"doing": "folds", "share": 0.5},
        {"doing": "writing", "share": 1.0},
    ]


def test_counted_work_gets_lines_too(capfd, monkeypatch):
    monkeypatch.setenv(VARIABLE, "lines")
    with counted_progress("replaying") as report:
        report(1, 4, "run r1")
        report(0, 0)
    assert lines(capfd.readouterr().err) == [
        {"doing": "replaying, run r1", "share": 0.25},
        {"doing": "replaying", "share": None},
    ]


def test_a_selection_says_what_it_does(capfd, monkeypatch):
    monkeypatch.setenv(VARIABLE, "lines")
    patent = shipped("patent8")
    recording = [str(patent / "recording.csv"), "--machine", str(patent / "machine.toml")]
    assert exit_status(["select", *recording, "--response", "Z", "--max-sensors", "2", "--json"]) == 0
    out, err = capfd.readouterr()
    assert json.loads(out)["schema"] == "selector.selection/1"
    shares = [line["share"] for line in lines(err) if line["share"] is not None]
    assert lines(err)[0]["share"] is None  # compiling: nobody knows how long
    assert lines(err)[1] == {"doing": "reading", "share": 0.0}
    assert len(shares) > 2
    assert all(0.0 <= share <= 1.0 for share in shares)
