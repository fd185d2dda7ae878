"""Cp, Cpk, their intervals and the share out of tolerance."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats
from scipy.signal import lfilter

from selector.physics.gauging.gauged_grinding import spread_freedoms, worth
from selector.physics.gauging.sizes import capability
from selector.physics.gauging.transducer import Tolerance

LIMITS = Tolerance(-3.0, 3.0)


def normal_scores(count: int) -> np.ndarray:
    """A sample that is as normal as one of its size can be."""
    return stats.norm.ppf((np.arange(count) + 0.5) / count)


def test_definitions():
    sizes = np.array([-1.0, 0.0, 1.0, 2.0])
    found = capability(sizes, LIMITS)
    assert found is not None
    sd = math.sqrt(5.0 / 3.0)
    assert found.cp == pytest.approx(6.0 / (6.0 * sd), rel=1e-14)
    assert found.cpk == pytest.approx((3.0 - 0.5) / (3.0 * sd), rel=1e-14)
    assert found.share_above == pytest.approx(stats.norm.sf(2.5 / sd), rel=1e-12)
    assert found.share_below == pytest.approx(stats.norm.cdf(-3.5 / sd), rel=1e-12)
    assert found.cp_quantiles is None
    assert found.cpk_quantiles is None
    # Cp by the chi-square quantiles of three degrees of freedom, 0.2158 and 9.348 (any table)
    assert found.cp_low == pytest.approx(found.cp * math.sqrt(0.2158 / 3), rel=1e-4)
    assert found.cp_high == pytest.approx(found.cp * math.sqrt(9.348 / 3), rel=1e-4)
    # Bissell: 1.96·√(1/9n + Cpk²/2(n − 1))
    half = 1.959964 * math.sqrt(1 / 36 + found.cpk**2 / 6)
    assert found.cpk_high - found.cpk == pytest.approx(half, rel=1e-6)
    assert found.cpk - found.cpk_low == pytest.approx(half, rel=1e-6)


def test_quantiles_are_the_deviations_of_normal_sizes():
    found = capability(normal_scores(20_000), LIMITS)
    assert found is not None
    # quantiles between two of the sample
    assert found.cp_quantiles == pytest.approx(found.cp, rel=2e-3)
    assert found.cpk_quantiles == pytest.approx(found.cpk, rel=2e-3)


def test_skew_sizes_are_worse_than_their_deviation_says():
    """Exponential sizes from −3 µm: quantiles 0.0014, 0.693 and 6.61 of the mean."""
    sizes = -np.log1p(-(np.arange(50_000) + 0.5) / 50_000) - 1.0
    found = capability(sizes, LIMITS)
    assert found is not None
    assert found.cp_quantiles == pytest.approx(6.0 / (6.608 - 0.00135), rel=2e-3)
    assert found.cpk_quantiles == pytest.approx((3.0 - (0.6931 - 1.0)) / (6.608 - 0.6931), rel=2e-3)
    assert found.cpk is not None
    assert found.cpk_quantiles < found.cpk


@pytest.mark.parametrize("count", [25, 200])
def test_intervals_cover_as_often_as_they_say(count):
    """4000 batches with Cp 1.5, Cpk 1.25; the binomial error of 95 % is 0.35 %, Bissell's interval is approximate."""
    rng = np.random.default_rng(8)
    inside = np.zeros(2)
    for _ in range(4000):
        found = capability(rng.normal(0.5, 2.0 / 3.0, count), LIMITS)
        assert found is not None
        inside += [found.cp_low <= 1.5 <= found.cp_high, found.cpk_low <= 1.25 <= found.cpk_high]
    share = inside / 4000
    assert share[0] == pytest.approx(0.95, abs=4 * 0.0035)
    assert share[1] == pytest.approx(0.95, abs=4 * 0.0035 + 0.01)


def test_counted_share_has_the_interval_of_clopper_and_pearson():
    sizes = np.concatenate([np.zeros(95), np.full(3, 4.0), np.full(2, -4.0)])
    found = capability(sizes, LIMITS)
    assert found is not None
    assert found.share_outside == pytest.approx(0.05)
    # 5 of 100, by any table: 1.64 % to 11.28 %
    assert found.share_outside_low == pytest.approx(0.0164, abs=5e-5)
    assert found.share_outside_high == pytest.approx(0.1128, abs=5e-5)
    none = capability(np.linspace(-1, 1, 50), LIMITS)
    assert none is not None
    assert none.share_outside_low == 0.0
    assert none.share_outside_high == pytest.approx(1 - 0.025 ** (1 / 50), rel=1e-9)


@given(st.lists(st.floats(-1e3, 1e3), min_size=2, max_size=50), st.floats(-100, 100), st.floats(0.1, 100))
def test_cpk_is_at_most_cp(sizes, lower, width):
    found = capability(sizes, Tolerance(lower, lower + width))
    if found is None:
        assert np.ptp(sizes) < 1e-6 * max(np.abs(sizes).max(), width)
        return
    assert found.cpk <= found.cp * (1 + 1e-12)
    assert all(math.isfinite(value) for value in vars(found).values() if value is not None)
    assert found.cp_low < found.cp < found.cp_high


def test_sizes_without_spread_have_no_capability():
    assert capability([1.0, 1.0, 1.0], LIMITS) is None
    assert capability([1.0], LIMITS) is None
    assert capability([], LIMITS) is None
    assert capability([0.1 + 0.2, 0.3], LIMITS) is None


@pytest.mark.parametrize("memory", [0.0, 0.9])
def test_intervals_hold_of_parts_that_resemble_those_before_them(memory):
    """Of 100 batches of 2000 parts 95 hold the truth but by chance; taken for independent it was 45 with memory 0.9."""
    rng, tolerance = np.random.default_rng(4), Tolerance(-3.0, 3.5)
    held = 0
    for _ in range(100):
        made = rng.standard_normal(2500)
        sizes = lfilter([math.sqrt(1.0 - memory**2)], [1.0, -memory], made)[500:]
        found = capability(sizes, tolerance)
        held += found.cp_low <= 6.5 / 6.0 <= found.cp_high
    assert held >= 88  # three standard deviations below 95


def test_skewed_sizes_know_their_spread_less_well():
    rng = np.random.default_rng(5)
    normal, skewed = rng.standard_normal(2000), rng.lognormal(0.0, 0.8, 2000)
    assert spread_freedoms(normal) == pytest.approx(1999, rel=0.2)
    assert spread_freedoms(skewed) < 0.3 * 1999
    assert worth(skewed) > 1300  # independent: 2000 but for the scatter of 44 batch means
