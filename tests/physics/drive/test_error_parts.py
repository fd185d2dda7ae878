"""A tracking error is split into what goes with speed, acceleration and direction, and nothing is lost."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from selector.physics.drive.drive_summary import direction_of_travel, error_parts
from selector.physics.drive.trajectory import Motion, moves

TIME_S = np.linspace(0.0, 2.0, 4001)
REFERENCE_M = 0.1 * np.sin(2.0 * np.pi * TIME_S) + 0.03 * np.sin(6.0 * np.pi * TIME_S)
SPEED = np.gradient(REFERENCE_M, TIME_S)


GOING_UP = np.linspace(0.0, 1.0, 500) ** 2
SPEED_UP = np.gradient(GOING_UP, np.linspace(0.0, 2.0, 500))


def motion_with(error_m: np.ndarray, reference_m: np.ndarray = REFERENCE_M, time_s: np.ndarray | None = None) -> Motion:
    nothing = np.zeros_like(error_m)
    return Motion(
        time_s=np.linspace(0.0, 2.0, len(error_m)) if time_s is None else time_s,
        reference_m=reference_m,
        table_m=reference_m - error_m,
        table_speed_m_per_s=nothing,
        motor=nothing,
        motor_speed=nothing,
        measured_m=nothing,
        command=nothing,
        actuator_force=nothing,
        axial_force_n=nothing,
        friction_n=nothing,
    )


@given(
    lag_s=st.floats(-0.05, 0.05),
    per_acceleration_s2=st.floats(-1e-4, 1e-4),
    reversal_m=st.floats(-1e-4, 1e-4),
    constant_m=st.floats(-1e-4, 1e-4),
)
def test_what_an_error_is_made_of_is_found_again(lag_s, per_acceleration_s2, reversal_m, constant_m):
    planted = (
        lag_s * SPEED
        + per_acceleration_s2 * np.gradient(SPEED, TIME_S)
        + reversal_m * direction_of_travel(SPEED)
        + constant_m
    )
    parts = error_parts(motion_with(planted))
    # rounding of positions of 0.1 m, 1e-17 m, over rows whose condition number is below 100
    assert parts.lag_s == pytest.approx(lag_s, abs=1e-13)
    assert parts.per_acceleration_s2 == pytest.approx(per_acceleration_s2, abs=1e-14)
    assert parts.reversal_m == pytest.approx(reversal_m, abs=1e-13)
    assert parts.constant_m == pytest.approx(constant_m, abs=1e-13)
    assert parts.rms_m["rest"] < 1e-14


def test_the_largest_part_is_named():
    assert error_parts(motion_with(0.01 * SPEED)).largest == "speed"
    assert error_parts(motion_with(1e-5 * direction_of_travel(SPEED))).largest == "direction"
    assert error_parts(motion_with(np.full_like(SPEED, 1e-5))).largest == "constant"
    assert error_parts(motion_with(1e-5 * np.sin(400.0 * TIME_S))).largest == "rest"


def test_an_axis_that_stands_has_only_a_constant_part():
    parts = error_parts(motion_with(np.full(100, 2e-6), np.zeros(100)))
    assert (parts.lag_s, parts.per_acceleration_s2, parts.reversal_m) == (None, None, None)
    assert parts.constant_m == pytest.approx(2e-6, rel=1e-12)  # rounding
    assert parts.share("constant") == pytest.approx(1.0, rel=1e-12)


@given(weights=st.lists(st.floats(-1.0, 1.0), min_size=5, max_size=5))
def test_parts_add_up_to_the_error_and_none_is_larger(weights):
    rows = [SPEED, np.gradient(SPEED, TIME_S), direction_of_travel(SPEED), np.ones_like(SPEED), np.sin(400.0 * TIME_S)]
    error = sum(1e-5 * weight * row / np.abs(row).max() for weight, row in zip(weights, rows, strict=True))
    motion = motion_with(error)
    parts = error_parts(motion)
    whole = float(np.sqrt(np.mean(motion.tracking_error_m**2)))
    assert np.sqrt(sum(rms**2 for rms in parts.rms_m.values())) == pytest.approx(whole, rel=1e-9, abs=1e-16)
    assert max(parts.rms_m.values()) <= whole * (1 + 1e-9) + 1e-16
    assert sum(parts.share(name) for name in parts.rms_m) == pytest.approx(1.0 if whole > 0 else 0.0, rel=1e-9)


def test_a_part_that_explains_all_leaves_nothing_to_its_likes():
    # speed and direction of a sine are alike (0.9): neither takes from the other
    assert error_parts(motion_with(0.01 * SPEED)).share("speed") == pytest.approx(1.0, rel=1e-9)
    assert error_parts(motion_with(1e-5 * direction_of_travel(SPEED))).share("direction") == pytest.approx(
        1.0, rel=1e-9
    )


def test_a_standing_axis_keeps_the_direction_of_its_last_motion():
    speed = np.array([0.0, 0.0, 1.0, 0.0, 1e-9, -1.0, 0.0])
    assert direction_of_travel(speed).tolist() == [0, 0, 1, 1, 1, -1, -1]


def test_what_a_motion_in_one_direction_does_not_tell_apart_is_one_part():
    parts = error_parts(motion_with(np.full(500, 3e-5), np.linspace(0.0, 1.0, 500) ** 2))
    assert (parts.largest, parts.reversal_m, parts.constant_m) == ("direction+constant", None, None)
    assert parts.share("direction+constant") == pytest.approx(1.0, rel=1e-9)
    # the speed varies, so that a lag can be told
    assert error_parts(motion_with(0.02 * SPEED_UP, GOING_UP)).lag_s == pytest.approx(0.02, rel=1e-9)


@pytest.mark.parametrize(
    ("targets", "together"), [([0.1], "speed+direction+constant"), ([0.1, 0.0], "speed+direction")], ids=len
)
def test_one_speed_does_not_tell_lag_from_friction(targets, together):
    def parts_of(acceleration: float):
        reference = moves(targets, 1e-3, speed_m_per_s=0.01, acceleration_m_per_s2=acceleration, dwell_s=0.5)
        speed = np.gradient(reference.position_m, 1e-3)
        return error_parts(motion_with(0.02 * speed, reference.position_m, reference.time_s))

    parts = parts_of(1.0)
    assert parts.largest == together
    assert (parts.lag_s, parts.reversal_m) == (None, None)
    # with a slow ramp the same motion tells
    assert parts_of(0.01).lag_s == pytest.approx(0.02, rel=1e-9)
