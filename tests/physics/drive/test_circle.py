"""References of circular tests: a full circle at a steady feed, smooth, and a bar that keeps its length."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from selector.errors import InputError
from selector.physics.drive.ball_bar.circle import Circle, TableBall, circle_references, measured_samples

circles = st.builds(
    Circle,
    feed_mm_per_min=st.floats(500.0, 20000.0),
    direction=st.sampled_from([1, -1]),
    radius_m=st.floats(0.02, 0.3),
    centre_m=st.tuples(st.floats(-1, 1), st.floats(-1, 1)),
    start_angle_rad=st.floats(-4, 4),
    overshoot_rad=st.floats(0.1, 3.0),
    table_ball=st.none() | st.builds(TableBall, st.floats(0, 0.3), st.floats(-4, 4), st.floats(-2, 2)),
)


def references(circle: Circle, samples: int = 4000):
    names = ("X", "Y") if circle.table_ball is None else ("X", "Y", "B")
    return circle_references(circle, names, period_s=circle.duration_s / samples)


@given(circles)
@settings(max_examples=30)
def test_speed_and_acceleration_are_the_derivatives(circle):
    made = references(circle, math.ceil(200 * circle.duration_s / circle.ramp_s))
    for one in made.values():
        for rate, values in ((one.speed_m_per_s, one.position_m), (one.acceleration_m_per_s2, one.speed_m_per_s)):
            gained = np.cumsum((rate[1:] + rate[:-1]) / 2 * one.period_s)
            # the trapezoidal rule over 1/200 of the ramp: π³/24·(1/200)² = 3e-5 of the change within a ramp
            np.testing.assert_allclose(
                values[1:] - values[0], gained, atol=1e-4 * np.abs(values - values[0]).max() + 1e-12
            )


@given(circles)
@settings(max_examples=30)
def test_it_starts_and_ends_at_rest(circle):
    for one in references(circle).values():
        speed = np.abs(one.speed_m_per_s).max()
        # the last sample may lie one period, 1/4000 of the run, after the end
        assert np.abs(one.speed_m_per_s[[0, -1]]).max() <= 1e-6 * speed + 1e-12


@given(circles)
@settings(max_examples=30)
def test_the_measured_arc_is_a_full_circle_at_the_feed(circle):
    made = references(circle)
    time = made["X"].time_s
    inside = measured_samples(circle, time)
    angle, speed, _ = circle.travelled_rad(time[inside])
    np.testing.assert_allclose(speed, circle.direction * circle.feed_mm_per_min / 60e3 / circle.radius_m, rtol=1e-9)
    assert len(np.flatnonzero(np.diff(inside.astype(int)) != 0)) == 2
    step = circle.speed_rad_per_s * made["X"].period_s
    assert abs(np.ptp(angle) + step - 2 * math.pi) <= step


@given(circles)
@settings(max_examples=30)
def test_the_bar_keeps_its_length_and_turns(circle):
    made = references(circle)
    spindle = made["X"].position_m + 1j * made["Y"].position_m - complex(*circle.centre_m)
    ball = np.zeros_like(spindle)
    if circle.table_ball is not None:
        turned = circle.table_ball.ball_angle_rad + made["B"].position_m
        ball = circle.table_ball.ball_distance_m * np.exp(1j * turned)
    bar = spindle - ball
    # rounding of metres
    np.testing.assert_allclose(np.abs(bar), circle.radius_m, atol=1e-14)
    turned = np.unwrap(np.angle(bar))
    total = 2 * math.pi + 2 * circle.overshoot_rad
    assert turned[-1] - turned[0] == pytest.approx(circle.direction * total, abs=1e-9)
    at_start = np.interp(0.0, circle.direction * circle.travelled_rad(made["X"].time_s)[0], turned)
    assert math.cos(at_start - circle.start_angle_rad) == pytest.approx(1.0, abs=1e-5)


def test_the_feed_is_the_speed_along_the_circle():
    # 3000 mm/min are 0.05 m/s
    made = circle_references(Circle(3000.0), period_s=1e-3)
    speed = np.hypot(made["X"].speed_m_per_s, made["Y"].speed_m_per_s)
    assert speed.max() == pytest.approx(0.05, rel=1e-12)
    # counter-clockwise from +X: Y rises where the circle begins
    at = int(np.argmax(measured_samples(Circle(3000.0), made["X"].time_s)))
    assert made["X"].position_m[at] == pytest.approx(0.1, abs=1e-6)
    assert made["Y"].speed_m_per_s[at] > 0.0499


@pytest.mark.parametrize(
    ("make", "named"),
    [
        (lambda: Circle(0.0), "feed_mm_per_min"),
        (lambda: Circle(100.0, radius_m=-0.1), "radius_m"),
        (lambda: TableBall(-0.1), "ball_distance_m"),
        (lambda: circle_references(Circle(1e-6), period_s=0.01), "sampled every"),
        (lambda: circle_references(Circle(100.0), period_s=0.0), "sampled every"),
    ],
)
def test_what_cannot_be_is_refused(make, named):
    with pytest.raises(InputError, match=named) as refused:
        make()
    assert refused.value.advice
