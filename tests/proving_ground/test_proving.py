"""`selector prove` from the command line: table, files, refusals; on tiny scenarios with an answerer of the tests."""

from __future__ import annotations

import csv
import json

import pytest

from selector.cli import exit_status
from tests.proving_ground.tiny_cases import BROKEN, CLEAN, SINGLE, by_correlation


@pytest.fixture
def _tiny(monkeypatch):
    monkeypatch.setattr("proving_ground.scenarios.scenarios", lambda *_: (SINGLE, CLEAN, BROKEN))
    monkeypatch.setattr("proving_ground.runner.answer_of_selector", by_correlation)


FEW = ["prove", "--strengths", "3,12", "--seeds", "0:2", "--jobs", "1"]


@pytest.mark.usefixtures("_tiny")
def test_the_score_is_json_and_lines_go_to_stderr(capsys):
    assert exit_status([*FEW, "--json"]) == 0
    said = capsys.readouterr()
    result = json.loads(said.out)
    assert result["schema"] == "selector.proof/1"
    assert result["cases"] == 10
    assert len(result["failures"]) == 4
    assert result["exam"] is False
    assert len(said.err.splitlines()) == 10
    assert "[10/10]" in said.err
    assert "tiny/single d′=12 seed 1" in said.err


@pytest.mark.usefixtures("_tiny")
def test_a_person_reads_a_table(capsys):
    assert exit_status(FEW) == 0
    out = capsys.readouterr().out
    first_column = " ".join(line.split("  ")[0].strip() for line in out.splitlines())
    assert "any false name on clean cases" in " ".join(first_column.split())  # broken into lines on narrow screens
    assert "the machine fell over" in " ".join(out.split())


@pytest.mark.usefixtures("_tiny")
def test_files_are_written_and_the_page_says_what_is_not_good_enough(tmp_path, capsys):
    out = tmp_path / "proof"
    assert exit_status([*FEW, "--rivals", "aic", "--out", str(out)]) == 0
    assert sorted(path.name for path in out.iterdir()) == ["cases.csv", "report.html", "score.json"]
    rows = list(csv.DictReader((out / "cases.csv").read_text(encoding="utf-8").splitlines()))
    assert len(rows) == 20
    assert {row["answerer"] for row in rows} == {"selector", "aic"}
    page = (out / "report.html").read_text(encoding="utf-8")
    assert "seeds of development" in page
    assert "largest drop of AIC" in page
    assert "rivals" in json.loads((out / "score.json").read_text(encoding="utf-8"))


@pytest.mark.usefixtures("_tiny")
def test_exam_seeds_need_the_exam(capsys):
    assert exit_status(["prove", "--seeds", "10000:10002"]) == 2
    assert "--exam" in capsys.readouterr().err
    assert exit_status(["prove", "--exam", "--seeds", "0:2"]) == 2


@pytest.mark.usefixtures("_tiny")
@pytest.mark.parametrize(
    "wrong", [["--seeds", "a"], ["--strengths", "0"], ["--strengths", "x"], ["--rivals", "nobody"], ["--jobs", "0"]]
)
def test_unusable_options_end_with_2(wrong, capsys):
    assert exit_status(["prove", *wrong]) == 2
    assert wrong[0] in capsys.readouterr().err


@pytest.mark.usefixtures("_tiny")
def test_names_can_be_listed(capsys):
    assert exit_status(["prove", "--list", "--json"]) == 0
    assert [one["name"] for one in json.loads(capsys.readouterr().out)] == ["tiny/single", "tiny/clean", "tiny/broken"]


def test_cases_can_be_written_for_others(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr("proving_ground.scenarios.scenarios", lambda *_: (SINGLE, CLEAN))
    out = tmp_path / "cases"
    assert exit_status(["prove", "--strengths", "6", "--seeds", "0:1", "--write-cases", str(out), "--json"]) == 0
    result = json.loads(capsys.readouterr().out)
    assert result["cases"] == 2
    assert result["answers_sha256"] in (out / "answers.sha256").read_text(encoding="utf-8")
    assert sorted(path.name for path in (out / "cases").iterdir()) == ["case-001", "case-002"]
