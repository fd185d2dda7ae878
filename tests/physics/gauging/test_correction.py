"""Thresholds that follow finished parts: closed forms of the loop, and parts that are ground."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from selector.errors import InputError
from selector.physics.gauging.characteristic import Characteristic
from selector.physics.gauging.gauged_grinding import finished_sizes, part_course
from selector.physics.gauging.sizes import sizes_by_formula
from selector.physics.gauging.transducer import Correction, Grinding, Noise, Stage
from tests.physics.gauging.set_ups import set_up

WORN = Grinding(20.0, (Stage(5.0, 2.0),), probe_wear_um_per_part=0.02)


def by_loop(correction: Correction, off_um: np.ndarray) -> np.ndarray:
    """What each part is off, one after the other."""
    zero, found = 0.0, []
    for number, off in enumerate(off_um):
        known = number - 1 - correction.parts_late
        if known >= 0:
            zero -= correction.share * found[known]
        found.append(off + zero)
    return np.array(found)


@pytest.mark.parametrize(("share", "late"), [(1.0, 0), (0.3, 0), (0.3, 1), (0.2, 4)])
def test_parts_without_noise_are_off_as_a_loop_has_it(share, late):
    correction = Correction(share, parts_late=late)
    setup = set_up(WORN)
    plain = finished_sizes(setup, 60).size_um
    found = finished_sizes(replace(setup, correction=correction), 60)
    expected = by_loop(correction, plain - setup.wanted_um)
    # a line moved by a size stops at that much less, but for what the start of the filter leaves: exp(−3 s/50 ms)
    np.testing.assert_allclose(found.size_um - setup.wanted_um, expected, atol=1e-6)
    np.testing.assert_allclose(correction.followed_um(plain - setup.wanted_um), expected, atol=1e-6)
    # of a tip that wears by 0.02 µm a part, 0.02/share is left once the loop has settled
    assert found.size_um[-1] - setup.wanted_um == pytest.approx(0.02 / share, rel=0.02)
    assert plain[-1] - setup.wanted_um == pytest.approx(59 * 0.02, rel=1e-4)


@pytest.mark.parametrize("share", [0.2, 0.7])
def test_noise_of_parts_and_of_their_measurement_spreads_sizes_as_an_average_of_them_does(share):
    """An exponentially weighted mean of white noise has share/(2 − share) of its variance."""
    setup = set_up(WORN, noise=Noise(0.2, 0.5))
    alone = finished_sizes(replace(setup, grinding=replace(WORN, probe_wear_um_per_part=0.0)), 4000, seed=2).sd_um
    corrected = finished_sizes(replace(setup, correction=Correction(share, 0.3)), 4000, seed=2)
    of_mean = share / (2.0 - share)
    expected = math.sqrt(alone**2 * (1.0 + of_mean) + 0.3**2 * of_mean)
    # 1/√(2·4000) is 1.1 %, neighbours depend on each other: 4 standard errors
    assert corrected.sd_um == pytest.approx(expected, rel=0.06)
    by_formula = sizes_by_formula(replace(setup, correction=Correction(share, 0.3)), parts=4000)
    assert corrected.sd_um == pytest.approx(by_formula.sd_um, rel=0.06)
    assert corrected.mean_um == pytest.approx(by_formula.mean_um, abs=0.03)


def test_more_parts_change_none_and_a_part_in_time_is_the_same_one():
    setup = replace(set_up(WORN, noise=Noise(0.2, 5.0)), correction=Correction(0.4, 0.2, 1))
    few, many = (finished_sizes(setup, parts, seed=3) for parts in (8, 30))
    np.testing.assert_array_equal(few.size_um, many.size_um[:8])
    # two parts are ground before the first is known
    assert not many.offset_um[:2].any()
    assert many.offset_um[2:].all()
    course = part_course(setup, 7, seed=3, period_s=0.01)
    assert (course.size_um, course.duration_s) == (few.size_um[7], few.duration_s[7])


def test_parts_that_no_threshold_stopped_are_not_measured():
    reaches_3_v = Characteristic(np.array([0.0, 50.0]), np.array([3.0, 2.5]))
    setup = replace(set_up(WORN), characteristic=reaches_3_v, correction=Correction(0.5), thresholds_v=(3.5,))
    sizes = finished_sizes(setup, 4)
    assert not sizes.tripped.any()
    assert not sizes.offset_um.any()


@pytest.mark.parametrize("late", [1, 2, 5])
def test_a_correction_that_would_rock_up_is_refused(late):
    """Its limit is where a root of z^(late + 1) − z^late + share = 0 leaves the unit circle."""

    def largest_root(share: float) -> float:
        return float(np.abs(np.roots([1.0, -1.0, *[0.0] * (late - 1), share])).max())

    with pytest.raises(InputError) as refused:
        Correction(1.0, parts_late=late)
    most = float(refused.value.expected.split()[2].rstrip(":"))
    assert largest_root(0.99 * most) < 1.0 < largest_root(1.01 * most)
    Correction(0.99 * most, parts_late=late)
