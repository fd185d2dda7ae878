"""Simulated beside recorded: the same differences as by hand, in units that are read, whatever was not recorded."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from selector.physics.channel_differences import ChannelDifference
from selector.physics.drive.driving import driven_runs, recorded_differences
from selector.telling.simulated.result import main_difference
from tests.physics.drive.test_driving import model, renamed

COURSE = np.sin(np.arange(200) / 20.0)


def difference(recorded, simulated, **more):
    told = {"run": "r1", "axis": "X", "channel": "q", "kind": "position", "unit": "um"} | more
    return ChannelDifference(**told, time_s=np.arange(len(recorded)) * 0.5, recorded=recorded, simulated=simulated)


@given(shift=st.floats(-100.0, 100.0), scale=st.floats(0.1, 10.0), at=st.integers(0, 199))
def test_numbers_of_a_difference(shift, scale, at):
    off = np.zeros(200)
    off[at] = -3.0 * scale
    one = difference(scale * COURSE + shift, scale * COURSE + shift + off)
    # rounding of a number of size 110 where 0.3 is looked at
    assert one.largest == pytest.approx(3.0 * scale, abs=1e-12)
    assert one.largest_at_s == 0.5 * at
    assert one.rms == pytest.approx(3.0 * scale / np.sqrt(200.0), abs=1e-12)
    # neither unit nor zero of a course matters
    assert one.relative == pytest.approx(3.0 / np.linalg.norm(COURSE - COURSE.mean()), rel=1e-9)


def test_nothing_is_a_share_of_a_level_course():
    assert difference(np.full(9, 7.1), np.zeros(9)).relative is None
    assert difference(np.zeros(9), np.ones(9)).relative is None


def test_what_is_told_first_is_the_worst_position():
    ones = tuple(
        difference(COURSE, COURSE + off, kind=kind, run=run)
        for kind, run, off in (("output", "r1", 9.0), ("position", "r1", 1.0), ("table", "r2", 2.0))
    )
    assert main_difference(ones) is ones[2]
    assert main_difference(ones[:1]) is ones[0]
    assert main_difference(()) is None


def test_a_model_beside_its_own_recording_does_not_differ():
    drive = model()
    own = drive.simulation(run="r1").recording
    told = recorded_differences(drive, driven_runs(drive, own), own)
    assert [one.kind for one in told] == ["position", "table", "error", "output", "force"]
    assert all(one.rms == 0.0 for one in told)
    assert [one.unit for one in told] == ["um", "um", "um", "A", "N"]


def test_differences_are_those_of_the_two_recordings():
    drive = model()
    own = renamed(
        drive.simulation(run="r1").recording, {"X_position": "qm", "X_current": "i"}, without=("X_table", "X_error")
    )
    heavier = drive.with_parameters({"axes.X.mechanics.mass_kg": 130.0})
    driven = driven_runs(heavier, own)
    told = {one.kind: one for one in recorded_differences(heavier, driven, own)}
    assert set(told) == {"position", "output", "force"}
    for kind, name, times in (("position", "qm", 1e6), ("output", "i", 1.0)):
        by_hand = times * (driven.recording.values("r1", [name]) - own.values("r1", [name]))[:, 0]
        assert told[kind].channel == name
        # the order of multiplying and subtracting: 1e-16 of 10 000 µm
        assert told[kind].rms == pytest.approx(np.sqrt(np.mean(by_hand**2)), rel=1e-9)
        assert told[kind].largest == pytest.approx(np.abs(by_hand).max(), rel=1e-9)
        assert told[kind].rms > 0


def test_only_samples_that_were_recorded_count():
    drive = model()
    own = drive.simulation(run="r1").recording
    holes = own.frame.copy()
    holes.iloc[10:50, list(own.names).index("X_table")] = np.nan
    holes["X_error"] = np.nan
    recording = own.with_values(holes)
    told = {one.kind: one for one in recorded_differences(drive, driven_runs(drive, recording), recording)}
    assert len(told["table"].time_s) == len(own.frame) - 40
    assert told["table"].rms == 0.0
    assert "error" not in told


def test_an_output_that_acts_is_no_result():
    drive = model()
    own = drive.simulation(run="r1").recording
    opened = recorded_differences(drive, driven_runs(drive, own, opened=True), own)
    assert "output" not in {one.kind for one in opened}
    closed = replace(driven_runs(drive, own), opened=False)
    assert "output" in {one.kind for one in recorded_differences(drive, closed, own)}
