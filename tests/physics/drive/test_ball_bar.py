"""What the bar shows: closed forms of geometry errors and of lag, recorded circles, steps that are short enough."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from selector.errors import InputError
from selector.physics.drive.ball_bar.circle import (
    BallBarTrace,
    PairGeometry,
    TableBall,
    ball_bar_run,
    measured_samples,
    positions_trace,
)
from selector.physics.drive.parts.axis import Axis, Friction, Sensing
from selector.physics.drive.simulation import simulate_axis
from selector.physics.drive.trajectory import ParameterCourse
from tests.physics.drive.axes import CONTINUOUS, RIGID, RIGID_SERVO, SAMPLED, THREE
from tests.physics.drive.ball_bars import BallBarPlan, ball_bar_test

RADIUS_UM = 1e5
SLOW = BallBarPlan(feeds_mm_per_min=(600.0,))
"""Lag of the stiff pair at 600 mm/min: R/2·(ω/Kv)² = 0.5e5·(0.1/400)² = 3e-3 µm."""

STIFF = Axis(RIGID, replace(RIGID_SERVO, position_gain_per_s=400.0, velocity_gain=2400.0, velocity_integral_gain=0.0))
LAG_UM = 0.01
PAIR = {"X": STIFF, "Y": STIFF}


@pytest.mark.parametrize(
    ("geometry", "expected"),
    [
        (PairGeometry(), lambda c, s: 0 * c),
        (PairGeometry(squareness_um_per_m=50.0), lambda c, s: 5.0 * c * s),
        (PairGeometry(scale_um_per_m=(40.0, -20.0)), lambda c, s: 4.0 * c**2 - 2.0 * s**2),
        (PairGeometry(bow_um=(6.0, 0.0)), lambda c, s: 6.0 * c**2 * s),
        (PairGeometry(bow_um=(0.0, -3.0)), lambda c, s: -3.0 * s**2 * c),
        # the ball of the workpiece further out: the spindle ball is nearer to it on that side
        (PairGeometry(centre_offset_um=(10.0, -4.0)), lambda c, s: -10.0 * c + 4.0 * s),
        (PairGeometry(length_error_um=7.0), lambda c, s: -7.0 + 0 * c),
    ],
    ids=["ideal", "squareness", "scales", "bow X", "bow Y", "centre", "length"],
)
def test_errors_of_the_geometry(geometry, expected):
    for trace in ball_bar_test(PAIR, geometry, SLOW):
        shown = expected(np.cos(trace.angle_rad), np.sin(trace.angle_rad))
        # a cross error d changes the length by d²/(2R), up to 10²/2e5 = 5e-4 µm
        np.testing.assert_allclose(trace.deviation_um, shown, atol=LAG_UM + 1e-3)


def test_lag_makes_the_circle_smaller_with_the_square_of_the_feed():
    plan = BallBarPlan(feeds_mm_per_min=(2000.0, 4000.0))
    axis = Axis(
        RIGID, replace(RIGID_SERVO, position_gain_per_s=30.0, velocity_gain=24000.0, velocity_integral_gain=0.0)
    )
    traces = ball_bar_test({"X": axis, "Y": axis}, plan=plan)
    # velocity loop of 35·24000/95 rad/s: first-order position loop within 30/8800
    gains = 35.0 * 24000.0 / 95.0
    for trace in traces:
        pace = trace.feed_mm_per_min / 60e3 / trace.radius_m
        smaller = RADIUS_UM * (1.0 / math.sqrt(1.0 + (pace / 30.0) ** 2) - 1.0)
        assert trace.deviation_um.mean() == pytest.approx(smaller, rel=3 * 30.0 / gains)
    assert [(one.feed_mm_per_min, one.direction) for one in traces] == [(2000, 1), (2000, -1), (4000, 1), (4000, -1)]


def test_both_directions_are_mirror_images_for_equal_axes():
    axis = Axis(THREE, CONTINUOUS, friction=Friction(coulomb_n=200.0))
    one, other = ball_bar_test({"X": axis, "Y": axis}, plan=BallBarPlan(feeds_mm_per_min=(3000.0,), radius_m=0.05))
    # X ↔ Y and the other direction is the same test: the deviation at θ is that at 90° − θ; 20 nm for interpolation
    mirrored = np.interp(one.angle_rad, *_sorted(math.pi / 2 - other.angle_rad, other.deviation_um), period=2 * math.pi)
    quiet = np.abs(np.gradient(mirrored)) < 0.02
    assert quiet.mean() > 0.9
    np.testing.assert_allclose(one.deviation_um[quiet], mirrored[quiet], atol=0.02)


def _sorted(angle, values):
    order = np.argsort(angle % (2 * math.pi))
    return (angle % (2 * math.pi))[order], values[order]


def test_the_default_step_is_short_enough():
    axes = {
        "X": Axis(THREE, CONTINUOUS, friction=Friction(coulomb_n=300.0)),
        "Y": Axis(THREE, replace(CONTINUOUS, position_gain_per_s=38.0)),
    }
    plan = BallBarPlan(feeds_mm_per_min=(4000.0,), radius_m=0.05)
    for one, finer in zip(ball_bar_test(axes, plan=plan), ball_bar_test(axes, plan=plan, step_s=5e-5), strict=True):
        # a hundredth of what a ball-bar resolves, 0.1 µm
        np.testing.assert_allclose(one.deviation_um, finer.deviation_um, atol=1e-3)


@pytest.mark.parametrize("direction", [1, -1])
def test_lag_of_a_rotary_axis_shows_where_the_ball_is_across_the_bar(direction):
    """A table that lags Δ more than the linear axes moves the ball back by distance·Δ, along the bar."""
    fast = replace(RIGID_SERVO, velocity_gain=2400.0, velocity_integral_gain=0.0)
    linear = Axis(RIGID, replace(fast, position_gain_per_s=100.0))
    table = Axis(RIGID, replace(fast, position_gain_per_s=50.0))
    feed, distance = 2000.0, 0.08
    pace = feed / 60e3 / 0.1
    behind = pace / 50.0 - pace / 100.0
    for angle, expected in ((-math.pi / 2, direction * distance * behind * 1e6), (0.0, 0.0)):
        plan = BallBarPlan(feeds_mm_per_min=(feed,), table_ball=TableBall(distance, angle))
        circle = next(one for one in plan.circles if one.direction == direction)
        trace, runs = ball_bar_run({"X": linear, "Y": linear, "B": table}, circle, PairGeometry())
        assert trace.axes == ("X", "Y", "B")
        # second order: radius/2·(pace/100)² = 0.6 µm, distance·pace²·(1/50² − 1/100²)/2 = 1.3 µm
        assert trace.deviation_um.mean() == pytest.approx(expected, abs=2.0)
        # the angle of the table against a steady bar: all constant
        assert np.ptp(trace.deviation_um) < 0.05
    turned = runs["B"].motion.table_m
    assert abs(turned[-1] - turned[0]) == pytest.approx(2 * math.pi + 2 * circle.overshoot_rad, rel=1e-3)


def test_offsets_of_a_rotary_table():
    plan = replace(SLOW, table_ball=TableBall(0.05, 0.0, ratio=0.5))
    rotary = {**PAIR, "B": STIFF}
    aside, on_it = PairGeometry(rotary_centre_offset_um=(10.0, 0.0)), PairGeometry(centre_offset_um=(10.0, 0.0))
    one = ball_bar_test(rotary, aside, plan)[0]
    # the table aside is a centre aside; a ball aside on the table turns with it, half as fast as the bar
    np.testing.assert_allclose(one.deviation_um, -10.0 * np.cos(one.angle_rad), atol=LAG_UM + 2e-3)
    other = ball_bar_test(rotary, on_it, plan)[0]
    turned = np.unwrap(other.angle_rad)
    np.testing.assert_allclose(other.deviation_um, -10.0 * np.cos(turned / 2.0), atol=LAG_UM + 2e-3)


def test_noise_has_a_seed_and_runs_have_their_own():
    axis = replace(STIFF, servo=replace(RIGID_SERVO, sample_s=1e-3), sensing=Sensing(current_noise=0.01))
    plan = BallBarPlan(feeds_mm_per_min=(20000.0,), radius_m=0.03, noise_um=0.5)
    first, again, other = (ball_bar_test({"X": axis, "Y": axis}, plan=plan, seed=seed) for seed in (1, 1, 2))
    np.testing.assert_array_equal(first[0].deviation_um, again[0].deviation_um)
    assert np.abs(first[0].deviation_um - other[0].deviation_um).max() > 1.0
    quiet = ball_bar_test({"X": axis, "Y": axis}, plan=replace(plan, noise_um=0.0), seed=1)
    noise = first[0].deviation_um - quiet[0].deviation_um
    # 5 standard errors of a standard deviation
    assert noise.std() == pytest.approx(0.5, rel=5 / math.sqrt(2 * len(noise)))
    back = first[1].deviation_um - quiet[1].deviation_um
    assert abs(np.corrcoef(noise[: len(back)], back[: len(noise)])[0, 1]) < 5 / math.sqrt(len(noise))


def test_parameters_along_the_command_act_on_the_trace():
    def course(reference):
        return ParameterCourse(reference.period_s, guide_damping_ns_per_m=2000.0 + 4e5 * np.abs(reference.position_m))

    axes = dict.fromkeys("XY", Axis(THREE, replace(CONTINUOUS, feedback="motor")))
    plan = BallBarPlan(feeds_mm_per_min=(4000.0,), radius_m=0.02, noise_um=0.1)
    level, constant = ball_bar_run(axes, plan.circles[0], PairGeometry(), noise_um=plan.noise_um)
    shown, run = ball_bar_run(axes, plan.circles[0], PairGeometry(), noise_um=plan.noise_um, courses={"X": course})
    assert (run["Y"].course, constant["X"].course) == (None, None)
    asked = run["X"].reference
    alone = simulate_axis(axes["X"], asked, step_s=run["X"].step_s, course=course(asked))
    np.testing.assert_array_equal(run["X"].motion.table_m, alone.table_m)
    np.testing.assert_array_equal(run["Y"].motion.table_m, constant["Y"].motion.table_m)
    inside = measured_samples(plan.circles[0], alone.time_s)
    more = (alone.table_m - constant["X"].motion.table_m)[inside] * 1e6 * np.cos(level.angle_rad)
    # 533 N·max(cos²θ·sin θ) on a spring of 1e8 N/m are 2 µm, and the integral of the velocity loop is late besides
    assert np.abs(more).max() > 1.0
    # second order: 5 µm/(2·20 mm)·5 µm and lag of the angle, 5 µm·5 µm/20 mm
    np.testing.assert_allclose(shown.deviation_um - level.deviation_um, more, atol=2e-3)
    test = ball_bar_test(axes, plan=plan, courses={"X": course})
    np.testing.assert_array_equal(test[0].deviation_um, shown.deviation_um)


def test_samples_are_whole_periods_of_the_control():
    axis = Axis(THREE, SAMPLED)
    trace = ball_bar_test({"X": axis, "Y": axis}, plan=BallBarPlan(feeds_mm_per_min=(5000.0,), radius_m=0.02))[0]
    turn_s = 2 * math.pi * 0.02 / (5000.0 / 60e3)
    # 7200 a turn would be 0.21 ms: 0.5 ms, a period of the control
    assert len(trace.angle_rad) == pytest.approx(turn_s / 5e-4, abs=1.5)


def test_recorded_positions_become_a_trace():
    time = np.arange(6000) * 2e-3
    angle = 1.0 - 0.7 * time  # 8.4 rad clockwise: more than a circle
    radius = 0.1 + 5e-6 * np.cos(2 * angle)
    trace = positions_trace(
        time, 0.3 + radius * np.cos(angle), -0.2 + radius * np.sin(angle), radius_m=0.1, centre_m=(0.3, -0.2)
    )
    assert trace.direction == -1
    assert trace.feed_mm_per_min == pytest.approx(0.7 * 0.1 * 60e3, rel=1e-9)
    np.testing.assert_allclose(trace.deviation_um, 5.0 * np.cos(2 * trace.angle_rad), atol=1e-9)
    # the middle 360°: as much left out before as after
    assert trace.angle_rad[0] == pytest.approx(1.0 - (8.4 - 2 * math.pi) / 2, abs=3e-3)


EVEN = np.linspace(0, 2 * np.pi, 400, endpoint=False)


@pytest.mark.parametrize(
    ("make", "named"),
    [
        (lambda: BallBarTrace(EVEN[:350], EVEN[:350], 1, 1000.0), "315°"),
        (lambda: BallBarTrace(EVEN, EVEN, -1, 1000.0), "360° clockwise"),
        (lambda: BallBarTrace(np.delete(EVEN, range(50, 60)), EVEN[10:], 1, 1000.0), "longest gap 9.9°"),
        (lambda: BallBarTrace(2 * EVEN, EVEN, 1, 1000.0), "720°"),
        (lambda: BallBarTrace(EVEN, EVEN[1:], 1, 1000.0), "deviations"),
        (lambda: BallBarTrace(EVEN, np.where(EVEN > 3, np.nan, 0), 1, 1000.0), "missing"),
        (lambda: BallBarTrace(EVEN[::10], EVEN[::10], 1, 1000.0), "100 or more"),
        (lambda: BallBarTrace(EVEN, EVEN, 1, -5.0), "feed_mm_per_min"),
        (lambda: positions_trace([0, 1, 2], [0, 1, 2], [0, 1, 2], radius_m=0.1), "100 or more"),
        (lambda: positions_trace(EVEN[::-1], np.cos(EVEN), np.sin(EVEN), radius_m=1), "increas"),
    ],
)
def test_what_cannot_be_is_refused(make, named):
    with pytest.raises(InputError, match=named) as refused:
        make()
    assert refused.value.advice
