"""How far A = A0 − x holds, by the probe's own frequency; and how far cubics between 60 points are off.

Then what the two feedbacks of G do, motion → coil and permanent magnet → probe, to the swing and to finished sizes.

python -m benchmarks.bench_gauge_swings

The probe of tests/physics/gauging/examples.py (30 g, its contact, generator and rest gap moved with it) with another
stiffness: its frequency is `ratio` times the 100 Hz of the pull, quality 10, no gap of the magnet, pull so strong that
the free amplitude is always 170 µm. A over A0 where A0 − x is 0.9 and 0.6 of A0, come to from larger allowances as in
grinding; then where a swing that is come to from below is another one (share of A0 behind the first touch, and how
large it is), and at which share of the allowances from 0 to 0.9 the swing repeats after one round, several, or never.
"""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path

import numpy as np

from selector.physics.gauging.characteristic import characteristic, steady_swing
from selector.physics.gauging.gauged_grinding import finished_sizes
from selector.physics.gauging.gauging_model import GaugingModel, gauging_model
from selector.physics.gauging.model_file import parsed_model_file
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


FEEDBACKS = {"none": (False, 0.0), "coil": (True, 0.0), "magnet of 0.5 N": (False, 0.5), "both": (True, 0.5)}


def with_feedback(path: Path, coil: bool, pull_n: float, volts: tuple[float, ...] | None) -> GaugingModel:
    """A shipped model file with feedbacks, and thresholds; None: those of eq. 23."""
    text = path.read_text(encoding="utf-8").partition("[thresholds]")
    text = text[0] + "[noise]" + text[2].partition("[noise]")[2] if text[1] else text[0]
    text = text.replace("gap_m = 1.5e-3", f"gap_m = 1.5e-3\nmotion_in_coil = {str(coil).lower()}")
    text = text.replace("gap_m = 1.0e-3", f"gap_m = 1.0e-3\npull_n = {pull_n}")
    said = "" if volts is None else f"\n[thresholds]\nvolts = {list(volts)}\n"
    return gauging_model(parsed_model_file(text + said))


def feedbacks(name: str) -> None:
    """Swing, line, and sizes of 2000 parts: with the thresholds of the gauge without, and with thresholds set anew.

    The latter are those of eq. 23 plus the peaks of the ripple where a part is to size.
    """
    path, plain_v = Path("fixtures/gauging") / f"{name}.toml", None
    print(f"\n{name}\n| feedback | free stroke | touch | K | same thresholds: mean, sd | set anew: mean, sd |")
    for label, (coil, pull_n) in FEEDBACKS.items():
        model = with_feedback(path, coil, pull_n, None)
        curve, setup = model.characteristic, model.setup
        peaks_v = float(model.crest.crest_at(setup.wanted_um, model.values.filter_s))
        anew_v = tuple(volts + peaks_v for volts in model.advised_thresholds_v)
        plain_v = plain_v or anew_v
        told = []
        for volts in (plain_v, anew_v):
            sizes = finished_sizes(with_feedback(path, coil, pull_n, volts).setup, 2000, seed=1)
            told.append(f"{sizes.mean_um:.3f} ± {sizes.mean_error_um:.3f}, {sizes.sd_um:.3f} ± {sizes.sd_error_um:.3f}")
        print(
            f"| {label} | {2 * curve.free_amplitude_um:.2f} µm | {curve.touch_um:.2f} µm "
            f"| {1e3 * setup.gauge.gain_v_per_um:.3f} mV/µm | {told[0]} | {told[1]} |"
        )


def main() -> None:
    feedbacks("grind-to-size")
    feedbacks("interrupted")
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
