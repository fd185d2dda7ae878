"""Time constants between the points of a grid: their interval holds the truth, and is open where the grid ends."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from selector.diagnosis.effects.catalogue import effect_of
from selector.diagnosis.effects.effect import Fitted, Quantity, Variant
from selector.diagnosis.effects.thermal._wording import delay_of, worth
from selector.diagnosis.evidence.moments import solved
from selector.diagnosis.evidence.naming import shape_intervals
from selector.diagnosis.evidence.response import bench_of
from selector.diagnosis.shapes.signals import course, lagged
from tests.diagnosis.made import comparison

GRID = (100.0, 213.0, 454.0, 968.0, 2060.0, 4400.0)


def profiled(tau_s, seed):
    """The interval of a lag of the spindle speed that the simulation does not have."""
    rng = np.random.default_rng(seed)
    of = comparison({"Z": rng.normal(size=900)})
    speed = np.repeat(rng.choice([0.0, 1.0], 45), 20)
    of = replace(of, recorded={**of.recorded, "spindle_speed": speed})
    z = of.recorded["Z"] + 4.0 * lagged(of, course(of, "spindle_speed"), tau_s)
    of = replace(of, recorded={**of.recorded, "Z": z})
    effect = replace(
        effect_of("thermal.memory"),
        testable=lambda *_: None,
        variants=lambda c, _: [
            Variant(lagged(c, course(c, "spindle_speed"), tau)[:, None], ("n",), {"tau_s": Quantity(tau, "s")})
            for tau in GRID
        ],
    )
    bench, _ = bench_of(of, "Z", [effect])
    for _ in range(2):
        best = int(np.argmax(solved(bench.moments(bench.base([]))).gain))
        # the noise is what is left beside the effect, as in a search
        bench = bench.refitted_noise([best])
    shape, intervals = shape_intervals(bench, [best], best)
    return shape["tau_s"].value, *intervals["tau_s"]


def test_nine_of_ten_intervals_hold_a_truth_between_the_points_of_the_grid():
    inside = []
    for seed in range(12):
        for tau_s in (310.0, 660.0, 1410.0):
            value, low, high = profiled(tau_s, seed)
            assert low < value < high
            assert high < 4.0 * low
            inside.append(low <= tau_s <= high)
    assert np.mean(inside) >= 0.9


def test_beyond_the_end_of_the_grid_the_interval_is_open():
    value, low, high = profiled(9000.0, 1)
    assert (value, high) == (GRID[-1], np.inf)
    assert low >= GRID[-3]
    assert profiled(30.0, 1)[1] == 0.0


@pytest.mark.parametrize(
    ("interval", "text", "said"),
    [
        ((600.0, 1800.0), "of 20 min (10 min to 30 min)", "1200 s (600 to 1800)"),
        ((600.0, np.inf), "of 20 min (at least 10 min)", "1200 s (at least 600)"),
        ((0.0, 1800.0), "of 20 min (at most 30 min)", "1200 s (at most 1800)"),
    ],
)
def test_an_open_interval_in_words(interval, text, said):
    shape = {"tau_s": Quantity(1200.0, "s")}
    fitted = Fitted(
        "Z", "um", Variant(np.ones((9, 1)), ("n",), shape), np.ones(1), np.ones(1), {"tau_s": interval}, 1, 2
    )
    assert delay_of(fitted) == f"with a delay {text}"
    assert Quantity(1200.0, "s", *interval).words() == said


@pytest.mark.parametrize(
    ("extremes", "text"),
    [
        ((-9.02, 0.3), "it moves Z by up to −9.02 µm since the start of a run"),
        ((-3.0, 4.0), "it moves Z by −3 to +4 µm since the start of a run"),
        ((0.0, 0.0), "worth 2 µm at most"),
    ],
)
def test_which_way_an_effect_goes_is_said(extremes, text):
    fitted = Fitted("Z", "um", Variant(np.ones((9, 1)), ("n",)), np.ones(1), np.ones(1), {}, 1.0, 2.0, extremes)
    assert worth(fitted) == text
