"""d′ is what a matched filter separates; noise has the colour that it says; the oracle leaves the noise."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from proving_ground.concealment import Noise, d_prime, held_out_errors, recalibration, scale_for, unabsorbed

STARTS = (0, 700, 1500, 2100)
TIME = np.concatenate([30.0 * np.arange(b - a) for a, b in pairwise(STARTS)])
SIMULATED = 40.0 * (1.0 - np.exp(-TIME / 4000.0)) * np.repeat([1.0, 0.6, 1.4], np.diff(STARTS))
EFFECT = np.sin(TIME / 1700.0) * np.repeat([1.0, 2.0, 0.5], np.diff(STARTS))
COLOURS = [
    Noise(0.6),
    Noise(0.6, 0.85),
    Noise(0.6, 0.995),
    Noise(0.6, 0.85, tails=3.0),
    Noise(0.3, step=0.5),
    Noise(0.4, 0.7, cycle_samples=23, cycle_sd=0.6),
]


def strength(noise: Noise, effect: np.ndarray = EFFECT) -> float:
    free = recalibration(SIMULATED, TIME, STARTS)
    return d_prime({"Z": effect}, {"Z": noise}, {"Z": free}, STARTS)


@pytest.mark.parametrize("noise", COLOURS)
def test_strength_is_what_a_matched_filter_separates(noise):
    rows = STARTS[:-1]
    free = recalibration(SIMULATED, TIME, STARTS)
    template = unabsorbed(EFFECT[:, None], free, noise, rows)[:, 0]
    template /= np.linalg.norm(template)
    generator = np.random.default_rng(1)
    statistics = []
    for _ in range(150):
        recorded = noise.rounded(SIMULATED + noise.drawn(generator, STARTS))[: rows[-1], None]
        statistics.append(template @ unabsorbed(recorded, free, noise, rows)[:, 0])
    # 150 draws: the standard error of a standard deviation of 1 is 0.058; 4 of them, and as much again for heavy tails
    assert np.std(statistics) == pytest.approx(1.0, abs=0.25)
    assert abs(np.mean(statistics)) < 0.35  # 4 standard errors of 0.082


def test_white_noise_without_anything_to_fit_is_energy_over_variance():
    rows = STARTS[-2]
    found = d_prime({"Z": EFFECT}, {"Z": Noise(0.5)}, {"Z": np.empty((STARTS[-1], 0))}, STARTS)
    assert found == pytest.approx(np.linalg.norm(EFFECT[:rows]) / 0.5, rel=1e-12)  # rounding


def test_what_recalibration_does_is_worth_nothing():
    slope = recalibration(SIMULATED, TIME, STARTS)[:, 2]
    absorbed = 3.0 + 0.2 * SIMULATED - 15.0 * slope
    assert strength(Noise(0.6, 0.85), absorbed) < 1e-6 * strength(Noise(0.6, 0.85))  # rounding of the projection


def test_what_every_cycle_repeats_is_worth_nothing_in_noise_of_that_cycle():
    noise = Noise(0.4, 0.7, cycle_samples=23, cycle_sd=0.6)
    repeated = np.concatenate([np.sin(2 * np.pi * np.arange(n) / 23) for n in np.diff(STARTS)])
    assert strength(noise, repeated) < 1e-6 * strength(Noise(0.4, 0.7), repeated)  # rounding of the projection


def test_held_out_run_does_not_count():
    other = EFFECT.copy()
    other[STARTS[-2] :] *= 100.0
    assert strength(Noise(0.6), other) == strength(Noise(0.6))


@pytest.mark.parametrize("noise", COLOURS)
def test_noise_has_the_colour_that_it_says(noise):
    starts = (0, 20_000)
    drawn = noise.drawn(np.random.default_rng(5), starts)
    wanted = np.hypot(noise.sd, noise.cycle_sd)
    # the standard error of the standard deviation of AR(1) 0.995 over 20 000 samples is 7 %; twice that
    assert np.std(drawn) == pytest.approx(wanted, rel=0.14)
    cycle = noise.repeated(starts)
    rest = drawn - cycle @ np.linalg.lstsq(cycle, drawn, rcond=None)[0] if noise.cycle_samples else drawn
    assert np.corrcoef(rest[1:], rest[:-1])[0, 1] == pytest.approx(noise.phi, abs=0.03)  # 4 of 1/√20000


@settings(max_examples=25)
@given(st.floats(0.5, 30.0), st.floats(0.5, 2.0), st.floats(0.01, 100.0))
def test_size_for_a_strength_is_found(target, power, factor):
    size = scale_for(target, lambda s: factor * s**power)
    assert factor * size**power == pytest.approx(target, rel=0.0101)  # the tolerance that it keeps


def test_strength_that_no_size_has_is_said():
    with pytest.raises(ValueError, match="wanted 6"):
        scale_for(6.0, lambda size: 4.0 * np.tanh(size))


def test_oracle_leaves_the_noise():
    noise = Noise(0.6, 0.5)
    errors = noise.drawn(np.random.default_rng(3), STARTS)
    recorded = SIMULATED + EFFECT + errors
    found = held_out_errors(recorded, SIMULATED, EFFECT, errors, noise, TIME, STARTS)
    assert found.noise_floor == pytest.approx(np.std(errors[STARTS[-2] :]), rel=0.02)  # a mean of 0.06
    # three parameters fitted to about 500 independent samples leave about 0.3 % more; the gain is extrapolated
    assert found.oracle == pytest.approx(found.noise_floor, rel=0.05)
    assert found.recalibrated > 1.05 * found.oracle
