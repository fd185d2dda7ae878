"""The pages of `predict` and `simulate thermal` from the command line: written beside the rest, or refused in words."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest

from selector.cli import exit_status
from tests.cli.test_simulating import ONE_NODE
from tests.physics.thermal.test_field_moment import MODEL

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("model.toml").write_text(ONE_NODE, encoding="utf-8")
    return tmp_path


def run(capfd, *arguments: str) -> tuple[int, str, str]:
    capfd.readouterr()
    code = exit_status([*arguments, "--json"])
    out, err = capfd.readouterr()
    return code, out, err


def test_a_simulation_has_a_page_if_it_is_asked_for(folder, capfd):
    code, out, err = run(capfd, "simulate", "thermal", "model.toml", "--out", "a.csv", "--report", "pages/a.html")
    assert code == 0, err
    document = json.loads(out)
    assert document["report"] == "pages/a.html"
    assert document["files"] == ["a.csv", "a.machine.toml"]
    page = Path("pages/a.html").read_text(encoding="utf-8")
    assert "SIMULATED" in page
    assert "Z moves most" in page
    first = Path("pages/a.html").read_bytes()
    assert run(capfd, "simulate", "thermal", "model.toml", "--out", "a.csv", "--report", "pages/a.html")[0] == 0
    assert Path("pages/a.html").read_bytes() == first
    _, out, _ = run(capfd, "simulate", "thermal", "model.toml", "--out", "b.csv")
    assert json.loads(out)["report"] is None


def test_recorded_runs_stand_on_one_page(folder, capfd):
    for name in ("r1", "r2"):
        assert run(capfd, "simulate", "thermal", "model.toml", "--out", f"runs/{name}.csv")[0] == 0
        Path(f"runs/{name}.machine.toml").rename(folder / "machine.toml")
    arguments = ["model.toml", "--inputs", "runs", "--machine", "machine.toml", "--out", "again", "--report", "a.html"]
    code, _, err = run(capfd, "simulate", "thermal", *arguments)
    assert code == 0, err
    page = Path("a.html").read_text(encoding="utf-8")
    assert "<h2>Run r1</h2>" in page
    assert "<h2>Run r2</h2>" in page
    # what acts was recorded, what answers was simulated
    assert re.search(r"<td[^>]*>spindle_speed</td><td>input</td>", page)
    assert re.search(r"<td[^>]*>T1</td><td>output</td>", page)


@pytest.mark.parametrize(
    ("more", "said"),
    [
        (["--report", "a.csv"], "ends in .html"),
        (["--report", "model.toml/a.html"], "a folder"),
        (["--report", "a.html", "--picture-at-min", "5"], "for a model of the kind network"),
        (["--picture-at-min", "5"], "without --report"),
    ],
)
def test_a_page_that_cannot_be_is_refused_before_anything_is_written(more, said, folder, capfd):
    code, out, err = run(capfd, "simulate", "thermal", "model.toml", "--out", "a.csv", *more)
    assert (code, out) == (2, "")
    assert said in err
    assert "What to do" in err
    assert sorted(path.name for path in folder.iterdir()) == ["model.toml"]


def test_a_picture_after_the_end_is_refused(folder, capfd):
    Path("field.toml").write_text(MODEL, encoding="utf-8")
    arguments = ["field.toml", "--out", "a.csv", "--report", "a.html", "--picture-at-min"]
    for minutes, said in (("-1", "0 or more"), ("nan", "0 or more"), ("91", "at most 90 min")):
        code, _, err = run(capfd, "simulate", "thermal", *arguments, minutes)
        assert code == 2
        assert said in err
        assert sorted(path.name for path in folder.iterdir()) == ["field.toml", "model.toml"]
    code, _, err = run(capfd, "simulate", "thermal", *arguments, "65")
    assert code == 0, err
    page = Path("a.html").read_text(encoding="utf-8")
    assert "1 h 5 min, at 0 r/min," in page
    assert "with 1 thermometer\\u003c" in page
    # the drawing program has 4.8 MB; the picture of the field is to stay below 1.5
    assert len(page) < 6.4e6


def test_the_page_of_a_prediction_says_where_it_comes_from(folder, capfd):
    tests = ROOT / "fixtures" / "dutycycle"
    code, _, err = run(
        capfd, "predict", str(tests / "tests"), "--machine", str(tests / "machine.toml"), "--response", "Z",
        "--cycle", str(tests / "cycles" / "rising.csv"), "--method", "piecewise", "--tolerance", "10", "--out", "out",
    )  # fmt: skip
    assert code == 0, err
    page = Path("out/report.html").read_text(encoding="utf-8")
    for text in ("Simulated data", "rising.csv", "n0800.csv", "Spindle on a column", "SHA-256", "Timed offset blocks"):
        assert text in page
    assert str(tests) not in page
    assert "within 10 µm" in page
    blocks = Path("out/program.txt").read_text(encoding="utf-8").split("[Z]")[1].strip()
    assert blocks.splitlines()[-1].replace("'", "&#39;").replace(">", "&gt;") in page
