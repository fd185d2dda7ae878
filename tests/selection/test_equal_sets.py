"""Every set that is about as good: nothing is missed, and it comes back from its result."""

from __future__ import annotations

import itertools
import json

import pytest

from selector.selection import Options, select
from selector.selection.exploration import Exploration
from selector.selection.result_file import selection_of
from tests.selection.machines import SENSORS, linear, machine


@pytest.mark.parametrize("within", [None, 0.3])
def test_all_sets_of_the_size_within_the_margin_are_listed_and_no_other(within):
    source = machine(second=lambda truth: 3.0 * truth["column"] + truth["air"], n=120)
    found = select(source, Options(max_sensors=3, within=within))
    explored, size = Exploration.of(source), len(found.chosen)
    errors = {
        sensors: tuple(explored.fixed(sensors).models[name].heldout_rmse_um for name in found.models)
        for sensors in itertools.combinations(SENSORS, size)
    }
    assert found.equal is not None
    assert found.equal.n_compared == len(errors)
    spread = [explored.fixed(SENSORS).models[name] for name in found.models]
    power = [one.rmse_um**2 / (1.0 - one.r2) for one in spread]

    def relative(of_set):
        return sum(error**2 / p for error, p in zip(of_set, power, strict=True))

    best = min(errors.values(), key=relative)
    if within is None:
        expected = {sensors for sensors, one in errors.items() if relative(one) <= 1.05**2 * relative(best)}
    else:
        expected = {
            sensors for sensors, one in errors.items() if all(e <= b + within for e, b in zip(one, best, strict=True))
        }
    assert {one.sensors for one in found.equal.sets} == expected
    assert found.equal.n_equal == len(expected)
    for one in found.equal.sets:
        assert one.heldout_rmse_um == pytest.approx(errors[one.sensors], rel=1e-6)


def test_sets_that_must_hold_a_sensor_all_hold_it():
    found = select(machine(n=120), Options(max_sensors=2, must=("T7",), within=5.0))
    assert found.equal is not None
    assert found.equal.n_compared in (1, 6)
    assert all("T7" in one.sensors for one in found.equal.sets)


def test_sets_with_lags_are_listed_and_come_back_from_a_result():
    found = select(machine(lambda truth: linear(truth) + 9.0 * truth["hidden"], n=160), Options(memory=True))
    assert found.recipe.shape.has_memory
    assert found.equal is not None
    document = json.loads(json.dumps(found.as_dict()))
    assert selection_of(document).as_dict()["equal_sets"] == document["equal_sets"]
