"""Limits of speed and command: what a continuous control does at them, beside sampled ones and the law step by step."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from selector.physics.drive.parts.axis import Axis
from selector.physics.drive.simulation import simulate_axis
from selector.physics.drive.trajectory import Reference
from tests.physics.drive.axes import CONTINUOUS, RIGID, RIGID_SERVO, THREE, sine

LIMITED = replace(RIGID_SERVO, command_limit=5.0, speed_limit=0.2, velocity_feedforward=0.8)


def by_the_letter(axis: Axis, reference: Reference, step_s: float) -> np.ndarray:
    """The law of servo.py in steps of order 1: the integral stops while the command is limited, and only then."""
    servo, mechanics = axis.servo, axis.mechanics
    x = v = integral = 0.0
    most = np.inf if servo.speed_limit is None else servo.speed_limit
    out = []
    each = round(reference.period_s / step_s)
    fine = np.arange(each * (len(reference.position_m) - 1) + 1) * step_s
    # sines: what lies between the samples is known
    w = 4.0 * np.pi
    amplitude = reference.speed_m_per_s[0] / w
    for k, (r, r_speed) in enumerate(zip(amplitude * np.sin(w * fine), amplitude * w * np.cos(w * fine), strict=True)):
        if k % each == 0:
            out.append(x)
        wanted = servo.position_gain_per_s * (r - x) + servo.velocity_feedforward * r_speed
        error = min(max(wanted, -most), most) - v
        command = servo.velocity_gain * error + servo.velocity_integral_gain * integral
        if abs(command) <= servo.command_limit:
            integral += step_s * error
        limited = min(max(command, -servo.command_limit), servo.command_limit)
        v += step_s * (servo.actuator_gain * limited - mechanics.guide_damping_ns_per_m * v) / mechanics.mass_kg
        x += step_s * v
    return np.array(out)


@pytest.mark.parametrize("integral_gain", [0.0, 2e3, 2e4])
def test_it_is_what_the_law_says_step_by_step(integral_gain):
    axis = Axis(RIGID, replace(LIMITED, velocity_integral_gain=integral_gain))
    reference = sine(1e-3, 0.5)
    motion = simulate_axis(axis, reference, step_s=5e-5)
    # long at the limit, and off it too
    assert 0.2 < np.mean(np.abs(motion.command) == 5.0) < 0.95
    apart = [np.abs(by_the_letter(axis, reference, step_s) - motion.table_m).max() for step_s in (4e-6, 2e-6, 1e-6)]
    # order 1 of the letter; what it tends to is the motion
    assert apart[0] < 1e-6
    assert np.array(apart[:-1]) / apart[1:] == pytest.approx(2.0, abs=0.3)


def test_a_sampled_control_tends_to_the_continuous_one():
    axis = Axis(THREE, replace(CONTINUOUS, command_limit=10.0, speed_limit=80.0))
    reference = sine(2e-3, 0.3)
    limit = simulate_axis(axis, reference, step_s=2.5e-5).table_m
    apart = []
    for sample_s in (2e-5, 1e-5):
        sampled = replace(axis, servo=replace(axis.servo, sample_s=sample_s))
        apart.append(np.abs(simulate_axis(sampled, reference, step_s=2e-5).table_m - limit).max())
    # half a sample of delay: order 1
    assert apart[0] < 1e-5
    assert apart[0] / apart[1] == pytest.approx(2.0, abs=0.2)


@given(
    command=st.floats(1.0, 30.0),
    speed=st.floats(10.0, 200.0),
    gain=st.floats(1.0, 8.0),
    integral_gain=st.floats(0.0, 400.0),
)
@settings(max_examples=30)
def test_limits_hold_at_any_gain_and_the_step_does_not_matter(command, speed, gain, integral_gain):
    servo = replace(
        CONTINUOUS, command_limit=command, speed_limit=speed, velocity_gain=gain, velocity_integral_gain=integral_gain
    )
    reference = sine(1e-3, 0.4)
    axis = Axis(THREE, servo)
    coarse, fine = (simulate_axis(axis, reference, step_s=step_s) for step_s in (1e-4, 5e-5))
    assert np.abs(coarse.command).max() <= command
    # 2e-9 m at most in 400 draws; up to 5e-6 m if the ends of limits are not located
    assert np.abs(coarse.table_m - fine.table_m).max() <= 1e-8
