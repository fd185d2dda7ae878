"""Block sums give the same fits as the samples."""

from __future__ import annotations

import numpy as np
import pytest

from selector.diagnosis.evidence.moments import beside, moderated, moments, solved


@pytest.fixture
def problem():
    generator = np.random.default_rng(4)
    base, columns = generator.standard_normal((300, 2)), generator.standard_normal((300, 7))
    columns[:, 3] += 0.8 * base[:, 1]
    target = base @ [1.0, -2.0] + columns[:, 3] + 0.1 * generator.standard_normal(300)
    blocks = [slice(k, k + 50) for k in range(0, 300, 50)]
    return base, columns, target, blocks, [1, 2, 1, 3]


def sums_of(problem, bounds=None):
    base, columns, target, blocks, counts = problem
    limits = np.tile([-np.inf, np.inf], (7, 1)) if bounds is None else bounds
    return beside(moments(columns, target, blocks, counts, limits), base, columns, target, blocks)


def residual_square(x, y):
    return float(np.sum((y - x @ np.linalg.lstsq(x, y, rcond=None)[0]) ** 2))


def test_gains_are_those_of_least_squares(problem):
    base, columns, target, _, _ = problem
    gains = solved(sums_of(problem)).gain
    alone = residual_square(base, target)
    for gain, here in zip(gains, ([0], [1, 2], [3], [4, 5, 6]), strict=True):
        expected = alone - residual_square(np.column_stack([base, columns[:, here]]), target)
        assert gain == pytest.approx(expected, rel=1e-9)  # sums of products in float64


def test_a_column_of_the_base_gains_nothing(problem):
    base, columns, target, blocks, counts = problem
    columns = columns.copy()
    columns[:, 0] = base[:, 0] * 3.0
    assert solved(sums_of((base, columns, target, blocks, counts))).gain[0] == 0.0


def test_bounds_hold(problem):
    bounds = np.tile([-np.inf, np.inf], (7, 1))
    bounds[3] = [-0.5, 0.5]
    free, bound = solved(sums_of(problem)), solved(sums_of(problem, bounds))
    assert free.coefficients[0][1, 0] == pytest.approx(1.0, abs=0.03)  # the truth is 1, noise 0.1 in 300 samples
    assert bound.coefficients[0][1, 0] == 0.5
    assert 0.0 < bound.gain[2] < free.gain[2]


def test_what_is_told_well_stays_as_it_is():
    assert moderated(np.array([3.0]), np.array([[4.0]])) == pytest.approx([3.0])
    fourier = moderated(np.array([6.0, -8.0]), np.eye(2))
    assert fourier == pytest.approx([6.0, -8.0], rel=0.02)


def test_columns_that_nearly_are_one_another_do_not_run_away_elsewhere():
    generator = np.random.default_rng(8)
    squares, shrunk = 0.0, 0.0
    for _ in range(50):
        one = generator.standard_normal(200)
        alike = one + 0.02 * generator.standard_normal(200)
        columns = np.column_stack([one, alike])
        gram = columns.T @ columns
        beta = np.linalg.solve(gram, columns.T @ (one + generator.standard_normal(200)))
        apart = generator.standard_normal((100, 2))  # where the two part company
        truth = apart[:, 0]
        squares += np.mean((apart @ beta - truth) ** 2)
        shrunk += np.mean((apart @ moderated(beta, np.linalg.inv(gram)) - truth) ** 2)
    assert shrunk < 0.1 * squares


def test_an_effect_that_is_in_their_difference_alone_is_kept():
    one = np.linspace(-1.0, 1.0, 400)
    alike = one + 0.05 * np.sin(40.0 * one)
    columns = np.column_stack([one, alike])
    gram = columns.T @ columns
    beta = np.array([-20.0, 20.0])
    assert beta @ gram @ beta > 36.0
    assert moderated(beta, np.linalg.inv(gram)) == pytest.approx(beta, rel=0.05)
