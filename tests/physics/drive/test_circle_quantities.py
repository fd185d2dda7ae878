"""Roundness after ISO 230-4: closed forms, the minimum zone against every candidate, what shifts must not change."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays

from selector.errors import InputError
from selector.physics.drive.ball_bar.circle import (
    BallBarTrace,
    centred_traces,
    circle_quantities,
    hysteresis,
    least_squares_circle,
    minimum_zone_um,
    roundness,
)

RADIUS_UM = 1e5
SECOND_ORDER = 1e-3
"""A deviation d of the radius R moves distances by d²/R: 10 µm of 100 mm by 1 nm."""

ANGLE = np.linspace(0, 2 * np.pi, 720, endpoint=False)


def trace(deviation_um, direction=1, feed=1000.0, angle=ANGLE) -> BallBarTrace:
    """A function of (angle, direction), at these angles."""
    return BallBarTrace(direction * angle, deviation_um(direction * angle, direction), direction, feed)


def every_width(angle, deviation) -> float:
    """The narrowest annulus by trying all: its centre is as far from two points as from each other, twice over."""
    points = (RADIUS_UM + deviation) * np.exp(1j * angle)
    pairs = list(itertools.combinations(range(len(points)), 2))
    across = np.array([points[a] - points[b] for a, b in pairs])
    middle = np.array([(points[a] + points[b]) / 2 for a, b in pairs])
    # across·centre = across·middle, two of them at a time
    offset = (across * middle.conj()).real
    least = math.inf
    for k, m in itertools.combinations(range(len(pairs)), 2):
        det = across[k].real * across[m].imag - across[k].imag * across[m].real
        if abs(det) > 1e-3 * abs(across[k]) * abs(across[m]):
            x = (offset[k] * across[m].imag - offset[m] * across[k].imag) / det
            y = (offset[m] * across[k].real - offset[k] * across[m].real) / det
            least = min(least, float(np.ptp(np.abs(points - complex(x, y)))))
    return least


@given(arrays.arrays(np.float64, 9, elements=st.floats(-20, 20)), st.floats(0, 6))
@settings(max_examples=25)
def test_the_minimum_zone_is_the_narrowest_of_all(deviation, turn):
    angle = turn + np.arange(9) * 2 * np.pi / 9
    found = minimum_zone_um(angle, deviation, RADIUS_UM)
    # distances of 1e5 µm are exact to 1e-11; bisectors that nearly coincide, left out, cost the rest
    assert found == pytest.approx(every_width(angle, deviation), abs=1e-5)


deviations = arrays.arrays(np.float64, 120, elements=st.floats(-50, 50))
EVEN = np.linspace(0, 2 * np.pi, 120, endpoint=False)


@given(deviations)
@settings(max_examples=30)
def test_nothing_is_narrower_than_the_minimum_zone(deviation):
    found = roundness(BallBarTrace(EVEN, deviation, 1, 1000.0))
    # 1e-9: what the linear programme may break a bound by
    assert found.circular_deviation_um <= found.radial_max.value_um - found.radial_min.value_um + 1e-8
    assert found.circular_deviation_um <= np.ptp(deviation) + 1e-8


@given(deviations, st.floats(-30, 30), st.floats(-30, 30), st.floats(0, 6), st.floats(-30, 30))
@settings(max_examples=30)
def test_set_up_and_turn_do_not_change_the_roundness(deviation, across, along, turn, longer):
    points = (RADIUS_UM + deviation) * np.exp(1j * EVEN)
    moved = (points - complex(across, along)) * np.exp(1j * turn)
    first = minimum_zone_um(EVEN, deviation, RADIUS_UM)
    second = minimum_zone_um(np.angle(moved), np.abs(moved) - RADIUS_UM + longer, RADIUS_UM)
    # a bar that is 30 µm of 100 mm longer stretches the points across the radius by 3e-4, and the width follows in part
    assert second == pytest.approx(first, abs=2e-4 * (1 + first))
    circle, mean = least_squares_circle(np.angle(moved), np.abs(moved) - RADIUS_UM, RADIUS_UM)
    before, mean_before = least_squares_circle(EVEN, deviation, RADIUS_UM)
    expected = (complex(*before) - complex(across, along)) * np.exp(1j * turn)
    # the same circle of the same points
    assert complex(*circle) == pytest.approx(expected, abs=1e-6)
    assert mean == pytest.approx(mean_before, abs=1e-6)


@pytest.mark.parametrize(
    ("deviation", "circular", "both", "hysteresis_um", "mean"),
    [
        (lambda a, d: 0 * a, 0, 0, 0, 0),
        (lambda a, d: -7 + 0 * a, 0, 0, 0, -7),
        (lambda a, d: 9 * np.cos(a - 1), 0, 0, 0, 0),
        (lambda a, d: 5 * np.cos(2 * a), 10, 10, 0, 0),
        (lambda a, d: d * 5 * np.sin(2 * a), 10, 10, 10, 0),
        (lambda a, d: 2 * np.sin(3 * a + 1) + 4, 4, 4, 0, 4),
        (lambda a, d: d * 3 + 0 * a, 0, 6, 6, 0),
    ],
    ids=["ideal", "short bar", "off centre", "scales", "gains", "three lobes", "direction"],
)
def test_closed_forms(deviation, circular, both, hysteresis_um, mean):
    (found,) = circle_quantities([trace(deviation, -1), trace(deviation, 1)])
    # extremes of the harmonics lie within half a sample, 0.25°: 1e-5 of the amplitude
    assert found.counter_clockwise.circular_deviation_um == pytest.approx(circular, abs=SECOND_ORDER)
    assert found.clockwise.circular_deviation_um == pytest.approx(circular, abs=SECOND_ORDER)
    assert found.both.circular_deviation_um == pytest.approx(both, abs=SECOND_ORDER)
    assert found.hysteresis.value_um == pytest.approx(hysteresis_um, abs=SECOND_ORDER)
    assert found.both.mean_radial_um == pytest.approx(mean, abs=SECOND_ORDER)


def test_extremes_stand_where_they_are():
    spike = np.zeros(720)
    spike[180] = 12.0  # at 90°
    spike[500] = -8.0  # at 250°
    one = trace(lambda a, d: spike + 20 * np.cos(a))
    found = roundness(one)
    assert math.degrees(found.radial_max.angle_rad) == pytest.approx(90, abs=0.1)
    assert math.degrees(found.radial_min.angle_rad) == pytest.approx(250, abs=0.1)
    # two of 720 samples move the least-squares centre and radius by up to 2·12/720 and 12/720
    assert found.radial_max.value_um == pytest.approx(12.0, abs=0.1)
    assert found.radial_min.value_um == pytest.approx(-8.0, abs=0.1)
    assert found.centre_um[0] == pytest.approx(20.0, abs=0.05)


def test_hysteresis_does_not_need_the_same_angles():
    def backlash(a, d):
        return d * 4 * np.sign(np.sin(a)) * np.cos(a)

    other = np.linspace(0.003, 2 * np.pi + 0.003, 1000, endpoint=False)
    found = hysteresis(trace(backlash), trace(backlash, -1, angle=other))
    # twice the half gap, found half a sample, 0.3°, beside the reversal
    assert found.value_um == pytest.approx(8.0, abs=1e-3)
    assert min(abs(math.degrees(found.angle_rad) - at) for at in (0, 180, 360)) < 1.0


def test_centred_traces_have_no_centre_left():
    both = [trace(lambda a, d: 30 * np.cos(a - 2) + d * np.sin(2 * a) - 4, d) for d in (1, -1)]
    moved = centred_traces(both)
    angle = np.concatenate([one.angle_rad for one in moved])
    centre, mean = least_squares_circle(angle, np.concatenate([one.deviation_um for one in moved]), RADIUS_UM)
    assert centre == pytest.approx((0.0, 0.0), abs=1e-7)
    # 30 µm off centre and 100 mm: 30²/(4·1e5) of the mean radius
    assert mean == pytest.approx(-4.0, abs=0.003)


def test_pairs_are_asked_for():
    one = trace(lambda a, d: 0 * a)
    for given_traces in ([one], [one, one], [], [one, trace(lambda a, d: 0 * a, -1, feed=1500.0)]):
        with pytest.raises(InputError):
            circle_quantities(given_traces)
    # feeds that were measured agree to a per cent
    assert len(circle_quantities([one, trace(lambda a, d: 0 * a, -1, feed=1004.0)])) == 1
