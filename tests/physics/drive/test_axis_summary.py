"""Errors, limits and stiffness of a simulated axis are those of its courses."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from selector.physics.drive.drive_model import drive_model
from selector.physics.drive.drive_summary import (
    axis_summary,
    limited_samples,
    loop_summary,
    parameters_along,
    simulation_findings,
    tightest_loop,
)
from selector.physics.drive.model_file import parsed_model_file
from selector.physics.drive.parts.axis import Axis, RigidMechanics, Servo
from selector.physics.drive.parts.catalogue import thc6350_x_axis
from selector.physics.drive.parts.stiffness import axial_compliance, three_mass_mechanics
from selector.physics.drive.simulation import simulate_axis
from selector.physics.drive.stability import stability
from selector.physics.drive.trajectory import ParameterCourse, Reference, moves, sine

SERVO = Servo(position_gain_per_s=40.0, velocity_gain=4.0, velocity_integral_gain=160.0)
SLIDE = Axis(RigidMechanics(95.0, 200.0), Servo(100.0, 200.0, actuator_gain=35.0))
THERE = moves([0.1], 1e-3, speed_m_per_s=0.2, acceleration_m_per_s2=2.0, jerk_m_per_s3=50.0, dwell_s=0.2)


def screw_axis() -> Axis:
    parts = thc6350_x_axis()
    return Axis(three_mass_mechanics(parts), SERVO, compliance=axial_compliance(parts))


def test_errors_are_those_of_the_motion():
    motion = simulate_axis(SLIDE, THERE, step_s=1e-3)
    found = axis_summary(SLIDE, THERE, motion, None)
    error = THERE.position_m - motion.table_m
    assert found.max_m == np.abs(error).max()
    assert found.max_at_s == THERE.time_s[int(np.argmax(np.abs(error)))]
    assert found.rms_m == pytest.approx(np.sqrt(np.mean(error**2)), rel=1e-12)  # rounding
    assert (found.stiffness_n_per_m, found.damping_ns_per_m) == (None, (200.0, 200.0))
    assert found.limited_share == 0.0


def test_the_limit_of_the_command_is_counted_where_it_is_reached():
    most = 0.6 * float(np.abs(simulate_axis(SLIDE, THERE, step_s=1e-3).command).max())
    limited = replace(SLIDE, servo=replace(SLIDE.servo, command_limit=most))
    motion = simulate_axis(limited, THERE, step_s=1e-3)
    found = limited_samples(limited, THERE, motion)
    np.testing.assert_array_equal(found, np.abs(motion.command) == most)
    assert 0 < found.mean() < 1


def test_the_limit_of_the_speed_is_counted_where_the_axis_is_asked_for_more():
    limited = replace(SLIDE, servo=replace(SLIDE.servo, speed_limit=0.15))
    motion = simulate_axis(limited, THERE, step_s=1e-3)
    found = limited_samples(limited, THERE, motion)
    # it drives at its limit and catches up for a while after the command has come to rest
    assert np.abs(motion.motor_speed).max() < 0.151
    assert found.mean() > 0.2
    assert not found[0]
    assert not limited_samples(SLIDE, THERE, motion).any()


def test_stiffness_follows_position_and_load_of_the_motion():
    axis, reference = screw_axis(), sine(0.05, 1.0, 0.5, 1e-3, phase_rad=np.pi / 2)
    motion = simulate_axis(axis, reference, step_s=1e-4)
    course = parameters_along(thc6350_x_axis(), axis, motion)
    assert course is not None
    low, high = axis_summary(axis, reference, motion, course).stiffness_n_per_m or (0.0, 0.0)
    assert (low, high) == (course.axial_stiffness_n_per_m.min(), course.axial_stiffness_n_per_m.max())
    assert low < axis.mechanics.axial_stiffness_n_per_m * 1.02
    assert low < high
    assert parameters_along(thc6350_x_axis(), replace(axis, compliance=None), motion) is None
    assert parameters_along(None, axis, motion) is None
    off = replace(motion, table_m=motion.table_m + 10.0)
    assert parameters_along(thc6350_x_axis(), axis, off) is None


def test_what_a_course_leaves_out_is_constant():
    axis = replace(screw_axis(), compliance=None)
    reference = Reference(1e-3, np.zeros(3), np.zeros(3), np.zeros(3))
    motion = simulate_axis(axis, reference, step_s=1e-4)
    found = axis_summary(axis, reference, motion, ParameterCourse(1e-3, None, np.array([1.0, 2.0, 3.0])))
    stiffness = axis.mechanics.axial_stiffness_n_per_m
    assert (found.stiffness_n_per_m, found.damping_ns_per_m) == ((stiffness, stiffness), (1.0, 3.0))


def test_an_axis_without_a_control_has_no_loop():
    assert loop_summary(replace(SLIDE, servo=None)) is None
    loop = loop_summary(SLIDE)
    assert loop is not None
    assert loop.stability.stable
    assert loop.figures.bandwidth_hz > 0


def test_the_loop_is_told_where_it_is_nearest_to_its_edge():
    """A screw held at one end is softer further out, and its loop unstable there with a gain that does near it."""
    text = """
        [model]
        kind = "drive"
        name = "long screw"
        [motion]
        kind = "moves"
        targets_mm = [10.0, {far}, 0.0]
        feed_mm_per_min = 20000
        acceleration_m_per_s2 = 3.0
        jerk_m_per_s3 = 60.0
        [axes.X]
        varying = "state"
        [axes.X.parts]
        like = "thc6350-x"
        [axes.X.parts.screw]
        length_mm = 3000.0
        origin_mm = 100.0
        both_ends = false
        [axes.X.servo]
        position_gain_per_s = 40.0
        velocity_gain = 14.0
        velocity_integral_gain = 800.0
        """
    near, far = (drive_model(parsed_model_file(text.format(far=far))) for far in (20.0, 2500.0))
    loops = []
    for model in (near, far):
        done = model.simulation()
        loops.append(tightest_loop(model, "X", done.runs_of("X")))
        told = [one for one in simulation_findings(model, done, {"X": loops[-1]}) if "table position" in one.statement]
        assert bool(told) == (model is far)
    assert loops[1].at_m == pytest.approx(2.5, abs=0.02)
    assert loops[1].figures.gain_margin_db < loops[0].figures.gain_margin_db - 5.0
    # the same axis, with the nut's origin there
    axis = done.runs_of("X")[0].axis
    there = replace(axis.compliance, origin_m=axis.compliance.origin_m + loops[1].at_m)
    limits = stability(replace(axis, compliance=there)).gain_limits
    assert loops[1].stability.gain_limits == pytest.approx(limits, rel=0.1)  # the load of the motion stiffens the nut
