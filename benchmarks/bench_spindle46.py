"""A real spindle: five tests of 40 h predict the staircase of the 6 h after them, and the error that is claimed.

    python benchmarks/bench_spindle46.py [--tests] [--single] [--separate] [--select]

With --tests only the first 40 h are used: each test is left out in turn, and the fifth predicted by the four before it.
With --separate every test is a run of its own, as if it had been recorded so.
Everything in `predict` was settled on that; how often the staircase was looked at stands in the docs.

With --select it is `select` with five thermometers that is asked, without and with memory: for a model of the 40 h that
is applied to what came after them (the fifth test with --tests), and for the error of each of the six runs (five with
--tests), the procedure made anew without it; with memory also where clocks tell that the runs follow one another.
"""

from __future__ import annotations

import argparse
import contextlib
import io
import json
import re
import tempfile
from pathlib import Path

import numpy as np
import pandas as pd

from selector.cli import exit_status
from selector.physics.thermal.modes.driven import parts_of
from selector.physics.thermal.modes.driven_model import driven_model
from selector.physics.thermal.modes.modes import AmbientCourse, Cyclogram
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
    print(f"errors are at most {model.claim_factor:.2g} times what is claimed, 19 times in 20")
    print("| response | moves, rms [µm] | left | claimed | true ÷ claimed | tests left out |")
    print("|---|---:|---:|---:|---:|---:|")
    heldout = model.heldout_um
    for r, name in enumerate(responses):
        left = float(np.sqrt(((true - found)[:, r] ** 2).mean()))
        moves = float(np.sqrt((true[:, r] ** 2).mean()))
        seen = "-" if heldout is None else f"{heldout[r]:.1f}"
        print(f"| {name} | {moves:.1f} | {left:.1f} | {claimed[r]:.1f} | {left / claimed[r]:.2f} | {seen} |")


def asked(machine: Path, *words: str | Path) -> dict:
    """The JSON of a command."""
    with contextlib.redirect_stdout(io.StringIO()) as said, contextlib.redirect_stderr(io.StringIO()):
        assert exit_status([*map(str, words), "--machine", str(machine), "--json"]) == 0
    return json.loads(said.getvalue())


def selected(before: pd.DataFrame, after: pd.DataFrame) -> None:
    """Prints what models of thermometers leave of what came after, and of every run without which they were made."""
    responses = ("X1", "Y1", "Z")
    starts = parts_of(mode_data([thermal_test("tests", before, [RESPONSES[name] for name in responses])]))
    at = np.searchsorted(before.time_s - before.time_s.iloc[0], [part.from_s for part in starts][1:])
    runs = [before.iloc[rows] for rows in np.split(np.arange(len(before)), at)] + [after]
    options = [*(word for name in responses for word in ("--response", name)), "--max-sensors", "5"]
    print("| model of | | | " + " | ".join(f"{name}: left, of [µm]" for name in responses) + " |")
    print("|---|---|---|" + "---:|" * len(responses))
    with tempfile.TemporaryDirectory() as folder:
        seconds, clock = Path(folder, "seconds"), Path(folder, "clock")
        said = (shipped("spindle46") / "machine.toml").read_text(encoding="utf-8")
        for place in (seconds, clock):
            place.mkdir()
            for k, rows in enumerate([before, *runs]):
                stamps = pd.Timestamp(2024, 1, 1) + pd.to_timedelta(rows.time_s, unit="s")
                time = stamps if place == clock else rows.time_s - rows.time_s.iloc[0]
                rows.assign(time_s=time).to_parquet(place / f"{'r' if k else 'whole'}{k}.parquet")
            text = re.sub(r"(?m)^unit = \"s\"", 'unit = "datetime"', said, count=1) if place == clock else said
            (place / "machine.toml").write_text(text, encoding="utf-8")
        for place, memory, how in ((seconds, [], "static"), (seconds, ["--memory"], "memory"),
                                   (clock, ["--memory"], "memory, clocks")):  # fmt: skip
            machine, parts = place / "machine.toml", sorted(place.glob("r*.parquet"))
            if place == seconds:
                found = asked(machine, "select", place / "whole0.parquet", *options, *memory, "--out", place / how)
                (left,) = asked(machine, "apply", place / how / "model.json", parts[-1])["per_run"].values()
                told = [f"{left[name]['rmse_um']:.1f}, {left[name]['before_rmse_um']:.1f}" for name in responses]
                print(f"| one record | {how} | {', '.join(found['chosen']['sensors'])} | " + " | ".join(told) + " |")
            models = asked(machine, "select", *parts, *options, *memory)["models"]
            for run in models[responses[0]]["per_run"]:
                of = [models[name]["per_run"][run] for name in responses]
                told = [f"{one['heldout_rmse_um']:.1f}, {one['before_rmse_um']:.1f}" for one in of]
                print(f"| the others | {how} | {run} | " + " | ".join(told) + " |")
            told = [f"{models[name]['heldout_rmse_um']:.1f}" for name in responses]
            print(f"| the others | {how} | all | " + " | ".join(told) + " |", flush=True)


def main() -> None:
    """Prints Markdown tables."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--tests", action="store_true", help="the first 40 h alone")
    parser.add_argument("--single", action="store_true", help="every response by itself")
    parser.add_argument("--separate", action="store_true", help="every test as a run of its own")
    parser.add_argument("--select", action="store_true", help="models of thermometers instead of the duty cycle")
    arguments = parser.parse_args()
    tests = pd.read_parquet(shipped("spindle46") / "tests.parquet")
    stairs = pd.read_parquet(shipped("spindle46") / "staircase.parquet")
    early = tests[tests.time_s < FIFTH_S], tests[tests.time_s >= FIFTH_S]
    if arguments.select:
        selected(*(early if arguments.tests else (tests, stairs)))
        return
    for responses in [(name,) for name in RESPONSES] if arguments.single else [tuple(RESPONSES)]:
        predicted(*(early if arguments.tests else (tests, stairs)), responses, separate=arguments.separate)


if __name__ == "__main__":
    main()
