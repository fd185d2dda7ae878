"""Block sums give the same fits as the samples."""

from __future__ import annotations

import numpy as np
import pytest

from selector.diagnosis.evidence.moments import beside, moments, solved


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
