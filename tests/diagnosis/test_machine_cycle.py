"""The machine's cycle is read off the simulation; what comes back with it is no effect, and hides none."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from selector.diagnosis.comparison import Comparison
from selector.diagnosis.evidence.response import bench_of
from selector.diagnosis.evidence.search import search
from selector.diagnosis.shapes.machine_cycle import machine_cycle
from selector.diagnosis.workflow import diagnosis
from selector.recording import Channel
from tests.diagnosis.test_search import effect

N, PERIOD_S, STEP_S = 1500, 7.3, 0.05
ROWS = np.tile(np.arange(N) * STEP_S, 3)
RUN = np.repeat(np.arange(3), N)
STROKE = np.array([1.0, 1.6, 0.7])[RUN]
TURN = 2.0 * np.pi * ROWS / PERIOD_S
COURSES = {
    "x.square": STROKE**2 * np.sign(np.sin(TURN) + 0.2),
    "x.third": STROKE**3 * np.sin(3.0 * TURN),
    "x.warm": 1.0 - np.exp(-ROWS / 25.0),
}


def compared(residual, simulated):
    return Comparison(
        runs=("r1", "r2", "r3"),
        starts=(0, N, 2 * N, 3 * N),
        time_s=ROWS,
        channels=(Channel("E", "displacement", "um", axis="X"),),
        recorded={"E": simulated + residual},
        simulated={"E": simulated},
        responses=("E",),
        held_out=RUN == 2,
    )


def locked(generator):
    """A course that every cycle repeats, smooth, of standard deviation 1."""
    n = round(PERIOD_S / STEP_S)
    white = np.fft.rfft(generator.standard_normal(n))
    course = np.fft.irfft(white / np.maximum(np.arange(len(white)), 1), n)
    place = ROWS / PERIOD_S % 1.0 * n
    smooth = np.interp(place, np.arange(n + 1), np.r_[course, course[:1]])
    return (smooth - smooth.mean()) / smooth.std()


SIMULATED = STROKE * (np.sin(TURN) + 0.3 * np.sin(2.0 * TURN))


def found(residual, seed=0):
    bench, _ = bench_of(compared(residual, SIMULATED), "E", [effect(*item) for item in COURSES.items()])
    return search({"E": bench}, false_alarm=0.02, seed=seed)


def test_the_cycle_is_read_off_jittered_courses():
    generator = np.random.default_rng(1)
    jittered = ROWS + 0.1 * STEP_S * generator.uniform(-1.0, 1.0, len(ROWS)) * (ROWS > 0)
    turn = 2.0 * np.pi * jittered / PERIOD_S
    simulated = STROKE * (np.sin(turn) + 0.3 * np.sin(2.0 * turn))
    cycle = machine_cycle(replace(compared(np.zeros(3 * N), simulated), time_s=jittered))
    assert cycle is not None
    assert cycle.period_s == pytest.approx(PERIOD_S, rel=1e-3)  # a third of a step over ten cycles


@pytest.mark.parametrize(
    "simulated",
    [
        ROWS**0.5,
        np.sin(2.0 * np.pi * ROWS / PERIOD_S * (1.0 + ROWS / 40.0)),
        np.sin(2.0 * np.pi * ROWS / np.array([5.0, 8.0, 11.0])[RUN]),
        np.zeros(3 * N),
    ],
    ids=["warming up", "ever faster", "another period in every run", "nothing moves"],
)
def test_no_cycle_where_none_is_common(simulated):
    assert machine_cycle(compared(np.zeros(3 * N), simulated)) is None


def test_what_every_cycle_repeats_is_no_effect():
    named, off = 0, 0
    for seed in range(12):
        generator = np.random.default_rng(seed)
        result = found(0.6 * locked(generator) + 0.3 * generator.standard_normal(3 * N), seed)
        named += bool(result.named)
        off += result.benches["E"].is_off_cycle
    assert off == 12
    assert named <= 1  # 2 % each


def test_what_every_cycle_repeats_calibrates_nothing():
    """An offset, gain or delay that fits what comes back would leave structure in runs of other strokes."""
    silent = 0
    for seed in range(8):
        generator = np.random.default_rng(seed)
        made = compared(0.6 * locked(generator) + 0.3 * generator.standard_normal(3 * N), SIMULATED)
        answer = diagnosis(made, effects=[effect(*item) for item in COURSES.items()])
        silent += answer.verdict == "nothing-missing"
        # in one stroke's cycles that the noise resembles; 4 % in the worst of these seeds
        assert answer.recalibration["E"]["gain"].value == pytest.approx(1.0, abs=0.06)
    assert silent >= 7


def test_beside_it_what_differs_from_run_to_run_is_found():
    right = 0
    for seed in range(8):
        generator = np.random.default_rng(seed)
        noise = 0.6 * locked(generator) + 0.3 * generator.standard_normal(3 * N)
        right += list(found(0.15 * COURSES["x.third"] + noise, seed).named) == ["x.third"]
    assert right >= 7


@pytest.mark.parametrize("size", [0.05, 0.5, 5.0])
def test_an_effect_that_comes_back_with_the_cycle_is_an_effect(size):
    generator = np.random.default_rng(3)
    result = found(size * COURSES["x.square"] + 0.3 * generator.standard_normal(3 * N))
    assert not result.benches["E"].is_off_cycle
    assert list(result.named) == ["x.square"]
