"""All phase shifts of all sources: against writing every realisation out, and in closed form."""

from __future__ import annotations

import math
from itertools import product

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from selector.physics.vibration.periodic_error import mean_square, realisation_amounts, section_times

ROUNDING = 1e-10
"""Phases ω·t of up to 10⁴ rad are rounded to 1e-12, and sums of numbers that cancel in part keep a little less."""


def drawn(rng: np.random.Generator, n_sources: int, n_lines: int):
    """Motion, frequency and source of lines, at least one a source where there are enough."""
    source = rng.permutation(np.arange(n_lines) % n_sources)
    return rng.normal(size=n_lines) + 1j * rng.normal(size=n_lines), rng.uniform(5.0, 900.0, n_lines), source


def written_out(motion, frequency, source, times, *, n_sources, phases):
    """Z of every realisation at every section, (N, n_sections), straight from the definition."""
    lines = motion[:, None] * np.exp(2j * np.pi * frequency[:, None] * times)
    steps = [np.exp(2j * np.pi * k / phases) for k in range(phases)]
    return np.array(
        [
            sum(shift[s] * lines[source == s].sum(axis=0) for s in range(n_sources))
            for shift in product(steps, repeat=n_sources)
        ]
    )


@pytest.mark.parametrize(
    ("n_sources", "phases"),
    [
        (1, 1),
        (1, 2),
        (1, 4),
        (2, 1),
        (2, 2),
        (2, 3),
        (3, 2),
        (3, 5),
        (4, 4),
        (5, 1),
        (5, 2),
        (5, 3),
        (8, 2),
        (2, 24),
        (3, 6),
    ],
)
def test_as_every_realisation_written_out(n_sources, phases):
    rng = np.random.default_rng(100 * n_sources + phases)
    motion, frequency, source = drawn(rng, n_sources, n_sources + 3)
    times = section_times(37, 0.8)
    found = realisation_amounts(motion, frequency, source, times, n_sources=n_sources, phases=phases)
    every = written_out(motion, frequency, source, times, n_sources=n_sources, phases=phases)
    assert found.count == len(every) == phases**n_sources
    assert found.expected_m == pytest.approx(np.abs(every).mean(), rel=ROUNDING)
    assert found.mean_abs_m == pytest.approx(np.abs(every.imag).mean(), rel=ROUNDING)
    assert found.largest_m == pytest.approx(np.abs(every).max(), rel=ROUNDING)
    assert found.rms_m == pytest.approx(math.sqrt((every.imag**2).mean()), rel=ROUNDING)


def test_five_sources_of_four_phases_are_1024():
    rng = np.random.default_rng(5)
    motion, frequency, source = drawn(rng, 5, 12)
    times = section_times(20, 0.3)
    found = realisation_amounts(motion, frequency, source, times, n_sources=5)
    every = written_out(motion, frequency, source, times, n_sources=5, phases=4)
    assert found.count == 1024
    assert found.expected_m == pytest.approx(np.abs(every).mean(), rel=ROUNDING)
    # the signed mean says nothing: 0 at every section, but for the rounding of 1024 summands
    assert np.abs(every.imag.mean(axis=0)).max() < 1e-12 * found.largest_m


@given(n_sources=st.integers(1, 5), phases=st.integers(1, 5), extra=st.integers(0, 4), seed=st.integers(0, 2**32 - 1))
@settings(max_examples=30)
def test_mean_square_in_closed_form(n_sources, phases, extra, seed):
    rng = np.random.default_rng(seed)
    motion, frequency, source = drawn(rng, n_sources, n_sources + extra)
    times = rng.uniform(0.0, 2.0, 4)
    every = written_out(motion, frequency, source, times, n_sources=n_sources, phases=phases)
    z = np.array(
        [motion[source == s] @ np.exp(2j * np.pi * np.outer(frequency[source == s], times)) for s in range(n_sources)]
    )
    size = (np.abs(every) ** 2).mean()
    assert mean_square(z, phases=phases) == pytest.approx((every.imag**2).mean(axis=0), abs=ROUNDING * size)
    if phases >= 2:
        assert (np.abs(z) ** 2).sum(axis=0) == pytest.approx((np.abs(every) ** 2).mean(axis=0), abs=ROUNDING * size)
    if phases >= 3:
        assert mean_square(z, phases=phases) == pytest.approx(0.5 * (np.abs(z) ** 2).sum(axis=0), rel=ROUNDING)


@given(phases=st.integers(1, 6), seed=st.integers(0, 2**32 - 1))
@settings(max_examples=30)
def test_amounts_keep_their_order(phases, seed):
    rng = np.random.default_rng(seed)
    motion, frequency, source = drawn(rng, 3, 5)
    found = realisation_amounts(motion, frequency, source, section_times(16, 1.0), n_sources=3, phases=phases)
    slack = 1.0 + ROUNDING
    assert found.mean_abs_m <= found.expected_m * slack
    assert found.mean_abs_m <= found.rms_m * slack
    assert found.expected_m <= found.largest_m * slack
    assert found.largest_m <= np.abs(motion).sum() * slack


def test_one_line_of_one_source_has_its_amplitude():
    found = realisation_amounts([3e-6 - 4e-6j], [50.0], [0], section_times(1000, 1.0), n_sources=1)
    assert found.expected_m == pytest.approx(5e-6, rel=ROUNDING)
    assert found.largest_m == pytest.approx(5e-6, rel=ROUNDING)
    assert found.rms_m == pytest.approx(5e-6 / math.sqrt(2.0), rel=ROUNDING)
    # 2/π of the amplitude; 1e-3: mean of 1000 sections that lie about evenly over the period
    assert found.mean_abs_m == pytest.approx(2.0 / math.pi * 5e-6, rel=1e-3)


def test_two_equal_sources_at_one_frequency():
    # shifts of 0, 90, 180, 270° against each other: |1 + e^{iφ}| = 2, √2, 0, √2
    found = realisation_amounts([1.0, 1.0], [40.0, 40.0], [0, 1], [0.013], n_sources=2)
    assert found.expected_m == pytest.approx((2.0 + 2.0 * math.sqrt(2.0)) / 4.0, rel=ROUNDING)
    # P → ∞: mean of |1 + e^{iφ}| is 4/π; with 360 steps to their square
    many = realisation_amounts([1.0, 1.0], [40.0, 40.0], [0, 1], [0.013], n_sources=2, phases=360)
    assert many.expected_m == pytest.approx(4.0 / math.pi, rel=1e-4)


def test_lines_of_one_source_keep_their_phases():
    # two lines of one source at one frequency that cancel leave nothing, whatever the shifts
    found = realisation_amounts([1.0, -1.0, 2.0], [40.0, 40.0, 40.0], [0, 0, 1], [0.1, 0.2], n_sources=2)
    assert found.expected_m == pytest.approx(2.0, rel=ROUNDING)
    assert found.count == 16


def test_a_common_factor_and_sources_without_motion_change_nothing_else():
    rng = np.random.default_rng(3)
    motion, frequency, source = drawn(rng, 3, 6)
    times = section_times(50, 1.0)
    plain = realisation_amounts(motion, frequency, source, times, n_sources=3)
    beside = realisation_amounts(
        np.append(motion, 0.0), np.append(frequency, 7.0), np.append(2 * source, 3), times, n_sources=9
    )
    assert beside.count == 4**9
    assert beside.expected_m == pytest.approx(plain.expected_m, rel=ROUNDING)
    larger = realisation_amounts(1e-6j * motion, frequency, source, times, n_sources=3)
    # a common turn of 90° is one of the shifts
    assert larger.mean_abs_m == pytest.approx(1e-6 * plain.mean_abs_m, rel=ROUNDING)


def test_nothing_moves():
    for motion in ([], [0.0]):
        found = realisation_amounts(motion, [1.0] * len(motion), [0] * len(motion), [0.0, 1.0], n_sources=5)
        assert (found.expected_m, found.rms_m, found.largest_m, found.count) == (0.0, 0.0, 0.0, 1024)


def test_section_times_meet_every_line_at_all_phases():
    times = section_times(1000, 2.0)
    assert (np.diff(times) > 0).all()
    assert 0 < times[0] < times[-1] < 2.0
    for frequency in (500.0, 499.5, 20.0, 0.5):
        # a grid of 1000 would meet 500 Hz always at one phase; here the phases average out to a few per cent
        assert abs(np.exp(2j * np.pi * frequency * times).mean()) < 0.05


def test_1024_realisations_at_10_000_sections():
    rng = np.random.default_rng(1)
    motion, frequency, source = drawn(rng, 5, 50)
    times = section_times(10_000, 1.0)
    # the limit of 0.5 s is in benchmarks/bench_promises.py
    found = realisation_amounts(motion, frequency, source, times, n_sources=5)
    assert found.count == 1024


@pytest.mark.parametrize("phases", [4, 60])
def test_of_too_many_some_are_drawn(phases):
    n = 13
    found = realisation_amounts(np.ones(n), np.zeros(n), np.arange(n), [0.0], n_sources=n, phases=phases)
    assert found.count == 1 << 14
    # of a random walk: Rayleigh, and 1/(16·n) more of it (the first term of the expansion in 1/n); half a percent is
    # one standard error of so many, and four steps a turn have 0.5 % less
    assert found.expected_m == pytest.approx(math.sqrt(n * math.pi) / 2 * (1 + 1 / (16 * n)), rel=0.015)
    assert found.rms_m == pytest.approx(math.sqrt(n / 2), rel=ROUNDING)
