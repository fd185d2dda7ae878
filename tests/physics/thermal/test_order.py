"""In which order operations need the fewest corrections, against going through them by hand."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from selector.physics.thermal.prediction.correction_program import (
    MOST_TRIED_ALL,
    best_order,
    correction_program,
    reordered,
)
from tests.physics.thermal.segments import of_segments

TAU_S = 2400.0


def course(cyclogram, time_s):
    """One mode with 0.02 µm per r/min, exactly."""
    value, at, found = 0.0, 0.0, np.zeros(len(time_s))
    ends = [*cyclogram.start_s[1:], cyclogram.end_s]
    for end, speed in zip(ends, cyclogram.speed_rpm, strict=True):
        steady = 0.02 * speed
        inside = (time_s >= at) & (time_s <= end)
        found[inside] = steady + (value - steady) * np.exp(-(time_s[inside] - at) / TAU_S)
        value = steady + (value - steady) * np.exp(-(end - at) / TAU_S)
        at = end
    return found[:, None]


#: Minutes and speeds of operations; the first has two.
OPERATIONS = (((20, 2500), (20, 0)), ((60, 500),), ((30, 2000),), ((45, 0),))
LENGTHS = [60.0 * sum(minutes for minutes, _ in one) for one in OPERATIONS]
CYCLE = of_segments(*[part for one in OPERATIONS for part in one])


def corrections(order, tolerances):
    cycle = of_segments(*[part for k in order for part in OPERATIONS[k]])
    time = np.union1d(np.arange(0.0, cycle.end_s + 1.0, 60.0), cycle.start_s)
    lengths = [LENGTHS[k] for k in order]
    program = correction_program(time, course(cycle, time)[:, 0], lengths, [tolerances[k] for k in order])
    return sum(len(one.times_s) - 1 for one in program.operations)


@pytest.mark.parametrize("tolerances", [[5.0] * 4, [2.0, 8.0, 4.0, 3.0]])
def test_no_order_needs_fewer(tolerances):
    found = best_order(course, CYCLE, LENGTHS, {0: tolerances})
    needed = {order: corrections(order, tolerances) for order in itertools.permutations(range(4))}
    assert found.corrections == min(needed.values()) < found.as_given == needed[0, 1, 2, 3]
    assert needed[tuple(k - 1 for k in found.operations)] == found.corrections
    assert (found.tried, found.is_exact) == (24, True)


def test_the_given_order_stays_where_none_is_better():
    found = best_order(course, CYCLE, LENGTHS, {0: [1000.0] * 4})
    assert (found.operations, found.corrections, found.as_given) == ((1, 2, 3, 4), 0, 0)


def test_of_many_operations_two_change_places_while_that_helps():
    parts = [(20.0, speed) for speed in (0, 2500, 0, 2500, 0, 2500, 0, 2500)]
    cycle = of_segments(*parts)
    assert len(parts) > MOST_TRIED_ALL
    found = best_order(course, cycle, [1200.0] * len(parts), {0: [8.0] * len(parts)})
    assert not found.is_exact
    assert found.corrections < found.as_given
    assert sorted(found.operations) == list(range(1, 9))


def test_operations_move_with_their_speeds_and_what_follows_stays():
    longer = of_segments(*[part for one in OPERATIONS for part in one], (15, 700))
    same = reordered(longer, LENGTHS, [0, 1, 2, 3])
    np.testing.assert_array_equal(same.start_s, longer.start_s)
    np.testing.assert_array_equal(same.speed_rpm, longer.speed_rpm)
    moved = reordered(longer, LENGTHS, [2, 0, 3, 1])
    np.testing.assert_array_equal(moved.speed_rpm, [2000, 2500, 0, 0, 500, 700])
    np.testing.assert_allclose(moved.start_s, 60.0 * np.array([0, 30, 50, 70, 115, 175]))
    assert moved.end_s == pytest.approx(longer.end_s)
