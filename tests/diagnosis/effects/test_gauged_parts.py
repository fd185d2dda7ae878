"""Gauges that are put onto part after part: lag that begins anew, and grooves on few of them."""

from __future__ import annotations

import numpy as np
import pytest

from selector.diagnosis.comparison import Comparison
from selector.diagnosis.effects.catalogue import effect_of
from tests.diagnosis.effects.concealed_truths import comparison_of

INTERRUPTED = effect_of("gauging.interrupted")
LAG = effect_of("gauging.lag")


def _explained(comparison: Comparison, response: str, column: np.ndarray) -> float:
    fitted = ~comparison.held_out
    target, part = comparison.difference(response)[fitted], column[fitted]
    left = target - part * (part @ target) / (part @ part)
    return 1.0 - float(left @ left / (target @ target))


@pytest.mark.parametrize("tau_s", [0.03, 0.2])
def test_a_lag_begins_anew_on_every_part(tau_s: float) -> None:
    step_s, rows = 0.02, 300
    runs = []
    for run in range(3):
        rng = np.random.default_rng(run)
        size, read = [], []
        for _ in range(4):
            course = np.maximum(rng.uniform(50.0, 100.0) - rng.uniform(15.0, 30.0) * step_s * np.arange(rows), 0.0)
            reading, y = np.empty(rows), course[0]
            for k in range(rows):
                # the size falls evenly within a sample
                for share in np.linspace(0.05, 1.0, 20) if k else ():
                    y += step_s / 20 / tau_s * (course[k - 1] + share * (course[k] - course[k - 1]) - y)
                reading[k] = y
            size.append(course)
            read.append(reading)
        time = step_s * np.arange(4 * rows)
        runs.append((time, {"d": np.concatenate(read)}, {"d": np.concatenate(size)}))
    comparison = comparison_of(runs, {"d": "size"}, ("d",))
    best = max(LAG.variants(comparison, "d"), key=lambda v: _explained(comparison, "d", v.columns[:, 0]))
    assert "anew" in best.names[0]
    # the time constants that are tried lie 1.8 apart
    assert 0.7 * tau_s < best.shape["tau_s"].value < 1.4 * tau_s
    assert _explained(comparison, "d", best.columns[:, 0]) > 0.97


@pytest.mark.parametrize("share", [0.01, 0.3])
def test_grooves_are_tried_however_few_parts_have_them(share: float) -> None:
    rng = np.random.default_rng(2)
    runs = []
    for _ in range(3):
        n = 600
        grooved, feed = (rng.random(n) < share).astype(float), rng.choice([0.2, 0.3, 0.4], n)
        size = 0.5 * grooved
        runs.append((40.0 * np.arange(n), {"feed": feed, "grooved": grooved, "d": size}, {"d": np.zeros(n)}))
    comparison = comparison_of(runs, {"feed": "feed_rate", "grooved": "state", "d": "size"}, ("d",))
    assert INTERRUPTED.testable(comparison, "d") is None
    shares = [_explained(comparison, "d", v.columns[:, 0]) for v in INTERRUPTED.variants(comparison, "d")]
    assert max(shares) == pytest.approx(1.0)
