"""The chart of a model's errors: exact while nothing changes, quick where something does."""

import numpy as np
import pytest

from selector.fleet.watching import LARGEST_DEVIATE, alarm_limit, charted, deviates


def test_deviates_are_standard_normal_however_few_values_are_known():
    rng = np.random.default_rng(0)
    # 4 000 charts of seven values, of any mean and spread
    found = np.array([deviates(rng.normal(7.0, 3.0, 9)) for _ in range(4000)])
    # standard errors: 0.016 of a mean, 0.011 of a standard deviation, 0.016 of a correlation; four of them
    assert np.abs(found.mean(axis=0)).max() < 0.064
    # ranks among few have no tails: their part makes the deviates a little small
    assert np.abs(found.std(axis=0) - 0.97).max() < 0.075
    assert np.abs(np.corrcoef(found.T) - np.eye(7)).max() < 0.064


@pytest.mark.parametrize(
    "errors",
    [
        lambda rng, n: np.hypot(rng.normal(0.0, 0.5, n), 0.4),
        lambda rng, n: np.hypot(rng.standard_t(3.0, n) * 0.5, 0.4),
        lambda rng, n: np.hypot(rng.normal(0.0, 0.5, n) * np.where(rng.random(n) < 0.3, 3.0, 0.5), 0.4),
        lambda rng, n: np.exp(rng.exponential(size=n)),
    ],
    ids=["usual", "heavy tails", "idle and hard days", "skewed"],
)
def test_false_alarms_of_the_size_of_errors_whatever_their_distribution(errors):
    rng = np.random.default_rng(4)
    one_year, years = 365, 400
    sizes = [np.log(errors(rng, 8 + one_year)) for _ in range(years)]
    found = sum(charted(one[:8], one[8:], 9000.0, is_two_sided=False).alarm_at is not None for one in sizes)
    # made for 365 of 9000; three standard errors of a count of 16 above
    assert found <= one_year / 9000.0 * years + 3.0 * 4.0


def alike(rng: np.random.Generator, like: float, n: int) -> np.ndarray:
    values = rng.normal(size=n)
    for i in range(1, n):
        values[i] = like * values[i - 1] + (1.0 - like**2) ** 0.5 * values[i]
    return values


@pytest.mark.parametrize("like", [0.3, 0.6, 0.8])
def test_runs_that_are_like_the_one_before_are_no_change(like):
    rng = np.random.default_rng(5)
    years = [alike(rng, like, 373) for _ in range(100)]
    alarms = sum(charted(one[:8], one[8:], 9000.0, is_two_sided=True).alarm_at is not None for one in years)
    # at most one a year in the mean is 63 of 100 years with an alarm; taken as independent, they had one in all
    assert alarms < 63


def test_likeness_that_costs_the_promise_is_told_and_no_other():
    rng = np.random.default_rng(6)

    def told(like, shift=0.0):
        years = [alike(rng, like, 258) for _ in range(40)]
        for one in years:
            one[100:] += shift
        return sum(charted(one[:8], one[8:], 9000.0, is_two_sided=True).alike > 0.9 for one in years)

    # a run tells of likeness what it does to deviates: of 0.95 half of the years show it
    assert told(0.95) > 10
    assert told(0.6) == 0
    # a change that stays is no likeness
    assert told(0.0, shift=3.0) == 0


def test_large_errors_that_follow_large_ones_are_no_change_of_size():
    rng = np.random.default_rng(8)
    alarms = 0
    for _ in range(200):
        mean_um = alike(rng, 0.9, 373)
        # a model has learnt the mean of its eight days
        sizes = np.log(np.hypot(0.5 * (mean_um - mean_um[:8].mean()), 0.2))
        alarms += charted(sizes[:8], sizes[8:], 9000.0, is_two_sided=False).alarm_at is not None
    # 72 of 200 years; 110 while small errors had their say about what follows large ones
    assert alarms < 90


def test_a_change_of_size_is_found_among_skewed_errors():
    rng = np.random.default_rng(6)
    sizes = np.hypot(rng.standard_t(3.0, 100) * 0.5, 0.4)
    sizes[60:] *= 3.0
    chart = charted(np.log(sizes[:8]), np.log(sizes[8:]), 9000.0, is_two_sided=False)
    assert chart.alarm_at is not None
    # fifteen runs after the change that it finds; eleven while what follows small errors counted for large ones, too
    assert 52 <= chart.alarm_at <= 67


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
    assert 2.0 < chart.highest <= LARGEST_DEVIATE - 0.5


@pytest.mark.parametrize("known", [6, 8, 20])
def test_runs_that_are_wild_one_after_the_other_are_no_measure_of_each_other(known):
    rng = np.random.default_rng(7)
    sizes = rng.normal(0.0, 0.25, (100, known + 4))
    sizes[:, known:] += np.log(50.0)
    found = [charted(one[:known], one[known:], 9000.0, is_two_sided=False).alarm_at for one in sizes]
    # when the second was judged among the first, as it was before, none of a hundred after six or eight
    assert sum(at is not None for at in found) >= 90
    # from one alone is learnt, as ever: the next such run is less of a surprise
    first, _, second = deviates(np.r_[sizes[0, :known], 50.0, 0.0, 50.0])[-3:]
    assert second < first - 0.2


def test_values_that_are_all_alike():
    assert deviates(np.ones(5)) == pytest.approx(0.0)
    assert deviates(np.r_[np.ones(3), 0.9])[-1] < -0.8 * LARGEST_DEVIATE
