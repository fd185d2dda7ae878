"""A real spindle: five tests of 40 h predict the staircase of the 6 h after them, and the error that is claimed.

    python benchmarks/bench_spindle46.py [--tests]

With --tests only the first 40 h are used: each test is left out in turn, and the fifth predicted by the four before it.
Everything in `predict` was settled on that; the staircase was looked at once, afterwards.
"""

from __future__ import annotations

import argparse

import numpy as np
import pandas as pd

from selector.physics.thermal.modes.cyclogram import AmbientCourse, Cyclogram
from selector.physics.thermal.modes.driven_model import driven_model
from selector.physics.thermal.modes.thermal_test import ThermalTest
from selector.shipped import shipped

RESPONSES = {"X1": "ch1", "X2": "ch2", "Y1": "ch3", "Y2": "ch4", "Z": "ch5"}
FIFTH_S = 32 * 3600


def predicted(before: pd.DataFrame, after: pd.DataFrame, responses: tuple[str, ...]) -> None:
    """Prints what is left of the displacements in what came after the tests."""
    columns = [RESPONSES[name] for name in responses]
    hall = before[["t16"]].to_numpy()
    test = ThermalTest(
        "tests",
        before.time_s.to_numpy(float),
        before.spindle.to_numpy(float),
        before[columns].to_numpy(),
        hall,
        ("t16",),
    )
    model = driven_model([test], responses)
    assert model is not None
    time = (after.time_s - after.time_s.iloc[0]).to_numpy(float)
    speed = after.spindle.to_numpy(float)
    changes = np.r_[0, 1 + np.flatnonzero(np.diff(speed))]
    cycle = Cyclogram(time[changes], speed[changes], time[-1] + 60.0)
    course = AmbientCourse(time, after[["t16"]].to_numpy(), ("t16",))
    true = after[columns].to_numpy() - after[columns].to_numpy()[0]
    found = model.displacement_um(cycle, time, course, follows=True)
    claimed = np.sqrt((model.error_um(cycle, time, course, follows=True) ** 2).mean(axis=0))
    hours = ", ".join(f"{tau / 3600:.2f}" for tau in model.fit.tau_s)
    print(f"\n{model.fit.spec.n_modes} modes ({hours} h), {model.fit.spec.law_kind}")
    print("| response | moves, rms [µm] | left | claimed | true ÷ claimed | tests left out |")
    print("|---|---:|---:|---:|---:|---:|")
    heldout = model.heldout_um
    for r, name in enumerate(responses):
        left = float(np.sqrt(((true - found)[:, r] ** 2).mean()))
        moves = float(np.sqrt((true[:, r] ** 2).mean()))
        seen = "-" if heldout is None else f"{heldout[r]:.1f}"
        print(f"| {name} | {moves:.1f} | {left:.1f} | {claimed[r]:.1f} | {left / claimed[r]:.2f} | {seen} |")


def main() -> None:
    """Prints Markdown tables."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--tests", action="store_true", help="the first 40 h alone")
    parser.add_argument("--single", action="store_true", help="every response by itself")
    arguments = parser.parse_args()
    tests = pd.read_parquet(shipped("spindle46") / "tests.parquet")
    stairs = pd.read_parquet(shipped("spindle46") / "staircase.parquet")
    early = tests[tests.time_s < FIFTH_S], tests[tests.time_s >= FIFTH_S]
    for responses in [(name,) for name in RESPONSES] if arguments.single else [tuple(RESPONSES)]:
        predicted(*(early if arguments.tests else (tests, stairs)), responses)


if __name__ == "__main__":
    main()
