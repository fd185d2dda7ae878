"""The error of whole tests that were left out: from cold, with the zero of their start, as duty cycles have it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from selector.physics.thermal.modes import choice
from selector.physics.thermal.modes.heldout import LeftOutTests, few_factor, left_out_tests
from selector.physics.thermal.modes.thermal_test import ThermalTest
from selector.physics.thermal.prediction.prediction import predict
from tests.physics.thermal.segments import of_segments

TAU_S, GAIN_UM, EXPONENT = (1500.0, 7200.0), (9.0, 14.0), 1.3
SPEEDS = (5000.0, 1000.0, 2000.0, 3000.0, 4000.0)
CYCLE = of_segments((60.0, 3500.0), (40.0, 1500.0), (30.0, 0.0), (60.0, 4500.0))


def course_um(cycle, time):
    """Two modes from cold."""
    speed = cycle.speed_at(np.minimum(time, cycle.end_s - 1e-6)) / 5000.0
    state, found = np.zeros(2), np.zeros(len(time))
    kept = np.exp(-60.0 / np.array(TAU_S))
    for i, share in enumerate(speed):
        found[i] = state.sum()
        state = state * kept + share**EXPONENT * np.array(GAIN_UM) * (1.0 - kept)
    return found


def recorded(rng, *, scatter, noise_um=0.1, idle_min=10.0, speeds=SPEEDS):
    """Heating and cooling; the gain of each day is another one, and so is the zero of the gauge."""
    tests = []
    for k, speed in enumerate(speeds):
        cycle = of_segments(*([(idle_min, 0.0)] if idle_min else []), (240.0, speed), (180.0, 0.0))
        time = np.arange(0.0, cycle.end_s, 60.0)
        read = (1.0 + scatter * rng.normal()) * course_um(cycle, time) + rng.normal(0.0, noise_um, len(time))
        tests.append(ThermalTest(f"r{k}", time, cycle.speed_at(time), read[:, None] + rng.normal(0.0, 20.0)))
    return tests


def fitted(monkeypatch, tests):
    """The fit that was chosen, with its blocks."""
    kept = []
    finished = choice._finished
    monkeypatch.setattr(choice, "_finished", lambda *of: kept.append(of) or finished(*of))
    found = choice.choose_modes(tests, ("Z",))
    _, _, data, fit, _ = kept[-1]
    return found, data, fit


def test_a_test_of_another_gain_is_off_from_its_start_by_that_gain(monkeypatch):
    rng = np.random.default_rng(1)
    tests = recorded(rng, scatter=0.0, noise_um=0.02)
    odd = replace(tests[3], displacement_um=tests[3].displacement_um[0] + 1.1 * (
        tests[3].displacement_um - tests[3].displacement_um[0]
    ))  # fmt: skip
    found, _, _ = fitted(monkeypatch, [*tests[:3], odd, tests[4]])
    at = found.left_out.runs.index(3)
    moved = np.sqrt(np.mean((odd.displacement_um - odd.displacement_um[0]) ** 2))
    # a zero of its own would take half of it away; the zero of a single reading is known to 0.02 µm
    assert found.left_out.error_um[at, 0] == pytest.approx(moved * 0.1 / 1.1, rel=0.15)
    assert found.left_out.moved_um[at, 0] == pytest.approx(moved, rel=0.02)


def test_the_noise_of_the_gauge_is_no_error_of_the_prediction(monkeypatch):
    found, data, fit = fitted(monkeypatch, recorded(np.random.default_rng(2), scatter=0.0, noise_um=0.4, idle_min=0.0))
    left_out = left_out_tests(fit, data)
    assert (left_out.noise_um > 0.1).all()  # the zero of a start is known from a few readings only
    # what noise alone would explain is none of it, but what it hides may be
    assert 0.0 < left_out.rmse_um[0] < np.sqrt(np.mean(left_out.noise_um**2))
    quiet = replace(left_out, noise_um=0.0 * left_out.noise_um)
    assert quiet.rmse_um[0] == pytest.approx(np.sqrt(np.mean(left_out.error_um**2)))
    assert found.heldout_um == pytest.approx(left_out.rmse_um)


def test_tests_of_one_speed_are_left_out_one_by_one(monkeypatch):
    found, _, _ = fitted(monkeypatch, recorded(np.random.default_rng(3), scatter=0.02, speeds=(4000.0,) * 4))
    assert found.left_out.runs == (0, 1, 2, 3)
    alone, _, _ = fitted(monkeypatch, recorded(np.random.default_rng(3), scatter=0.02, speeds=(4000.0,)))
    assert alone.left_out is None
    assert alone.heldout_um is not None


def test_a_claim_does_not_shrink_with_the_hours_at_rest_that_were_recorded():
    moves_um = np.array([20.0, 4.0])
    short = LeftOutTests((0, 1), np.full((2, 2), 0.8), np.full((2, 2), 10.0), np.zeros((2, 2)))
    # four times as long, three quarters of it cold: error and movement are half as large in the mean
    long = replace(short, error_um=short.error_um / 2.0, moved_um=short.moved_um / 2.0)
    few = few_factor(2) / 2.0
    assert short.claimed_um(moves_um)[0] == long.claimed_um(moves_um)[0] == pytest.approx(1.6 * few)
    # of less movement than that of the tests not only the same part
    assert short.claimed_um(moves_um)[1] == pytest.approx(0.8 * few * np.sqrt(0.4))


def test_fewer_tests_claim_more():
    factors = [few_factor(n) for n in (1, 2, 4, 9)]
    # 19 in 20, one-sided, of 1.14 ÷ √n: 6.5 times; from seven tests on twice
    np.testing.assert_allclose(factors, [6.52, 3.77, 2.55, 2.0], rtol=2e-3)


def test_claims_of_days_that_scatter_are_borne_out():
    ratios, factors = [], []
    for seed in range(5):
        rng = np.random.default_rng([7, seed])
        prediction = predict(recorded(rng, scatter=0.04), ("Z",), CYCLE)
        minutes = np.arange(0.0, CYCLE.end_s + 1.0, 60.0)
        true = np.interp(prediction.time_s, minutes, course_um(CYCLE, minutes))
        off = np.mean((true - prediction.displacement_um[:, 0]) ** 2) + 0.04**2 * np.mean(true**2)
        ratios.append(np.sqrt(off) / prediction.claimed_um[0])
        factors.append(prediction.claim_factor)
        assert prediction.as_dict()["claim_factor"] == prediction.claim_factor
    # with a zero of its own in every left-out test the median was 2
    assert 0.67 < np.median(ratios) < 1.5
    # the factor is one of 19 times in 20; more than one of five beyond it has a chance of 2 %
    assert np.sum(np.array(ratios) > factors) <= 1
