"""How often a ball-bar test names a cause where there is only noise, and how large its standard errors are.

Circles without any error, readings with independent noise of 2 µm, both directions at 1000 mm/min, seeded:
``python benchmarks/ball_bar_alarms.py [runs]`` (170 runs of each length take 5 minutes).
"""

from __future__ import annotations

import sys
from collections import Counter, defaultdict

import numpy as np

from selector.physics.drive.ball_bar.causes import FeedCauses, circle_causes
from selector.physics.drive.ball_bar.circle import BallBarTrace

NOISE_UM = 2.0
"""So large that no alarm is below the smallest size that is told."""
LENGTHS = (900, 1800, 3600)


def ideal(samples: int, seed: int) -> FeedCauses:
    """Causes of one test of nothing."""
    noise = np.random.default_rng([seed, samples])
    traces = []
    for direction in (1, -1):
        angle = direction * (np.arange(samples) + 0.37) * 2 * np.pi / samples
        traces.append(BallBarTrace(angle, noise.normal(0, NOISE_UM, samples), direction, 1000.0))
    return circle_causes(traces).feeds[0]


def main(runs: int = 170) -> None:
    every = 0
    for samples in LENGTHS:
        alarms, named, scores = 0, Counter[str](), defaultdict[str, list[float]](list)
        for seed in range(1000, 1000 + runs):
            feed = ideal(samples, seed)
            found = [cause.kind for cause in feed.causes if cause.found]
            alarms += bool(found)
            named.update(found)
            for cause in feed.causes:
                name = "mean" if "mean" in cause.amounts else next(iter(cause.amounts))
                amount = cause.amounts[name]
                scores[cause.kind].append(amount.value / amount.standard_error)
        every += alarms
        print(f"{samples} samples a direction: {alarms} of {runs} name a cause {dict(named)}")
        print("  value/error, RMS:", {kind: round(float(np.std(one)), 2) for kind, one in scores.items()}, flush=True)
    print(f"together {every} of {runs * len(LENGTHS)}")


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
