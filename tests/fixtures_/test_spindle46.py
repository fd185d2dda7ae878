"""The recorded spindle is what its README says: origin, notice, tests, staircase, and the duty cycle of the latter."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from selector.physics.thermal.drift_quantities import drift_quantities
from selector.readers import read
from selector.readers.cycle_file import read_cycle

FOLDER = Path(__file__).parents[2] / "fixtures" / "spindle46"


@pytest.fixture(scope="module")
def reading():
    return read([FOLDER / "tests.parquet", FOLDER / "staircase.parquet"], FOLDER / "machine.toml")


def test_origin_and_notice_are_there():
    made = (FOLDER.parent / "make" / "spindle46.py").read_text(encoding="utf-8")
    readme = (FOLDER / "README.md").read_text(encoding="utf-8")
    assert re.search(r'SHA256 = "(\w{64})"', made)[1] in readme
    assert "CAIVIAC/FL_THERMAL" in readme
    assert "Copyright (c) 2024 CAIVIAC" in (FOLDER / "LICENSE").read_text(encoding="utf-8")


def test_roles_speeds_and_lengths_are_as_described(reading):
    recording = reading.recording
    assert recording.with_role("displacement") == ("X1", "X2", "Y1", "Y2", "Z")
    assert recording.with_role("ambient") == ("t16",)
    assert len(recording.with_role("temperature")) == 15
    speeds = {run: set(np.unique(recording.values(run, ["spindle_speed"])).tolist()) for run in recording.runs}
    assert speeds == {"tests": {0, 1250, 2500, 3750, 5000, 3500}, "staircase": {0, 500, 1500, 2500, 4500}}
    assert [run.rows for run in reading.runs] == [2400, 379]


def test_the_duty_cycle_is_the_staircase_with_its_hall(reading):
    cycle = read_cycle(FOLDER / "staircase.csv")
    hall = cycle.temperatures(["t16"])["t16"]
    recorded = reading.recording.values("staircase", ["spindle_speed", "t16"])
    time = reading.recording.time_s("staircase")
    rows = np.searchsorted(time - time[0], cycle.time_s)
    np.testing.assert_array_equal(cycle.speed_rpm, recorded[rows, 0])
    np.testing.assert_allclose(hall, recorded[rows, 1], atol=1e-9)  # the same decimals


def test_five_probes_of_which_no_places_are_known(reading):
    told = {run.run: [drift.name for drift in run.drifts] for run in drift_quantities(reading.recording)}
    assert told["tests"] == ["X1", "X2", "Y1", "Y2", "Z", "X2−X1", "Y2−Y1"]


def test_other_columns_of_a_duty_cycle_are_read_only_if_they_are_asked_for(tmp_path):
    path = tmp_path / "cycle.csv"
    path.write_text("t_min;spindle_speed;hall [degF];part\n0;1000;68,0;a\n60;0;77,0;b\n", encoding="utf-8")
    cycle = read_cycle(path)
    np.testing.assert_allclose(cycle.temperatures(["hall"])["hall"], [20.0, 25.0], atol=1e-9)  # decimals of °F
    assert cycle.temperatures(["T1"]) == {}
