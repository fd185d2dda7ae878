"""Options that many commands share."""

from __future__ import annotations

from pathlib import Path

import pytest
import typer

from selector.cli import exit_status as app_status
from selector.cli.shared.running import exit_status
from selector.cli.shared.source import Source, pairs, with_source
from selector.errors import OptionError


def test_pairs():
    assert pairs(["T1=degC", " T 2 = degF "], "--unit") == {"T1": "degC", "T 2": "degF"}
    assert pairs(["a=b=um"], "--unit") == {"a=b": "um"}
    assert pairs(None, "--unit") == {}


@pytest.mark.parametrize("values", [["T1"], ["=degC"], ["T1="], ["T1=degC", "T1=degF"]])
def test_pairs_that_cannot_be_used(values):
    with pytest.raises(OptionError, match="--unit"):
        pairs(values, "--unit")


def test_a_command_gets_the_options_as_one_value():
    seen = []
    app = typer.Typer(pretty_exceptions_enable=False)

    @app.command()
    @with_source
    def count(source: Source, twice: bool = False) -> None:
        seen.append((source, twice))

    @app.command()
    def rest() -> None:
        pass

    line = ["count", "r1.csv", "runs", "--machine", "m.toml", "--unit", "T1=degF", "--unit", "Z=mm", "--twice"]
    assert exit_status(app, line) == 0
    [(source, twice)] = seen
    assert twice
    assert source.runs == [Path("r1.csv"), Path("runs")]
    assert source.machine == Path("m.toml")
    assert source.units == ["T1=degF", "Z=mm"]
    assert source.encoding is None


@pytest.mark.parametrize(
    "wrong",
    [
        {"date_order": "ymdh"},
        {"period_s": 0.0},
        {"period_s": float("nan")},
        {"period_s": float("inf")},
        {"units": ["T1"]},
    ],
    ids=str,
)
def test_options_that_cannot_be_used(wrong, tmp_path):
    path = tmp_path / "r1.csv"
    path.write_text("t [s],T1 [degC],Z [um]\n0,20,0\n60,21,1\n120,22,2\n", encoding="utf-8")
    with pytest.raises(OptionError):
        Source(runs=[path], **wrong).reading()


@pytest.mark.parametrize("line", [["describe", ""], ["describe", "r1.csv", " "], ["select", "r1.csv", "--machine="]])
def test_an_empty_name_is_not_the_present_folder(line, capsys):
    assert app_status(line) == 2
    said = capsys.readouterr().err
    assert "an empty name" in said
    assert line[-2 if len(line) == 3 and line[-1] == " " else -1].rstrip("= ") in said


def test_a_blank_may_separate(tmp_path, capsys):
    file = tmp_path / "r1.csv"
    file.write_text("t_s T1_degC\n" + "".join(f"{k} 2{k}.5\n" for k in range(6)), encoding="utf-8")
    assert app_status(["describe", str(file), "--separator", " "]) == 0
    assert "T1" in capsys.readouterr().out
