"""Feed drives of model files: what runs, what is recorded of it, and what can be fitted again."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from selector.errors import InputError, ModelFileError, OptionError
from selector.physics.drive.ball_bar.circle import circle_references
from selector.physics.drive.closed_loop import fastest_rate_per_s
from selector.physics.drive.drive_model import DriveModel, axis_channels, drive_model
from selector.physics.drive.drive_summary import drive_summary, model_findings, simulation_findings
from selector.physics.drive.model_file import checked_model_file, file_reference, parsed_model_file, read_model_file
from selector.physics.drive.parts.stiffness import parameter_course
from selector.physics.drive.simulation import advised_step_s, simulate_axis
from selector.physics.model_text import plain_values
from tests.physics.drive.test_model_file import CIRCLE, MOVES, PARTS, RIGID, changed

EXAMPLES = Path(__file__).resolve().parents[3] / "fixtures" / "drive"


def parameters(file):
    return DriveModel(file).parameters


def with_parameters(file, values):
    return DriveModel(file).with_parameters(values).file


def model(*changes: tuple[str, object], columns=None):
    return drive_model(checked_model_file(changed(RIGID, *changes)), columns)


def column(recording, name, run=None):
    return recording.values(run or recording.runs[0], [name])[:, 0]


# what runs


def test_a_model_does_what_its_axis_does():
    drive = drive_model(read_model_file(EXAMPLES / "rigid-friction.toml"))
    recording = drive.simulation(run="r1").recording
    reference = file_reference(drive.file, {})
    axis = drive.axes["X"].axis
    motion = simulate_axis(axis, reference, step_s=advised_step_s(axis, reference.period_s))
    assert recording.runs == ("r1",)
    assert recording.channels == drive.outputs
    for name, course in {
        "X_command": motion.reference_m, "X_position": motion.measured_m, "X_table": motion.table_m,
        "X_error": motion.tracking_error_m * 1e6, "X_voltage": motion.command, "X_force": motion.axial_force_n,
    }.items():  # fmt: skip
        np.testing.assert_array_equal(column(recording, name), course, err_msg=name)
    np.testing.assert_array_equal(recording.time_s("r1"), reference.time_s)


def test_channels_say_what_they_are():
    channels = {channel.name: channel for channel in model().outputs}
    assert list(channels) == ["X_command", "X_position", "X_table", "X_error", "X_current", "X_force"]
    assert {channel.axis for channel in channels.values()} == {"X"}
    assert channels["X_error"].role == "displacement"
    assert channels["X_current"].role == "current"
    assert [c.name for c in model(("axes.X.output", "voltage")).outputs][4] == "X_voltage"
    assert model(("axes.X.output", "force")).outputs[4].role == "force"
    # a reader of the machine file can tell what the control sees from what is true
    assert (channels["X_position"].place, channels["X_table"].place) == ("scale (seen by the control)", "table (true)")
    by_motor = {channel.name: channel for channel in model(("axes.X.servo.feedback", "motor")).outputs}
    assert by_motor["X_position"].place == "motor (seen by the control)"
    rotary = {**RIGID["axes"]["X"], "mechanics": {"kind": "rotary", "mass_kg": 1.0}}
    turning = model(("axes.C", rotary), ("motion.axis", "X")).file_axes["C"]
    places = {kind: channel.place for kind, channel in axis_channels("C", turning, loaded=True).items()}
    assert (places["load"], places["table"]) == ("outside [N·m]", "table (true) [rad]")
    loaded = model(("motion.force_n", [[0, 0.0], [0.25, 300.0]])).simulation().recording
    assert loaded.names[-1] == "X_load"
    np.testing.assert_array_equal(column(loaded, "X_load"), np.where(loaded.time_s("simulation") >= 0.25, 300.0, 0.0))


def test_stiffness_and_damping_vary_as_the_file_says():
    still = (("axes.X", PARTS), ("motion.phase_deg", 90.0), ("axes.X.servo.velocity_gain", 4.0))
    runs = {kind: model(*still, ("axes.X.varying", kind)) for kind in ("constant", "command", "state")}
    error = {kind: column(one.simulation().recording, "X_error") for kind, one in runs.items()}
    done = runs["command"].simulation().axes["simulation"]["X"]
    made = runs["command"].axes["X"]
    course = parameter_course(made.parts, done.reference)
    np.testing.assert_array_equal(done.course.axial_stiffness_n_per_m, course.axial_stiffness_n_per_m)
    motion = simulate_axis(made.axis, done.reference, step_s=done.step_s, course=course)
    np.testing.assert_array_equal(error["command"], motion.tracking_error_m * 1e6)
    assert runs["state"].axes["X"].axis.compliance is not None
    # dry friction is in the damping along the command, and on its own otherwise
    assert made.axis.friction.coulomb_n == 0.0
    assert runs["state"].axes["X"].axis.friction.coulomb_n == runs["constant"].axes["X"].axis.friction.coulomb_n > 0.0
    # the springs of the three differ by some per cent, and they make a small part of the error
    for one, two in (("constant", "command"), ("constant", "state")):
        assert 0.0 < np.abs(error[one] - error[two]).max() < 0.2 * np.abs(error[one]).max()


def test_a_course_of_a_recording_is_followed():
    time_s = np.arange(0.0, 0.5, 0.001)
    position = 0.01 * (1.0 - np.cos(4.0 * math.pi * time_s))
    motion = ("motion", {"kind": "column", "file": "day.csv", "column": "x"})
    drive = model(motion, columns={"motion": (time_s + 7.0, position)})
    recording = drive.simulation().recording
    np.testing.assert_allclose(column(recording, "X_command"), position, atol=1e-12)  # spline through its own samples
    with pytest.raises(InputError, match="motion"):
        model(motion)
    force = model(("motion.force_n", {"file": "f.csv", "column": "F"}), columns={"motion.force_n": (time_s, time_s)})
    held = force.simulation().recording
    np.testing.assert_allclose(column(held, "X_load"), np.minimum(held.time_s("simulation"), 0.499), atol=1e-12)


def test_noise_goes_with_the_seed_and_only_with_it():
    noisy = model(("axes.X.sensing", {"current_noise": 5.0}))
    first, again, other = (column(noisy.simulation(seed=seed).recording, "X_table") for seed in (0, None, 1))
    np.testing.assert_array_equal(first, again)
    assert (first != other).any()
    np.testing.assert_array_equal(
        column(model(("axes.X.sensing", {"current_noise": 0.0})).simulation(seed=5).recording, "X_table"),
        column(model().simulation(seed=6).recording, "X_table"),
    )


def test_a_circle_is_a_run_a_direction_and_only_its_measured_arc_is_recorded():
    drive = model(("motion", {**CIRCLE, "feeds_mm_per_min": [5000.0]}), ("axes.Y", RIGID["axes"]["X"]))
    done = drive.simulation()
    assert done.recording.runs == tuple(drive.runs) == ("F5000 ccw", "F5000 cw")
    for run, circle in drive.runs.items():
        trace = done.traces[run]
        np.testing.assert_array_equal(column(done.recording, "deviation", run), trace.deviation_um)
        np.testing.assert_array_equal(column(done.recording, "angle", run), trace.angle_rad)
        time_s = done.recording.time_s(run)
        assert time_s[0] == 0.0
        # one turn at this feed, but for the last sample
        assert time_s[-1] + time_s[1] == pytest.approx(2.0 * math.pi / circle.speed_rad_per_s, abs=time_s[1])
        x, y = (column(done.recording, f"{axis}_table", run) for axis in "XY")
        np.testing.assert_allclose((np.hypot(x, y) - 0.1) * 1e6, trace.deviation_um, atol=1e-6)  # rounding of 0.1 m
        axis_run = done.axes[run]["Y"]
        reference = circle_references(circle, ("X", "Y"), period_s=axis_run.reference.period_s)["Y"]
        np.testing.assert_array_equal(axis_run.reference.position_m, reference.position_m)


def test_the_summary_of_a_circle_is_that_of_its_recording():
    drive = model(("motion", {**CIRCLE, "feeds_mm_per_min": [6000.0, 9000.0]}), ("axes.Y", RIGID["axes"]["X"]))
    done = drive.simulation()
    found = drive_summary(drive, done)
    for run, axes in found.axes.items():
        for name, one in axes.items():
            error, time_s = column(done.recording, f"{name}_error", run), done.recording.time_s(run)
            whole = done.axes[run][name].motion.tracking_error_m * 1e6
            rms = np.sqrt(np.mean(error**2))
            # run-in and run-out, an eighth of a turn each with a slower feed, would show
            assert abs(np.sqrt(np.mean(whole**2)) / rms - 1.0) > 0.001
            assert one.max_m * 1e6 == np.abs(error).max()
            assert one.max_at_s == time_s[int(np.argmax(np.abs(error)))]
            assert one.rms_m * 1e6 == pytest.approx(rms, rel=1e-12)  # rounding


def test_endless_calculations_are_refused():
    with pytest.raises(ModelFileError, match="steps"):
        model(("run.step_s", 1e-8))
    circle = (("motion", {**CIRCLE, "feeds_mm_per_min": [0.01]}), ("axes.Y", RIGID["axes"]["X"]))
    with pytest.raises(InputError, match=r"steps|samples"):
        model(*circle).simulation()


# parameters


def test_what_is_off_is_a_parameter_and_what_is_not_there_is_none():
    found = parameters(checked_model_file(RIGID))
    for key in ("friction.coulomb_n", "friction.offset_n", "servo.delay_s", "transmission.pitch_amplitude_m"):
        one = found[f"axes.X.{key}"]
        assert one.value == 0.0
        assert one.low <= 0.0 < one.high
    assert found["axes.X.friction.offset_n"].low < 0.0
    assert found["axes.X.mechanics.mass_kg"].unit == "kg"
    absent = ("servo.command_limit", "transmission.backlash_m", "friction.screw_coulomb_nm", "servo.sample_s",
              "friction.lugre.stiffness_n_per_m")  # fmt: skip
    assert not {f"axes.X.{key}" for key in absent} & found.keys()
    rotary = parameters(
        checked_model_file(
            changed(RIGID, ("axes.B", changed(RIGID, ("axes.X.mechanics.kind", "rotary"))["axes"]["X"]),
                    ("motion.axis", "X"))
        )
    )  # fmt: skip
    assert rotary["axes.B.mechanics.mass_kg"].unit == "kg·m²"
    assert rotary["axes.B.friction.coulomb_n"].unit == "N·m"


def test_units_follow_from_what_turns_and_what_the_control_puts_out():
    servo = {**RIGID["axes"]["X"]["servo"], "command_limit": 10.0, "speed_limit": 300.0}
    extra = {"servo": servo, "ripple": [{"harmonic": 2.0, "cogging": 1.0}]}
    slide, turn = {**RIGID["axes"]["X"], **extra}, {**RIGID["axes"]["X"], **extra}
    turn["mechanics"] = {"kind": "rotary", "mass_kg": 1.0}
    keys = ("velocity_gain", "velocity_integral_gain", "actuator_gain", "command_limit", "speed_limit")

    def units(section, output):
        axis = ("axes.B", {**section, "output": output})
        found = parameters(checked_model_file(changed(RIGID, axis, ("motion.axis", "X"))))
        return [found[f"axes.B.servo.{key}"].unit for key in keys] + [found["axes.B.ripple.1.cogging"].unit]

    screw = {**PARTS, **extra, "servo": {**servo, "actuator_gain": 0.8}}
    assert units(slide, "voltage") == ["V·s/m", "V/m", "N/V", "V", "m/s", "N"]
    assert units(slide, "force") == ["N·s/m", "N/m", "1", "N", "m/s", "N"]
    assert units(screw, "current") == ["A·s/rad", "A/rad", "N·m/A", "A", "rad/s", "N·m"]
    assert units(turn, "number") == ["s/rad", "1/rad", "N·m", "1", "rad/s", "N·m"]


@pytest.mark.parametrize("path", sorted(EXAMPLES.glob("*.toml")), ids=lambda path: path.stem)
def test_every_parameter_can_be_set_to_what_it_is(path):
    file = read_model_file(path)
    found = parameters(file)
    assert found
    for name, one in found.items():
        assert one.low <= one.value <= one.high, name
        assert one.low < one.high, name
    again = parameters(with_parameters(file, {name: one.value for name, one in found.items()}))
    assert {name: one.value for name, one in again.items()} == {name: one.value for name, one in found.items()}


@settings(max_examples=20)
@given(st.data())
def test_a_parameter_that_was_set_has_its_value(data):
    ripple = [{"harmonic": 2.0, "cogging": 1.0}]
    file = checked_model_file(changed(RIGID, ("axes.X.ripple", ripple), ("axes.X.friction.lugre", {
        "stiffness_n_per_m": 1e6})))  # fmt: skip
    found = parameters(file)
    name = data.draw(st.sampled_from(sorted(found)))
    value = data.draw(st.floats(found[name].low, found[name].high))
    changed_file = with_parameters(file, {name: value})
    assert parameters(changed_file)[name].value == value
    others = [key for key in plain_values(file) if key != "axes"]
    assert {key: plain_values(changed_file)[key] for key in others} == {key: plain_values(file)[key] for key in others}


def test_setting_a_parameter_is_writing_it_into_the_file():
    drive = model()
    set_to = drive.with_parameters({"axes.X.friction.coulomb_n": 40.0, "axes.X.servo.delay_s": 0.001})
    written = model(("axes.X.friction", {"coulomb_n": 40.0}), ("axes.X.servo.delay_s", 0.001))
    np.testing.assert_array_equal(
        column(set_to.simulation().recording, "X_table"), column(written.simulation().recording, "X_table")
    )
    off = set_to.with_parameters({"axes.X.friction.coulomb_n": 0.0, "axes.X.servo.delay_s": 0.0})
    np.testing.assert_array_equal(
        column(off.simulation().recording, "X_table"), column(drive.simulation().recording, "X_table")
    )


def test_wrong_parameters_and_bounds_are_refused():
    file = checked_model_file(changed(RIGID, ("bounds", {"axes.X.mechanics.mass_kg": [50.0, 150.0]})))
    assert parameters(file)["axes.X.mechanics.mass_kg"].high == 150.0
    with pytest.raises(OptionError, match="50 to 150"):
        with_parameters(file, {"axes.X.mechanics.mass_kg": 200.0})
    with pytest.raises(OptionError, match="no parameter"):
        with_parameters(file, {"axes.X.mass": 200.0})
    with pytest.raises(ModelFileError, match=r"axes\.X\.servo\.position_gain_per_s"):
        with_parameters(file, {"axes.X.servo.position_gain_per_s": -1.0})
    for bad in ({"axes.X.mass": [0.0, 1.0]}, {"axes.X.mechanics.mass_kg": [1.0, 2.0]}):
        with pytest.raises(ModelFileError, match="bounds"):
            model(("bounds", bad))


# findings


def told(drive):
    done = drive.simulation()
    after = simulation_findings(drive, done, drive_summary(drive, done).loops)
    return {one.id: one for one in (*model_findings(drive), *after)}


def test_a_good_axis_is_silent():
    assert told(model(("motion", {**MOVES, "jerk_m_per_s3": 50.0}))) == {}


def test_what_is_odd_is_told():
    assert "begins-in-motion" in told(model())
    assert "begins-in-motion" not in told(model(("motion.phase_deg", 90.0)))
    limited = told(model(("motion", MOVES), ("axes.X.servo.command_limit", 150.0)))["limit-reached"]
    assert 0.0 < limited.evidence["share"] < 1.0
    slow = told(model(("motion", MOVES), ("axes.X.servo.speed_limit", 0.05)))["faster-than-speed-limit"]
    assert slow.evidence["possible_m_per_s"] == 0.05


def test_a_table_that_leaves_its_screw_is_told():
    long_way = (("axes.X", PARTS), ("axes.X.servo.velocity_gain", 4.0), ("motion", {**MOVES, "targets_mm": [650.0],
                "feed_mm_per_min": 30000.0}))  # fmt: skip
    one = told(model(*long_way))["table-off-the-screw"]
    assert one.level == "error"
    assert one.evidence["to_m"] == pytest.approx(0.65, abs=0.01)
    with pytest.raises(InputError) as refused:
        model(*long_way, ("axes.X.varying", "command")).simulation()
    assert refused.value.where == "axis X, position of the table"


def test_an_unstable_loop_is_told_with_its_poles_before_it_runs_away():
    wild = model(("axes.X.servo.velocity_gain", 5e5))
    (one,) = (one for one in model_findings(wild) if one.id == "unstable-loop")
    assert one.level == "error"
    assert "poles" in one.statement or "pole" in one.statement
    with pytest.raises(InputError, match="unstable"):
        wild.simulation()


def test_a_coarse_step_is_told():
    drive = drive_model(read_model_file(EXAMPLES / "thc6350-x.toml"))
    rate = fastest_rate_per_s(drive.axes["X"].axis)
    for step_s, is_told in ((1.5 / rate, True), (0.5 / rate, False)):
        plain = plain_values(drive.file)
        plain["run"] = {"step_s": step_s}
        found = {one.id for one in model_findings(drive_model(checked_model_file(plain)))}
        assert ("coarse-step" in found) == is_told


# examples


def test_the_example_of_stick_slip_sticks_and_slips():
    drive = drive_model(read_model_file(EXAMPLES / "stick-slip.toml"))
    motion = drive.simulation().axes["simulation"]["Z"].motion
    feed_m_per_s = 1e-4
    steady = (motion.time_s > 1.0) & (motion.time_s < 4.5)
    speed = motion.table_speed_m_per_s[steady]
    # a table that followed would keep to the feed; here it rests most of the time, and slips many times as fast
    assert np.median(np.abs(speed)) < 0.5 * feed_m_per_s
    assert speed.max() > 10.0 * feed_m_per_s


def test_the_example_of_a_ball_bar_shows_the_gains_that_were_planted():
    plain = plain_values(read_model_file(EXAMPLES / "ball-bar.toml"))
    plain["motion"]["feeds_mm_per_min"] = (5000.0,)
    drive = drive_model(checked_model_file(plain))

    def swapping_um(gain_per_s: float) -> float:
        """Size of the ellipse at 45° that swaps sides with the direction: what unequal gains make."""
        done = drive.with_parameters({"axes.Y.servo.position_gain_per_s": gain_per_s}).simulation()
        there, back = (
            2.0 * np.mean(trace.deviation_um * np.sin(2.0 * np.unwrap(trace.angle_rad)))
            for trace in done.traces.values()
        )
        return abs(float(there - back)) / 2.0

    # with equal gains friction of the table and backlash, which are not symmetric in the two axes, leave a little
    assert swapping_um(38.0) > 5.0 * swapping_um(40.0)


def test_stiffness_and_damping_along_the_command_act_on_circles_too():
    text = """
[model]
kind = "drive"
name = "circle along the command"
[motion]
kind = "circle"
feeds_mm_per_min = [5000]
[axes.X]
parts = "thc6350-x"
varying = "command"
servo = {position_gain_per_s = 40, velocity_gain = 6, velocity_integral_gain = 300}
[axes.Y]
parts = "thc6350-x"
varying = "command"
servo = {position_gain_per_s = 40, velocity_gain = 6, velocity_integral_gain = 300}
"""
    model = drive_model(parsed_model_file(text))
    one = model.simulation().axes["F5000 ccw"]["X"]
    assert one.course is not None
    assert one.course.guide_damping_ns_per_m is not None
    # the guide's friction is in the damping, most of it where the axis turns
    assert one.course.guide_damping_ns_per_m.max() > 2 * one.course.guide_damping_ns_per_m.min()
    again = simulate_axis(one.axis, one.reference, step_s=one.step_s, course=one.course)
    np.testing.assert_array_equal(one.motion.table_m, again.table_m)
    constant = simulate_axis(one.axis, one.reference, step_s=one.step_s)
    assert np.abs(constant.table_m - one.motion.table_m).max() > 1e-6
