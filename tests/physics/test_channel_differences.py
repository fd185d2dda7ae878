"""What was simulated and recorded under one name is compared, at the samples of the recording, and nothing else."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from selector.physics.channel_differences import channel_differences
from selector.recording import Channel, Recording

TIME_S = np.arange(8) * 0.5
TOOL = Channel("tool", "displacement", "um")
SPEED = Channel("n", "spindle_speed", "rpm")
FORCE = Channel("F", "force", "N")


def recording(time_s, channels, run="r1", **courses) -> Recording:
    index = pd.MultiIndex.from_arrays([[run] * len(time_s), time_s], names=["run", "time_s"])
    return Recording(pd.DataFrame(courses, index=index), channels, {})


def test_channels_of_one_name_are_compared_and_inputs_are_not():
    there = recording(TIME_S, (TOOL, SPEED), tool=np.sin(TIME_S), n=np.full(8, 900.0))
    made = recording(TIME_S, (TOOL, SPEED, FORCE), tool=np.sin(TIME_S) + 0.5, n=np.full(8, 900.0), F=TIME_S)
    (one,) = channel_differences(made, there, {"n"})
    assert (one.run, one.channel, one.unit) == ("r1", "tool", "um")
    # a shift of 0.5 everywhere, up to the rounding of one addition
    assert (one.rms, one.largest) == pytest.approx((0.5, 0.5), rel=1e-12)
    assert one.relative == pytest.approx(0.5 / np.std(np.sin(TIME_S)), rel=1e-12)
    assert {d.channel for d in channel_differences(made, there)} == {"tool", "n"}
    assert next(d for d in channel_differences(made, there) if d.channel == "n").relative is None


def test_missing_samples_are_not_compared():
    course = np.sin(TIME_S)
    holed = course.copy()
    holed[3] = np.nan
    made = recording(TIME_S, (TOOL,), tool=course + np.where(np.arange(8) == 5, 2.0, 0.0))
    (one,) = channel_differences(made, recording(TIME_S, (TOOL,), tool=holed))
    assert len(one.time_s) == 7
    assert one.largest_at_s == 2.5


def test_other_times_are_read_between_samples_and_only_within_the_run():
    fine_s = np.arange(0.0, 3.01, 0.125)
    made = recording(fine_s, (TOOL,), tool=3.0 * fine_s)
    (one,) = channel_differences(made, recording(TIME_S, (TOOL,), tool=3.0 * TIME_S))
    # a straight line is exact between its samples; 3.5 s is beyond the simulation
    assert one.largest < 1e-12
    assert one.time_s[-1] == 3.0


def test_other_runs_units_and_names_are_left_out():
    made = recording(TIME_S, (TOOL,), tool=TIME_S)
    assert channel_differences(made, recording(TIME_S, (TOOL,), run="r2", tool=TIME_S)) == ()
    forces = recording(TIME_S, (Channel("tool", "force", "N"),), tool=TIME_S)
    assert channel_differences(made, forces) == ()
