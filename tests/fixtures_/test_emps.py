"""The recorded drive is the one that its README names, with its notice, and the machine files read it."""

from __future__ import annotations

import hashlib
import re
from pathlib import Path

import pytest

from selector.readers import read

FOLDER = Path(__file__).parents[2] / "fixtures" / "emps"
README = (FOLDER / "README.md").read_text(encoding="utf-8")


@pytest.mark.parametrize("name", ["DATA_EMPS.mat", "DATA_EMPS_PULSES.mat"])
def test_the_files_are_those_of_the_source(name):
    said = re.search(rf"`{name}` \| `([0-9a-f]{{64}})`", README)
    assert hashlib.sha256((FOLDER / name).read_bytes()).hexdigest() == said[1]


def test_the_authors_and_the_notice_are_there():
    licence = (FOLDER / "LICENSE").read_text(encoding="utf-8")
    assert "MIT License" in licence
    assert "Copyright (c) 2019 Wouter Kouw" in licence
    assert "A. Janot, M. Gautier, M. Brunot" in README


def test_both_records_are_read_as_described():
    reading = read([FOLDER / "DATA_EMPS.mat", FOLDER / "DATA_EMPS_PULSES.mat"], FOLDER / "machine.toml")
    channels = {channel.name: (channel.role, channel.unit) for channel in reading.recording.channels}
    assert channels == {
        "position_command": ("position_command", "m"),
        "position": ("position", "m"),
        "command": ("voltage", "V"),
    }
    assert [run.rows for run in reading.runs] == [24841, 24841]
    # the mark of the pulses is the only thing that is told
    assert [finding.id for finding in reading.findings] == ["columns-ignored"]


def test_the_pulses_have_their_own_machine_file():
    reading = read([FOLDER / "DATA_EMPS_PULSES.mat"], FOLDER / "machine-pulses.toml")
    assert reading.findings == ()
    assert set(reading.recording.frame["pulse"]) == {0.0, 5.0}
