"""Which recorded channels belong to an axis, and what is added to the output of its control behind it."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from selector.errors import OptionError
from selector.physics.drive.driving import driven_runs
from selector.recording import Channel, Recording
from tests.physics.drive.test_driving import model
from tests.physics.drive.test_model_file import PARTS

ADDED = ("axes.X.recorded", {"added": {"channel": "pulse", "factor": 2.0}})
KP, KV, GAIN = 50.0, 20000.0, 1.0
"""Of the axis that `model` describes; its output is called a current."""


def with_channels(recording: Recording, **courses: tuple[str, str, np.ndarray]) -> Recording:
    """A recording with more channels: name → role, unit, values."""
    (run,) = recording.runs
    table = recording.frame.loc[run].copy()
    channels = list(recording.channels)
    for name, (role, unit, values) in courses.items():
        table[name] = values
        channels.append(Channel(name, role, unit))
    return Recording.from_runs({run: table}, tuple(channels))


def without(recording: Recording, *names: str) -> Recording:
    (run,) = recording.runs
    kept = tuple(channel for channel in recording.channels if channel.name not in names)
    return Recording.from_runs({run: recording.frame.loc[run][[one.name for one in kept]]}, kept)


def standing(n: int = 600) -> Recording:
    """A command that stands, on the clock of the control."""
    table = pd.DataFrame({"r": np.zeros(n)}, index=pd.Index(np.arange(n) * 1e-3, name="time_s"))
    return Recording.from_runs({"r1": table}, (Channel("r", "position_command", "m"),))


def pulses(n: int) -> np.ndarray:
    return np.where(np.arange(n) % 100 >= 50, 150.0, 0.0)


def test_opened_an_addition_is_as_good_as_more_output():
    own = model().simulation(run="r1").recording
    n = len(own.frame)
    both = own.values("r1", ["X_current"])[:, 0] + 2.0 * pulses(n)
    recording = with_channels(without(own, "X_current"), i=("current", "A", both))
    whole = driven_runs(model(), recording, opened=True)
    assert whole.matched["X"]["output"] == "i"
    apart = driven_runs(model(ADDED), with_channels(recording, pulse=("current", "A", pulses(n))), opened=True)
    assert apart.matched["X"]["total"] == "i"
    for name in ("X_table", "X_force", "i"):
        a, b = (one.recording.values("r1", [name])[:, 0] for one in (whole, apart))
        # the same forces on the same steps but for the order of adding up; 300 N act, and nothing holds the table
        np.testing.assert_allclose(a, b, rtol=0.0, atol=1e-12 * max(1.0, float(np.abs(a).max())))
    assert np.ptp(whole.recording.values("r1", ["X_table"])) > 1e-3
    told = apart.recording
    np.testing.assert_allclose(
        told.values("r1", ["X_current"])[:, 0], own.values("r1", ["X_current"])[:, 0], rtol=0.0, atol=1e-9
    )


def test_a_loop_answers_an_addition_by_the_shift_that_its_gains_ask_for():
    step = np.where(np.arange(600) >= 20, 100.0, 0.0)
    recording = with_channels(standing(), pulse=("current", "A", step))
    done = driven_runs(model(ADDED, ("axes.X.friction", ...)), recording)
    told = done.recording
    # P and P: at rest kp·kv·shift = what is added; the slowest pole, 50/s or faster, leaves e^-29 of it
    assert told.values("r1", ["X_table"])[-1, 0] == pytest.approx(2.0 * 100.0 / (KP * KV), rel=1e-9)
    assert told.values("r1", ["X_current"])[-1, 0] == pytest.approx(-200.0, rel=1e-9)
    np.testing.assert_array_equal(told.values("r1", ["X_added"])[:, 0], 2.0 * step)
    both = told.values("r1", ["X_current"]) + told.values("r1", ["X_added"])
    np.testing.assert_array_equal(told.values("r1", ["X_total"]), both)
    # one mass: the force is that of the actuator, all of it; the load is from outside, and there is none
    np.testing.assert_allclose(told.values("r1", ["X_force"]), GAIN * both, rtol=0.0, atol=1e-9)
    assert "X_load" not in told.names


def test_nothing_added_is_the_simpler_run_to_the_last_bit():
    own = model().simulation(run="r1").recording
    nothing = with_channels(own, pulse=("current", "A", np.zeros(len(own.frame))))
    done = driven_runs(model(ADDED), nothing).recording
    np.testing.assert_array_equal(done.values("r1", ["X_table"]), own.values("r1", ["X_table"]))


def test_a_run_without_what_is_added_is_told():
    done = driven_runs(model(ADDED), standing())
    assert [one.id for one in done.findings] == ["output-not-recorded", "nothing-added"]
    assert "pulse" in done.findings[1].statement
    assert "X_added" not in done.recording.names


def test_a_short_name_is_a_channel_that_adds_as_it_is():
    drive = model(("axes.X.recorded", {"added": "pulse"}))
    recording = with_channels(standing(), pulse=("current", "A", pulses(600)))
    told = driven_runs(drive, recording).recording
    np.testing.assert_array_equal(told.values("r1", ["X_added"])[:, 0], pulses(600))


def test_an_axis_with_a_screw_takes_additions_opened_only():
    screw = model(
        ("axes.X", {**PARTS, "recorded": {"added": "pulse"}, "servo": {**PARTS["servo"], "velocity_gain": 6.0}})
    )
    recording = with_channels(standing(), pulse=("current", "A", 0.01 * pulses(600)), i=("current", "A", np.zeros(600)))
    with pytest.raises(OptionError, match=r"axes\.X\.recorded\.added"):
        driven_runs(screw, recording)
    done = driven_runs(
        screw, with_channels(without(recording, "i"), i=("current", "A", 0.01 * pulses(600))), opened=True
    )
    alone = driven_runs(screw, without(recording, "i", "pulse").__class__.from_runs(
        {"r1": without(recording, "i", "pulse").frame.loc["r1"].assign(i=0.01 * pulses(600))},
        (Channel("r", "position_command", "m"), Channel("i", "current", "A")),
    ), opened=True)  # fmt: skip
    np.testing.assert_array_equal(done.recording.values("r1", ["X_table"]), alone.recording.values("r1", ["X_table"]))
    assert done.matched["X"]["output"] == "i"


def test_two_channels_of_a_role_are_told_and_none_is_taken():
    own = without(model().simulation(run="r1").recording, "X_current")
    two = with_channels(own, a=("current", "A", np.ones(len(own.frame))), b=("current", "A", np.ones(len(own.frame))))
    done = driven_runs(model(), two)
    assert [(one.id, one.level) for one in done.findings] == [("channel-undecided", "warning")]
    assert done.findings[0].evidence["channels"] == ["a", "b"]
    assert "X_current" in done.recording.names
    with pytest.raises(OptionError, match="output"):
        driven_runs(model(), two, opened=True)
    said = driven_runs(model(("axes.X.recorded", {"output": "b"})), two)
    assert said.matched["X"]["output"] == "b"
    assert [(one.id, one.evidence["channels"]) for one in said.findings] == [("channel-not-used", ["a"])]


@pytest.mark.parametrize(("role", "unit", "value", "told"), [
    ("force", "N", 80.0, True), ("voltage", "V", 5.0, True), ("force", "N", 0.0, False), ("force", "N", np.nan, False),
    ("temperature", "degC", 20.0, False),
])  # fmt: skip
def test_what_looks_as_if_it_acts_and_is_left_is_told(role, unit, value, told):
    own = model().simulation(run="r1").recording
    done = driven_runs(model(), with_channels(own, extra=(role, unit, np.full(len(own.frame), value))))
    assert [one.id for one in done.findings] == (["channel-not-used"] if told else [])
