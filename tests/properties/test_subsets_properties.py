"""Properties of the subset search, against brute force by an orthogonal decomposition of the samples."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from selector.models.best_subsets._algebra import relax, spread_shares
from selector.models.best_subsets.problem import Problem, cross_products, valid_diagonal
from selector.models.best_subsets.subsets import best_sensor_sets, best_subsets
from tests.models.subset_cases import every_rss, rss_by_least_squares

# small integers make ties, duplicates and dependent columns common
CELLS = st.integers(-3, 3)


@st.composite
def regressions(draw, most=7):
    p = draw(st.integers(1, most))
    n = draw(st.integers(3, 16))
    seed = draw(st.integers(0, 2**32 - 1))
    rng = np.random.default_rng(seed)
    columns = rng.integers(-3, 4, size=(n, p)).astype(float)
    if draw(st.booleans()):
        columns += rng.normal(size=(n, p))
    for j in range(1, p):
        kind = draw(st.integers(0, 9))
        if kind == 0:
            columns[:, j] = 5.0
        elif kind == 1:
            columns[:, j] = columns[:, j - 1]
        elif kind == 2 and j > 1:
            columns[:, j] = columns[:, j - 1] - 2.0 * columns[:, j - 2]
    response = columns @ rng.integers(-1, 2, size=p) + draw(st.sampled_from([0.0, 0.1, 1.0])) * rng.normal(size=n)
    response[0] += 1.0
    return columns, response


def prepared(columns, response, intercept):
    if intercept:
        columns = columns - columns.mean(axis=0)
        response = response - response.mean()
    return columns, response


@settings(max_examples=75)
@given(regressions(), st.integers(1, 5), st.booleans(), st.data())
def test_best_subsets_are_those_of_brute_force(case, n_best, intercept, data):
    columns, response = case
    n, p = columns.shape
    roles = data.draw(st.lists(st.sampled_from(["free"] * 4 + ["must"]), min_size=p, max_size=p))
    must = [j for j in range(p) if roles[j] == "must"]
    x, y = prepared(columns, response, intercept)
    total = float(y @ y)
    if total < 1e-9:
        return
    products = cross_products(columns, response, intercept=intercept)
    found = best_subsets(products, n, n_best=n_best, must=must, intercept=intercept, max_size=p)
    assert found.proved

    def allowed(chosen):
        return set(must) <= set(chosen)

    for size in range(max(1, len(must)), p + 1):
        truth = every_rss(x, y, size, allowed)[:n_best]
        sets = found.by_size.get(size, ())
        # rounding of the cross-products: 1e-16 of the total, times the inverse of the smallest pivot that counts
        assert [one.rss for one in sets] == pytest.approx(truth, rel=1e-7, abs=1e-9 * total)
        assert len({one.columns for one in sets}) == len(sets)
        for one in sets:
            assert allowed(one.columns)
            assert one.rss == pytest.approx(rss_by_least_squares(x[:, one.columns], y), rel=1e-7, abs=1e-9 * total)


@settings(max_examples=30)
@given(regressions(most=5), st.integers(1, 3), st.data())
def test_best_sensor_sets_are_those_of_brute_force(case, n_best, data):
    columns, response = case
    n, p = columns.shape
    pairs = list(itertools.combinations(range(p), 2))
    terms = np.column_stack([columns, *[columns[:, a] * columns[:, b] for a, b in pairs], columns[:, 0] ** 3])
    owners = [(j,) for j in range(p)] + pairs + [(0,)]
    always = data.draw(st.sets(st.integers(0, len(owners) - 1), max_size=2))
    must = data.draw(st.sets(st.integers(0, p - 1), max_size=1))
    x, y = prepared(terms, response, True)
    total = float(y @ y)
    if total < 1e-9:
        return
    found = best_sensor_sets(
        cross_products(terms, response), n, owners, n_sensors=p, max_sensors=p, n_best=n_best, must=must, always=always
    )
    assert found.proved
    for size in range(max(1, len(must)), p + 1):
        truth = []
        for sensors in itertools.combinations(range(p), size):
            if not must <= set(sensors):
                continue
            brought = [j for j, own in enumerate(owners) if j in always or set(own) <= set(sensors)]
            truth.append(rss_by_least_squares(x[:, brought], y))
        sets = found.by_size.get(size, ())
        # as above; products of columns are worse conditioned
        assert [one.rss for one in sets] == pytest.approx(sorted(truth)[:n_best], rel=1e-6, abs=1e-8 * total)
        assert found.coverage[size].left == 0


@settings(max_examples=50)
@given(regressions(), st.integers(0, 2**32 - 1), st.data())
def test_bound_holds_at_any_shares(case, seed, data):
    columns, response = case
    p = columns.shape[1]
    x, y = prepared(columns, response, True)
    if p < 2 or float(y @ y) < 1e-9 or np.linalg.matrix_rank(x, tol=1e-6) < p:
        return
    size = data.draw(st.integers(1, p - 1))
    problem = Problem.of(cross_products(columns, response), len(y), (), True, 1, p)
    diagonal, _ = valid_diagonal(problem)
    matrix = np.zeros((p, p + 1))
    matrix[:, :p], matrix[:, p] = problem.gram, problem.cross
    shares = np.random.default_rng(seed).uniform(0.01, 1.0, p)
    spread_shares(shares, p, size)
    assert shares.sum() == pytest.approx(size, abs=1e-6)  # shares are kept above 1e-9
    work = np.zeros(p * (p + 1))
    bound = relax(matrix.ravel(), p + 1, p, size, 1.0, diagonal, shares, work, np.zeros(p), np.zeros(p), np.arange(p))
    # both sides are rounded to 1e-16 of the total times the condition, at most 1e6 here by the rank test
    assert bound <= every_rss(x, y, size)[0] / float(y @ y) + 1e-9
