"""What the program promises to do within a time, beside the time that it takes here.

python -m benchmarks.bench_promises [--repeats 3]

Tests count work and do not depend on the machine; these times do. Quickest of some runs, one thread (set
OMP_NUM_THREADS=1), compiled code warm. Ends with exit code 1 where a promise is not kept.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

from selector.cli import exit_status
from selector.controllers import evaluate
from selector.controllers.model_file import Input, ModelFile, Output, Term
from selector.physics.thermal.field.machine import virtual_machining_centre
from selector.physics.thermal.network.heat_system import Conditions
from selector.physics.thermal.network.transient import simulate_heat
from selector.physics.vibration.model_file import read_model_file
from selector.physics.vibration.periodic_error import realisation_amounts, section_times
from selector.physics.vibration.vibration_model import vibration_model

FIXTURES = Path(__file__).parents[1] / "fixtures"


def million_samples() -> Callable[[], object]:
    n, names = 10**6, [f"T{i}" for i in range(1, 38)]
    model = ModelFile(
        name="37",
        inputs=[Input(name=name, valid_min=0, valid_max=10, centre=3, scale=2) for name in names],
        outputs=[Output(name="Z", intercept=1, terms=[Term(powers={name: 1}, coefficient=0.3) for name in names])],
    )
    column, time_s = np.random.default_rng(0).normal(25.0, 3.0, n), np.arange(n, dtype=np.float64)
    return lambda: evaluate(model, time_s, dict.fromkeys(names, column))


def table_of_text(folder: Path) -> Callable[[], object]:
    from selector.readers import read

    rows, columns = 200_000, 40
    cells = np.round(20 + np.random.default_rng(0).normal(0, 3, (rows, columns)), 3)
    cells[:, 0] = np.arange(rows)
    head = "t [s]," + ",".join(f"T{k} [degC]" for k in range(1, columns)) + "\n"
    path = folder / "table.csv"
    path.write_text(head + "\n".join(",".join(map(repr, row)) for row in cells.tolist()), encoding="utf-8")
    return lambda: read([path])


def realisations() -> Callable[[], object]:
    rng, count = np.random.default_rng(1), 250
    motion = rng.normal(size=count) + 1j * rng.normal(size=count)
    frequency, source = rng.uniform(10.0, 2000.0, count), np.arange(count) % 5
    times = section_times(10_000, 1.0)
    return lambda: realisation_amounts(motion, frequency, source, times, n_sources=5)


def lathe() -> Callable[[], object]:
    model = vibration_model(read_model_file(FIXTURES / "vibration" / "lathe.toml"))
    stiffness = iter(np.linspace(0.1, 0.3, 1000))
    return lambda: model.with_parameters({"joints.1.dissipation": float(next(stiffness))}).simulation()


def shift_of_the_machine() -> Callable[[], object]:
    machine = virtual_machining_centre(refinement=0.5)
    time_s = np.arange(0.0, 8 * 3600 + 1, 60.0)
    conditions = Conditions(time_s, spindle_speed=np.where(time_s < 14_400, 3000.0, 500.0))
    return lambda: simulate_heat(machine.system, machine.laws, conditions, time_s=time_s, step_s=20.0, start_degc=20.0)


def hostile_name() -> Callable[[], object]:
    from selector.errors import ModelFileError
    from selector.physics.thermal.model_file import parsed_model_file

    def refused() -> None:
        try:
            parsed_model_file("[model]\n" + "a" * 4_000_000)
        except ModelFileError:
            return
        raise AssertionError

    return refused


def measured(work: Callable[[], object], repeats: int) -> float:
    """Quickest of some runs [s], after one that warms up."""
    work()
    times = []
    for _ in range(repeats):
        begin = time.perf_counter()
        work()
        times.append(time.perf_counter() - begin)
    return min(times)


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--repeats", type=int, default=3)
    options = parser.parse_args()
    broken = 0
    with tempfile.TemporaryDirectory() as scratch:
        for name, promised_s, work in (
            ("10⁶ samples of a model of 37 sensors", 1.5, million_samples()),
            ("a CSV of 40 columns × 200 000 rows", 3.0, table_of_text(Path(scratch))),
            ("1024 realisations at 10 000 sections", 0.5, realisations()),
            ("a simulation of the lathe with another parameter", 0.25, lathe()),
            ("a shift of the virtual machining centre, reduced", 2.0, shift_of_the_machine()),
            ("a model file with a key of 4 million letters is refused", 5.0, hostile_name()),
            ("selector --help, in a process that has begun", 0.5, lambda: exit_status(["--help"])),
        ):
            took_s = measured(work, options.repeats)
            broken += took_s > promised_s
            print(f"{name:60s} {took_s:8.3f} s, promised {promised_s:g} s", file=sys.stderr)
    sys.exit(int(broken > 0))


if __name__ == "__main__":
    main()
