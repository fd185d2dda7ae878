"""The true axis moves as mechanics says, and the simulation of it is right where nothing is concealed."""

from __future__ import annotations

import numpy as np
import pytest

from proving_ground.drive.true_axis import COMMAND_S, LENGTH_S, STEP_S, TrueAxis, given_motion, programme, true_motion

STILL = np.zeros(round(LENGTH_S / STEP_S))
PER_MS = round(COMMAND_S / STEP_S)


def constant_speed(speed=0.05):
    time = COMMAND_S * np.arange(round(LENGTH_S / COMMAND_S))
    ramp = np.clip((time - 0.3) / 0.2, 0.0, 1.0)
    return 0.1 + np.cumsum(speed * ramp * COMMAND_S)


def run(axis, command, force=STILL, delay_s=0.0):
    return [course[::PER_MS] for course in true_motion(axis, command, force, delay_s)]


def test_current_at_constant_speed_is_friction():
    axis = TrueAxis(coulomb_n=80.0, viscous_ns_per_m=400.0, force_per_a=100.0)
    amps = run(axis, constant_speed())[3]
    # the ramp is over by 0.5 s, what is left of it has died away with time constants of 20 ms
    assert amps[3000:] == pytest.approx((80.0 + 400.0 * 0.05) / 100.0, rel=1e-4)


def test_slipping_springs_have_the_same_level():
    one, other = (run(TrueAxis(coulomb_n=80.0, slips=s), constant_speed())[3][4000] for s in (0.0, 1.0))
    assert one == pytest.approx(other, rel=1e-4)  # both have slipped altogether


def test_friction_by_direction():
    command = constant_speed()
    axis = TrueAxis(coulomb_n=80.0, coulomb_by_direction=0.1, viscous_ns_per_m=0.0, force_per_a=100.0)
    assert run(axis, command)[3][4000] == pytest.approx(0.88, rel=1e-3)
    assert run(axis, 0.6 - command)[3][4000] == pytest.approx(-0.72, rel=1e-3)


def test_play_is_lost_at_reversal():
    rng = np.random.default_rng(1)
    command = programme("strokes", rng, 0.1, 1.5)
    axis = TrueAxis(coulomb_n=100.0, play_m=4e-6, on_scale=0.0)
    table = run(axis, command)[2] - run(axis._replace(play_m=0.0), command)[2]
    speed = np.gradient(command, COMMAND_S)
    steady = np.abs(np.gradient(speed, COMMAND_S)) < 0.01
    forward, back = (np.median(table[steady & (sign * speed > 0.01)]) for sign in (1, -1))
    # 1 % of the play: friction is the same, so only the play itself is lost
    assert back - forward == pytest.approx(4e-6, rel=0.01)


def test_wind_up_is_force_over_stiffness():
    axis = TrueAxis(coulomb_n=100.0, viscous_ns_per_m=0.0, stiffness_n_per_m=5e7, on_scale=0.0, presliding_m=3e-6)
    motor, _, table, _ = run(axis, constant_speed())
    assert motor[4000] - table[4000] == pytest.approx(100.0 / 5e7, rel=1e-3)


def test_error_of_the_lead_reaches_the_table():
    axis = TrueAxis(lead_m=2e-6, lead_pitch_m=0.01, on_scale=0.0)
    command = constant_speed(0.01)
    table = run(axis, command)[2] - run(axis._replace(lead_m=0.0), command)[2]
    # a wave of 1 Hz passes the screw unchanged; it starts from where the axis stood
    assert np.ptp(table[1000:6000]) == pytest.approx(4e-6, rel=0.01)


def test_current_keeps_its_limit():
    command = programme("strokes", np.random.default_rng(2), 0.15, 2.0)
    free = run(TrueAxis(), command)[3]
    limit = 0.8 * np.abs(free).max()
    assert np.abs(run(TrueAxis(limit_a=limit), command)[3]).max() <= limit * (1 + 1e-9)


def test_delay_shifts_the_motion():
    command = constant_speed()
    table, late = run(TrueAxis(), command)[2], run(TrueAxis(), command, delay_s=2e-3)[2]
    assert table[4000] - late[4000] == pytest.approx(0.05 * 2e-3, rel=1e-3)


@pytest.mark.parametrize("friction", [0.0, 90.0])
@pytest.mark.parametrize("on_scale", [0.0, 1.0])
def test_simulation_is_right_where_nothing_is_missing(friction, on_scale):
    axis = TrueAxis(coulomb_n=friction, on_scale=on_scale)
    command = programme("strokes", np.random.default_rng(3), 0.12, 1.5)
    _, speed, table, amps = run(axis, command)
    given_speed, given_table, given_amps = given_motion(axis, command)
    # two codes with steps of 0.1 and 0.125 ms, second order: far below noise of 0.2 µm and 30 mA
    assert np.abs(table - given_table).max() < 0.05e-6
    assert np.abs(amps - given_amps).max() < 0.01
    assert np.abs(speed - given_speed).max() < 1e-4


def test_encoder_is_fine_enough():
    axis = TrueAxis(coulomb_n=80.0, slips=1.0, ripple_n=5.0)
    command = programme("sines", np.random.default_rng(4), 0.12, 1.5)
    table = run(axis, command)[2]
    # steps of 5 nm in the loop, against noise of 0.2 µm of what is recorded
    other = run(axis._replace(encoder_m=1e-9), command)[2]
    assert np.abs(table - other).max() < 0.02e-6
