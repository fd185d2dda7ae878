"""A million hostile rows through the guard, and how many rows a second generated C does.

The guard is there as a person reads it (tests/controllers/plain_guard.py), as statements, as generated C and Python.

    python benchmarks/bench_guard.py [--rows 1000000] [--adapted] [--all]

The rows are those of tests/controllers/hostile.py: NaN, infinities, break codes, jumps, sensors that stand still, drop
out and return, any time step, switches and restarts; with --adapted also touch-offs, one in ten false.
Every correction, mode and sensor code is compared; with --all also those of Structured Text (interpreted, also as
PLCopen XML has it), of the functional mock-up unit in FMPy, of Klipper's module, of SCL and C in single precision, with
the statements in binary32, and of the component in LinuxCNC, which prints 10⁻⁶ µm.
"""

from __future__ import annotations

import argparse
import sys
import time
from dataclasses import fields
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))

from selector.controllers import read_model
from selector.controllers.c_compiler import compiler, compiler_version
from selector.controllers.guard.decided import decided_limits
from selector.controllers.program.guarded_program import axes_of
from selector.controllers.replay.compiled import c_answers, fmu_answers, halrun_answers, missing_program, python_answers
from selector.controllers.replay.parts import Answers, Rows, reference_answers
from selector.controllers.replay.printers_executed import klipper_answers
from selector.controllers.replay.structured_text_executed import st_answers, text_of_plcopen
from selector.controllers.writers.sinumerik import scl_text
from selector.controllers.writers.structured_text import plcopen_export
from tests.controllers import hostile
from tests.controllers.plain_guard import plain_answers

MODEL = Path(__file__).parents[1] / "fixtures" / "models" / "patent-three-sensors.json"
PIECE = 100_000


def others(n: int, *, is_adapted: bool) -> None:
    """Structured Text, what is in single precision, and LinuxCNC, each beside the statements in its own numbers."""
    model = hostile.adapted(hostile.model()) if is_adapted else hostile.model()
    unequal, off_um, modes = {"ST": 0, "PLCopen": 0, "FMU": 0, "SCL": 0, "C float": 0, "Klipper": 0}, 0.0, 0
    for seed in range(n // PIECE):
        rows = hostile.rows(PIECE, 1000 + seed, len(axes_of(model)))
        rows = hostile.touched(rows, 2000 + seed) if is_adapted else rows
        double, single = reference_answers(model, rows), reference_answers(model, rows, np.float32)
        given = {"ST": st_answers(model, rows), "SCL": st_answers(model, rows, scl_text(model))}
        given["PLCopen"] = st_answers(model, rows, text_of_plcopen(*plcopen_export(model).files.values()))
        given["FMU"] = fmu_answers(model, rows)
        given["C float"] = c_answers(model, rows, "float")
        if not is_adapted:  # Klipper takes no touch-offs
            given["Klipper"] = klipper_answers(model, rows)
        for name, answers in given.items():
            whole = double if name in ("ST", "PLCopen", "FMU", "Klipper") else single
            unequal[name] += sum(
                int(np.sum(getattr(whole, field.name) != getattr(answers, field.name))) for field in fields(Answers)
            )
        if missing_program() is None:
            shown = halrun_answers(model, rows)
            off_um = max(off_um, float(np.abs(shown.correction_um - double.correction_um).max()))
            modes += int(np.sum(shown.mode != double.mode))
    print(f"{n} rows, values that differ: " + ", ".join(f"{name} {count}" for name, count in unequal.items()))
    if missing_program() is None:
        print(f"LinuxCNC: {off_um:.1e} um at most, {modes} other modes")


def agreement(n: int, *, is_adapted: bool) -> None:
    model = hostile.adapted(hostile.model()) if is_adapted else hostile.model()
    limits, _ = decided_limits(model)
    unequal, beyond, worst, started = 0, 0, 0.0, time.perf_counter()
    for seed in range(n // PIECE):
        rows = hostile.rows(PIECE, 1000 + seed, len(axes_of(model)))
        rows = hostile.touched(rows, 2000 + seed) if is_adapted else rows
        guard = plain_answers(model, rows)
        for other in (reference_answers(model, rows), c_answers(model, rows), python_answers(model, rows)):
            for field in fields(Answers):
                # NaN would be unequal to itself
                unequal += int(np.sum(getattr(guard, field.name) != getattr(other, field.name)))
        for k, limit in enumerate(limits.values()):
            beyond += int(np.sum(~(np.abs(guard.correction_um[:, k]) <= limit.clamp_um)))
            step = np.abs(np.diff(guard.k0_um[:, k]))
            passed_s = np.clip(np.nan_to_num(rows.dt_s[1:], nan=0.0, posinf=10.0), 0.0, 10.0)
            free = (guard.mode[1:] != 0) & ~rows.is_restart[1:]
            worst = max(worst, float(np.max((step - limit.own_slew_um_per_s * passed_s)[free])))
        # the whole correction of the output with a slope, without what its axis takes along
        where, taken = positions_taken(rows.positions_m[:, 0])
        carried = np.where(taken[1:] & taken[:-1], guard.slope_um_per_m[:-1, 0] * np.diff(where), 0.0)
        limit = limits["Z"]
        base = np.clip(guard.correction_um[:-1, 0] + carried, -limit.clamp_um, limit.clamp_um)
        step = np.abs(guard.correction_um[1:, 0] - base)
        worst = max(worst, float(np.max((step - limit.slew_um_per_s * passed_s)[free])))
    took_s = time.perf_counter() - started
    print(f"{n} rows, {took_s:.0f} s: {unequal} values differ between the plain guard and statements, C or Python;")
    print(
        f"{beyond} corrections are not finite or beyond their clamp; slew exceeded by {max(worst, 0.0):.1e} um at most"
    )


def positions_taken(positions_m: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Positions inside the valid ones, where missing the last known; and which were there."""
    taken = np.abs(np.nan_to_num(positions_m, nan=np.inf)) <= 1e9
    last = np.maximum.accumulate(np.where(taken, np.arange(len(taken)), -1))
    part = hostile.model().outputs[0].position
    known = np.where(last >= 0, positions_m[np.maximum(last, 0)], part.reference_m)
    return np.clip(known, part.valid_min_m, part.valid_max_m), taken


def throughput(n: int) -> None:
    model = read_model(MODEL)
    rng, yes, no = np.random.default_rng(0), np.ones(n, dtype=bool), np.zeros(n, dtype=bool)
    low, high = (np.array([getattr(item, key) for item in model.inputs]) for key in ("valid_min", "valid_max"))
    readings = 20.0 + low + (high - low) * rng.random((n, len(low)))
    rows = Rows(np.ones(n), readings, np.zeros((n, len(axes_of(model)))), yes, yes, no, np.zeros(n))
    for precision in ("double", "float"):
        few = _seconds(model, _part(rows, n // 10), precision)
        many = _seconds(model, rows, precision)
        per_row_s = (many - few) / (n - n // 10)
        print(f"{len(model.inputs)} sensors, {precision}: {1.0 / per_row_s:.3g} rows/s, {1e9 * per_row_s:.0f} ns a row")


def _part(rows: Rows, n: int) -> Rows:
    tables = {field.name: getattr(rows, field.name) for field in fields(Rows)}
    return Rows(**{name: None if table is None else table[:n] for name, table in tables.items()})


def _seconds(model, rows: Rows, precision) -> float:
    best = np.inf
    for _ in range(5):
        started = time.perf_counter()
        c_answers(model, rows, precision)
        best = min(best, time.perf_counter() - started)
    return float(best)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--rows", type=int, default=1_000_000)
    parser.add_argument("--adapted", action="store_true", help="with touch-offs")
    parser.add_argument("--all", action="store_true", help="also Structured Text, SCL, C in single precision, LinuxCNC")
    options = parser.parse_args()
    print(compiler_version(compiler() or "cc"))
    if not options.adapted:
        throughput(options.rows)
    agreement(options.rows, is_adapted=options.adapted)
    if options.all:
        others(options.rows, is_adapted=options.adapted)


if __name__ == "__main__":
    main()
