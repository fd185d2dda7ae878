"""A store that spills seldom: the spill is found as it is, and is no other size than mass balance gives it."""

from __future__ import annotations

import numpy as np
import pytest

from selector.diagnosis.effects.catalogue import effect_of
from selector.diagnosis.shapes.residual import Remainder
from tests.diagnosis.effects.concealed_truths import comparison_of

EFFECT = effect_of("flow.overflow")


def _levels(pump: np.ndarray, brim: float, caught: float) -> tuple[np.ndarray, np.ndarray]:
    """Levels of both stores, in steps of 0.2 s; the upper one spills at `brim`."""
    upper = lower = 0.05
    found = np.empty((2, len(pump)))
    for k, flow in enumerate(pump):
        found[:, k] = upper, lower
        for _ in range(20):
            between, out = 0.0042 * np.sqrt(upper), 0.0042 * np.sqrt(lower)
            upper += 0.2 * (0.00118 * flow - between)
            spilled = max(upper - brim, 0.0)
            upper -= spilled
            lower += 0.2 * (between - out) + caught * spilled
    return found[0], found[1]


@pytest.mark.parametrize("caught", [0.0, 0.6])
def test_a_spill_of_the_upper_store_is_found_however_seldom(caught: float) -> None:
    rng = np.random.default_rng(4)
    pumps = [np.interp(np.arange(600) * 4.0, np.arange(0, 2600, 120.0), rng.uniform(0.4, 1.45, 22)) for _ in range(3)]
    highest = max(_levels(pump, np.inf, 0.0)[0].max() for pump in pumps[:2])
    runs, seldom = [], 0.0
    for pump in pumps:
        plain, truth = _levels(pump, np.inf, 0.0), _levels(pump, 0.96 * highest, caught)
        seldom += float(np.mean(truth[0] > 0.9599 * highest)) / 3
        runs.append((4.0 * np.arange(600), {"q": 1e-6 * pump, "h": 1e6 * truth[1]}, {"h": 1e6 * plain[1]}))
    assert 0.0 < seldom < 0.05
    comparison = comparison_of(runs, {"q": "flow", "h": "displacement"}, ("h",))
    remainder = Remainder(comparison, "h")
    best = max(EFFECT.variants(comparison, "h"), key=lambda v: remainder.share(v.columns[:, 0]))
    # offset, gain and delay take in some; the outflow of the catalogue's stores is in coarser steps
    assert remainder.share(best.columns[:, 0], most=1.5) > 0.95
    assert best.shape["upper_ceiling"].value == pytest.approx(0.96, abs=0.03)


def test_a_coefficient_is_held_within_its_bounds() -> None:
    rng = np.random.default_rng(0)
    time, course = np.arange(300) * 1.0, np.maximum(np.sin(np.arange(300) / 9.0) - 0.7, 0.0)
    swing = np.sin(np.arange(300) / 31.0)
    run = (time, {"h": swing + 3.0 * course + 0.01 * rng.normal(size=300)}, {"h": swing})
    remainder = Remainder(comparison_of([run, run], {"h": "displacement"}, ("h",)), "h")
    course = np.tile(course, 2)
    assert remainder.share(course) > 0.99
    # of 3 units 1 is allowed: 1 − (2/3)² of the squares
    assert remainder.share(course, most=1.0) == pytest.approx(5.0 / 9.0, abs=0.01)
    assert remainder.share(-course, most=1.0) == 0.0
