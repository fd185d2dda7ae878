"""Day-to-day regimes: found when planted, and hardly ever when not."""

from __future__ import annotations

import numpy as np
import pytest

from selector.selection import Options, select
from selector.selection.doubts import regimes
from tests.selection.machines import found_ids, machine, one_finding


def test_scatter_from_day_to_day_is_no_regime():
    """Promised: 1 %. Of 36 series of 12 days at 1 %, more than 2 alarms would have a chance of 0.5 %."""
    alarms = sum(
        len(regimes(np.random.default_rng(seed).normal(size=12), 0)[0]) > 1 for seed in range(26)
    )  # fmt: skip
    heavy = sum(
        len(regimes(np.random.default_rng(seed).standard_t(2, size=12), 0)[0]) > 1 for seed in range(10)
    )  # fmt: skip
    assert alarms + heavy <= 2


def test_a_shift_of_five_deviations_is_found_where_it_is():
    places = []
    for seed in range(10):
        values = np.random.default_rng(seed).normal(size=16) + 5.0 * (np.arange(16) >= 7)
        bounds, p_value, explained = regimes(values, 0)
        places.append(bounds[1][0] if len(bounds) > 1 else None)
        assert len(bounds) > 1
        assert p_value <= 0.01
        assert explained > 0.5
    # a single day next to the change may go to either side
    assert sum(place in (6, 7, 8) for place in places) >= 9


def test_three_regimes_and_seldom_more():
    exact = more = 0
    for seed in range(12):
        scatter = np.random.default_rng(seed).normal(0, 0.5, 18)
        bounds = regimes(np.r_[np.zeros(6), np.full(6, 10.0), np.full(6, -5.0)] + scatter, 0)[0]
        exact += bounds == [(0, 6), (6, 12), (12, 18)]
        more += len(bounds) > 3
        # an extra cut may come in, but none of the true ones is missed
        assert {6, 12} <= {stop for _, stop in bounds}
    assert exact >= 8  # 82 % in 40 seeds
    assert exact + more == 12


def test_a_single_odd_day_is_no_regime():
    values = np.random.default_rng(3).normal(size=12)
    values[5] += 50.0
    assert regimes(values, 0)[0] == [(0, 12)]


@pytest.mark.parametrize("values", [np.arange(5.0), np.zeros(20)], ids=["too few days", "no scatter"])
def test_nothing_to_find(values):
    assert regimes(values, 0) == ([(0, len(values))], 1.0, 0.0)


def test_the_answer_does_not_depend_on_luck():
    values = np.random.default_rng(0).normal(size=14) + 4.0 * (np.arange(14) >= 7)
    assert {len(regimes(values, seed)[0]) for seed in range(5)} == {2}


def test_a_change_of_the_machine_half_way_is_a_finding():
    day = iter(range(100))

    def law(truth):
        """From the ninth day on another tool: the same heat moves it a third further."""
        return (6.0 if next(day) < 8 else 8.0) * truth["spindle"] - 4.0 * truth["column"]

    selection = select(machine(law, n_runs=16, n=80), Options(max_sensors=2))
    finding = one_finding(selection, "regimes")
    runs = [regime["runs"] for regime in finding.evidence["regimes"]]
    assert runs == [[f"day{i}" for i in range(1, 9)], [f"day{i}" for i in range(9, 17)]]
    assert finding.where.channel == "Z"


def test_the_same_machine_all_days_has_no_regimes():
    assert "regimes" not in found_ids(select(machine(n_runs=12, n=80), Options(max_sensors=2)))
