"""A real spindle: five tests of 40 h predict the staircase of the 6 h after them, and the error that is claimed.

    python benchmarks/bench_spindle46.py [--tests] [--single] [--separate]

With --tests only the first 40 h are used: each test is left out in turn, and the fifth predicted by the four before it.
With --separate every test is a run of its own, as if it had been recorded so.
Everything in `predict` was settled on that; the staircase was looked at once, afterwards.
"""

from __future__ import annotations

import argparse

import numpy as np
import pandas as pd

from selector.physics.thermal.modes.cyclogram import AmbientCourse, Cyclogram
from selector.physics.thermal.modes.driven import parts_of
from selector.physics.thermal.modes.driven_model import driven_model
from selector.physics.thermal.modes.thermal_test import ThermalTest, mode_data
from selector.shipped import shipped

RESPONSES = {"X1": "ch1", "X2": "ch2", "Y1": "ch3", "Y2": "ch4", "Z": "ch5"}
FIFTH_S = 32 * 3600


def thermal_test(name: str, rows: pd.DataFrame, columns: list[str]) -> ThermalTest:
    """These rows as a run of their own."""
    time = (rows.time_s - rows.time_s.iloc[0]).to_numpy(float)
    hall = rows[["t16"]].to_numpy()
    return ThermalTest(name, time, rows.spindle.to_numpy(float), rows[columns].to_numpy(), hall, ("t16",))


def predicted(before: pd.DataFrame, after: pd.DataFrame, responses: tuple[str, ...], *, separate: bool) -> None:
    """Prints what is left of the displacements in what came after the tests."""
    columns = [RESPONSES[name] for name in responses]
    tests = [thermal_test("tests", before, columns)]
    if separate:
        at = np.searchsorted(tests[0].time_s, [part.from_s for part in parts_of(mode_data(tests))][1:])
        tests = [
            thermal_test(f"r{k}", before.iloc[rows], columns)
            for k, rows in enumerate(np.split(np.arange(len(before)), at))
        ]
    model = driven_model(tests, responses)
    assert model is not None
    time = (after.time_s - after.time_s.iloc[0]).to_numpy(float)
    speed = after.spindle.to_numpy(float)
    changes = np.r_[0, 1 + np.flatnonzero(np.diff(speed))]
    cycle = Cyclogram(time[changes], speed[changes], time[-1] + 60.0)
    course = AmbientCourse(time, after[["t16"]].to_numpy(), ("t16",))
    true = after[columns].to_numpy() - after[columns].to_numpy()[0]
    found = model.displacement_um(cycle, time, course, follows=not separate)
    errors = model.error_um(cycle, time, course, follows=not separate, told=not separate)
    claimed = np.sqrt((errors**2).mean(axis=0))
    hours = ", ".join(f"{tau / 3600:.2f}" for tau in model.fit.tau_s)
    print(f"\n{model.fit.spec.n_modes} modes ({hours} h), {model.fit.spec.law_kind}")
    print(f"claims known to a factor of {model.claim_factor:.2g}")
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
    parser.add_argument("--separate", action="store_true", help="every test as a run of its own")
    arguments = parser.parse_args()
    tests = pd.read_parquet(shipped("spindle46") / "tests.parquet")
    stairs = pd.read_parquet(shipped("spindle46") / "staircase.parquet")
    early = tests[tests.time_s < FIFTH_S], tests[tests.time_s >= FIFTH_S]
    for responses in [(name,) for name in RESPONSES] if arguments.single else [tuple(RESPONSES)]:
        predicted(*(early if arguments.tests else (tests, stairs)), responses, separate=arguments.separate)


if __name__ == "__main__":
    main()
