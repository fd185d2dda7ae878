"""Reversal pulses: the height of a spike by integrating its equations, and pulses of circles that others made."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import integrate, signal

from selector.physics.drive.ball_bar.causes import circle_causes
from selector.physics.drive.ball_bar.compensation import compensations, pulse_m_per_s, spike_height_m
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
    found = [one.amplitude_mm_per_min for one in told.pulses if one.axis == "X"]
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
