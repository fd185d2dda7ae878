"""The chart of a model's errors: exact while nothing changes, quick where something does."""

import numpy as np
import pytest

from selector.fleet.watching import LARGEST_DEVIATE, alarm_limit, charted, deviates


def test_deviates_are_standard_normal_however_few_values_are_known():
    rng = np.random.default_rng(0)
    # 4 000 charts of six new values after three known ones, of any mean and spread
    found = np.array([deviates(*np.split(rng.normal(7.0, 3.0, 9), [3])) for _ in range(4000)])
    # standard errors: 0.016 of a mean, 0.011 of a standard deviation, 0.016 of a correlation; four of them
    assert np.abs(found.mean(axis=0)).max() < 0.064
    assert np.abs(found.std(axis=0) - 1.0).max() < 0.045
    assert np.abs(np.corrcoef(found.T) - np.eye(6)).max() < 0.064


def test_mean_number_of_runs_between_false_alarms():
    rng = np.random.default_rng(1)
    limit = alarm_limit(200.0)
    lengths = []
    for _ in range(600):
        total, n = 0.0, 0
        while total <= limit:
            total, n = max(0.0, total + rng.normal() - 0.5), n + 1
        lengths.append(n)
    # run lengths are nearly exponential: 4 % standard error, and the formula is good to some per cent
    assert np.mean(lengths) == pytest.approx(200.0, rel=0.2)


def test_a_change_is_found_and_dated():
    rng = np.random.default_rng(2)
    known, new = rng.normal(0.0, 1.0, 8), rng.normal(0.0, 1.0, 40)
    new[20:] -= 3.0
    chart = charted(known, new, 1000.0, is_two_sided=True)
    assert chart.alarm_at is not None
    assert 20 <= chart.alarm_at <= 26
    # chance may begin the sum a run or two earlier
    assert chart.changed_at in {18, 19, 20}
    assert charted(known, new, 1000.0, is_two_sided=False).alarm_at is None


def test_one_wild_run_is_no_alarm():
    known = np.random.default_rng(3).normal(0.0, 1.0, 20)
    chart = charted(known, np.r_[1000.0, known[:5]], 1000.0, is_two_sided=True)
    assert chart.alarm_at is None
    assert chart.highest == pytest.approx(LARGEST_DEVIATE - 0.5)


def test_values_that_are_all_alike():
    assert deviates(np.ones(3), np.ones(2)) == pytest.approx(0.0)
    assert deviates(np.ones(3), np.array([0.9])) == pytest.approx(-LARGEST_DEVIATE)
