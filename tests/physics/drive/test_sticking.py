"""Stick-slip is told where a table creeps and jumps, and nowhere else."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from selector.physics.drive.drive_summary import stick_slip
from selector.physics.drive.trajectory import Motion

TIME_S = np.arange(0.0, 10.0, 0.002)
SPEED = 1e-4


def motion_with(reference_m: np.ndarray, table_m: np.ndarray) -> Motion:
    nothing = np.zeros_like(TIME_S)
    return Motion(
        time_s=TIME_S,
        reference_m=reference_m,
        table_m=table_m,
        table_speed_m_per_s=nothing,
        motor=nothing,
        motor_speed=nothing,
        measured_m=nothing,
        command=nothing,
        actuator_force=nothing,
        axial_force_n=nothing,
        friction_n=nothing,
    )


def stairs(period_s: float, jump_s: float) -> np.ndarray:
    """A table that stands, and at the end of every period catches up within `jump_s`."""
    done, phase = np.divmod(TIME_S, period_s)
    return SPEED * period_s * (done + np.clip((phase - period_s + jump_s) / jump_s, 0.0, 1.0))


@given(st.floats(0.3, 1.5), st.floats(0.02, 0.3))
def test_jumps_are_counted_and_the_time_between_them_is_measured(period_s, share):
    found = stick_slip(motion_with(SPEED * TIME_S, stairs(period_s, share * period_s)))
    assert found is not None
    # the first is where it breaks loose; the last may not be done at the end
    assert abs(found.jumps - (10.0 / period_s - 1.0)) <= 1.0
    # a sample at either end of each jump may count to either side
    assert found.creeping_share == pytest.approx(1.0 - share, abs=2 * 0.002 / period_s + 0.1 * share + 0.02)


def test_the_two_directions_are_counted_alike():
    half = len(TIME_S) // 2
    reference = SPEED * np.minimum(TIME_S, TIME_S[-1] - TIME_S)
    rising = stairs(0.5, 0.05)[:half]
    table = np.concatenate([rising, rising.max() - (rising - rising[0])])
    found = stick_slip(motion_with(reference, table))
    assert found is not None
    # 10 a direction, of which the first of each and what the turn cuts off are left out
    assert 16 <= found.jumps <= 18


@pytest.mark.parametrize(
    "table",
    [
        SPEED * TIME_S,
        SPEED * np.maximum(TIME_S - 0.5, 0.0),
        SPEED * TIME_S + 2e-5 * np.sin(30.0 * TIME_S),
        SPEED * TIME_S + 5e-6 * np.random.default_rng(1).normal(size=len(TIME_S)),
        0.2 * SPEED * TIME_S,
        np.where(TIME_S < 6.0, 0.0, SPEED * TIME_S),
    ],
    ids=["smooth", "late", "vibrating", "noisy", "far too slow", "loose only once"],
)
def test_other_motions_are_no_stick_slip(table):
    assert stick_slip(motion_with(SPEED * TIME_S, table)) is None


def test_an_axis_that_is_not_asked_to_move_does_not_stick():
    assert stick_slip(motion_with(np.zeros_like(TIME_S), stairs(0.5, 0.05))) is None
