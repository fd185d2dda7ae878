"""What machines of one type share: the population, what few runs add to it, and machines that are not one type."""

import numpy as np
import pytest

from selector.models.population import Evidence, Population, parted, population_of

MEAN = np.array([0.0, 3.0, -2.0])
COVARIANCE = np.array([[0.04, 0.0, 0.0], [0.0, 0.25, 0.1], [0.0, 0.1, 0.16]])


def products(coefficients, rng, *, n_runs=6, noise_um=0.2, drift_um=0.0, rows=50):
    """Cross-products of the runs of a machine, each with a drift of its own that no column sees."""
    found = []
    for _ in range(n_runs):
        rise = rng.uniform(1, 5, 2) * (1 - np.exp(-np.linspace(0, 4, rows)[:, None] / [1.0, 3.0]))
        columns = np.column_stack([np.ones(rows), rise + rng.normal(0, 0.1, (rows, 2))])
        drift = drift_um * rng.normal() * np.linspace(0, 1, rows)
        table = np.column_stack([columns, columns @ coefficients + drift + rng.normal(0, noise_um, rows)])
        found.append(table.T @ table)
    return np.array(found)


def fleet(rng, n, mean=MEAN, covariance=COVARIANCE, **how):
    drawn = rng.multivariate_normal(mean, covariance, n)
    return [Evidence.of(products(one, rng, **how)) for one in drawn]


def test_noise_is_that_of_a_sample_where_samples_are_independent_and_more_where_runs_drift():
    rng = np.random.default_rng(1)
    plain = np.mean([Evidence.of(products(MEAN, rng)).noise_um2 for _ in range(40)])
    # 40 machines of 6 runs leave a standard error of about 4 %
    assert plain == pytest.approx(0.2**2, rel=0.15)
    drifting = np.mean([Evidence.of(products(MEAN, rng, drift_um=0.5)).noise_um2 for _ in range(40)])
    assert drifting > 10 * plain
    assert np.isnan(Evidence.of(products(MEAN, rng, n_runs=1)).noise_um2)


def test_the_population_is_found_again():
    rng = np.random.default_rng(2)
    found = population_of(fleet(rng, 300))
    # standard errors: of a mean √(0.25/300) = 0.03, of a variance √(2/300) = 8 %; three of them
    assert found.mean == pytest.approx(MEAN, abs=0.09)
    assert found.covariance == pytest.approx(COVARIANCE, abs=0.06)


def test_the_posterior_is_that_of_the_plain_formula():
    rng = np.random.default_rng(3)
    one = Population((), MEAN, COVARIANCE, 0.05)
    evidence = Evidence.of(products(np.array([0.1, 3.5, -1.5]), rng, n_runs=1))
    prior = np.linalg.inv(COVARIANCE)
    spread = np.linalg.inv(prior + evidence.normal / 0.05)
    found, covariance = one.posterior(evidence)
    assert found == pytest.approx(spread @ (prior @ MEAN + evidence.right / 0.05), rel=1e-9)
    assert covariance == pytest.approx(spread, rel=1e-9)


def test_without_a_sample_it_is_the_mean_and_with_very_many_what_the_machine_says_itself():
    rng = np.random.default_rng(4)
    one = Population((), MEAN, COVARIANCE, 0.04)
    nothing = Evidence(np.zeros((3, 3)), np.zeros(3), float("nan"))
    assert one.posterior(nothing)[0] == pytest.approx(MEAN)
    many = Evidence.of(1e6 * products(np.array([0.0, 9.0, 9.0]), rng, noise_um=1e-6))
    assert one.posterior(many)[0] == pytest.approx([0.0, 9.0, 9.0], abs=1e-4)


def test_few_machines_leave_more_open_than_many():
    rng = np.random.default_rng(5)
    wide = [np.trace(population_of(fleet(rng, 3)).covariance) for _ in range(20)]
    narrow = [np.trace(population_of(fleet(rng, 30)).covariance) for _ in range(20)]
    assert np.mean(wide) > np.mean(narrow)


def test_a_machine_of_the_type_is_near_and_another_one_far():
    rng = np.random.default_rng(6)
    one = population_of(fleet(rng, 20))
    near = [one.distance(each) for each in fleet(rng, 20, n_runs=2)]
    assert np.mean(near) == pytest.approx(1.0, abs=0.5)
    assert one.distance(Evidence.of(products(np.array([0.0, -3.0, 2.0]), rng, n_runs=1))) > 5 * max(near)


def test_a_machine_with_runs_far_apart_counts_less():
    rng = np.random.default_rng(7)
    weighted, plain = [], []
    for _ in range(10):
        same = fleet(rng, 6, covariance=1e-6 * np.eye(3))
        drifting = Evidence.of(products(MEAN, rng, drift_um=5.0))
        weighted.append(population_of([*same, drifting]).mean - MEAN)
        own = [np.linalg.solve(one.normal, one.right) for one in (*same, drifting)]
        plain.append(np.mean(own, axis=0) - MEAN)
    assert np.square(weighted).sum() < 0.5 * np.square(plain).sum()


def test_one_population_is_not_parted_two_types_are_and_one_that_stands_alone_is_left_out():
    rng = np.random.default_rng(8)
    narrow = 0.05 * COVARIANCE
    one = fleet(rng, 12, covariance=narrow)
    assert parted(one)[1] == (tuple(range(12)),)
    other = fleet(rng, 8, mean=np.array([0.0, 1.0, -4.0]), covariance=narrow)
    assert parted([*one, *other])[1] == (tuple(range(12)), tuple(range(12, 20)))
    whole, types = parted([other[0], *one])
    assert (whole.members, types) == (tuple(range(1, 13)), (tuple(range(1, 13)),))
    # what is left is the population that they are without it
    assert whole.mean == pytest.approx(population_of(one).mean)


def test_a_machine_that_records_in_another_unit_stands_alone_however_far_the_others_are_apart():
    """Beside a wide scatter two distributions are not much more likely than one."""
    kept = 0
    for seed in range(10):
        rng = np.random.default_rng([9, seed])
        wide = fleet(rng, 12, n_runs=4, drift_um=0.6)
        in_mm = Evidence.of(products(1e-3 * MEAN, rng, n_runs=4, drift_um=6e-4, noise_um=2e-4))
        assert parted(wide)[0].members == tuple(range(12))
        kept += 0 in parted([in_mm, *wide])[0].members
    # of 40 such fleets five keep it; all kept it where only two distributions were compared
    assert kept <= 2
