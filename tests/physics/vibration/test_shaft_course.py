"""Speed and angle of a shaft whose speed runs straight between corners."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import integrate

from selector.errors import InputError
from selector.physics.vibration.structure import ShaftCourse


def test_speed_is_straight_between_corners_and_level_outside():
    course = ShaftCourse([1.0, 3.0], [600.0, 1200.0])
    assert course.rpm_at([0.0, 1.0, 2.0, 3.0, 9.0]).tolist() == [600.0, 600.0, 900.0, 1200.0, 1200.0]
    assert course.range_rpm(1.5, 2.0) == (750.0, 900.0)
    assert course.range_rpm(0.0, 9.0) == (600.0, 1200.0)
    assert not course.is_level
    assert ShaftCourse([0.0, 1.0], [5.0, 5.0]).is_level
    assert ShaftCourse([0.0, 1.0, 2.0], [5.0, 9.0, 5.0]).range_rpm(0.0, 2.0) == (5.0, 9.0)


def test_turns_of_a_ramp_by_hand():
    course = ShaftCourse([1.0, 3.0], [600.0, 1200.0])
    # 10 turns in the first second, 15/s on average over two, then 20/s; before time 0 backwards
    assert course.turns_at([0.0, 1.0, 3.0, 4.0, -1.0]) == pytest.approx([0.0, 10.0, 40.0, 60.0, -10.0], abs=1e-12)
    assert ShaftCourse([5.0], [60.0]).turns_at([0.0, 7.5]) == pytest.approx([0.0, 7.5], abs=1e-12)


@given(
    steps=st.lists(st.floats(0.01, 5.0), min_size=1, max_size=6),
    speeds=st.lists(st.floats(0.0, 5000.0), min_size=7, max_size=7),
    begin=st.floats(-3.0, 3.0),
    to_s=st.floats(-5.0, 30.0),
)
def test_turns_are_the_integral_of_the_speed(steps, speeds, begin, to_s):
    corners = begin + np.concatenate(([0.0], np.cumsum(steps)))
    course = ShaftCourse(corners, speeds[: len(corners)])
    grid = np.unique(np.concatenate(([0.0, to_s], corners[(corners > min(0, to_s)) & (corners < max(0, to_s))])))
    # trapezoids are exact on straight lines
    exact = integrate.trapezoid(course.rpm_at(grid), grid) / 60.0 * math.copysign(1.0, to_s)
    # sums of some thousand turns
    assert course.turns_at([to_s])[0] == pytest.approx(exact, abs=1e-9)


@pytest.mark.parametrize(
    ("time_s", "rpm"),
    [([], []), ([0.0, 0.0], [1.0, 2.0]), ([1.0, 0.0], [1.0, 2.0]), ([0.0], [1.0, 2.0]), ([0.0], [-1.0]),
     ([0.0, math.nan], [1.0, 1.0]), ([0.0, 1.0], [1.0, math.nan])],
)  # fmt: skip
def test_what_is_no_course_is_refused(time_s, rpm):
    with pytest.raises(InputError) as caught:
        ShaftCourse(time_s, rpm)
    assert caught.value.where == "shaft_rpm"
