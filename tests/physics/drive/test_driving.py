"""Feed drives that are driven by recordings: in closed loop after the command, opened after the control's output."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from selector.errors import InputError, OptionError
from selector.physics.drive.drive_model import drive_model
from selector.physics.drive.drive_summary import simulation_findings
from selector.physics.drive.driving import driven_runs
from selector.physics.drive.model_file import checked_model_file
from selector.recording import Channel, Recording
from tests.physics.drive.test_model_file import RIGID, changed

FRICTION = ("axes.X.friction", {"coulomb_n": 30.0, "offset_n": 2.0})
AT_REST = ("motion.phase_deg", 90.0)


def model(*changes):
    return drive_model(checked_model_file(changed(RIGID, AT_REST, FRICTION, *changes)))


def renamed(recording: Recording, names: dict[str, str], without: tuple[str, ...] = ()) -> Recording:
    """A recording as a machine would have it: fewer channels, with other names and no axis."""
    kept = [channel for channel in recording.channels if channel.name not in without]
    channels = tuple(replace(c, name=names.get(c.name, c.name), axis=None) for c in kept)
    tables = {
        run: pd.DataFrame(
            {one.name: recording.values(run, [old.name])[:, 0] for one, old in zip(channels, kept, strict=True)},
            index=pd.Index(recording.time_s(run), name="time_s"),
        )
        for run in recording.runs
    }
    return Recording.from_runs(tables, channels)


def test_driven_by_its_own_command_it_does_the_same():
    drive = model()
    own = drive.simulation(run="r1").recording
    again = driven_runs(drive, own).recording
    assert again.channels == own.channels
    # the control reads positions at its samples only, which are those of the recording
    np.testing.assert_array_equal(again.frame.to_numpy(), own.frame.to_numpy())


def test_opened_it_does_the_same_after_the_same_output():
    drive = model()
    own = drive.simulation(run="r1").recording
    done = driven_runs(drive, own, opened=True)
    np.testing.assert_array_equal(done.recording.values("r1", ["X_current"]), own.values("r1", ["X_current"]))
    error_m = done.recording.values("r1", ["X_table"]) - own.values("r1", ["X_table"])
    # the same outputs on the same steps: nothing differs but rounding of 1e-17 m, which nothing holds back
    assert np.abs(error_m).max() < 1e-12
    heavier = drive.with_parameters({"axes.X.mechanics.mass_kg": 110.0})
    closed_m, opened_m = (
        np.abs(
            driven_runs(heavier, own, opened=opened).recording.values("r1", ["X_table"]) - own.values("r1", ["X_table"])
        ).max()
        for opened in (False, True)
    )
    # a wrong mass shows opened, and hides behind the control in closed loop
    assert opened_m > 5.0 * closed_m > 0.0


def test_channels_are_found_by_role_and_named_as_recorded():
    drive = model()
    own = renamed(drive.simulation(run="r1").recording, {"X_command": "qg", "X_position": "qm", "X_current": "i"},
                  without=("X_table", "X_error", "X_force"))  # fmt: skip
    done = driven_runs(drive, own)
    assert done.matched == {"X": {"command": "qg", "position": "qm", "output": "i"}}
    assert done.recording.names == ("qg", "qm", "X_table", "X_error", "i", "X_force")
    assert done.recording.channel("qm").axis == "X"
    np.testing.assert_array_equal(done.recording.values("r1", ["qm"]), own.values("r1", ["qm"]))
    assert done.findings == ()


def test_the_file_names_channels_that_roles_do_not_tell():
    two = renamed(model().simulation(run="r1").recording, {"X_command": "a"}, without=("X_error", "X_force"))
    drive = model(("axes.X.recorded", {"command": "a", "position": "X_table"}))
    assert driven_runs(drive, two).matched["X"]["position"] == "X_table"
    with pytest.raises(OptionError, match=r"axes\.X\.recorded\.output"):
        driven_runs(model(("axes.X.recorded", {"output": "nothing"})), two)
    with pytest.raises(OptionError, match="twice"):
        driven_runs(model(("axes.X.recorded", {"table": "X_position", "position": "X_position"})), two)


def test_a_name_that_is_taken_is_marked():
    own = renamed(model().simulation(run="r1").recording, {"X_force": "X_table", "X_table": "T"})
    names = driven_runs(model(), own).recording.names
    assert "X_table (simulated)" in names
    assert len(set(names)) == len(names)


def test_a_recorded_load_acts():
    drive = model(("motion.force_n", [[0, 0.0], [0.2, 500.0]]))
    own = drive.simulation(run="r1").recording
    again = driven_runs(model(), own).recording
    np.testing.assert_array_equal(again.values("r1", ["X_error"]), own.values("r1", ["X_error"]))
    assert (again.values("r1", ["X_error"]) != model().simulation(run="r1").recording.values("r1", ["X_error"])).any()


def test_samples_stand_at_the_times_of_a_clock_that_is_not_even():
    drive = model()
    own = drive.simulation(run="r1").recording
    random = np.random.default_rng(1)
    time_s = own.time_s("r1") + 3.0 + np.r_[0.0, random.uniform(-5e-5, 5e-5, len(own.time_s("r1")) - 2), 0.0]
    even = own.time_s("r1")
    table = pd.DataFrame(
        {"X_command": np.interp(time_s - 3.0, even, own.values("r1", ["X_command"])[:, 0])},
        index=pd.Index(time_s, name="time_s"),
    )
    jittered = Recording.from_runs({"r1": table}, (Channel("X_command", "position_command", "m", axis="X"),))
    done = driven_runs(drive, jittered)
    np.testing.assert_array_equal(done.recording.time_s("r1"), time_s)
    assert [one.id for one in done.findings] == ["recorded-clock-jitter", "output-not-recorded"]
    assert done.findings[0].where.run == "r1"
    expected = np.interp(time_s - 3.0, even, own.values("r1", ["X_table"])[:, 0])
    # interpolating twice between samples of 1 ms, at 10 mm and 2 Hz: acceleration·period²/8 each, 0.2 µm
    np.testing.assert_allclose(done.recording.values("r1", ["X_table"])[:, 0], expected, atol=1e-6)


def test_two_axes_are_driven_together_and_one_that_was_not_recorded_is_told():
    both = model(("axes.Y", RIGID["axes"]["X"]), ("motion.axis", "X"))
    own = model().simulation(run="r1").recording
    done = driven_runs(both, own)
    assert list(done.axes["r1"]) == ["X"]
    assert [(one.id, one.where.channel) for one in done.findings] == [("axis-not-driven", "Y")]
    tables = pd.DataFrame(
        {name: own.values("r1", ["X_command"])[:, 0] for name in ("X_command", "Y_command")},
        index=pd.Index(own.time_s("r1"), name="time_s"),
    )
    commands = tuple(Channel(f"{a}_command", "position_command", "m", axis=a) for a in "XY")
    two = driven_runs(both, Recording.from_runs({"r1": tables}, commands))
    assert list(two.axes["r1"]) == ["X", "Y"]
    np.testing.assert_array_equal(two.recording.values("r1", ["X_table"]), own.values("r1", ["X_table"]))


def test_recordings_that_cannot_drive_are_refused():
    own = model().simulation(run="r1").recording
    with pytest.raises(OptionError, match="position_command"):
        driven_runs(model(), renamed(own, {}, without=("X_command",)))
    with pytest.raises(OptionError, match="output"):
        driven_runs(model(), renamed(own, {}, without=("X_current",)), opened=True)
    for name, opened in (("X_command", False), ("X_current", True)):
        holes = own.frame.copy()
        holes.iloc[5, list(own.names).index(name)] = np.nan
        with pytest.raises(InputError, match="missing"):
            driven_runs(model(), own.with_values(holes), opened=opened)


def test_a_clock_written_with_few_digits_fits_the_control():
    own = model().simulation(run="r1").recording
    # 0.02 % off, as a crystal that is cheap, is another clock; a millionth is the same
    for stretch, fits in ((1.0 + 5e-7, True), (1.0 + 2e-4, False)):
        frame = own.frame.copy()
        frame.index = frame.index.set_levels(frame.index.levels[1] * stretch, level=1)
        recording = own.with_values(frame)
        if fits:
            driven_runs(model(), recording)
        else:
            with pytest.raises(InputError, match="sample_s"):
                driven_runs(model(), recording)


def test_progress_is_told():
    seen = []
    own = model().simulation(run="r1").recording
    driven_runs(model(), own, progress=lambda *said: seen.append(said))
    assert seen == [(0, 1, "r1")]


def test_it_begins_where_and_as_fast_as_the_machine_did():
    whole = model().simulation(run="r1").recording
    late = whole.frame.iloc[100:]
    rest = whole.with_values(late)
    done = driven_runs(model(), rest).recording
    blind = driven_runs(model(), renamed(rest, {}, without=("X_position", "X_table"))).recording
    error, blind_error = (
        np.abs(one.values("r1", ["X_table"]) - rest.values("r1", ["X_table"])).max() for one in (done, blind)
    )
    # 100 samples on, the axis runs at 0.12 m/s and 2.4 mm behind its command
    assert error < 0.01 * blind_error


def test_a_start_in_motion_is_told_only_where_the_axis_stands():
    drive = model()
    whole = drive.simulation(run="r1").recording
    rest = whole.with_values(whole.frame.iloc[100:])
    seen = driven_runs(drive, rest)
    assert simulation_findings(drive, seen, {}, driven=True) == ()
    blind = driven_runs(drive, renamed(rest, {}, without=("X_position", "X_table")))
    (one,) = simulation_findings(drive, blind, {}, driven=True)
    assert one.id == "begins-in-motion"
    # a recording has no phase
    assert "phase_deg" not in one.suggestion
    assert "position" in one.suggestion
    sine = model(("motion.phase_deg", 0.0))
    assert "phase_deg" in simulation_findings(sine, sine.simulation(), {})[0].suggestion
