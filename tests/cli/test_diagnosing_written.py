"""What `selector diagnose` writes, what of an earlier answer it removes, and what it does not open."""

from __future__ import annotations

import hashlib
import json
import os
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from selector.cli import exit_status
from selector.diagnosis import workflow
from selector.diagnosis.answer import Diagnosis, Errors, Fit, NamedEffect
from tests.cli.test_diagnosing import command, folder, refused

__all__ = ["folder"]


def answered_with(comparison, course):
    """An answer that names one thermal effect, of this course; nothing if it is None."""
    errors = Errors(1.0, 0.5, 0.4)
    zero = np.zeros(len(comparison.time_s))
    effect = NamedEffect(
        "thermal.memory", "Z", "column", "Z follows past heating.", {}, 0.97, 1e-6, 0.8, (), "warm up",
        courses={"Z": course},
    )  # fmt: skip
    found = Diagnosis(
        comparison, "nothing-missing", "", (), (),
        {name: Fit("um", errors, errors, 0.9, None, None, zero, zero, zero) for name in comparison.responses},
        (), (), (), {}, comparison.findings, 0,
    )  # fmt: skip
    return found if course is None else replace(found, verdict="missing-physics", effects=(effect,))


@pytest.fixture
def answers(monkeypatch):
    """The courses that the next answers name, from the comparison; None: nothing is named."""
    courses = []

    def answered(comparison, **_):
        course = courses.pop(0)
        return answered_with(comparison, None if course is None else course(comparison))

    monkeypatch.setattr(workflow, "diagnosis", answered)
    return courses


def follows_t1(comparison):
    return 0.5 * (comparison.recorded["T1"] - comparison.recorded["T1"][0])


def follows_nothing(comparison):
    return np.where(np.arange(len(comparison.time_s)) % 2 == 0, 5.0, -5.0)


def names(path):
    return sorted(one.name for one in path.iterdir())


def test_an_answer_takes_the_place_of_an_earlier_one(folder, answers, capsys):
    out = folder / "answer"
    answers += [follows_t1, None]
    assert exit_status(command(folder, "--out", str(out))) == 0
    assert names(out) == ["correction.json", "diagnosis.json", "model.json", "report.html", "study.toml"]
    assert all(name in capsys.readouterr().out for name in names(out)[:1])
    (out / "notes.txt").write_text("mine", encoding="utf-8")
    assert exit_status(command(folder, "--out", str(out))) == 0
    assert names(out) == ["diagnosis.json", "notes.txt", "report.html", "study.toml"]


@pytest.mark.parametrize("name", ["diagnosis.json", "report.html", "correction.json", "model.json", "study.toml"])
def test_what_something_else_wrote_is_not_replaced(folder, answers, capsys, name):
    out = folder / "answer"
    out.mkdir()
    (out / name).write_text('{"schema": "selector.model/1", "name": "mine"}', encoding="utf-8")
    said = refused(capsys, command(folder, "--out", str(out)))
    assert name in said
    assert "another folder" in said
    assert (out / name).read_text(encoding="utf-8").endswith('"mine"}')
    assert names(out) == [name]


def test_a_folder_in_the_place_of_a_file_is_not_replaced(folder, answers, capsys):
    (folder / "answer" / "report.html").mkdir(parents=True)
    assert "report.html" in refused(capsys, command(folder, "--out", str(folder / "answer")))


def test_an_improved_model_of_an_earlier_answer_goes_and_one_of_yours_stays(folder, answers):
    out = folder / "answer"
    out.mkdir()
    improved = out / "improved.toml"
    improved.write_text("# Written by `selector diagnose --model`: the model with …\n", encoding="utf-8")
    answers += [None, None]
    assert exit_status(command(folder, "--out", str(out))) == 0
    assert names(out) == ["diagnosis.json", "report.html", "study.toml"]
    improved.write_text("mine", encoding="utf-8")
    assert exit_status(command(folder, "--out", str(out))) == 0
    assert improved.read_text(encoding="utf-8") == "mine"


def test_what_is_told_of_the_correction_is_told_everywhere(folder, answers, capsys):
    answers += [follows_nothing] * 3
    assert exit_status(command(folder)) == 0
    told = " ".join(capsys.readouterr().out.split())
    assert exit_status(command(folder, "--json")) == 0
    alone = json.loads(capsys.readouterr().out)
    (finding,) = [one for one in alone["findings"] if one["id"] == "correction-not-in-model-file"]
    assert finding["statement"] in told
    assert exit_status(command(folder, "--json", "--out", str(folder / "answer"))) == 0
    assert json.loads(capsys.readouterr().out) == alone
    assert json.loads((folder / "answer" / "diagnosis.json").read_text(encoding="utf-8")) == alone
    assert names(folder / "answer") == ["correction.json", "diagnosis.json", "report.html", "study.toml"]


def test_an_empty_folder_name(folder, answers, capsys):
    assert "--out" in refused(capsys, command(folder, "--out", ""))
    assert answers == []


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no pipes here")
@pytest.mark.parametrize("option", ["--machine", "--model"])
@pytest.mark.parametrize("ending", [".toml", ".fmu"])
def test_pipes_are_not_opened(folder, answers, capsys, option, ending):
    pipe = folder / f"pipe{ending}"
    os.mkfifo(pipe)
    simulation = ["--simulation", str(folder / "sim")] if option == "--machine" else []
    arguments = ["diagnose", str(folder / "r1.csv"), option, str(pipe), *simulation]
    assert "not a regular file" in refused(capsys, arguments)


def test_a_device_and_a_file_too_large_are_no_machine_file(folder, answers, capsys):
    large = folder / "large.toml"
    large.write_bytes(b"# \n" * 3_500_000)
    files = ["diagnose", str(folder / "r1.csv"), "--simulation", str(folder / "sim"), "--machine"]
    assert "10 MB" in refused(capsys, [*files, str(large)])
    if Path("/dev/zero").exists():
        assert "device" in refused(capsys, [*files, "/dev/zero"])


def test_the_report_tells_files_with_hashes_and_what_was_asked(folder, answers):
    answers.append(None)
    out = folder / "answer"
    assert exit_status(command(folder, "--out", str(out), "--holdout", "r2", "--false-alarm", "0.03")) == 0
    page = (out / "report.html").read_text(encoding="utf-8")
    for path in (folder / "r1.csv", folder / "sim" / "r1.csv"):
        assert hashlib.sha256(path.read_bytes()).hexdigest() in page
    for part in ("r1, simulated", "r1.csv", "holdout", "0.03"):
        assert part in page
    assert str(folder) not in page
