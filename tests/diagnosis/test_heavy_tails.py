"""Noise with heavy tails: strays count for what they tell, and normal noise is left as it is."""

import numpy as np
import pytest

from selector.diagnosis.comparison import Comparison
from selector.diagnosis.effects.catalogue import effect_of
from selector.diagnosis.evidence.misfit import with_pseudo_target
from selector.diagnosis.evidence.moments import solved
from selector.diagnosis.evidence.response import Bench, bench_of
from selector.recording import Channel

N = 3000


def bench(tails: float | None, step: float, seed: int) -> Bench:
    rng = np.random.default_rng(seed)
    time = np.tile(np.arange(N) * 1.0, 2)
    simulated = np.sin(time / 80.0)
    noise = rng.normal(size=2 * N) if tails is None else rng.standard_t(tails, 2 * N) * np.sqrt(1.0 - 2.0 / tails)
    jump = step * ((time >= 1500.0) & (np.arange(2 * N) < N))
    comparison = Comparison(
        runs=("r1", "r2"),
        starts=(0, N, 2 * N),
        time_s=time,
        channels=(Channel("Z", "displacement", "um"),),
        recorded={"Z": simulated + noise + jump},
        simulated={"Z": simulated},
        responses=("Z",),
        held_out=np.zeros(2 * N, dtype=bool),
        resolution={"Z": 0.0},
    )
    return bench_of(comparison, "Z", (effect_of("data.step"),))[0]


def gain(of: Bench) -> float:
    return float(solved(of.moments(of.base([]))).gain.max())


def test_strays_hide_less_of_a_small_jump() -> None:
    plain = [bench(3.0, 0.2, seed) for seed in range(6)]
    gains = np.array([(gain(of), gain(with_pseudo_target(of, []))) for of in plain])
    # for Student's t with 3 degrees the information on a level is twice 1/variance
    assert np.median(gains[:, 1] / gains[:, 0]) > 1.4


def test_of_noise_alone_no_more_is_made() -> None:
    gains = [gain(with_pseudo_target(bench(3.0, 0.0, seed), [])) for seed in range(6)]
    assert np.median(gains) < 12.0


def test_normal_noise_is_left_as_it_is() -> None:
    of = bench(None, 0.2, 1)
    assert with_pseudo_target(of, []) is of


def test_pseudo_values_have_the_noise_that_they_say() -> None:
    of = with_pseudo_target(bench(3.0, 0.0, 2), [])
    assert of.pseudo_target is not None
    assert float(np.std(of.white_target)) == pytest.approx(1.0, abs=0.05)
    assert of.without_own("nothing") is of
    assert of.refitted_noise([]).pseudo_target is None
