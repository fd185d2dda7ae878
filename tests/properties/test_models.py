"""Laws that every term, lag, fit and held-out error obeys, on random input."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from selector.models.design import (
    Scaling,
    Term,
    block_bounds,
    design_matrix,
    lagged,
    physical_transform,
    polynomial_terms,
    start_reading,
)
from selector.models.least_squares import fit
from selector.models.moments import coefficients, squared_error, within_one_standard_error

MODEST = settings(max_examples=30)
NAMES = ("T1", "T2", "T3")


def numbers(low, high):
    return st.floats(low, high, allow_nan=False, allow_infinity=False, width=64)


@st.composite
def any_terms(draw):
    """Any list of different terms, hierarchical or not."""
    powers = st.dictionaries(st.sampled_from(NAMES), st.integers(1, 3), min_size=1)
    found = draw(st.lists(powers, min_size=1, max_size=6, unique_by=lambda p: tuple(sorted(p.items()))))
    return tuple(Term.of(dict(sorted(p.items()))) for p in found)


@MODEST
@given(
    any_terms(),
    hnp.arrays(np.float64, 3, elements=numbers(-50, 50)),
    hnp.arrays(np.float64, 3, elements=numbers(0.1, 20)),
    st.integers(0, 2**32 - 1),
)
def test_the_physical_form_is_the_scaled_form(terms, centre, scale, seed):
    rng = np.random.default_rng(seed)
    scaling = Scaling(NAMES, tuple(centre.tolist()), tuple(scale.tolist()))
    x = centre + scale * rng.uniform(-2, 2, (30, 3))
    beta = rng.normal(size=1 + len(terms))
    scaled = np.column_stack([np.ones(30), design_matrix(scaling.scaled(x), NAMES, terms)]) @ beta
    physical_terms, matrix = physical_transform(terms, scaling)
    columns = np.column_stack([np.ones(30), design_matrix(x, NAMES, physical_terms)])
    # terms of this size cancel when centre/scale is large; each is rounded
    size = np.abs(columns) @ np.abs(matrix) @ np.abs(beta)
    assert np.all(np.abs(columns @ (matrix @ beta) - scaled) <= 1e-13 * size)


@MODEST
@given(st.integers(1, 3), st.booleans(), st.permutations(NAMES))
def test_the_terms_of_a_set_do_not_depend_on_its_order(degree, interactions, order):
    def keys(names):
        return {tuple(sorted(t.powers)) for t in polynomial_terms(names, degree, interactions=interactions)}

    assert keys(order) == keys(NAMES)


@MODEST
@given(
    hnp.arrays(np.float64, st.integers(1, 60), elements=st.one_of(numbers(-100, 100), st.just(np.nan))),
    st.lists(st.integers(0, 60), max_size=5),
    numbers(0.01, 1e6),
    st.integers(0, 2**32 - 1),
)
def test_a_lag_in_pieces_is_the_lag_of_the_whole(x, cuts, tau_s, seed):
    rng = np.random.default_rng(seed)
    t = np.cumsum(rng.exponential(30.0, len(x)) + 1e-3)
    tau = np.array([tau_s])
    nothing = np.full(1, np.nan)
    whole, state, last = lagged(x[:, None], t, tau, nothing, nothing)
    parts, running, when = [], nothing, nothing
    for part in np.split(np.arange(len(x)), sorted(c for c in cuts if c < len(x))):
        found, running, when = lagged(x[part][:, None], t[part], tau, running, when)
        parts.append(found)
    assert np.array_equal(np.concatenate(parts), whole, equal_nan=True)
    assert np.array_equal(running, state, equal_nan=True)
    assert np.array_equal(when, last, equal_nan=True)
    known = np.isfinite(x)
    if known.any():
        # a mean of what was read so far, weights positive: never outside its range, but for rounding
        low, high = np.fmin.accumulate(x[known]), np.fmax.accumulate(x[known])
        room = 1e-12 * np.abs(x[known]).max()
        assert np.all((low - room <= whole[known, 0]) & (whole[known, 0] <= high + room))


@st.composite
def regressions(draw):
    """(x, y) with 2 to 4 variables that may be strongly correlated, far from zero, and of any scale."""
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    n, p = draw(st.integers(20, 60)), draw(st.integers(1, 3))
    common = rng.normal(size=(n, 1)) * draw(st.sampled_from([0.0, 1.0, 30.0]))
    x = (common + rng.normal(size=(n, p))) * draw(st.sampled_from([1e-3, 1.0, 1e3])) + draw(numbers(-100, 100))
    return x, x @ rng.normal(size=p) / x.std() + rng.normal(size=n) * draw(st.sampled_from([0.01, 1.0, 100.0]))


def fitted(x, y, **options):
    names = NAMES[: x.shape[1]]
    scaling = Scaling(names, tuple(x.mean(axis=0).tolist()), tuple(x.std(axis=0).tolist()))
    return fit(x, y, scaling=scaling, terms=polynomial_terms(names, 1), name="Z", **options)


@MODEST
@given(regressions())
def test_residuals_are_orthogonal_to_every_column(data):
    x, y = data
    model = fitted(x, y)
    residuals = y - model.predicted(x)
    columns = np.column_stack([np.ones(len(x)), model.scaling.scaled(x)])
    size = np.linalg.norm(columns, axis=0) * np.linalg.norm(y)
    assert np.all(np.abs(columns.T @ residuals) <= 1e-10 * size)


@MODEST
@given(regressions(), numbers(0.1, 10), numbers(-300, 300))
def test_another_unit_gives_the_same_model(data, factor, offset):
    x, y = data
    here, there = fitted(x, y), fitted(x * factor + offset, y)
    spread = np.ptp(here.predicted(x)) + np.abs(y).max()
    # an offset of 300 on readings that vary by 1e-3 costs 6 digits, and collinear columns 3 more
    assert np.abs(there.predicted(x * factor + offset) - here.predicted(x)).max() <= 1e-7 * spread
    assert there.r2 == pytest.approx(here.r2, abs=1e-7)


@MODEST
@given(regressions())
def test_standard_errors_and_quality_are_sane(data):
    x, y = data
    model = fitted(x, y)
    assert 0.0 <= model.r2 <= 1.0
    assert model.adjusted_r2 <= model.r2
    assert np.all(model.vif >= 1.0)
    for covariance in (model.covariance, model.classical_covariance):
        assert np.array_equal(covariance, covariance.T) or np.allclose(covariance, covariance.T, rtol=1e-12)
        assert np.linalg.eigvalsh(covariance).min() >= -1e-12 * np.trace(covariance)


@MODEST
@given(regressions(), numbers(1e-6, 100))
def test_ridge_shrinks(data, penalty):
    x, y = data
    free, held = fitted(x, y), fitted(x, y, ridge=penalty)
    assert np.linalg.norm(held.coefficients[1:]) <= np.linalg.norm(free.coefficients[1:]) * (1 + 1e-12)
    # residuals are rounded to the level of what is predicted
    assert held.rmse_um >= free.rmse_um * (1 - 1e-12) - 1e-15 * np.abs(y).max()


@MODEST
@given(regressions(), st.integers(2, 4))
def test_errors_from_cross_products_are_those_of_the_rows(data, n_groups):
    x, y = data
    w = np.column_stack([np.ones(len(x)), (x - x.mean(axis=0)) / x.std(axis=0), y])
    groups = np.arange(len(x)) * n_groups // len(x)
    columns = list(range(1, 1 + x.shape[1]))
    for g in range(n_groups):
        inside, outside = w[groups == g], w[groups != g]
        beta = coefficients(outside.T @ outside, columns, [w.shape[1] - 1])
        direct = np.linalg.lstsq(outside[:, :-1], outside[:, -1], rcond=None)[0]
        error = float(((inside[:, -1] - inside[:, :-1] @ direct) ** 2).sum())
        found = float(squared_error(inside.T @ inside, columns, [w.shape[1] - 1], beta)[0])
        # cancellation of sums of squares, and a condition number of up to 1e3 squared in the normal equations
        assert found == pytest.approx(error, rel=1e-7, abs=1e-9 * float(inside[:, -1] @ inside[:, -1]))


@MODEST
@given(st.integers(0, 2**32 - 1), numbers(-1000, 1000), numbers(1e-3, 1e3))
def test_the_start_of_a_run_moves_with_its_readings(seed, offset, factor):
    rng = np.random.default_rng(seed)
    t = np.arange(40.0) * 10
    x = 5 * (1 - np.exp(-t / rng.uniform(50, 2000))) + rng.normal(0, 0.1, 40)
    level, error = start_reading(t, x)
    moved, moved_error = start_reading(t, x * factor + offset)
    assert moved == pytest.approx(level * factor + offset, rel=1e-9, abs=1e-7 * factor)
    assert moved_error == pytest.approx(error * factor, rel=1e-4)


@MODEST
@given(st.integers(20, 5000), st.integers(1, 10))
def test_blocks_do_not_touch(n, n_blocks):
    bounds = block_bounds(n, n_blocks)
    assert bounds[0][0] == 0
    assert bounds[-1][1] == n
    for (_, stop), (start, _) in itertools.pairwise(bounds):
        assert stop < start
    if n >= 10 * n_blocks:
        assert min(stop - start for start, stop in bounds) >= 0.5 * n / n_blocks


@MODEST
@given(hnp.arrays(np.float64, st.tuples(st.integers(1, 8), st.integers(1, 6)), elements=numbers(0.1, 10)))
def test_the_candidate_of_least_error_is_always_eligible(errors):
    found = within_one_standard_error(errors, np.ones(errors.shape[1]))
    assert found[int(np.argmin(errors.mean(axis=1)))]
    # whatever the groups say, nobody is further than 10 % (in root mean square) from the best
    mean = errors.mean(axis=1)
    assert np.all(np.sqrt(mean[found]) <= 1.1 * np.sqrt(mean.min()) * (1 + 1e-12))
