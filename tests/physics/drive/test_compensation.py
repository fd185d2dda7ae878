"""Reversal pulses: the height of a spike by integrating its equations, and pulses of circles that others made."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import integrate, signal

from selector.physics.drive.ball_bar.causes import circle_causes, compensations, pulse_m_per_s, spike_height_m
from selector.physics.drive.ball_bar.circle import BallBarTrace
from selector.readers.ball_bar_file import read_circles
from tests.physics.drive.planted_circles import LEAD_M, RADIUS_M, PlantedCircles


@pytest.mark.parametrize("reset_s", [0.005, 0.025, 0.3])
def test_the_pulse_of_a_height_is_the_one_that_makes_it(reset_s):
    height = spike_height_m(0.004, 0.01, 40.0, reset_s)
    assert pulse_m_per_s(height, 0.01, 40.0, reset_s) == pytest.approx(0.004, rel=1e-6)


@pytest.mark.parametrize(
    ("gain", "reset_s", "height", "acceleration"), [(4000.0, 2e-5, 4e-3, 4e-8), (0.1, 1e3, 1e-8, 1e2)]
)
def test_numbers_that_no_axis_has_end_in_a_pulse_too(gain, reset_s, height, acceleration):
    pulse = pulse_m_per_s(height, acceleration, gain, reset_s)
    assert spike_height_m(pulse, acceleration, gain, reset_s) == pytest.approx(height, rel=1e-6)


def test_pulses_of_planted_circles_are_the_step_of_force_that_was_planted(tmp_path):
    planted = PlantedCircles(1)
    has = planted.drawn()
    read, _ = read_circles([planted.write(tmp_path / "test.txt")])
    causes = circle_causes([one.trace for one in read], lead_m={"X": LEAD_M, "Y": LEAD_M})
    told = compensations(causes, ("X", "Y"), RADIUS_M, {"X": 1.0 / 8.0})
    # per mass: of the loop of `planted_circles`, whose velocity controller has 60 times the gain, and Tn = 1/8 s
    gain = has["gain X"]
    damping = 60.0 * gain
    loop = [1.0, damping, 8.0 * damping + gain * damping, 8.0 * gain * damping]
    _, alone = signal.step(([1.0, 0.0], loop), T=np.linspace(0.0, 1.0, 4001))
    expected = 6e4 * has["spike X"] * 1e-6 / alone.max() / damping
    found = [one.amplitude.value for one in told.pulses if one.axis == "X"]
    assert len(found) == 2
    assert found == pytest.approx([expected] * 2, rel=0.15)


@pytest.mark.parametrize(
    ("acceleration", "gain", "reset_s", "pulse"),
    [(0.003, 60.0, 0.03, 0.019), (0.2, 25.0, 0.01, 0.001), (0.02, 40.0, 0.025, 0.01), (2.0, 100.0, 0.2, 0.05)],
)
def test_a_spike_is_as_high_as_its_equations_make_it(acceleration, gain, reset_s, pulse):
    # δ = a·t²/2 while it sticks, then δ' + Kv·δ = y, y' = −y/Tn, by a solver
    breaks = integrate.solve_ivp(
        lambda t, y: [acceleration * t, acceleration * t + gain * y[0]],
        (0.0, 10.0),
        [0.0, 0.0],
        events=lambda t, y: acceleration * t + gain * y[0] + y[1] / reset_s - pulse,
        rtol=1e-10,
        atol=1e-14,
    )
    at, (behind, _) = breaks.t_events[0][0], breaks.y_events[0][0]
    after = integrate.solve_ivp(
        lambda t, y: [y[1] - gain * y[0], -y[1] / reset_s],
        (0.0, 3.0),
        [behind, acceleration * at + gain * behind],
        max_step=1e-3,
        rtol=1e-10,
        atol=1e-14,
    )
    assert spike_height_m(pulse, acceleration, gain, reset_s) == pytest.approx(after.y[0].max(), rel=1e-4)


def test_an_axis_that_sticks_for_long_makes_a_sawtooth():
    """δ = a·t²/2 for a third of a second, and back within a few hundredths: 59 and 98 µm, two decays that differ."""
    pulse, gain, reset_s, traces = 0.015, 30.0, 0.02, []
    for feed in (600.0, 2000.0):
        speed = feed / 60e3
        acceleration = speed**2 / RADIUS_M
        after_s, behind_um = _course_after_reversal(pulse, acceleration, gain, reset_s)
        for way in (1, -1):
            angle = np.arange(3600) * 2.0 * np.pi / 3600 * way
            along = np.zeros(3600)
            for end in (0.0, np.pi):
                since_s = np.mod(way * (angle - end), 2.0 * np.pi) * RADIUS_M / speed
                along += np.cos(end) * np.interp(since_s, after_s, behind_um, right=0.0)
            lag_um = 1e6 * RADIUS_M * (speed / RADIUS_M / gain) ** 2 / 2.0
            noise = np.random.default_rng(3).normal(0.0, 0.1, 3600)
            deviation = along * np.cos(angle) - lag_um + noise
            traces.append(BallBarTrace(angle, deviation, way, feed, RADIUS_M, ("X", "Y")))
    told = compensations(circle_causes(traces), ("X", "Y"), RADIUS_M, {"X": reset_s})
    assert [one.axis for one in told.pulses] == ["X", "X"]
    for one in told.pulses:
        true_um = 1e6 * spike_height_m(pulse, one.acceleration_m_per_s2, gain, reset_s)
        assert one.height_um.value == pytest.approx(true_um, rel=0.06)
        # the shape has one decay: what it is off there is part of the error
        assert abs(one.height_um.value - true_um) < 3.0 * one.height_um.standard_error
        assert one.amplitude.value == pytest.approx(60e3 * pulse, rel=0.15)
        assert abs(one.amplitude.value - 60e3 * pulse) < 3.0 * one.amplitude.standard_error


@pytest.mark.parametrize("height_um", [0.0, 16.0])
def test_a_spike_of_one_sample_is_told_as_too_narrow(height_um):
    traces = []
    for way in (1, -1):
        angle = (np.arange(460) + 0.5) * 2.0 * np.pi / 460 * way
        deviation = np.random.default_rng(way + 2).normal(0.0, 0.1, 460)
        deviation[0] += height_um
        traces.append(BallBarTrace(angle, deviation, way, 1500.0, RADIUS_M, ("X", "Y")))
    found = [one for one in circle_causes(traces).findings if one.id == "ball-bar-narrow-spike"]
    assert [one.where.channel for one in found] == ["X"] * bool(height_um)


def _course_after_reversal(pulse: float, acceleration: float, gain: float, reset_s: float):
    """Times [s] and how far the axis is behind [µm], from the equations of the loop step by step."""
    step_s, behind, pushed, integral, stuck = 1e-5, 0.0, 0.0, 0.0, True
    course = []
    for k in range(120_000):
        course.append(behind)
        if stuck:
            behind, velocity = acceleration * (k * step_s) ** 2 / 2.0, acceleration * k * step_s
            integral += step_s * (velocity + gain * behind) / reset_s
            stuck = velocity + gain * behind + integral < pulse
            pushed = velocity + gain * behind
        else:
            behind += step_s * (pushed - gain * behind)
            pushed -= step_s * pushed / reset_s
    return np.arange(len(course)) * step_s, 1e6 * np.array(course)
