"""Accuracy of predicted duty cycles and of time constants on simulated machines whose truth is known.

python -m benchmarks.bench_modes [--machines 6] [--cycles 52]

Every machine is tested at 800, 1000, 1250, 1600 and 2000 r/min (240 min of heating, 420 min of cooling; of every other
machine two tests only heat) with 0.1, 0.3 or 0.5 µm of noise and 2 to 60 s between samples. Errors are the largest of a
duty cycle relative to its peak, over rising, falling, intermittent and random cycles at tested and untested speeds.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable

import numpy as np

from selector.physics.thermal.modes.choice import choose_modes
from tests.physics.thermal.mode_machines import (
    RESPONSES,
    Machine,
    duty_cycles,
    fitted_modes,
    heat_and_cool,
    modal_machine,
    random_bar,
    random_modal,
    random_network,
    recorded,
    relative_errors,
)

MACHINES: dict[str, Callable[[np.random.Generator], Machine]] = {
    "2–4 hidden modes": random_modal,
    "6–10 lumps": random_network,
    "6–10 lumps, convection +50 %": lambda rng: random_network(rng, 0.5),
    "6–10 lumps, convection +100 %": lambda rng: random_network(rng, 1.0),
    "6–10 lumps, convection +200 %": lambda rng: random_network(rng, 2.0),
    "bar": random_bar,
    "bar, convection grows": lambda rng: random_bar(rng, 1.0),
}


def accuracy(machines: int, cycles: int) -> None:
    print("machine | two modes: median, max | chosen: median, max | other axes: median | worst machine | seconds")
    for name, make in MACHINES.items():
        chosen, plain, others, seconds = [], [], [], []
        for seed in range(machines):
            rng = np.random.default_rng(seed)
            machine = make(rng)
            schedule = heat_and_cool(only_heating=(1000.0, 1600.0) if seed % 2 else ())
            tests = recorded(machine, rng, [0.1, 0.3, 0.5][seed % 3], [10.0, 60.0, 2.0, 30.0][seed % 4], schedule)
            courses = duty_cycles(rng, count=cycles // 4)
            begin = time.perf_counter()
            fit = choose_modes(tests, RESPONSES)
            seconds.append(time.perf_counter() - begin)
            errors = 100 * relative_errors(machine, fit.model, courses)
            chosen.append((np.median(errors[:, 0]), errors[:, 0].max()))
            others.append(np.median(errors[:, 1:]))
            plain_fit, data = fitted_modes(tests, 2, "levels")
            two = plain_fit.model(data, RESPONSES)
            errors = 100 * relative_errors(machine, two, courses)
            plain.append((np.median(errors[:, 0]), errors[:, 0].max()))
        mine, his = np.array(chosen), np.array(plain)
        print(
            f"{name} | {np.median(his[:, 0]):.2f} %, {np.median(his[:, 1]):.1f} % | "
            f"{np.median(mine[:, 0]):.2f} %, {np.median(mine[:, 1]):.2f} % | {np.median(others):.2f} % | "
            f"{mine[:, 0].max():.2f} %, {mine[:, 1].max():.2f} % | {np.median(seconds):.1f}",
            flush=True,
        )


def time_constants(machines: int) -> None:
    print("true τ | tests | as many modes found | largest error of a τ: median, max")
    for tau in ((300, 1800, 7200), (400, 1200, 3600), (600, 1200, 2400), (600, 5400)):
        for words, schedule in (("five speeds", heat_and_cool()), ("one speed", heat_and_cool((2000.0,)))):
            errors = []
            for seed in range(machines):
                rng = np.random.default_rng(seed)
                size = len(tau)
                machine = modal_machine(tau, rng.uniform(5, 25, (size, 3)), rng.uniform(1, 1.5, size))
                found = choose_modes(recorded(machine, rng, 0.1, 10.0, schedule), RESPONSES).model.tau_s
                if len(found) == size:
                    errors.append(100 * float(np.abs(found / tau - 1).max()))
            print(
                f"{tau} | {words} | {len(errors)} of {machines} | {np.median(errors):.2f} %, {max(errors):.2f} %",
                flush=True,
            )


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--machines", type=int, default=6)
    parser.add_argument("--cycles", type=int, default=52)
    options = parser.parse_args()
    accuracy(options.machines, options.cycles)
    time_constants(3 * options.machines)
