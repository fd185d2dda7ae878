"""How far A = A0 − x holds, by the probe's own frequency; and how far cubics between 60 points are off.

python -m benchmarks.bench_gauge_swings

The probe of tests/physics/gauging/examples.py (30 g, its contact, generator and rest gap moved with it) with another
stiffness: its frequency is `ratio` times the 100 Hz of the pull, quality 10, no gap of the magnet, pull so strong that
the free amplitude is always 170 µm. A over A0 where A0 − x is 0.9 and 0.6 of A0, come to from larger allowances as in
grinding; then where a swing that is come to from below is another one (share of A0 behind the first touch, and how
large it is), and at which share of the allowances from 0 to 0.9 the swing repeats after one round, several, or never.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from selector.physics.gauging.gauge.characteristic import characteristic
from selector.physics.gauging.gauge.vibrating_contact import steady_swing
from tests.physics.gauging.examples import TRANSDUCER
from tests.physics.gauging.test_steady_swing import tuned

RATIOS, QUALITY = (0.8, 0.95, 1.0, 1.03, 1.1, 1.3, 2.0, 4.0), 10.0
SHARES = np.round(np.arange(-0.9, 0.951, 0.05), 3)


def row(ratio: float) -> str:
    gauge = tuned(ratio, QUALITY)
    free = steady_swing(gauge, None)
    touch_um, amplitude_um = 1e6 * gauge.rest_gap_m - free.highest_um, 0.5 * free.stroke_um
    followed = []
    for order in (SHARES[::-1], SHARES):
        state, swings = free.state, []
        for share in order:
            swings.append(steady_swing(gauge, touch_um + share * amplitude_um, start=state))
            state = swings[-1].state
        followed.append(swings)
    falling, rising = followed[0][::-1], followed[1]
    size = {share: 0.5 * swing.stroke_um / amplitude_um for share, swing in zip(SHARES, falling, strict=True)}
    other = [
        (share, max(down.stroke_um, up.stroke_um) / (2 * amplitude_um))
        for share, down, up in zip(SHARES, falling, rising, strict=True)
        if down.rounds == up.rounds == 1 and abs(down.voltage_v - up.voltage_v) > 1e-3 * free.voltage_v
    ]
    two = f"{other[0][0]:+.2f} to {other[-1][0]:+.2f}, up to {max(large for _, large in other):.2f}" if other else ""
    inside = [swing.rounds for share, swing in zip(SHARES, falling, strict=True) if 0.0 <= share <= 0.9]
    counts = [
        sum(test) / len(inside)
        for test in ([r == 1 for r in inside], [r > 1 for r in inside], [r == 0 for r in inside])
    ]
    voltages = np.array([swing.voltage_v for share, swing in zip(SHARES, falling, strict=True) if 0.0 <= share <= 0.9])
    rises = [f"{SHARES[SHARES >= 0][i]:.2f}" for i in np.flatnonzero(np.diff(voltages) > 1e-3 * free.voltage_v)]
    return (
        f"| {ratio:g} | {size[0.1]:.3f} | {size[0.4]:.3f} | {two} | {counts[0]:.0%}, {counts[1]:.0%}, {counts[2]:.0%} "
        f"| {' '.join(rises)} |"
    )


def main() -> None:
    print(
        "| ratio | 0.9 | 0.6 | two swings | one round, several, never | voltage rises from |\n|---|---|---|---|---|---|"
    )
    for ratio in RATIOS:
        print(row(ratio), flush=True)
    coarse = characteristic(TRANSDUCER)
    low, high = coarse.monotone_um
    at = np.linspace(low, high, 1601)
    state, followed = steady_swing(TRANSDUCER, None).state, []
    for allowance in at[::-1]:
        swing = steady_swing(TRANSDUCER, float(allowance), start=state)
        state = swing.state
        followed.append(swing.voltage_v)
    exact = np.array(followed[::-1])
    slope = np.gradient(exact, at)
    off_um = np.abs((coarse.voltage_at(at) - exact) / slope)
    print(
        f"\ncubics between {len(coarse.allowance_um)} points, which serve from {low:.1f} to {high:.1f} µm, are off by:"
    )
    for begin, end in pairwise((low, low + 0.5, low + 1.0, low + 140.0, low + 149.0, low + 154.0, low + 157.0)):
        inside = (at >= begin) & (at < end)
        print(
            f"{begin:.1f} to {end:.1f} µm: up to {off_um[inside].max():.4f} µm of size, "
            f"slope {1e3 * slope[inside].min():.1f} to {1e3 * slope[inside].max():.1f} mV/µm"
        )


if __name__ == "__main__":
    main()
