"""Every set that is about as good: nothing is missed, and it comes back from its result."""

from __future__ import annotations

import itertools
import json

import numpy as np
import pytest

from selector.selection import Options, select
from selector.selection.equal_sets import CHUNK
from selector.selection.exploration import Exploration
from selector.selection.result_file import selection_of
from tests.models.runs import recording
from tests.selection.machines import SENSORS, linear, machine


@pytest.mark.parametrize("chunk", [CHUNK, 2])
@pytest.mark.parametrize("within", [None, 0.3])
def test_all_sets_of_the_size_within_the_margin_are_listed_and_no_other(within, chunk, monkeypatch):
    monkeypatch.setattr("selector.selection.equal_sets.CHUNK", chunk)
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
    best = min(errors.values(), key=lambda one: sum(error**2 / p for error, p in zip(one, power, strict=True)))
    most = [1.05 * b if within is None else b + within for b in best]
    # what one displacement gains does not pay for what another loses
    expected = {sensors for sensors, one in errors.items() if all(np.array(one) <= most)}
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


@pytest.mark.parametrize("seed", range(4))
def test_the_best_set_for_all_responses_together_is_compared(seed):
    """Of every size, among all sets, by the mean of what is left of each response where it was fitted."""
    rng = np.random.default_rng(seed)
    names, mixing, law = [f"T{k}" for k in range(9)], rng.normal(size=(5, 9)), rng.normal(size=(5, 3))
    runs, rises, moved = {}, [], []
    for run in range(4):
        latent = np.vstack([np.zeros((8, 5)), rng.normal(size=(120, 5)).cumsum(axis=0)])
        sensors = latent @ mixing + rng.normal(0.0, 3.0, (128, 9)) * (np.arange(128) >= 8)[:, None]
        courses = latent @ law
        columns = dict(zip((*names, "X", "Y", "Z"), np.column_stack([sensors, courses]).T, strict=True))
        runs[f"r{run}"] = (np.arange(128.0), columns)
        rises.append(sensors)
        moved.append(courses)
    found = select(recording(runs), Options(responses=("X", "Y", "Z"), max_sensors=4))
    # of sets to take instead none loses in one response what it gains in another
    best = np.array(found.equal.sets[0].heldout_rmse_um)
    assert all((np.array(one.heldout_rmse_um) <= 1.05 * best).all() for one in found.equal.sets)
    design, responses = np.vstack(rises), np.vstack(moved)

    def left(of_set):
        columns = np.column_stack([np.ones(len(design)), design[:, of_set]])
        off = responses - columns @ np.linalg.lstsq(columns, responses, rcond=None)[0]
        return float((off.var(axis=0) / responses.var(axis=0)).sum())

    compared = {one.sensors for one in found.combinations}
    for size in range(1, 5):
        best = min(itertools.combinations(range(9), size), key=left)
        assert tuple(names[k] for k in best) in compared
