"""The command that is shown asks for what the page asks."""

from __future__ import annotations

import os
import shlex
from pathlib import Path

import pytest

from selector.cli import exit_status, selecting
from selector.errors import CancelledError
from selector.readers import Overrides
from selector.selection import Options
from selector.workbench.commands import command_text, option_arguments, source_arguments


@pytest.fixture
def understood(monkeypatch):
    """(source, options) that the command line makes of some words."""
    seen = []

    def study(source, options, progress=None):
        seen[:] = [source, options]
        raise CancelledError

    monkeypatch.setattr(selecting, "study", study)

    def parse(*words):
        assert exit_status(["select", *words]) == 130
        return tuple(seen)

    return parse


@pytest.mark.parametrize(
    "options",
    [
        Options(),
        Options(responses=("Z", "Y axis")),
        Options(level=0.995),
        Options(level=(0.99, 0.951), rounds=2),
        Options(rounds=3),
        Options(max_sensors=3, degree=2, interactions=True, memory=True, ridge=True, absolute_similarity=True),
        Options(reference="absolute", tolerance=0.001, seed=7),
        Options(must=("T1", "-T2"), never=("T 3",), cost={"T4": 2.5, "a=b": 1e-3}),
        Options(conditions={"r1": "winter", "r2": "summer"}),
    ],
    ids=repr,
)
def test_options_come_back(understood, options):
    assert understood("r1.csv", *option_arguments(options))[1] == options


def test_what_nobody_asked_is_not_said():
    assert option_arguments(Options()) == ()


def test_the_way_of_reading_comes_back(understood, tmp_path):
    overrides = Overrides(
        encoding="gb18030", separator=";", decimal=",", header_row=3, sheet="S 1", time_column="t", time_unit="min",
        date_order="dmy", period_s=0.1, units={"T=1": "degF"}, roles={"T1": "ambient"},
    )  # fmt: skip
    files = [tmp_path / "recordings" / "r1.csv", tmp_path.parent / "r2.csv"]
    words = source_arguments(tmp_path, files, tmp_path / "machine.toml", overrides)
    source, _ = understood(*words)
    assert source.runs == [Path("recordings/r1.csv"), tmp_path.parent / "r2.csv"]
    assert source.machine == Path("machine.toml")
    assert source.overrides() == overrides


@pytest.mark.skipif(os.name == "nt", reason="the shell of Windows has other rules")
def test_the_text_can_be_pasted_into_a_shell():
    words = ("select", "a file.csv", "--must", "T'1", "--role", "$(rm)=ambient", ";")
    assert shlex.split(command_text(words)) == ["selector", *words]
