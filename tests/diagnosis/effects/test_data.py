"""Faults of recorded responses: each put into a recording is found again with its size, place and words."""

from __future__ import annotations

import dataclasses
import re

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from selector.diagnosis.comparison import Comparison
from selector.diagnosis.effects.catalogue import effect_of
from selector.diagnosis.effects.data.stuck import frozen_stretches
from selector.diagnosis.effects.effect import Fitted
from selector.diagnosis.evidence.frozen import frozen_responses
from selector.diagnosis.shapes.signals import rise
from selector.recording import Channel
from tests.work import counted_calls

IDS = ("data.clock", "data.drift", "data.gain", "data.step", "data.stuck", "data.swapped", "data.zero")
N, STEP_S = 400, 30.0
RUNS = ("r1", "r2", "r3")


def course(run, scale=1.0, phase=0.0):
    """Heating and cooling [µm], other in each run."""
    t = np.arange(N) * STEP_S
    duty = np.sin(2 * np.pi * t / (3000.0 + 800.0 * run) + phase) > -0.2
    x = np.zeros(N)
    for k in range(1, N):
        x[k] = x[k - 1] + STEP_S / 1500.0 * (30.0 * scale * duty[k] - x[k - 1])
    return x


def comparison_with(fault, *, noise_um=0.3, runs=RUNS, held_out=-1, seed=0):
    """`fault` (name, run number, time_s, true course) → recorded course."""
    random = np.random.default_rng(seed)
    time_s = np.tile(np.arange(N) * STEP_S, len(runs))
    simulated = {
        "Z": np.concatenate([course(k) for k in range(len(runs))]),
        "Y": np.concatenate([course(k, -0.4, 2.0) for k in range(len(runs))]),
    }
    recorded = {}
    for name, values in simulated.items():
        faulty = [fault(name, k, time_s[:N], simulated, slice(k * N, (k + 1) * N)) for k in range(len(runs))]
        noise = random.normal(scale=noise_um, size=len(values))
        parts = []
        for k, part in enumerate(faulty):
            rows = slice(k * N, (k + 1) * N)
            noisy = (values[rows] if part is None else part) + np.where(np.isnan(noise[rows]), 0.0, noise[rows])
            parts.append(np.round(noisy, 2))
        recorded[name] = np.concatenate(parts)
    return Comparison(
        runs=runs,
        starts=tuple(N * k for k in range(len(runs) + 1)),
        time_s=time_s,
        channels=(Channel("Z", "displacement", "um"), Channel("Y", "displacement", "um")),
        recorded=recorded,
        simulated=simulated,
        responses=("Z", "Y"),
        held_out=np.repeat(np.arange(len(runs)), N) == (held_out % len(runs) if held_out is not None else -1),
        resolution={"Z": 0.01, "Y": 0.01},
    )


def best_fit(effect_id, comparison, response):
    """The shape that leaves least beside offset, gain and delay, as the search would find it in white noise."""
    effect = effect_of(effect_id)
    y, x = comparison.difference(response), comparison.simulated[response]
    fit = ~comparison.held_out & np.isfinite(y)
    nuisance = np.column_stack([np.ones(len(y)), x, -np.gradient(x)])
    best = None
    for variant in effect.variants(comparison, response):
        assert np.isfinite(variant.columns).all()
        if not np.any(variant.columns[fit]):
            continue
        design = np.column_stack([variant.columns, nuisance])[fit]
        beta, _, rank, _ = np.linalg.lstsq(design, y[fit], rcond=1e-9)
        if rank < design.shape[1]:
            continue
        k = variant.columns.shape[1]
        if variant.bounds and any(
            not low <= b <= high for b, (low, high) in zip(beta[:k], variant.bounds, strict=True)
        ):
            continue
        left = float(np.sum((y[fit] - design @ beta) ** 2))
        if best is None or left < (1.0 - 1e-9) * best[0]:
            error = np.sqrt(np.diag(np.linalg.inv(design.T @ design)) * left / fit.sum())[:k]
            best = left, variant, beta[:k], error
    if best is None:
        return None
    left, variant, beta, error = best
    amount = variant.columns @ beta
    fitted = Fitted(
        response, "um", variant, beta, error, {}, float(np.sqrt(np.mean(amount**2))), float(np.abs(amount).max())
    )
    return left / fit.sum(), variant, effect.reading(fitted, comparison)


def none(*_):
    return None


def only(channel, run, change):
    def fault(name, k, time_s, simulated, rows):
        return change(time_s, simulated[name][rows]) if name == channel and (run is None or k in run) else None

    return fault


def holds(quantity, value):
    """The 95 % interval, twice as wide so that one test in thousands fails, contains the value."""
    middle, half = 0.5 * (quantity.low + quantity.high), quantity.high - quantity.low
    assert abs(value - middle) <= half, (quantity, value)


# 0.3 µm of noise leaves 0.09 µm²; a shape on a grid may leave a little more
LEFT = 0.09 * 1.25


def test_a_zero_in_one_run():
    found = best_fit("data.zero", comparison_with(only("Z", {1}, lambda _, x: x + 2.0)), "Z")
    assert found[0] < LEFT
    assert found[1].run == "r2"
    holds(found[2].parameters["zero"], 2.0)
    assert re.fullmatch(r"Z .* 2\S* µm .*high.* r2\.", found[2].statement)


def test_of_two_runs_the_odd_one_is_named():
    for run in (0, 1):
        for effect, change, key, value in (
            ("data.zero", lambda _, x: x - 3.0, "zero", -3.0),
            ("data.gain", lambda _, x: 1.3 * x, "gain", 1.3),
            ("data.clock", lambda t, x: np.interp(t - 90.0, t, x), "shift_s", 90.0),
        ):
            found = best_fit(effect, comparison_with(only("Z", {run}, change)), "Z")
            assert found[1].run == RUNS[run], effect
            # the clock's shift is read from a first-order term and a grid: a tenth is enough to know it
            assert found[2].parameters[key].value == pytest.approx(value, rel=0.1)


@pytest.mark.parametrize("factor", [25.4, 1 / 25.4, 1.8, 2.0, 1000.0, -1.0])
def test_factors_between_units_are_recognised(factor):
    found = best_fit("data.gain", comparison_with(only("Z", {0}, lambda _, x: factor * x)), "Z")
    holds(found[2].parameters["gain"], factor)
    assert "known" in found[2].statement
    plain = best_fit("data.gain", comparison_with(only("Z", {0}, lambda _, x: 1.13 * x)), "Z")
    assert "known" not in plain[2].statement


@pytest.mark.parametrize("shift_s", [-60.0, 45.0, 300.0, 900.0, -1500.0])
def test_a_clock_shifted_in_one_run(shift_s):
    change = only("Z", {1}, lambda t, x: np.interp(t - shift_s, t, x))
    found = best_fit("data.clock", comparison_with(change, held_out=None), "Z")
    # grid of shifts: a tenth
    assert found[2].parameters["shift_s"].value == pytest.approx(shift_s, rel=0.12)
    assert found[1].run == "r2"
    assert ("late" if shift_s > 0 else "early") in found[2].statement


def test_a_clock_that_jumps():
    change = only("Z", {0}, lambda t, x: np.interp(np.where(t >= 6000.0, t - 240.0, t), t, x))
    found = best_fit("data.clock", comparison_with(change), "Z")
    assert found[1].run == "r1"
    # 12 moments in 12000 s
    assert abs(found[1].shape["from_s"].value - 6000.0) <= 1000.0
    assert found[2].parameters["shift_s"].value == pytest.approx(240.0, rel=0.2)


def test_a_clock_of_another_rate():
    change = only("Z", None, lambda t, x: np.interp(0.98 * t, t, x))
    found = best_fit("data.clock", comparison_with(change), "Z")
    # first order in 2 %
    assert found[2].parameters["rate_error"].value == pytest.approx(0.02, rel=0.1)
    assert "too fast" in found[2].statement


def test_a_drift_from_a_moment_on():
    change = only("Z", {1}, lambda t, x: x + 4.0 * np.maximum(t - 5000.0, 0.0) / 3600.0)
    found = best_fit("data.drift", comparison_with(change), "Z")
    assert found[1].run == "r2"
    # eight starts in 12000 s
    assert abs(found[1].shape["from_s"].value - 5000.0) <= 1500.0
    # a start that is off by a tenth of the run changes the slope by a quarter
    assert found[2].parameters["drift"].value == pytest.approx(4.0, rel=0.25)
    assert "K/h" not in found[2].statement


@settings(max_examples=15)
@given(moment=st.integers(30, 370), size=st.sampled_from([-3.0, 2.0, 8.0]), run=st.integers(0, 1))
def test_a_jump_at_any_moment(moment, size, run):
    change = only("Z", {run}, lambda _, x: x + size * (np.arange(N) >= moment))
    found = best_fit("data.step", comparison_with(change), "Z")
    assert found[1].run == RUNS[run]
    # a moment every 10 samples
    assert abs(found[1].shape["from_s"].value - moment * STEP_S) <= 10.5 * STEP_S
    # of the rows after a jump, those between it and the next moment of the grid are not in the fitted step
    assert found[2].parameters["step"].value == pytest.approx(size, rel=0.1 + 10.0 / (N - moment))
    quantity = found[2].parameters["from_s"]
    assert quantity.low <= quantity.value <= quantity.high


def test_a_frozen_stretch():
    def freeze(_, x):
        x = x.copy()
        x[150:220] = np.nan
        return x

    comparison = comparison_with(only("Z", {1}, freeze))
    held = comparison.recorded["Z"].copy()
    held[np.isnan(held)] = held[N + 149]
    comparison.recorded["Z"] = held
    assert [(run, first - N, last - N) for run, first, last in frozen_stretches(comparison, "Z")] == [("r2", 149, 219)]
    sure = frozen_responses(comparison)
    assert [(one.id, one.channel, one.run, one.from_s, one.to_s) for one in sure] == [
        ("data.stuck", "Z", "r2", 149 * STEP_S, 219 * STEP_S)
    ]
    mean_square, variant, reading = best_fit("data.stuck", comparison, "Z")
    assert mean_square < LEFT
    assert variant.run == "r2"
    assert variant.shape["to_s"].value == 219 * STEP_S
    assert " µm in run r2" in reading.statement
    assert " µm for " in sure[0].statement
    assert effect_of("data.stuck").testable(comparison, "Y") is not None
    # 23.6 °C, which is off by 17 K
    of_heat = [dataclasses.replace(one, role="temperature", unit="degC", axis=None) for one in comparison.channels]
    warm = dataclasses.replace(comparison, channels=tuple(of_heat))
    assert " °C in run r2" in best_fit("data.stuck", warm, "Z")[2].statement
    assert " °C for " in frozen_responses(warm)[0].statement


@pytest.mark.parametrize(("stands", "frozen"), [(5, 5), (9, 0)])
def test_a_channel_that_stands_more_than_twice_a_run_dwells_by_nature(stands, frozen):
    comparison = comparison_with(only("Z", None, lambda _, x: x))
    for first in np.arange(10, 10 + 100 * stands, 100):
        comparison.recorded["Z"][first : first + 40] = comparison.recorded["Z"][first]
    assert len(frozen_stretches(comparison, "Z")) == frozen


@pytest.mark.parametrize(("early", "frozen"), [(4, 0), (40, 1)])
def test_a_start_that_the_simulation_makes_a_little_early_freezes_no_sensor(early, frozen):
    """A reading in whole counts that rests, while the simulation moves in the last rows of it or in most of them."""
    comparison = comparison_with(only("Z", None, lambda _, x: x))
    z = comparison.recorded["Z"]
    rows = slice(100, 146)
    z[rows] = z[rows][0]
    simulated = comparison.simulated["Z"].copy()
    simulated[rows] = simulated[rows][0]
    simulated[146 - early : 146] += np.linspace(0.0, 10.0 * np.ptp(simulated), early)
    counted = dataclasses.replace(
        comparison, simulated=comparison.simulated | {"Z": simulated}, resolution={**comparison.resolution, "Z": 1.0}
    )
    assert len(frozen_stretches(counted, "Z")) == frozen


@pytest.mark.parametrize(("early", "frozen"), [(3, 0), (40, 1)])
def test_a_speed_that_is_0_until_it_follows_a_little_late_is_at_rest(early, frozen):
    """Noise is gone meanwhile, as of a machine that stands; the simulation starts in the last rows, or goes on."""
    comparison = comparison_with(only("Z", None, lambda _, x: x), noise_um=0.3)
    rows, simulated = slice(100, 146), comparison.simulated["Z"].copy()
    comparison.recorded["Z"][rows] = 0.0
    simulated[rows] = 0.0
    simulated[146 - early : 146] = np.linspace(0.0, 0.9 * np.ptp(simulated), early)
    speeds = [dataclasses.replace(one, role="velocity", unit="m/s") for one in comparison.channels]
    moving = dataclasses.replace(comparison, channels=tuple(speeds), simulated=comparison.simulated | {"Z": simulated})
    assert len(frozen_stretches(moving, "Z")) == frozen


def test_readings_that_return_to_a_limit_are_not_frozen():
    comparison = comparison_with(only("Z", None, lambda _, x: x), noise_um=0.001)
    comparison.recorded["Z"] = np.minimum(comparison.recorded["Z"], 15.0)
    assert frozen_stretches(comparison, "Z") == []


@pytest.mark.parametrize("resolution", [0.001, 0.1, 1.0])
def test_nothing_is_frozen_in_normal_readings(resolution):
    for seed in range(5):
        comparison = comparison_with(none, noise_um=0.3, seed=seed)
        comparison.recorded["Z"] = resolution * np.round(comparison.recorded["Z"] / resolution)
        comparison = Comparison(**{**vars(comparison), "resolution": {"Z": resolution, "Y": 0.01}})
        assert frozen_stretches(comparison, "Z") == []
        assert frozen_responses(comparison) == ()


def test_channels_that_changed_places():
    def swap(name, k, time_s, simulated, rows):
        return simulated["Y" if name == "Z" else "Z"][rows] if k >= 1 else None

    comparison = comparison_with(swap)
    for response, other in (("Z", "Y"), ("Y", "Z")):
        mean_square, variant, reading = best_fit("data.swapped", comparison, response)
        assert mean_square < LEFT
        assert variant.sources == (response, other)
        assert "changed places" in reading.statement


def test_temperatures_that_changed_places_before_the_simulation_read_them():
    comparison = comparison_with(none)
    names, time = ["T1", "T2"], comparison.time_s
    courses = {"T1": 20.0 + 5.0 * (1.0 - np.exp(-time / 900.0)), "T2": 20.0 + 2.0 * np.sin(time / 700.0) ** 2}
    index = comparison.run_index == comparison.runs.index(comparison.runs[0])
    read = {own: np.where(index, courses[other], courses[own]) for own, other in (names, names[::-1])}
    weights = dict(zip(names, (3.0, -1.0), strict=True))
    simulated, true = (sum(weights[name] * rise(comparison, one[name]) for name in names) for one in (read, courses))
    noise = 0.01 * np.random.default_rng(0).normal(size=len(time))
    changed = dataclasses.replace(
        comparison,
        channels=(*comparison.channels, *(Channel(name, "temperature", "degC") for name in names)),
        recorded={**comparison.recorded, **read, "Z": true + noise},
        simulated={**comparison.simulated, "Z": simulated},
    )
    mean_square, variant, reading = best_fit("data.swapped", changed, "Z")
    assert mean_square < LEFT
    assert (set(variant.sources), variant.run) == (set(names), comparison.runs[0])
    assert all(name in reading.statement for name in names)
    assert reading.parameters["share"].value == pytest.approx(1.0, abs=0.05)


def test_an_effect_that_is_not_there_gains_nothing():
    comparison = comparison_with(none)
    y = comparison.difference("Z")[~comparison.held_out]
    for effect in IDS:
        found = best_fit(effect, comparison, "Z")
        # the best of up to 200 shapes with one coefficient each gains about 2·ln 200 = 11 noise variances of 800
        assert found is None or found[0] > np.var(y) * (1 - 25 / 800), effect


def test_single_runs_have_no_odd_one():
    comparison = comparison_with(none, runs=("r1",), held_out=None)
    for effect in ("data.zero", "data.gain"):
        assert {variant.run for variant in effect_of(effect).variants(comparison, "Z")} == {None}
    assert all(variant.run in (None, "r1") for variant in effect_of("data.clock").variants(comparison, "Z"))


def test_all_shapes_of_many_runs_are_few_and_cheap():
    comparison = comparison_with(none, runs=tuple(f"r{k}" for k in range(12)))
    with counted_calls() as calls:
        counts = {effect: len(list(effect_of(effect).variants(comparison, "Z"))) for effect in IDS}
    # of 14 400 rows; three times the calls that it takes
    assert calls.count < 200_000
    assert max(counts.values()) <= 220, counts


def test_every_effect_says_what_it_is():
    for id_ in IDS:
        effect = effect_of(id_)
        assert effect.family == "data"
        assert all((effect.title, effect.physics, effect.reference, effect.refuted_by, effect.experiment, effect.needs))
        assert effect.enters == "measurement"
