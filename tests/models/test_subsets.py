"""The exact best subsets of columns and of sensors."""

from __future__ import annotations

import contextlib
import itertools
import math
import signal
import threading
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from unittest.mock import ANY

import numpy as np
import pytest
import statsmodels.api as sm

from selector.errors import InputError
from selector.models.best_subsets import _wide as wide
from selector.models.best_subsets import subsets
from selector.models.best_subsets.problem import (
    Problem,
    cross_products,
    factor_from_rows,
    rss_from_factor,
    valid_diagonal,
)
from selector.models.best_subsets.results import adjusted_r2, aicc, best_of, bic, mallows_cp
from selector.models.best_subsets.subsets import best_sensor_sets, best_subsets, side_by_side
from tests.models.subset_cases import best_rss_of_every_size, rss_by_least_squares, warm_machine

# cross-products hold squares: 1e-9 of the total leaves six digits for a condition number of 1e4
CLOSE = 1e-9


@pytest.mark.parametrize("intercept", [True, False])
def test_criteria_agree_with_statsmodels(intercept):
    columns, response = warm_machine(60, 5, seed=1)
    response = response + 40.0
    found = best_subsets(cross_products(columns, response, intercept=intercept), 60, intercept=intercept)
    for one in (sets[0] for sets in found.by_size.values()):
        design = columns[:, one.columns]
        fit = sm.OLS(response, sm.add_constant(design) if intercept else design).fit()
        assert one.r2 == pytest.approx(fit.rsquared, rel=CLOSE)
        assert one.adjusted_r2 == pytest.approx(fit.rsquared_adj, rel=CLOSE)
        # statsmodels keeps the constants of the likelihood and does not count the variance
        constant = 60 * (math.log(2 * math.pi) + 1)
        assert one.bic == pytest.approx(fit.bic + math.log(60) - constant, abs=1e-6)
        k = len(one.columns) + intercept + 1
        assert one.aicc == pytest.approx(fit.aic + 2 - constant + 2 * k * (k + 1) / (60 - k - 1), abs=1e-6)
    full = found.by_size[5][0]
    assert full.cp == pytest.approx(5 + intercept, abs=1e-6)  # by the definition of Cp


def test_adjusted_r2_changes_its_definition_without_an_intercept():
    assert adjusted_r2(0.9, 11, 4) == pytest.approx(1 - 10 / 6 * 0.1)
    assert adjusted_r2(0.9, 11, 4, intercept=False) == pytest.approx(1 - 11 / 7 * 0.1)


def test_criteria_without_degrees_of_freedom_are_not_numbers():
    assert math.isnan(adjusted_r2(0.9, 5, 4))
    assert math.isnan(aicc(1.0, 6, 4))
    assert math.isnan(mallows_cp(1.0, 6, 4, math.nan))
    assert bic(0.0, 6, 2) == -math.inf


@pytest.fixture(params=["few columns", "many columns", "many columns given away"])
def bound(request, monkeypatch):
    """Every search as for few columns, or as for many."""
    if request.param == "few columns":
        return
    monkeypatch.setattr(subsets, "MANY_COLUMNS", 0)
    monkeypatch.setattr(subsets, "better_for_few", lambda *_: True)
    monkeypatch.setattr(wide, "LEAST_SHARE", 0.7 if "away" in request.param else wide.LEAST_SHARE)
    monkeypatch.delattr(subsets._SizeSearch, "run")


@pytest.mark.parametrize("seed", [0, 1])
@pytest.mark.parametrize("kind", ["warm", "independent"])
def test_same_optimum_as_all_16383_subsets(kind, seed, bound, monkeypatch):
    if seed == 1:  # good sets to start with hide a bound that is too large
        monkeypatch.setattr(subsets, "starting_sets", lambda *_: None)
    rng = np.random.default_rng(seed)
    columns, response = warm_machine(80, 14, seed)
    if kind == "independent":
        columns = rng.normal(size=(80, 14))
        response = columns[:, :3].sum(axis=1) + 3 * rng.normal(size=80)
    cross = cross_products(columns, response)
    found = best_subsets(cross, 80)
    assert found.proved
    for size, rss in best_rss_of_every_size(cross).items():
        assert found.by_size[size][0].rss == pytest.approx(rss, rel=1e-8)  # proof tolerance 1e-9, and rounding
        assert found.gap[size] == 0.0
        one = found.by_size[size][0]
        centred = columns[:, one.columns] - columns[:, one.columns].mean(axis=0)
        assert one.rss == pytest.approx(rss_by_least_squares(centred, response - response.mean()), rel=1e-8)


def test_best_takes_the_best_value_of_a_criterion():
    columns, response = warm_machine(100, 8, seed=3)
    found = best_subsets(cross_products(columns, response), 100, n_best=3)
    every = [one for sets in found.by_size.values() for one in sets]
    assert found.best().adjusted_r2 == max(one.adjusted_r2 for one in every)
    for criterion in ("aicc", "bic", "cp"):
        assert getattr(found.best(criterion), criterion) == min(getattr(one, criterion) for one in every)
    with pytest.raises(InputError, match="adjusted_r2, aicc, bic, cp"):
        found.best("r2")


def test_duplicates_constants_and_sums_are_explained_and_never_nan(bound):
    rng = np.random.default_rng(0)
    x = rng.normal(size=(40, 3))
    columns = np.column_stack([x, x[:, 0], np.full(40, 20.1), x[:, 1] + x[:, 2]])
    response = x @ [1.0, 2.0, 3.0] + 0.1 * rng.normal(size=40)
    found = best_subsets(cross_products(columns, response), 40)
    assert found.proved
    full = rss_by_least_squares(x - x.mean(axis=0), response - response.mean())
    for size, sets in found.by_size.items():
        for one in sets:
            assert all(math.isfinite(v) for v in (one.rss, one.r2, one.adjusted_r2, one.aicc, one.bic, one.cp))
        if size >= 3:
            assert sets[0].rss == pytest.approx(full, rel=1e-9)
    said = {finding.id: finding.evidence["columns"] for finding in found.findings}
    assert said["constant-column"] == [4]
    dependent = [f.evidence["columns"] for f in found.findings if f.id == "dependent-columns"]
    assert sorted(dependent) == [[0, 3], [1, 2, 5]]


def test_duplicate_columns_still_end_with_proof(bound):
    columns, response = warm_machine(150, 14, seed=5)
    doubled = np.column_stack([columns, columns[:, :6]])
    most = 4 if subsets.MANY_COLUMNS == 0 else 14  # the bound for many is poor for more of so few
    plain = best_subsets(cross_products(columns, response), 150, max_size=most)
    found = best_subsets(cross_products(doubled, response), 150, max_size=None if most == 14 else most)
    assert found.proved
    for size in range(1, most + 1):
        assert found.by_size[size][0].rss == pytest.approx(plain.by_size[size][0].rss, rel=1e-8)


def test_fewer_samples_than_columns_end_with_proof(bound):
    rng = np.random.default_rng(4)
    columns, response = rng.normal(size=(9, 12)), rng.normal(size=9)
    found = best_subsets(cross_products(columns, response), 9)
    assert found.proved
    assert max(found.by_size) == 7  # one degree of freedom is left
    centred, about = columns - columns.mean(axis=0), response - response.mean()
    for size in (2, 4, 6):
        least = min(rss_by_least_squares(centred[:, list(s)], about) for s in itertools.combinations(range(12), size))
        assert found.by_size[size][0].rss == pytest.approx(least, rel=1e-7, abs=CLOSE * (about @ about))


@pytest.mark.parametrize("looks", [0.0, 250.0])  # the last of the 258 that the whole search takes
def test_stopped_search_brackets_the_optimum(monkeypatch, looks):
    columns, response = warm_machine(200, 45, seed=2, noise_um=3.0)
    cross = cross_products(columns, response)
    proved = best_subsets(cross, 200)
    clock = itertools.count()
    monkeypatch.setattr(subsets.time, "perf_counter", lambda: float(next(clock)))
    stopped = best_subsets(cross, 200, time_limit_s=looks)
    assert (stopped.nodes > 45) == (looks > 0.0)
    assert proved.proved
    assert not stopped.proved
    assert max(stopped.gap.values()) > 0.0
    for size, sets in proved.by_size.items():
        optimum, best = sets[0].rss, stopped.by_size[size][0].rss
        assert stopped.lower_bound[size] <= optimum * (1 + 1e-9)
        assert optimum <= best * (1 + 1e-9)
        assert best * (1 - stopped.gap[size]) <= optimum * (1 + 1e-9)


def test_the_clock_is_looked_at_often(monkeypatch):
    columns, response = warm_machine(200, 60, seed=2, noise_um=3.0)
    cross = cross_products(columns, response)
    looks = itertools.count()
    monkeypatch.setattr(subsets.time, "perf_counter", lambda: float(next(looks)))
    found = best_subsets(cross, 200, time_limit_s=300.0)  # some 250 are for the starting sets
    assert not found.proved
    assert 0 < found.nodes < 60 * 5_000  # some 600 in 20 ms between two looks: what Ctrl-C has to wait for


def test_keyboard_interrupt_passes_through(monkeypatch):
    columns, response = warm_machine(100, 12, seed=2)
    times = iter([0.0])

    def clock():
        try:
            return next(times)
        except StopIteration:
            raise KeyboardInterrupt from None

    monkeypatch.setattr(subsets.time, "perf_counter", clock)
    with pytest.raises(KeyboardInterrupt):
        best_subsets(cross_products(columns, response), 100)


def test_an_interrupt_ends_the_threads():
    columns, response = warm_machine(400, 120, seed=2, noise_um=3.0)  # some minutes
    cross = cross_products(columns, response)
    before = threading.active_count()

    def stop(number, frame):
        raise KeyboardInterrupt

    usual = signal.signal(signal.SIGALRM, stop)
    try:
        signal.setitimer(signal.ITIMER_REAL, 2.0)
        with pytest.raises(KeyboardInterrupt):
            best_subsets(cross, 400)
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, usual)
    assert threading.active_count() == before


def test_searches_side_by_side_are_given_up_with_their_block():
    columns, response = warm_machine(400, 120, seed=2, noise_um=3.0)  # some minutes each
    cross = cross_products(columns, response)
    with contextlib.suppress(KeyboardInterrupt), side_by_side() as threads:
        of_columns = threads.submit(best_subsets, cross, 400)
        owners = [(k,) for k in range(120)]
        of_sensors = threads.submit(best_sensor_sets, cross, 400, owners, n_sensors=120, max_sensors=9)
        raise KeyboardInterrupt
    assert not of_columns.result().proved
    assert not of_sensors.result().proved
    # and no others
    assert best_subsets(cross[:9, :9], 400).proved


def test_number_of_cores_changes_nothing(monkeypatch):
    columns, response = warm_machine(200, 45, seed=2, noise_um=3.0)
    cross = cross_products(columns, response)
    found = []
    for cores in (1, 3):
        monkeypatch.setattr(subsets.os, "cpu_count", lambda cores=cores: cores)
        found.append(best_subsets(cross, 200))
    assert found[0].by_size == found[1].by_size
    assert found[0].nodes == found[1].nodes
    assert found[0].lower_bound == found[1].lower_bound


@pytest.mark.parametrize(("parent", "threads"), [(None, 3), (object(), 1)], ids=["alone", "worker"])
def test_a_worker_of_a_pool_leaves_the_other_cores_to_the_others(monkeypatch, parent, threads):
    asked = []

    class Counted(ThreadPoolExecutor):
        def __init__(self, n_threads):
            asked.append(n_threads)
            super().__init__(n_threads)

    monkeypatch.setattr(subsets, "ThreadPoolExecutor", Counted)
    monkeypatch.setattr(subsets.os, "cpu_count", lambda: 3)
    monkeypatch.setattr(subsets.multiprocessing, "parent_process", lambda: parent)
    columns, response = warm_machine(200, 45, seed=2, noise_um=3.0)
    best_subsets(cross_products(columns, response), 200)
    assert asked == [threads]


def test_few_of_many_columns_are_proved_where_eigenvalues_say_little():
    columns, response = warm_machine(400, 250, seed=1)
    cross = cross_products(columns, response)
    found = best_subsets(cross, 400, max_size=4)
    assert found.proved
    assert best_subsets(cross, 400, max_size=4) == replace(found, seconds=ANY)
    stopped = best_subsets(cross, 400, max_size=4, time_limit_s=0.0)
    assert max(stopped.gap.values()) > 0.0
    for size, sets in found.by_size.items():
        assert stopped.lower_bound[size] <= sets[0].rss * (1 + 1e-9)
    assert found.nodes < 500  # 264; with the bound for fewer columns it has not ended after 606


@pytest.mark.parametrize("a", [2, 3, 5])
def test_no_choice_of_a_columns_is_below_the_bound_of_how_few_they_are(a):
    columns, response = warm_machine(60, 12, seed=3)
    problem = Problem.of(cross_products(columns, response), 60, (), True, 1, None)
    directions = wide.shared_directions(problem)[:, :3]
    basis, n = wide.conditioned(problem, directions, (4,), np.delete(np.arange(12), 4))[2:]
    rng = np.random.default_rng(a)
    w, d = wide.evened(n, rng.uniform(0.5, 2.0, 11), a)
    rows = np.abs(n) * w / w[:, None]
    np.fill_diagonal(rows, 0.0)
    plain = np.diag(n) - np.sort(rows, axis=1)[:, -(a - 1) :].sum(axis=1)
    assert d == pytest.approx(plain, abs=1e-12)  # ROUNDING times the columns, and that of sums
    gram = n + basis @ basis.T
    for chosen in itertools.combinations(range(11), a):
        part = gram[np.ix_(chosen, chosen)] - (basis @ basis.T)[np.ix_(chosen, chosen)] - np.diag(d[list(chosen)])
        assert np.linalg.eigvalsh(part)[0] > -1e-12


def test_raised_diagonals_of_open_nodes_are_valid_and_no_node_needs_more_room():
    columns, response = warm_machine(200, 70, seed=2, noise_um=3.0)
    problem = Problem.of(cross_products(columns, response), 200, (), True, 1, None)
    diagonal, _ = valid_diagonal(problem)
    part = subsets._SizeSearch(problem, 20, diagonal)
    part.most = 300
    best_rss, best_state = np.ones(1), np.zeros((1, 70), np.int8)
    while not part.ended and part.visited < 800:
        part.run(problem, problem.scratch(), best_rss, best_state, 1_000_000)
    assert not part.ended
    assert part.tree.bound.size <= 300
    assert part.tree.rank.min() < 0.0  # depth first, because there is no room
    raised = 0
    for slot in np.flatnonzero(part.tree.rank < np.inf):
        kept, free = (np.flatnonzero(part.tree.state[slot] == state) for state in (1, 0))
        link = problem.gram[np.ix_(free, kept)]
        given = problem.gram[np.ix_(free, free)] - link @ np.linalg.solve(problem.gram[np.ix_(kept, kept)], link.T)
        stored = part.tree.diagonal[slot, free].astype(float)
        assert np.linalg.eigvalsh(given - np.diag(stored))[0] > -1e-13  # rounding of the eigenvalues
        raised += bool(np.any(stored > 1.5 * diagonal[free]))
    assert raised > 50


def test_depth_first_when_memory_is_short_finds_the_same(monkeypatch):
    columns, response = warm_machine(200, 50, seed=2, noise_um=3.0)
    cross = cross_products(columns, response)
    plain = best_subsets(cross, 200, max_size=20)
    monkeypatch.setattr(subsets, "MAX_OPEN_BYTES", 0)
    short = best_subsets(cross, 200, max_size=20)
    assert short.proved
    assert short.nodes != plain.nodes  # otherwise the heap was never full and this test shows nothing
    for size in plain.by_size:
        assert short.by_size[size][0].rss == pytest.approx(plain.by_size[size][0].rss, rel=1e-9)


def test_same_result_every_time():
    columns, response = warm_machine(150, 25, seed=8)
    cross = cross_products(columns, response)
    first, second = best_subsets(cross, 150, n_best=2), best_subsets(cross, 150, n_best=2)
    assert first.by_size == second.by_size
    assert first.nodes == second.nodes


def test_diagonal_leaves_the_matrix_positive_semidefinite():
    for seed in range(3):
        columns, response = warm_machine(100, 20, seed)
        columns[:, 3] = columns[:, 4] + columns[:, 5] if seed == 2 else columns[:, 3]
        problem = Problem.of(cross_products(columns, response), 100, (), True, 1, None)
        diagonal, _ = valid_diagonal(problem)
        assert np.linalg.eigvalsh(problem.gram - np.diag(diagonal))[0] > -1e-13  # rounding of the eigenvalues
        assert np.count_nonzero(diagonal) == (17 if seed == 2 else 20)


def test_factor_from_rows_keeps_the_digits_that_cross_products_lose():
    rng = np.random.default_rng(0)
    columns = rng.normal(size=(50, 4))
    rest = rng.normal(size=50)
    design = np.column_stack([np.ones(50), columns])
    rest -= design @ np.linalg.lstsq(design, rest)[0]
    response = columns.sum(axis=1) + 1e-7 * rest
    exact = 1e-14 * float(rest @ rest)
    factor = factor_from_rows(columns, response)
    assert rss_from_factor(factor, (0, 1, 2, 3)) == pytest.approx(exact, rel=1e-6)  # 1e-16 of the response, squared
    found = best_subsets(cross_products(columns, response), 50, factor=factor)
    assert found.by_size[4][0].rss == pytest.approx(exact, rel=1e-6)
    np.testing.assert_allclose(factor.T @ factor, cross_products(columns, response), rtol=1e-12, atol=1e-11)


@pytest.mark.parametrize(
    ("options", "message"), [({"must": [9]}, "must has"), ({"n_best": 0}, "n_best"), ({"max_size": 0}, "max_size")]
)
def test_unusable_options_are_named(options, message):
    columns, response = warm_machine(30, 3, seed=0)
    with pytest.raises(InputError, match=message):
        best_subsets(cross_products(columns, response), 30, **options)


@pytest.mark.parametrize(
    ("cross", "message"),
    [
        (np.zeros((3, 2)), "shape"),
        (np.diag([1.0, 1.0, 0.0]), "does not vary"),
        (np.array([[1.0, 0.5, 0.1], [0.2, 1.0, 0.1], [0.1, 0.1, 1.0]]), "not symmetric"),
        (np.diag([1.0, np.nan, 1.0]), "missing"),
    ],
)
def test_unusable_matrices_are_named(cross, message):
    with pytest.raises(InputError, match=message):
        best_subsets(cross, 30)


def test_unusable_samples_are_named():
    with pytest.raises(InputError, match="shape"):
        cross_products(np.ones((3, 2)), np.ones(4))
    with pytest.raises(InputError, match="1 missing"):
        cross_products(np.array([[1.0], [np.nan]]), np.ones(2))


def quadratic_case(n_sensors, seed):
    rng = np.random.default_rng(seed)
    rises = rng.normal(size=(120, n_sensors))
    pairs = list(itertools.combinations(range(n_sensors), 2))
    columns = np.column_stack([rises, rises**2, *[rises[:, a] * rises[:, b] for a, b in pairs]])
    owners = [(i,) for i in range(n_sensors)] * 2 + pairs
    response = rises[:, 1] + rises[:, 0] * rises[:, 3] + 0.5 * rng.normal(size=120)
    return columns, response, owners


def test_sensor_sets_bring_their_squares_and_products():
    columns, response, owners = quadratic_case(6, seed=0)
    centred, about = columns - columns.mean(axis=0), response - response.mean()
    found = best_sensor_sets(cross_products(columns, response), 120, owners, n_sensors=6, max_sensors=6, n_best=4)
    assert found.proved
    for size in range(1, 7):
        scores = []
        for sensors in itertools.combinations(range(6), size):
            brought = tuple(j for j, own in enumerate(owners) if set(own) <= set(sensors))
            scores.append((rss_by_least_squares(centred[:, list(brought)], about), sensors, brought))
        scores.sort()
        assert len(found.by_size[size]) == min(4, len(scores))
        for one, (rss, sensors, brought) in zip(found.by_size[size], scores, strict=False):
            assert one.rss == pytest.approx(rss, rel=1e-9)
            assert (one.sensors, one.columns) == (sensors, brought)
        assert sum(vars(found.coverage[size]).values()) == math.comb(6, size)
        assert found.coverage[size].left == 0
    assert best_of([one for sets in found.by_size.values() for one in sets], "bic").sensors == (0, 1, 3)


def test_supersets_bound_and_every_sensor_set_is_accounted_for():
    columns, response = warm_machine(120, 24, seed=3)
    owners = [(j,) for j in range(24)]
    found = best_sensor_sets(cross_products(columns, response), 120, owners, n_sensors=24, max_sensors=9)
    plain = best_subsets(cross_products(columns, response), 120, max_size=9)
    assert sum(c.bounded for c in found.coverage.values()) > 0
    for size, coverage in found.coverage.items():
        assert sum(vars(coverage).values()) == math.comb(24, size)
        assert coverage.evaluated + coverage.bounded == math.comb(24, size)
        assert found.by_size[size][0].columns == plain.by_size[size][0].columns


def test_stopped_sensor_search_brackets_the_optimum():
    columns, response, owners = quadratic_case(14, seed=1)
    cross = cross_products(columns, response)
    sizes = {"n_sensors": 14, "max_sensors": 4}
    full = best_sensor_sets(cross, 120, owners, **sizes)
    found = best_sensor_sets(cross, 120, owners, **sizes, time_limit_s=0.0)
    for size in full.by_size:
        assert found.lower_bound[size] <= full.by_size[size][0].rss * (1 + 1e-9)
        assert found.by_size[size][0].rss >= full.by_size[size][0].rss * (1 - 1e-9)
        assert sum(vars(found.coverage[size]).values()) == math.comb(14, size)


def test_unknown_owner_is_named():
    columns, response = warm_machine(30, 3, seed=0)
    with pytest.raises(InputError, match=r"owners has \[9\]"):
        best_sensor_sets(cross_products(columns, response), 30, [(0,), (1,), (9,)], n_sensors=2, max_sensors=2)
