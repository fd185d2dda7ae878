"""First-order lags: against the exact solution, in pieces, with gaps, and at any step."""

from __future__ import annotations

import numpy as np
import pytest

from selector.models.design import Lag, lagged, time_constant_grid

TAU = 600.0


def lag(values, time_s, tau_s=TAU):
    values = np.asarray(values, dtype=np.float64)[:, None]
    found, _, _ = lagged(
        values, np.asarray(time_s, dtype=np.float64), np.array([tau_s]), np.full(1, np.nan), np.full(1, np.nan)
    )
    return found[:, 0]


def ramp_error(step_s: float) -> float:
    """Largest error on x = sin(t/τ), started in equilibrium at x = 0; the exact lag is ½(e^(−u) + sin u − cos u)."""
    t = np.arange(0.0, 6 * TAU, step_s)
    u = t / TAU
    exact = 0.5 * (np.exp(-u) + np.sin(u) - np.cos(u))
    return float(np.abs(lag(np.sin(u), t) - exact).max())


def test_converges_to_the_exact_solution_with_order_one():
    coarse, middle, fine = ramp_error(40.0), ramp_error(20.0), ramp_error(10.0)
    assert fine < 0.01
    # backward Euler: halving the step halves the error; higher orders of a step of τ/15 change the ratio by 7 %
    assert coarse / middle == pytest.approx(2.0, rel=0.07)
    assert middle / fine == pytest.approx(2.0, rel=0.035)


def test_a_step_is_followed_with_the_time_constant():
    t = np.arange(0.0, 5 * TAU, 1.0)
    x = np.where(t > 0, 1.0, 0.0)
    # 1/600 of a time constant a step: the discrete time constant is off by 0.08 %
    assert lag(x, t)[int(TAU)] == pytest.approx(1 - np.exp(-1), rel=2e-3)
    assert lag(x, t)[-1] == pytest.approx(1.0, abs=0.01)


def test_starts_in_equilibrium_and_stays_there():
    assert lag(np.full(50, 21.5), np.arange(50.0)).tolist() == [21.5] * 50


@pytest.mark.parametrize("step_s", [1.0, 600.0, 1e6])
def test_never_overshoots_however_long_the_step(step_s):
    found = lag([0.0] + [1.0] * 20, np.arange(21) * step_s)
    assert np.all(np.diff(found) >= 0)
    assert 0.0 <= found.min() <= found.max() <= 1.0


@pytest.mark.parametrize("size", [1, 2, 7, 50])
def test_in_pieces_is_bit_for_bit_the_whole(size):
    rng = np.random.default_rng(0)
    t = np.cumsum(rng.uniform(0.1, 90.0, 200))
    x = np.column_stack([rng.normal(size=200), rng.normal(size=200)])
    x[rng.random(x.shape) < 0.1] = np.nan
    tau = np.array([30.0, 900.0])
    whole, *_ = lagged(x, t, tau, np.full(2, np.nan), np.full(2, np.nan))
    state, last, parts = np.full(2, np.nan), np.full(2, np.nan), []
    for start in range(0, 200, size):
        part, state, last = lagged(x[start : start + size], t[start : start + size], tau, state, last)
        parts.append(part)
    assert np.array_equal(np.concatenate(parts), whole, equal_nan=True)


def test_where_the_source_is_missing_the_state_waits_and_then_takes_the_gap_in_one_step():
    found = lag([0.0, 1.0, np.nan, np.nan, 1.0], [0.0, 10.0, 20.0, 30.0, 40.0], tau_s=10.0)
    # 10 s: 0 + 10/20 · 1; then 30 s at once: 0.5 + 30/40 · 0.5
    assert found == pytest.approx([0.0, 0.5, np.nan, np.nan, 0.875], nan_ok=True)


def test_a_source_that_is_missing_at_first_starts_with_its_first_reading():
    found = lag([np.nan, np.nan, 7.0, 7.0], [0.0, 1.0, 2.0, 3.0])
    assert found == pytest.approx([np.nan, np.nan, 7.0, 7.0], nan_ok=True)


def test_irregular_sampling_gives_the_same_lag():
    """Of a slow signal: the error of a step is that of the regular grid with the longest step."""
    rng = np.random.default_rng(1)
    regular = np.arange(0.0, 6 * TAU, 10.0)
    irregular = np.sort(np.r_[0.0, rng.uniform(0, 6 * TAU, 900)])
    # knots where both have a sample would not exist; compare by interpolation, whose error is (τ/60)²/8 of a curve of 1
    a = np.interp(regular, irregular, lag(np.sin(irregular / TAU), irregular))
    assert np.abs(a - lag(np.sin(regular / TAU), regular)).max() < 2 * ramp_error(10.0)


def test_arguments_are_not_changed():
    state, last, x = np.full(1, np.nan), np.full(1, np.nan), np.ones((3, 1))
    lagged(x, np.arange(3.0), np.array([5.0]), state, last)
    assert np.isnan(state[0])
    assert np.isnan(last[0])


def test_an_empty_piece_changes_nothing():
    state, last = np.array([2.0]), np.array([4.0])
    found, after, when = lagged(np.zeros((0, 1)), np.zeros(0), np.array([5.0]), state, last)
    assert found.shape == (0, 1)
    assert (after[0], when[0]) == (2.0, 4.0)


def test_name_of_a_lag():
    assert Lag("T1", 1800.0).name == "T1.lag1800s"
    assert Lag("n", 1234.5678).name == "n.lag1234.57s"


@pytest.mark.parametrize(("period_s", "duration_s"), [(1.0, 3600.0), (60.0, 6 * 3600.0), (600.0, 1200.0)])
def test_grid_of_time_constants(period_s, duration_s):
    grid = time_constant_grid(period_s, duration_s)
    assert len(grid) == 9
    assert grid[0] >= 3 * period_s * (1 - 1e-12)
    # no slower than the run, unless the run is but a few samples long
    assert grid[-1] == pytest.approx(max(duration_s, 6 * period_s))
    assert np.ptp(np.diff(np.log(grid))) < 1e-9  # even in the logarithm
