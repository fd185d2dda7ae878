"""Every written file of every control on 28 801 rows, one a second: how far it is from what it has to give.

    python benchmarks/bench_replay.py [--only c linuxcnc …]

The rows are run 1 of the simulated fixtures/vmc37, interpolated, with noise of 0.02 K, stretches of missing readings,
break codes, an axis that moves, and a sign test that somebody forgets. The model has a rise, an ambient reading and a
speed, memory of half an hour and of 12 h, and a slope; the drive has a model of one temperature.
"""

from __future__ import annotations

import argparse
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd

from selector.controllers import Guard, Input, ModelFile, Output, OutputLimits, PositionPart, State, Term
from selector.controllers.guard.decided import with_decided_limits
from selector.controllers.replay.parts import Rows, reference_answers
from selector.controllers.replay.replayed import executed
from selector.controllers.writers.targets import TARGETS

ROOT = Path(__file__).parents[1]


def model_of_three(*, has_slope: bool) -> ModelFile:
    """A rise, an ambient reading and a speed, with memory."""
    inputs = (
        Input(name="T15", valid_min=-2.0, valid_max=14.0, centre=5.0, scale=4.0, rate_limit_per_min=6.0),
        Input(name="Tamb", reference="absolute", valid_min=15.0, valid_max=28.0, centre=21.0, scale=2.0),
        Input(name="spindle_speed", role="spindle_speed", unit="rpm", reference="absolute", valid_min=0.0,
              valid_max=6000.0, scale=1000.0),
    )  # fmt: skip
    states = tuple(
        State(name=f"T15 over {tau_s:.0f} s", source="T15", tau_s=tau_s, centre=2.0, scale=4.0)
        for tau_s in (1800.0, 43_200.0)
    )
    named = [*(item.name for item in inputs), *(state.name for state in states)]
    terms = tuple(
        Term(powers={name: 1}, coefficient=c) for name, c in zip(named, (7.3, -2.1, 0.9, 4.4, -3.2), strict=True)
    )
    part = PositionPart(
        axis="Z", reference_m=0.1, valid_min_m=0.0, valid_max_m=0.5, intercept=1.5,
        terms=(Term(powers={"T15": 1}, coefficient=6.0),),
    )  # fmt: skip
    limits = (OutputLimits(output="Z", clamp_um=60.0, slew_um_per_s=0.7), OutputLimits(output="Y", clamp_um=20.0))
    return with_decided_limits(
        ModelFile(
            name="three sensors", inputs=inputs, states=states,
            outputs=(
                Output(name="Z", axis="Z", intercept=-1.9, terms=terms, position=part if has_slope else None),
                Output(name="Y", axis="Y", intercept=0.3, terms=terms[:2]),
            ),
            guard=Guard(limits=limits, hold_at_most_s=1200.0),
        )
    )  # fmt: skip


def model_of_one() -> ModelFile:
    """What fits into the parameters of a drive."""
    item = Input(name="Tamb", reference="absolute", valid_min=15.0, valid_max=28.0, centre=20.0)
    return ModelFile(
        name="one sensor",
        inputs=(item,),
        outputs=(Output(name="Z", axis="Z", intercept=0.0, terms=(Term(powers={"Tamb": 1}, coefficient=4.0),)),),
    )


def recorded(model: ModelFile) -> Rows:
    """Run 1 of the fixture at 1 s, with faults."""
    rng = np.random.default_rng(7)
    table = pd.read_csv(ROOT / "fixtures" / "vmc37" / "r1.csv")
    time_s = np.arange(0.0, 60.0 * table["t_min"].iloc[-1] + 1.0)
    n = len(time_s)
    columns = []
    for item in model.inputs:
        values = np.interp(time_s, 60.0 * table["t_min"], table[item.name])
        columns.append(values if item.unit == "rpm" else values + rng.normal(0.0, 0.02, n))
    readings = np.column_stack(columns)
    for start in rng.integers(600, n - 3000, 6):
        readings[start : start + rng.integers(20, 2500), rng.integers(readings.shape[1])] = rng.choice(
            [np.nan, 850.0, -9999.0]
        )
    axes = [output.position.axis for output in model.outputs if output.position is not None]
    positions = np.tile(0.25 + 0.25 * np.sin(time_s / 40.0)[:, None], (1, len(axes)))
    tests = np.zeros((n, len(model.outputs)))
    tests[20_000:22_000, 0] = 5.0
    yes = np.ones(n, dtype=bool)
    return Rows(np.diff(time_s, prepend=0.0), readings, positions, yes, yes, ~yes, np.zeros(n), tests)


def main() -> None:
    """Prints a row per file."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--only", nargs="+", choices=TARGETS, default=list(TARGETS))
    for name in parser.parse_args().only:
        target = TARGETS[name]
        has_slope = name not in ("fanuc", "reprapfirmware")
        model = model_of_one() if name == "rexroth" else model_of_three(has_slope=has_slope)
        rows = recorded(model)
        if not target.has_guard:
            rows = replace(rows, test_um=None)
        began, whole = time.perf_counter(), reference_answers(model, rows)
        files = target.write(model).files
        for part in executed(model, files, [one for one in target.parts if one.file in files], rows, whole):
            for of in part.differences(model):
                print(
                    f"{name:9s} {of.file:30s} {of.output}, {len(rows)} rows: {of.max_abs_difference_um:.2g} µm, "
                    f"{of.allowed_um:.2g} allowed, {of.guard_difference_um:.2g} from the guard ({of.executed_by})",
                    flush=True,
                )
        modes = ", ".join(f"{mode}: {share:.0%}" for mode, share in _shares(whole.mode))
        largest = np.abs(whole.correction_um).max()
        print(f"{'':9s} modes {modes}; up to {largest:.3g} µm; {time.perf_counter() - began:.0f} s", flush=True)


def _shares(modes: np.ndarray) -> list[tuple[int, float]]:
    return [(int(mode), float(np.mean(modes == mode))) for mode in np.unique(modes)]


if __name__ == "__main__":
    main()
