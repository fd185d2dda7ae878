"""The meaning of the file, and its fast twin."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from selector.controllers import evaluator
from selector.controllers.evaluator import evaluate, evaluate_after
from selector.controllers.model_file import Input, ModelFile, Output, State, Term
from selector.errors import RecordingError
from selector.models.design import lagged
from tests.controllers.model_builders import rich_model, rise_model, warm_up
from tests.controllers.stepwise import Evaluator
from tests.work import counted_calls


def stepwise(model, time_s, readings, start=None, positions=None):
    machine = Evaluator(model, start)
    rows = [
        machine.step(
            float(t),
            {name: float(values[k]) for name, values in readings.items()},
            None if positions is None else {axis: float(values[k]) for axis, values in positions.items()},
        )
        for k, t in enumerate(time_s)
    ]
    return {output.name: np.array([row[output.name] for row in rows]) for output in model.outputs}


def same_bits(one, other):
    return all(np.array_equal(one[name], other[name], equal_nan=True) for name in one) and one.keys() == other.keys()


def lag_model(tau_s: float = 600.0, **changes) -> ModelFile:
    return ModelFile(
        name="lag",
        inputs=(Input(name="T1", valid_min=0, valid_max=10, **changes),),
        states=(State(name="s", source="T1", tau_s=tau_s),),
        outputs=(Output(name="Z", intercept=0, terms=(Term(powers={"s": 1}, coefficient=1),)),),
    )


def test_value_by_hand():
    # T1: x = 6, z = 1; T3: x = 0, z = −2; Z = 1 + 3·1 − 2·(−2) + 0.5·1·(−2) = 7, exact in binary
    start = {"T1": 20.0, "T3": 21.0}
    assert Evaluator(rise_model(), start).step(0.0, {"T1": 26.0, "T3": 21.0}) == {"Z": 7.0}


def test_first_reading_is_the_start():
    machine = Evaluator(rise_model())
    first = machine.step(0.0, {"T1": 31.0, "T3": 18.0})["Z"]
    # x = 0: z1 = −2, z3 = −2; Z = 1 − 6 + 4 + 2 = 1
    assert first == 1.0
    assert machine.step(60.0, {"T1": 37.0, "T3": 18.0})["Z"] == 7.0


def test_powers_are_repeated_multiplication():
    z = 0.1
    model = ModelFile(
        name="cube",
        inputs=(Input(name="T1", reference="absolute", valid_min=0, valid_max=1),),
        outputs=(Output(name="Z", intercept=0.0, terms=(Term(powers={"T1": 3}, coefficient=0.7),)),),
    )
    assert Evaluator(model).step(0.0, {"T1": z})["Z"] == ((0.7 * z) * z) * z


def test_position_dependent_part_is_zero_at_its_reference():
    model = rich_model()
    readings = {"T1": 25.0, "T амб": 22.0, "n": 1200.0}
    at_reference = Evaluator(model, {"T1": 20.0}).step(0.0, readings, {"Y": 0.25})
    assert at_reference == Evaluator(model, {"T1": 20.0}).step(0.0, readings)
    away = Evaluator(model, {"T1": 20.0}).step(0.0, readings, {"Y": 0.5})
    slope = 3.0 + 7.7 * ((5.0 - 4.1) / 2.3)
    assert away["Y lower"] == at_reference["Y lower"] + slope * 0.25
    assert away["Z"] == at_reference["Z"]


def test_lag_approaches_the_exponential_as_the_step_shrinks():
    """First order: halving the step halves the error against 1 − exp(−t/τ)."""
    errors = []
    for step_s in (20.0, 10.0, 5.0):
        time_s = np.arange(0.0, 3000.0 + step_s, step_s)
        readings = {"T1": np.where(time_s > 0.0, 21.0, 20.0)}
        y = evaluate(lag_model(), time_s, readings)["Z"]
        errors.append(np.max(np.abs(y - (1.0 - np.exp(-time_s / 600.0)))))
    assert errors[0] < 0.02  # (dt/τ)/2 = 0.017
    # second-order terms are dt/τ = 3 % of the first-order ones
    assert errors[0] / errors[1] == pytest.approx(2.0, rel=0.05)
    assert errors[1] / errors[2] == pytest.approx(2.0, rel=0.05)


def test_lag_is_stable_for_any_step():
    y = evaluate(lag_model(tau_s=1.0), np.array([0.0, 1e6, 2e6, 9e9]), {"T1": np.array([20.0, 30.0, 10.0, 25.0])})["Z"]
    assert np.all(y >= -10.0)
    assert np.all(y <= 10.0)
    # a step of 1e6 τ leaves a share 1e-6 of the old value; 20 K at most
    assert y[1:] == pytest.approx([10.0, -10.0, 5.0], abs=2.1e-5)


def test_lag_starts_at_the_first_value_not_at_zero():
    time_s = np.arange(5) * 60.0
    y = evaluate(lag_model(reference="absolute"), time_s, {"T1": np.full(5, 23.5)})["Z"]
    assert np.all(y == 23.5)


def test_exported_memory_is_the_fitted_memory():
    """The lag that a model is fitted with and the lag of its file are the same bits."""
    rng = np.random.default_rng(1)
    time_s = np.cumsum(rng.uniform(0.5, 90.0, 3000))
    x = rng.normal(5.0, 3.0, 3000)
    fitted, _, _ = lagged(x[:, None], time_s, np.array([600.0]), np.array([np.nan]), np.array([np.nan]))
    exported = evaluate(lag_model(reference="absolute"), time_s, {"T1": x})["Z"]
    assert np.array_equal(exported, fitted[:, 0])


def test_missing_readings():
    time_s = np.array([0.0, 60.0, 120.0, 180.0, 240.0])
    readings = {"T1": np.array([np.nan, 20.0, np.inf, 26.0, 24.0]), "T3": np.array([20.0, 20.0, 20.0, np.nan, 20.0])}
    y = evaluate(rise_model(), time_s, readings)["Z"]
    # the start of T1 is its first finite reading
    assert np.isnan(y).tolist() == [True, False, True, True, False]
    assert y[1] == 1.0


def test_memory_waits_and_then_counts_the_whole_gap():
    time_s = np.array([0.0, 60.0, 120.0, 180.0])
    with_gap = evaluate(lag_model(), time_s, {"T1": np.array([20.0, np.nan, np.nan, 26.0])})["Z"]
    without = evaluate(lag_model(), time_s[[0, 3]], {"T1": np.array([20.0, 26.0])})["Z"]
    assert np.isnan(with_gap[1:3]).all()
    assert with_gap[[0, 3]].tolist() == without.tolist()
    assert without[1] == 6.0 * (180.0 / 780.0)


def test_an_output_does_not_suffer_from_a_sensor_that_it_does_not_use():
    model = rich_model()
    readings = {"T1": np.full(3, np.nan), "T амб": np.full(3, 22.0), "n": np.full(3, 900.0)}
    y = evaluate(model, np.arange(3.0), readings)
    assert np.isnan(y["Z"]).all()
    assert np.isfinite(y["Y lower"]).all()


@settings(max_examples=30)
@given(st.integers(0, 2**32 - 1), st.integers(1, 120), st.booleans(), st.booleans())
def test_blocks_give_the_same_bits_as_single_steps(seed, n, given_start, with_positions):
    """Bit-equal: the same operations in the same order, nothing is reassociated or fused."""
    rng = np.random.default_rng(seed)
    time_s = np.cumsum(rng.uniform(0.01, 500.0, n))
    readings = {
        "T1": rng.normal(25.0, 5.0, n),
        "T амб": rng.normal(22.0, 2.0, n),
        "n": rng.choice([0.0, 1500.0, 3000.0], n),
    }
    for values in readings.values():
        values[rng.random(n) < 0.15] = rng.choice([np.nan, np.inf, -np.inf])
    start = {"T1": 19.3} if given_start else None
    positions = {"Y": rng.uniform(-0.1, 0.6, n)} if with_positions else None
    block = evaluator.BLOCK_SAMPLES
    try:
        evaluator.BLOCK_SAMPLES = 16  # so that short runs span several blocks
        fast = evaluate(rich_model(), time_s, readings, start, positions)
    finally:
        evaluator.BLOCK_SAMPLES = block
    assert same_bits(fast, stepwise(rich_model(), time_s, readings, start, positions))


def test_same_bits_over_a_long_run_with_real_blocks():
    n = 2 * evaluator.BLOCK_SAMPLES + 7
    rng = np.random.default_rng(3)
    time_s = np.arange(n) * 2.0
    readings = {
        "T1": 20.0 + np.cumsum(rng.normal(0, 0.01, n)),
        "T амб": 22.0 + np.sin(time_s / 4e4),
        "n": rng.choice([0.0, 3000.0], n),
    }
    assert same_bits(evaluate(rich_model(), time_s, readings), stepwise(rich_model(), time_s, readings))


@settings(max_examples=30)
@given(st.lists(st.floats(), min_size=1, max_size=30), st.floats(allow_nan=False, allow_infinity=False))
def test_hostile_readings_give_the_same_bits_without_a_warning(values, coefficient):
    model = lag_model()
    terms = (Term(powers={"s": 3}, coefficient=coefficient), Term(powers={"T1": 2}, coefficient=1.0))
    model = model.model_copy(update={"outputs": (Output(name="Z", intercept=0, terms=terms),)})
    time_s = np.arange(len(values)) * 60.0
    readings = {"T1": np.array(values)}
    assert same_bits(evaluate(model, time_s, readings), stepwise(model, time_s, readings))


def test_intercept_alone_is_constant():
    model = rise_model(outputs=(Output(name="Z", intercept=4.5),))
    assert evaluate(model, *warm_up(5))["Z"].tolist() == [4.5] * 5


def test_fallback_is_evaluated_like_a_model():
    fallback = {"without": ["T3"], "inputs": rise_model().inputs[:1], "outputs": [{"name": "Z", "intercept": 2.5}]}
    model = ModelFile.model_validate(rise_model().model_dump() | {"fallbacks": [fallback]})
    time_s, readings = warm_up(4)
    assert evaluate(model.fallbacks[0], time_s, {"T1": readings["T1"]})["Z"].tolist() == [2.5] * 4


@pytest.mark.parametrize(
    ("time_s", "readings", "found"),
    [
        ([0.0, 1.0], {"T1": [1.0, 2.0]}, "no values of 'T3'"),
        ([0.0, 1.0], {"T1": [1.0, 2.0], "T3": [1.0]}, r"\(1,\) values of 'T3'"),
        ([0.0, 0.0], {"T1": [1.0, 2.0], "T3": [1.0, 2.0]}, "time that repeats"),
        ([0.0, math.nan], {"T1": [1.0, 2.0], "T3": [1.0, 2.0]}, "time that repeats"),
    ],
)
def test_unusable_arguments(time_s, readings, found):
    with pytest.raises(RecordingError, match=found):
        evaluate(rise_model(), time_s, readings)


def test_samples_of_37_sensors_are_evaluated_many_at_once():
    """A million take about a second: benchmarks/bench_promises.py."""
    n, names = 10**5, [f"T{i}" for i in range(1, 38)]
    model = ModelFile(
        name="37",
        inputs=[Input(name=name, valid_min=0, valid_max=10, centre=3, scale=2) for name in names],
        outputs=[Output(name="Z", intercept=1, terms=[Term(powers={name: 1}, coefficient=0.3) for name in names])],
    )
    column = np.random.default_rng(0).normal(25.0, 3.0, n)
    time_s = np.arange(n, dtype=np.float64)
    with counted_calls() as calls:
        result = evaluate(model, time_s, dict.fromkeys(names, column))["Z"]
    assert np.isfinite(result).all()
    assert calls.count < n / 10


def test_a_run_with_memory_of_another_begins_as_alone_and_is_computed_once(monkeypatch):
    model = lag_model()
    model = model.model_copy(update={"outputs": (model.outputs[0].model_copy(update={"reference": "rise"}),)})
    time_s, readings = warm_up()
    of = {"T1": np.r_[np.nan, np.nan, readings["T1"][2:]]}
    earlier, start = [(time_s - 20_000.0, {"T1": readings["T1"] + 3.0})], {"T1": 20.5}
    alone = evaluate(model, time_s, of, start)["Z"]
    follows = evaluate(model, time_s, of, start, None, earlier)["Z"]
    computed: list[int] = []
    plain = evaluator.evaluate
    monkeypatch.setattr(evaluator, "evaluate", lambda *given: computed.append(len(given[1])) or plain(*given))
    found = evaluate_after(model, earlier, time_s, of, start, None)["Z"]
    assert follows[2] != alone[2]
    assert np.array_equal(found, follows + (alone[2] - follows[2]), equal_nan=True)
    # and alone as far as its first sample with an answer
    assert computed == [len(time_s), 3]
