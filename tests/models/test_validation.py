"""Held-out errors from cross-products against refits on the rows, and the one-standard-error choice."""

from __future__ import annotations

import numpy as np
import pytest

from selector.models.design import Columns, Datum, Design, polynomial_terms, rows_of
from selector.models.moments import (
    HeldOut,
    LeaveOneOut,
    error_curve_point,
    grouping_by_condition,
    grouping_by_run,
    inner_grouping,
    moments,
    response_power,
    scaling_of,
    within_one_standard_error,
)
from tests.models.runs import recording


def study(n_runs=5, n=80, n_blocks=1, seed=0):
    """(source, design, columns, moments) of runs of different length, with two responses."""
    rng = np.random.default_rng(seed)
    runs = {}
    for r in range(n_runs):
        t = np.arange(float(n + 7 * r))
        a, b = rng.normal(size=(2, len(t))).cumsum(axis=1) * 0.3 + rng.normal(size=(2, 1))
        z = 4 * a - 2 * b + 0.3 * a * b + rng.normal(0, 0.5, len(t))
        runs[f"r{r}"] = (t, {"T1": a, "T2": b, "Z": z, "Y": 2 * b + rng.normal(0, 0.5, len(t))})
    source = recording(runs)
    design = Design(("T1", "T2"), ("Z", "Y"), Datum("absolute"))
    columns = Columns(scaling_of(source, design), polynomial_terms(("T1", "T2"), 2, interactions=True))
    return source, design, columns, moments(source, design, columns, n_blocks=n_blocks)


def refitted(source, design, columns, chosen, unseen, training):
    """Sum of squared errors on `unseen` rows of a least-squares fit on the `training` rows, per response."""
    rows = rows_of(source, design, source.runs)
    x = np.column_stack([np.ones(len(rows.run)), columns.matrix(rows.variables)[:, chosen]])
    beta = np.linalg.lstsq(x[training(rows)], rows.responses[training(rows)], rcond=None)[0]
    error = rows.responses[unseen(rows)] - x[unseen(rows)] @ beta
    return (error**2).sum(axis=0)


@pytest.mark.parametrize("chosen", [[], [0], [0, 1], [0, 1, 2, 3, 4]])
def test_leaving_runs_out_is_refitting_without_them(chosen):
    source, design, columns, m = study()
    found = LeaveOneOut.of(m, grouping_by_run(m)).errors(chosen, 2)
    for r in range(5):
        expected = refitted(source, design, columns, chosen, lambda w, r=r: w.run == r, lambda w, r=r: w.run != r)
        assert found.sse[r] == pytest.approx(expected, rel=1e-8)
    assert found.n_samples.tolist() == [80.0 + 7 * r for r in range(5)]


def test_leaving_blocks_out_purges_their_edges():
    source, design, columns, m = study(n_runs=1, n=160, n_blocks=4)
    found = LeaveOneOut.of(m, tuple((i,) for i in range(4))).errors([0, 1], 2)
    for i in range(4):
        expected = refitted(
            source,
            design,
            columns,
            [0, 1],
            lambda w, i=i: w.blocks(4) == i,
            lambda w, i=i: (w.blocks(4) != i) & (w.blocks(4) >= 0),
        )
        assert found.sse[i] == pytest.approx(expected, rel=1e-8)


def test_leaving_conditions_out():
    source, design, columns, m = study()
    groups = grouping_by_condition(m, {"r0": "winter", "r3": "winter", "r1": "summer", "r2": "summer"})
    assert groups == ((0, 3), (1, 2), (4,))
    found = LeaveOneOut.of(m, groups).errors([0, 1], 2)
    expected = refitted(
        source, design, columns, [0, 1], lambda w: np.isin(w.run, [0, 3]), lambda w: ~np.isin(w.run, [0, 3])
    )
    assert found.sse[0] == pytest.approx(expected, rel=1e-8)


def test_inner_groups_are_runs_or_blocks_or_both():
    assert inner_grouping(study(n_runs=3)[3]) == ((0,), (1,), (2,))
    assert inner_grouping(study(n_runs=1, n_blocks=4)[3]) == ((0,), (1,), (2,), (3,))
    two = inner_grouping(study(n_runs=2, n_blocks=2)[3])
    assert two == ((0, 1), (2, 3), (0,), (1,), (2,), (3,))
    many = inner_grouping(study(n_runs=3, n_blocks=2)[3])
    assert many == ((0, 1), (2, 3), (4, 5))


def test_power_is_the_variance_of_each_response():
    source, design, _, m = study()
    rows = rows_of(source, design, source.runs)
    assert response_power(m) == pytest.approx(rows.responses.var(axis=0), rel=1e-10)


def test_pooled_error_counts_samples_and_not_groups():
    held_out = HeldOut(np.array([[4.0], [100.0]]), np.array([4.0, 1.0]))
    assert held_out.mse.tolist() == [[1.0], [100.0]]
    assert held_out.rmse_um == pytest.approx([np.sqrt(104 / 5)])


class TestOneStandardError:
    def test_the_best_is_always_as_good_as_itself(self):
        assert within_one_standard_error(np.array([[1.0, 2.0, 3.0]]), np.ones(3)).tolist() == [True]

    def test_a_candidate_within_the_scatter_of_its_differences_is_as_good(self, monkeypatch):
        monkeypatch.setattr("selector.models.moments.WORTH_OF_A_SENSOR", 0.0)
        best = np.array([1.0, 1.0, 1.0, 1.0])
        noisy = best + np.array([0.06, -0.05, 0.05, -0.04])
        surely_worse = best + 0.05
        found = within_one_standard_error(np.array([best, noisy, surely_worse]), np.ones(4))
        assert found.tolist() == [True, True, False]

    def test_what_is_worth_less_than_a_sensor_is_as_good_however_sure_the_groups_are(self):
        best = np.ones(6)
        # mean squares: 5 % of the root is 10.25 % of the square
        found = within_one_standard_error(np.array([best, best * 1.10, best * 1.11]), np.ones(6))
        assert found.tolist() == [True, True, False]

    def test_differences_are_paired(self):
        """Groups that are hard for everyone make no candidate as good as the best."""
        best = np.array([1.0, 100.0, 1.0, 100.0])
        assert within_one_standard_error(np.array([best, best * 1.15]), np.ones(4)).tolist() == [True, False]
        # unpaired, the standard error of each mean would be 28, and 15 % of 50 nothing beside it

    def test_by_hand_with_weights(self):
        errors = np.array([[1.0, 1.0], [1.1, 0.99]])
        weights = np.array([1.0, 3.0])
        difference = np.array([0.1, -0.01])
        mean = difference @ weights / 4
        spread = np.sqrt((weights / 4) @ (difference - mean) ** 2 * 2 / 1 / 2)
        assert (mean <= spread) == within_one_standard_error(errors, weights)[1]

    def test_two_groups_cannot_excuse_more_than_the_cap(self, monkeypatch):
        errors = np.array([[1.0, 1.0], [3.0, 0.5]])
        assert within_one_standard_error(errors, np.ones(2)).tolist() == [True, False]
        monkeypatch.setattr("selector.models.moments.MOST_ABOVE_BEST", 1.0)
        assert within_one_standard_error(errors, np.ones(2)).tolist() == [True, True]


def test_point_of_the_error_curve():
    held_out = HeldOut(np.array([[10.0], [40.0], [90.0]]), np.array([10.0, 10.0, 10.0]))
    point = error_curve_point(3, held_out)
    rmse = np.sqrt(140 / 30)
    assert point.n_sensors == 3
    assert point.rmse_um == pytest.approx((rmse,))
    assert point.standard_error_um == pytest.approx((np.std([1, 4, 9], ddof=1) / np.sqrt(3) / (2 * rmse),))
    assert np.ravel(point.per_group_um) == pytest.approx([1.0, 2.0, 3.0])
