"""`selector simulate`: what recordings, columns and places it refuses, and where it says that they are."""

from __future__ import annotations

import errno
import re
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from selector.cli import exit_status
from selector.cli.shared.simulation_files import named_as_asked
from selector.errors import OptionError

MODEL = """
[model]
kind = "drive"
name = "a slide"
[motion]
kind = "sine"
amplitude_mm = 10.0
frequency_hz = 5.0
duration_s = 0.2
phase_deg = 90.0
[axes.X.mechanics]
kind = "rigid"
mass_kg = 100.0
guide_damping_ns_per_m = 200.0
[axes.X.servo]
position_gain_per_s = 60.0
velocity_gain = 20000.0
sample_s = 0.001
"""
SINE = MODEL[MODEL.index("[motion]") : MODEL.index("[axes.X.mech")]
COLUMN = MODEL.replace(SINE, '[motion]\nkind = "column"\nfile = "c.csv"\ncolumn = "r"\nunit = "mm"\n')
TIME_S = np.arange(200) * 1e-3
COMMAND_M = 0.01 * np.cos(30.0 * TIME_S)


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("model.toml").write_text(MODEL, encoding="utf-8")
    Path("column.toml").write_text(COLUMN, encoding="utf-8")
    return tmp_path


def refused(capfd, *arguments: str) -> str:
    """What stderr says; not a word of a library, nothing written."""
    before = sorted(path.name for path in Path.cwd().rglob("*"))
    capfd.readouterr()
    assert exit_status(["simulate", "drive", *arguments, "--json"]) == 2
    out, err = capfd.readouterr()
    assert out == ""
    assert "Warning" not in err
    assert sorted(path.name for path in Path.cwd().rglob("*")) == before
    return err


@pytest.mark.parametrize(
    ("channel", "row", "value", "said"),
    [
        ("X_command", 101, np.nan, "1 missing values, the first in row 102"),
        ("X_command", 101, 1e300, "1e+300 m at 0.101 s (row 102)"),
        ("X_position", 0, 1e300, "1e+300 m at 0 s (row 1)"),
        ("X_load", 3, 1e300, "1e+300 N at 0.003 s (row 4)"),
        ("X_load", 3, np.nan, "missing values of 'X_load'"),
    ],
)
def test_recordings_that_drive_nothing_say_file_and_channel(folder, capfd, channel, row, value, said):
    table = pd.DataFrame({"time_s": TIME_S, "X_command [m]": COMMAND_M, "X_position [m]": COMMAND_M, "X_load [N]": 5.0})
    table.loc[row, next(name for name in table.columns if name.startswith(channel))] = value
    table.to_csv("run1.csv", index=False)
    err = refused(capfd, "model.toml", "--inputs", "run1.csv", "--out", "simulated")
    assert said in err
    assert "run1.csv" in err
    assert f"channel {channel}" in err


def test_recordings_that_take_too_many_steps_say_the_key_and_the_run(folder, capfd):
    table = pd.DataFrame({"time_s": TIME_S * 1e6, "X_command [m]": COMMAND_M})
    table.to_csv("run1.csv", index=False)
    err = refused(capfd, "model.toml", "--inputs", "run1.csv", "--out", "simulated")
    assert "1.99e+08 steps" in err
    assert "key axes.X.servo.sample_s, run run1" in err


def test_two_commands_are_told_by_name(folder, capfd):
    pd.DataFrame({"time_s": TIME_S, "a_command [m]": COMMAND_M, "b_command [m]": COMMAND_M}).to_csv(
        "run1.csv", index=False
    )
    err = refused(capfd, "model.toml", "--inputs", "run1.csv", "--out", "simulated")
    assert "a_command, b_command" in err
    assert 'command = "a_command"' in err


@pytest.mark.parametrize(
    ("content", "said", "where"),
    [
        (b"\x00\x01\x02\xff" * 40, "binary data", "key motion.file"),
        (b"", "an empty file", "key motion.file"),
        (b"t,r\n" + b"".join(b"%.3f,word\n" % (k * 1e-3) for k in range(50)), "no column 'r'", "key motion.column"),
        (
            b"time_s,r [mm]\n" + b"".join(b"%.3f,%s\n" % (k * 1e-3, b"1e300" if k == 7 else b"1") for k in range(50)),
            "(row 8)",
            "key motion, column 'r' of c.csv",
        ),
    ],
    ids=["binary", "empty", "words", "huge"],
)
def test_columns_that_cannot_be_say_key_and_file(folder, capfd, content, said, where):
    Path("c.csv").write_bytes(content)
    err = refused(capfd, "column.toml", "--out", "run.csv")
    assert said in err
    assert where in err
    assert "c.csv" in err
    assert not any(line.rstrip().endswith("one of") for line in err.splitlines())


def test_a_runaway_names_file_and_axis(folder, capfd):
    text = MODEL.replace("position_gain_per_s = 60.0", "position_gain_per_s = 9000.0").replace("= 0.2", "= 5.0")
    Path("wild.toml").write_text(text, encoding="utf-8")
    err = refused(capfd, "wild.toml", "--out", "run.csv")
    assert "wild.toml, axis X," in err
    assert re.search(r"position_gain_per_s below [0-9.]+", err)


def test_a_delay_that_no_gain_repairs_is_told_with_what_does(folder, capfd):
    text = MODEL.replace("sample_s = 0.001", "velocity_integral_gain = 1e5\nsample_s = 0.001\ndelay_s = 0.02").replace(
        "= 0.2", "= 5.0"
    )
    Path("late.toml").write_text(text, encoding="utf-8")
    err = refused(capfd, "late.toml", "--out", "run.csv")
    assert "Shorten delay_s (20 ms)" in err


@pytest.mark.parametrize(
    ("path", "shown"), [("a/.0123456789abcdef.part/o.csv", "a/o.csv"), (".0123456789abcdef.part/o.csv", "o.csv")]
)
def test_places_are_named_as_they_were_asked_for(path, shown):
    with pytest.raises(OSError, match="space") as caught, named_as_asked():
        raise OSError(errno.ENOSPC, "no space", path)
    assert caught.value.filename == shown
    with pytest.raises(OptionError) as told, named_as_asked():
        raise OptionError("full", expected="space", where=f"--out {path}", advice="free some")
    assert told.value.where == f"--out {shown}"


def test_a_folder_where_the_page_is_to_be_is_called_a_folder(folder, capfd):
    Path("page.html").mkdir()
    assert "folder" in refused(capfd, "model.toml", "--out", "a.csv", "--report", "page.html")


@pytest.mark.parametrize("link", ["a.csv", "a.machine.toml", "page.html", "sub"])
def test_links_to_nothing_are_not_replaced(folder, capfd, link):
    Path(link).symlink_to("nowhere")
    where = "sub/a.csv" if link == "sub" else "a.csv"
    err = refused(capfd, "model.toml", "--out", where, "--report", "page.html")
    assert "link to nowhere" in err
    assert Path(link).is_symlink()


def test_one_run_goes_into_a_file_and_only_several_into_a_folder(folder, capfd):
    told = refused(capfd, "model.toml", "--out", "simulated")
    assert "a file that ends in .csv" in told
    # circles of a ball-bar test and parts of a batch go into one without --inputs
    assert "only several runs go into a folder" in told
