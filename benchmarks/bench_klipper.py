"""How long Klipper waits for the exported module: a look at the sensors, and a move.

    python benchmarks/bench_klipper.py

Models of 2, 48 and 100 sensors (the most that are taken), each with a memory, a square, and every check of the guard;
X, Y and Z are corrected. The module is called by the stand-in for Klipper's printer; the median of five rounds is told.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from pathlib import Path
from statistics import median

sys.path.insert(0, str(Path(__file__).parents[1]))

from selector.controllers import Guard, Input, ModelFile, Output, State, Term
from selector.controllers.replay.printers_executed import Printer
from selector.controllers.writers.klipper import MOST_INPUTS, klipper_extra


def printer_of(n_sensors: int) -> Printer:
    names = [f"T{k}" for k in range(1, n_sensors + 1)]
    terms = [Term(powers={name: 2}, coefficient=0.1) for name in names]
    terms += [Term(powers={f"{name} late": 1}, coefficient=0.1) for name in names]
    model = ModelFile(
        name="many",
        inputs=tuple(Input(name=name, valid_min=0.0, valid_max=20.0, rate_limit_per_min=5.0) for name in names),
        states=tuple(State(name=f"{name} late", source=name, tau_s=900.0) for name in names),
        outputs=tuple(Output(name=axis, axis=axis, intercept=0.1, terms=tuple(terms)) for axis in "XYZ"),
        guard=Guard(stuck_after_s=900.0),
    )
    printer = Printer(klipper_extra(model))
    for _ in range(200):
        look(printer)
    return printer


def look(printer: Printer) -> None:
    printer.now += 1.0
    printer.readings = [20.0 + 0.01 * (printer.now % 3)] * len(printer.readings)
    for sensor in printer.sensors.values():
        sensor.speak(printer.now, 0.0)
    printer.tick(printer.now)


def move(printer: Printer) -> None:
    printer.extra.move([printer.at[0] + 0.1, 0.0, 1.0, 0.0], 100.0)


def seconds(of: Callable[[Printer], None], printer: Printer, times: int) -> float:
    rounds = []
    for _ in range(5):
        started = time.perf_counter()
        for _ in range(times):
            of(printer)
        rounds.append((time.perf_counter() - started) / times)
    return median(rounds)


if __name__ == "__main__":
    for n in (2, 48, MOST_INPUTS):
        made = printer_of(n)
        look_ms, move_us = 1e3 * seconds(look, made, 300), 1e6 * seconds(move, made, 3000)
        print(f"{n:3d} sensors: a look {look_ms:.2f} ms, a move {move_us:.0f} us")
