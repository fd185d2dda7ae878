"""A noise that wanders says nothing of the level: names are found in the steps, and the level is that of the record."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from selector.diagnosis.effects.catalogue import effect_of
from selector.diagnosis.evidence.response import bench_of
from selector.diagnosis.matching.alignment import comparison_of
from selector.recording import Channel, Recording

ROWS = 400


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_the_level_is_the_mean_of_what_is_left(seed):
    draw = np.random.default_rng(seed)
    recorded, simulated = {}, {}
    for run in ("r1", "r2", "r3"):
        time = pd.Index(60.0 * np.arange(ROWS), name="time_s")
        speed = np.repeat(draw.choice([0.0, 1000.0, 3000.0], ROWS // 40), 40)
        course = 20.0 * (1.0 - np.exp(-np.arange(ROWS) / 150.0))
        wandering = np.cumsum(draw.normal(0.0, 0.3, ROWS))
        recorded[run] = pd.DataFrame({"n": speed, "Z": course + 5.0 + wandering}, index=time)
        simulated[run] = pd.DataFrame({"Z": course}, index=time)
    channels = (Channel("n", "spindle_speed", "rpm"), Channel("Z", "displacement", "um", axis="Z"))
    pair = Recording.from_runs(recorded, channels), Recording.from_runs(simulated, channels[1:])
    bench, _ = bench_of(comparison_of(*pair), "Z", (effect_of("thermal.instant_speed"),))
    assert bench.noise.phi.sum() > 0.9
    for named in ([], [bench.first_candidate("thermal.instant_speed")]):
        left = bench.residual(named)[bench.fitted]
        assert abs(np.mean(left)) < 1e-9 * np.std(bench.target)
        # a factor of ten and more of the swing without
        assert np.std(left) < 2.0 * np.std(bench.target[bench.fitted])
