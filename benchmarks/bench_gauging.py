"""Finished sizes by eq. 25 and by Monte Carlo: where they agree, and what each takes.

python -m benchmarks.bench_gauging [--parts 20000]

Mean is the finished size less the wanted one. *r* is σ_ẏ/(|K|·a), how restless the noise is against the course of the
reading; *wave* the largest rate of the smoothed surface over a. Monte Carlo: ± one standard error. The times of one
distribution by formula and of one batch follow, with parts a second; compiled code is warm. Curved rows: the gauge of
tests/physics/gauging/examples.py by its characteristic; what its curve moves the mean by stands behind them.

Last: what thresholds that follow measured parts take of the drift of fixtures/gauging/wear.toml, in 100 batches.
"""

from __future__ import annotations

import argparse
import time
from dataclasses import replace
from pathlib import Path

import numpy as np

from selector.physics.gauging.characteristic import characteristic, linear_gauge
from selector.physics.gauging.gauged_grinding import GaugedGrinding, finished_sizes
from selector.physics.gauging.gauging_model import gauging_model
from selector.physics.gauging.model_file import read_model_file
from selector.physics.gauging.sizes import sizes_by_formula
from selector.physics.gauging.transducer import (
    Correction,
    Grinding,
    LinearGauge,
    Noise,
    Relay,
    RippleCrest,
    Stage,
    Surface,
)
from tests.physics.gauging.examples import TRANSDUCER

GAUGE = LinearGauge(-0.01, 3.0, 0.05)
GRINDING = Grinding(22.0, (Stage(20.0, 12.0), Stage(5.0, 2.0)), allowance_sd_um=1.0)
SHORT = Grinding(22.0, (Stage(20.0, 12.0), Stage(0.5, 10.0)), allowance_sd_um=1.0)
BASE = GaugedGrinding(GAUGE, GRINDING, Relay(0.02))


def cases() -> dict[str, GaugedGrinding]:
    """T_Φ 50 ms, relay 20 ms late, last feed 5 µm/s, unless the name says otherwise."""
    curve = characteristic(TRANSDUCER)
    gauge = linear_gauge(curve, 2.0, 0.05)
    swings_hz = 2.0 * TRANSDUCER.electromagnet.frequency_hz
    crest = RippleCrest(curve.allowance_um, curve.crest_v, TRANSDUCER.smoothing.time_constant_s, 2.0 * swings_hz)
    quick = replace(GAUGE, time_constant_s=0.003)
    return {
        "noise 0.05 µm, 100/s": replace(BASE, noise=Noise(0.05, 100.0)),
        "noise 0.2 µm, 0.5/s": replace(BASE, noise=Noise(0.2, 0.5)),
        "feed ± 8 %, noise 0.1 µm, 2/s": replace(BASE, grinding=replace(GRINDING, feed_sd=0.08), noise=Noise(0.1, 2.0)),
        "noise 0.3 µm, 10/s": replace(BASE, noise=Noise(0.3, 10.0)),
        "noise 0.3 µm, 100/s": replace(BASE, noise=Noise(0.3, 100.0)),
        "noise 1 µm, 100/s": replace(BASE, noise=Noise(1.0, 100.0)),
        "noise 2 µm, 100/s": replace(BASE, noise=Noise(2.0, 100.0)),
        "T_Φ 3 ms, noise 0.5 µm, 30/s": replace(BASE, gauge=quick, thresholds_v=(), noise=Noise(0.5, 30.0)),
        "relay noise 2 mV every 10 ms": replace(BASE, relay=Relay(0.02, 0.002)),
        "relay noise, and 0.3 µm, 100/s": replace(BASE, relay=Relay(0.02, 0.002), noise=Noise(0.3, 100.0)),
        "noise 1 µm, 20/s, last 2 µm at 0.5 µm/s": replace(
            BASE, grinding=SHORT, thresholds_v=(), noise=Noise(1.0, 20.0)
        ),
        "the same, noise 2/s": replace(BASE, grinding=SHORT, thresholds_v=(), noise=Noise(1.0, 2.0)),
        "the same, relay noise 10 mV": replace(BASE, grinding=SHORT, thresholds_v=(), relay=Relay(0.02, 0.01)),
        "run-out 0.2 µm, 120 r/min": replace(BASE, surface=Surface(120.0, runout_um=0.2)),
        "run-out 1 µm, 120 r/min": replace(BASE, surface=Surface(120.0, runout_um=1.0)),
        "run-out 1 µm, noise 0.3 µm, 20/s": replace(
            BASE, surface=Surface(120.0, runout_um=1.0), noise=Noise(0.3, 20.0)
        ),
        "4 grooves of 5 µm, a tenth, 150 r/min": replace(BASE, surface=Surface(150.0, 4, 0.1, 5.0)),
        "the same and noise 0.3 µm, 20/s": replace(BASE, surface=Surface(150.0, 4, 0.1, 5.0), noise=Noise(0.3, 20.0)),
        "curved, noise 0.5 µm, 10/s": replace(
            GaugedGrinding(gauge, GRINDING, Relay(0.02), noise=Noise(0.5, 10.0)), characteristic=curve
        ),
        "curved, the same, ripple": replace(
            GaugedGrinding(gauge, GRINDING, Relay(0.02), noise=Noise(0.5, 10.0)), characteristic=curve, crest=crest
        ),
        "curved, noise 3 µm, 0.5/s, T_Φ 0.5 s": replace(
            GaugedGrinding(
                replace(gauge, time_constant_s=0.5), Grinding(80.0, (Stage(5.0, 2.0),)), Relay(), noise=Noise(3.0, 0.5)
            ),
            characteristic=curve,
        ),
        "curved, keyway of 5 mm, 6 %, T_Φ 0.3 s": replace(
            GaugedGrinding(
                replace(gauge, time_constant_s=0.3),
                Grinding(100.0, (Stage(15.0, 30.0), Stage(3.0, 2.0)), allowance_sd_um=5.0),
                Relay(0.01),
                Surface(150.0, 1, 0.06, 5000.0),
                Noise(0.5, 1.0),
            ),
            characteristic=curve,
        ),
    }


CORRECTIONS = (
    None, Correction(0.1, 0.2), Correction(0.2, 0.2), Correction(0.3, 0.2), Correction(0.5, 0.2), Correction(1.0, 0.2),
    Correction(0.2, 0.0), Correction(0.2, 0.5), Correction(0.2, 1.0), Correction(0.2, 0.2, 3), Correction(0.4, 0.2, 3),
)  # fmt: skip


def corrections() -> None:
    """Mean and spread of all parts, what formula has of the spread, and the range of the mean course of a batch."""
    setup = gauging_model(read_model_file(Path("fixtures/gauging/wear.toml"))).setup
    print("\n| share, noise, parts late | mean | sd | by formula | rms | course | out of ± 2 µm |")
    for one in CORRECTIONS:
        corrected = replace(setup, correction=one)
        batches = np.array([finished_sizes(corrected, 120, seed=seed).size_um for seed in range(100)])
        formula, course = sizes_by_formula(corrected, parts=120), batches.mean(axis=0)
        print(
            f"| {'none' if one is None else f'{one.share:g}, {one.gauge_sd_um:g} µm, {one.parts_late}'} "
            f"| {batches.mean():.3f} | {batches.std():.3f} | {formula.mean_um:.3f}, {formula.sd_um:.3f} "
            f"| {np.sqrt(np.mean(batches**2)):.3f} | {course.min():.2f} to {course.max():.2f} "
            f"| {100 * np.mean(np.abs(batches) > 2.0):.2f} % |"
        )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--parts", type=int, default=20_000)
    options = parser.parse_args()
    finished_sizes(BASE, 1)
    print("| case | r | wave | eq. 25 | Monte Carlo |\n|---|---|---|---|---|")
    times = []
    for name, setup in cases().items():
        begin = time.perf_counter()
        formula = sizes_by_formula(setup)
        formula_s = time.perf_counter() - begin
        begin = time.perf_counter()
        sizes = finished_sizes(setup, options.parts, seed=1)
        parts_s = time.perf_counter() - begin
        wanted = setup.wanted_um
        moved = f", curve {formula.curvature_um:+.3f}" if setup.characteristic is not None else ""
        print(
            f"| {name} | {formula.restlessness:.2f} | {formula.ripple_rate:.2f} "
            f"| {formula.mean_um - wanted:+.3f}, {formula.sd_um:.3f}{moved} "
            f"| {sizes.mean_um - wanted:+.4f} ± {sizes.mean_error_um:.4f}, "
            f"{sizes.sd_um:.4f} ± {sizes.sd_error_um:.4f} |"
        )
        steps = sizes.duration_s.mean()
        times.append(
            f"{name}: formula {1e3 * formula_s:.1f} ms, {options.parts / parts_s:.0f} parts/s of {steps:.2f} s"
        )
    print("\n" + "\n".join(times))
    corrections()


if __name__ == "__main__":
    main()
