"""A speed that the control takes from readings of its encoder: over how many samples, and when none are asked for."""

from __future__ import annotations

import numpy as np
import pytest

from selector.errors import InputError
from selector.physics.drive.parts.axis import Axis, AxisState, RigidMechanics, Sensing, Servo
from selector.physics.drive.simulation import simulate_axis
from selector.physics.drive.trajectory import sine

MASS_KG, SAMPLE_S, RESOLUTION_M = 95.0, 1e-3, 1e-6
SERVO = Servo(160.0, 240.0, actuator_gain=35.0, sample_s=SAMPLE_S, feedback="motor")


def by_hand(reference, span, position, speed):
    """The loop in plain words: a free mass under a held force moves on a parabola."""
    read = lambda x: RESOLUTION_M * np.floor(x / RESOLUTION_M + 0.5)  # noqa: E731
    readings = [read(position - (span - k) * SAMPLE_S * speed) for k in range(span)]
    positions, commands = [], []
    for target in reference.position_m:
        readings.append(read(position))
        difference = (readings[-1] - readings[-1 - span]) / (span * SAMPLE_S)
        commands.append(240.0 * (160.0 * (target - readings[-1]) - difference))
        positions.append(position)
        acceleration = 35.0 * commands[-1] / MASS_KG
        position += speed * SAMPLE_S + 0.5 * acceleration * SAMPLE_S**2
        speed += acceleration * SAMPLE_S
    return np.array(positions), np.array(commands)


@pytest.mark.parametrize("span", [1, 2, 5])
def test_the_loop_by_hand(span):
    axis = Axis(
        RigidMechanics(MASS_KG),
        SERVO,
        sensing=Sensing(motor_resolution=RESOLUTION_M, speed_from_encoder=True, speed_samples=span),
    )
    reference = sine(0.01, 2.0, 0.5, SAMPLE_S)
    start = AxisState(motor=1e-4, motor_speed=0.08, table_m=1e-4, table_speed_m_per_s=0.08)
    motion = simulate_axis(axis, reference, step_s=SAMPLE_S, start=start)
    positions, commands = by_hand(reference, span, 1e-4, 0.08)
    # the same arithmetic in another order: rounding, unless a reading falls the other way, which it does not here
    assert motion.motor == pytest.approx(positions, abs=1e-12)
    assert motion.command == pytest.approx(commands, abs=1e-8)


@pytest.mark.parametrize("sensing", [{"speed_samples": 2}, {"speed_samples": 0, "speed_from_encoder": True}])
def test_a_span_needs_an_encoder_and_a_sample(sensing):
    with pytest.raises(InputError, match="speed_samples"):
        Sensing(**sensing)
