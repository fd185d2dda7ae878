"""Resonances of a simulation that are a little off are its parameters, and no others that it lacks."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter

from selector.diagnosis.comparison import Comparison
from selector.diagnosis.shapes.linear_response import resonator, with_moved_resonances
from selector.diagnosis.workflow import diagnosis
from selector.recording import Channel

PERIOD_S, N, RUNS = 1e-3, 1500, 3
SIMULATED = ((48.0, 0.03, 1.0), (131.0, 0.02, 0.4))


def answer(force, modes):
    """Acceleration of a structure that is shaken [m/s²], by its modes (Hz, damping, size)."""
    parts = []
    for frequency_hz, damping, size in modes:
        numerators, denominator = resonator(frequency_hz, damping, PERIOD_S)
        parts.append(size * lfilter(numerators[2], denominator, force))
    return np.sum(parts, axis=0)


def shaken(modes):
    random = np.random.default_rng(5)
    force = [random.normal(size=N) for _ in range(RUNS)]
    simulated = np.concatenate([answer(part, SIMULATED) for part in force])
    recorded = np.concatenate([answer(part, modes) for part in force])
    recorded += 0.05 * np.std(recorded) * random.normal(size=len(recorded))
    return Comparison(
        runs=tuple(f"r{k + 1}" for k in range(RUNS)),
        starts=tuple(range(0, RUNS * N + 1, N)),
        time_s=np.tile(np.arange(N) * PERIOD_S, RUNS),
        channels=(Channel("F", "force", "N"), Channel("a", "acceleration", "m/s^2")),
        recorded={"F": np.concatenate(force), "a": recorded},
        simulated={"a": simulated},
        responses=("a",),
        held_out=np.arange(RUNS * N) >= (RUNS - 1) * N,
    )


LITTLE_OFF = ((48.4, 0.035, 1.0), (130.0, 0.02, 0.4))


def test_they_are_found_where_the_recording_has_them():
    moved = with_moved_resonances(shaken(LITTLE_OFF))
    assert moved is not None
    _, resonances, share = moved
    assert sorted(one.value for one in resonances.values()) == pytest.approx([-0.763, 0.833], abs=0.1)
    assert 0.5 < share < 1.0


def test_resonances_a_little_off_are_a_matter_of_calibration():
    comparison = shaken(LITTLE_OFF)
    found = diagnosis(comparison)
    assert (found.verdict, found.effects) == ("miscalibrated", ())
    assert len(found.recalibration["model"]) == 2
    assert "resonance of 48 Hz moved by 0.8" in found.headline
    fit = found.fit["a"]
    assert fit.heldout.rmse_after < 0.6 * fit.heldout.rmse_before
    noise = 0.05 * np.std(comparison.recorded["a"])
    assert fit.heldout.rmse_after == pytest.approx(noise, rel=0.1)


@pytest.mark.parametrize("modes", [(*SIMULATED, (84.0, 0.03, 0.1)), (*LITTLE_OFF, (84.0, 0.03, 0.1))])
def test_a_resonance_that_is_lacking_is_named_beside_them(modes):
    found = diagnosis(shaken(modes))
    assert "vibration.mode" in {effect.id for effect in found.effects}


def test_resonances_that_are_right_stay_where_they_are():
    comparison = shaken(SIMULATED)
    assert with_moved_resonances(comparison) is None


def test_resonances_that_leave_the_unseen_run_far_off_are_not_the_whole_of_it():
    """A chatter that the fitted runs do not have."""
    comparison = shaken(LITTLE_OFF)
    chatter = np.where(comparison.held_out, 0.15 * np.std(comparison.recorded["a"]), 0.0)
    chatter = chatter * np.sin(2.0 * np.pi * 211.0 * comparison.time_s * (1.0 + 0.1 * comparison.time_s))
    found = diagnosis(replace(comparison, recorded=comparison.recorded | {"a": comparison.recorded["a"] + chatter}))
    assert found.verdict != "miscalibrated"


def test_an_unseen_run_that_is_shaken_harder_is_off_by_more_and_says_nothing_against_them():
    comparison = shaken(LITTLE_OFF)
    times = np.where(comparison.held_out, 3.0, 1.0)
    recorded = {name: times * of for name, of in comparison.recorded.items()}
    harder = replace(comparison, recorded=recorded, simulated={"a": times * comparison.simulated["a"]})
    assert diagnosis(harder).verdict == "miscalibrated"
