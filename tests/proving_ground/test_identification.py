"""The inverse dynamic model finds the mass and friction that made a force, and says how surely."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from proving_ground.real.identification import (
    filtered_motion,
    identified_axis_of_servo,
    identified_rigid_axis,
    servo_bandwidth_hz,
)
from selector.errors import InputError
from selector.physics.drive.parts.axis import Servo
from selector.physics.drive.trajectory import moves

PERIOD_S = 1e-3
BANDWIDTH_HZ = 20.0


@pytest.fixture(scope="module")
def course():
    # smooth enough for 20 Hz: jerk phases of 0.1 s
    return moves(
        [0.1, 0.2, 0.05, 0.0], PERIOD_S, speed_m_per_s=0.12, acceleration_m_per_s2=0.8, jerk_m_per_s3=8.0, repeat=2
    )


def force_of(course, mass, viscous, coulomb, offset):
    v = course.speed_m_per_s
    return mass * course.acceleration_m_per_s2 + viscous * v + coulomb * np.sign(v) + offset


def identified(course, force, **options):
    return identified_rigid_axis(PERIOD_S, course.position_m, force, bandwidth_hz=BANDWIDTH_HZ, **options)


@settings(max_examples=25)
@given(st.floats(10.0, 500.0), st.floats(0.0, 2000.0), st.floats(0.0, 100.0), st.floats(-50.0, 50.0))
def test_the_parameters_that_made_the_force_are_found(course, mass, viscous, coulomb, offset):
    found = identified(course, force_of(course, mass, viscous, coulomb, offset))
    assert found.names == ("mass_kg", "guide_damping_ns_per_m", "coulomb_n", "offset_n")
    # corners of acceleration are rounded at 100 Hz, and the sign of the speed changes between samples: a few
    # thousandths of the forces (0.5 m/s², 0.1 m/s) that each parameter makes
    scale = 0.5 * mass + 0.1 * viscous + coulomb + abs(offset)
    errors = np.abs(found.values - [mass, viscous, coulomb, offset]) * [0.5, 0.1, 1.0, 1.0]
    assert errors.max() < 4e-3 * scale
    assert found.relative_force_error < 0.05


def test_the_estimate_is_linear_in_the_force_and_odd_in_the_direction(course):
    force = force_of(course, 95.0, 200.0, 20.0, -3.0)
    found, twice = identified(course, force), identified(course, 2.0 * force)
    assert twice.values == pytest.approx(2.0 * found.values, rel=1e-9)
    assert twice.relative_force_error == pytest.approx(found.relative_force_error, rel=1e-9)
    mirrored = identified_rigid_axis(PERIOD_S, -course.position_m, -force, bandwidth_hz=BANDWIDTH_HZ)
    assert mirrored.values == pytest.approx(found.values * [1.0, 1.0, 1.0, -1.0], rel=1e-9)


def test_standard_errors_are_those_of_repeated_runs(course):
    rng = np.random.default_rng(11)
    force = force_of(course, 95.0, 200.0, 0.0, -3.0)  # without the sign, whose edge is no noise
    runs = [identified(course, force + rng.normal(0.0, 20.0, len(force))) for _ in range(120)]
    spread = np.std([run.values for run in runs], axis=0)
    said = np.mean([run.standard_errors for run in runs], axis=0)
    # 120 runs give a spread to 6.5 %; the decimating filter correlates neighbours a little
    assert said == pytest.approx(spread, rel=0.25)


def test_a_force_of_the_other_sign_is_refused(course):
    servo = Servo(160.0, 240.0, 1000.0, 35.0)
    with pytest.raises(InputError, match="sign"):
        identified_axis_of_servo(PERIOD_S, course.position_m, -force_of(course, 95.0, 200.0, 20.0, -3.0) / 35.0, servo)


def test_a_force_that_acts_later_is_brought_forward(course):
    # the command of each sample is held: half a sample late in the mean, here three samples more to see it well
    force = force_of(course, 95.0, 200.0, 0.0, 0.0)
    early = np.interp(course.time_s + 3.5e-3, course.time_s, force)
    without, with_delay = identified(course, early), identified(course, early, delay_s=3.5e-3)
    assert abs(with_delay["guide_damping_ns_per_m"] - 200.0) < 2.0
    assert abs(without["guide_damping_ns_per_m"] - 200.0) > 10.0


def test_the_bandwidth_is_that_of_the_loop_with_the_mass_found(course):
    servo = Servo(160.0, 240.0, actuator_gain=35.0)
    force = force_of(course, 95.0, 200.0, 20.0, -3.0)
    found = identified_axis_of_servo(PERIOD_S, course.position_m, force / 35.0, servo)
    # √(160·240·35/95)/2π
    assert servo_bandwidth_hz(servo, 95.0) == pytest.approx(18.93, abs=0.005)
    assert found.cut_off_hz == pytest.approx(5 * servo_bandwidth_hz(servo, found["mass_kg"]), rel=1e-3)
    assert found.decimation == round(0.4 * 1000 / (2 * 18.93))
    assert found["mass_kg"] == pytest.approx(95.0, rel=5e-3)


@pytest.mark.parametrize("frequency", [5.0, 20.0, 60.0])
def test_the_filter_has_the_gain_of_its_closed_form_and_no_delay(frequency):
    time = np.arange(4000) * PERIOD_S
    omega = 2 * math.pi * frequency
    position, speed, acceleration = filtered_motion(PERIOD_S, np.sin(omega * time), 100.0)
    # bilinear Butterworth of order 4, twice; central differences: sin(ωh)/h each
    gain = 1 / (1 + (math.tan(omega * PERIOD_S / 2) / math.tan(math.pi * 0.1)) ** 8)
    slope = math.sin(omega * PERIOD_S) / PERIOD_S
    inner = slice(1000, 3000)
    assert position[inner] == pytest.approx(gain * np.sin(omega * time)[inner], abs=1e-6)
    assert speed[inner] == pytest.approx(gain * slope * np.cos(omega * time)[inner], abs=1e-6 * omega)
    assert acceleration[inner] == pytest.approx(-gain * slope**2 * np.sin(omega * time)[inner], abs=1e-6 * omega**2)


@pytest.mark.parametrize(
    ("spoil", "says"),
    [
        (lambda x, f: (x, f[:-1]), "as many positions as forces"),
        (lambda x, f: (np.where(np.arange(len(x)) == 7, np.nan, x), f), "missing values"),
        (lambda x, f: (x[:300], f[:300]), "longer record"),
        (lambda x, f: (x[:20], f[:20]), "longer record"),
        (lambda x, f: (np.zeros_like(x), f), "leaves mass_kg"),
        (lambda x, f: (np.arange(len(x)) * 1e-4, f), "coulomb_n, offset_n open"),
    ],
)
def test_records_that_say_nothing_are_refused(course, spoil, says):
    x, f = spoil(course.position_m, force_of(course, 95.0, 200.0, 20.0, -3.0))
    with pytest.raises(InputError, match=says):
        identified_rigid_axis(PERIOD_S, x, f, bandwidth_hz=BANDWIDTH_HZ)


def test_a_record_too_slow_for_its_loop_is_refused(course):
    with pytest.raises(InputError, match="500 Hz"):
        identified_rigid_axis(PERIOD_S, course.position_m, course.position_m, bandwidth_hz=100.0)
