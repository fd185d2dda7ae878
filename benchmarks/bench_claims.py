"""The error that `predict` claims from separate tests in a hall that moves, on simulated machines whose truth is known.

    python benchmarks/bench_claims.py [--machines 8] [--seed 1] [--tests 5] [--start cold|mixed] [--days 0.04]

A machine has three to five modes, each with an exponent of the speed and a gain per kelvin of the hall of its own; half
of the machines cool better while they turn, half drift by 0.3 µm in an hour. So no fit has the law of the machine. A
test heats, then cools, in a run of its own; `mixed`: all but the first begin warm from other work. From these tests six
duty cycles that begin cold are predicted. Told is true ÷ claimed error, root mean square over the duty cycles, how
often it is above the factor that is told beside the claim, and how often a single duty cycle is.

With `--days` the hall is constant and nothing drifts, tests begin cold, and all that a day moves is larger or smaller
by this much (standard deviation), the days of the duty cycles, too.
"""

from __future__ import annotations

import argparse

import numpy as np
from numpy.typing import NDArray

from selector.physics.thermal.modes.choice import choose_modes
from selector.physics.thermal.modes.driven_model import driven_model
from selector.physics.thermal.modes.heldout import AT_MOST
from selector.physics.thermal.modes.modes import AmbientCourse, Cyclogram
from selector.physics.thermal.modes.thermal_test import ThermalTest
from selector.types import Vector
from tests.physics.thermal.segments import of_segments

Squares = NDArray[np.float64]
FASTEST_RPM, N_CYCLES, PERIOD_S = 5000.0, 6, 60.0
SPEEDS_RPM = (800, 1000, 1250, 1600, 2000, 2500, 3000, 3500, 4000, 4500)
RESPONSES = ("Z", "X")


class Machine:
    """Modes with random time constants, gains and exponents."""

    def __init__(self, rng: np.random.Generator) -> None:
        self.rng, modes, self.scatter = rng, int(rng.integers(3, 6)), 0.0
        self.tau_s = np.exp(np.sort(rng.uniform(np.log(400), np.log(20000), modes)))
        self.gain_um = rng.normal(0, 1, (modes, 2)) * [20, 8]
        self.hall_um_per_k = rng.normal(0, 1.5, (modes, 2))
        self.exponent = rng.uniform(0.9, 1.7, modes)
        self.film, self.walk_um, self.noise_um = rng.choice([0.0, 0.5]), rng.choice([0.0, 0.3]), rng.choice([0.1, 0.3])

    def on_days(self, scatter: float) -> None:
        """From now on the hall is constant, nothing drifts, and days scatter."""
        self.hall_um_per_k[:], self.walk_um, self.scatter = 0.0, 0.0, scatter

    def run(self, cycle: Cyclogram, *, warm: bool = False, noise: bool = True) -> tuple[Vector, Vector, Vector, Vector]:
        """(times [s], displacements [µm], hall [°C], speeds [r/min]); a warm run begins after other work."""
        rng, n, before = self.rng, int(cycle.end_s // PERIOD_S) + 1, 600 if warm else 0
        at, day = np.arange(before + n) * PERIOD_S, rng.uniform(size=2)
        hall = 21 + rng.normal() + rng.uniform(0.5, 2) * np.sin(2 * np.pi * (at / 86400 + day[0]))
        hall += 0.3 * np.sin(2 * np.pi * (at / 9000 + day[1]))
        time = at[:n]
        speed = cycle.speed_at(np.minimum(time, cycle.end_s - 1e-6))
        share = np.r_[np.zeros(before), speed / FASTEST_RPM]
        if warm:
            share[100 : 100 + rng.integers(60, 300)] = rng.uniform(0.2, 0.9)
            share[before - rng.integers(60, 240) : before] = 0.0
        state, course = np.zeros((len(self.tau_s), 2)), np.empty((before + n, 2))
        for i, here in enumerate(share):
            course[i] = state.sum(axis=0)
            cooling = 1.0 + self.film * here
            kept = np.exp(-PERIOD_S * cooling / self.tau_s)[:, None]
            level = (here**self.exponent)[:, None] * self.gain_um + (hall[i] - hall[0]) * self.hall_um_per_k
            state = state * kept + level / cooling * (1.0 - kept)
        moved = course[before:] - course[before]
        moved *= 1.0 + (self.scatter * rng.normal() if self.scatter else 0.0)
        moved += np.cumsum(rng.normal(0, self.walk_um * np.sqrt(PERIOD_S / 3600), moved.shape), axis=0)
        if noise:
            moved += rng.normal(0, self.noise_um, moved.shape)
        return np.asarray(time), moved, np.asarray(hall[before:] + rng.normal(0, 0.02 * noise, n)), speed


def tests_of(machine: Machine, n_tests: int, start: str) -> list[ThermalTest]:
    """Heating and cooling, each in a run of its own, one of them at the fastest speed."""
    rng, found = machine.rng, []
    for k, speed in enumerate(rng.permutation([FASTEST_RPM, *rng.choice(SPEEDS_RPM, n_tests - 1, replace=False)])):
        parts = (10.0, 0.0), (rng.uniform(120, 300), float(speed)), (rng.uniform(60, 300), 0.0)
        time, moved, hall, held = machine.run(of_segments(*parts), warm=start == "mixed" and k > 0)
        seen = () if machine.scatter else (hall[:, None], ("hall",))
        found.append(ThermalTest(f"r{k + 1}", time, held, moved, *seen))
    return found


def duty_cycle(rng: np.random.Generator) -> Cyclogram:
    """Three to seven segments of up to an hour and a half, some of them pauses."""
    speeds = rng.choice([0, 0, *range(600, 5001, 200)], int(rng.integers(3, 8)))
    return of_segments(*((float(rng.uniform(20, 90)), float(speed)) for speed in speeds))


def claims_of_days(machine: Machine, n_tests: int) -> Squares | None:
    """Squares of true and claimed error [µm²] of duty cycles on days that scatter, (2, n_cycles, n_responses)."""
    fit = choose_modes(tests_of(machine, n_tests, "cold"), RESPONSES)
    if fit.left_out is None:
        return None
    squares = []
    for _ in range(N_CYCLES):
        cycle = duty_cycle(machine.rng)
        time, true, *_ = machine.run(cycle, noise=False)
        course = fit.model.displacement_um(cycle, np.minimum(time, cycle.end_s))
        claimed = fit.left_out.claimed_um(np.sqrt(np.mean(course**2, axis=0)))
        squares.append((((course - true) ** 2).mean(axis=0), claimed**2))
    return np.moveaxis(np.array(squares), 0, 1)


def claims_in_a_hall(machine: Machine, n_tests: int, start: str) -> Squares | None:
    """As `claims_of_days`, in a hall that moves; None where that is not seen, or nothing is claimed."""
    model = driven_model(tests_of(machine, n_tests, start), RESPONSES)
    if model is None or model.heldout_um is None:
        return None
    squares = []
    for _ in range(N_CYCLES):
        cycle = duty_cycle(machine.rng)
        time, true, degc, _ = machine.run(cycle, noise=False)
        time, hall = np.minimum(time, cycle.end_s), AmbientCourse(time, degc[:, None], ("hall",))
        off = model.displacement_um(cycle, time, hall, follows=False) - true
        claimed = model.error_um(cycle, time, hall, follows=False)
        squares.append(((off**2).mean(axis=0), (claimed**2).mean(axis=0)))
    return np.moveaxis(np.array(squares), 0, 1)


def main() -> None:
    """Prints a line a machine, and what all of them say."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--machines", type=int, default=8)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--tests", type=int, default=5)
    parser.add_argument("--start", choices=("cold", "mixed"), default="cold")
    parser.add_argument("--days", type=float)
    arguments = parser.parse_args()
    of_machines, of_cycles = [], []
    for m in range(arguments.machines):
        machine = Machine(np.random.default_rng([arguments.seed, m]))
        if arguments.days is not None:
            machine.on_days(arguments.days)
            squares = claims_of_days(machine, arguments.tests)
        else:
            squares = claims_in_a_hall(machine, arguments.tests, arguments.start)
        if squares is None:
            print(f"machine {m}: the hall is not seen, or nothing is claimed", flush=True)
            continue
        true_um, claimed_um = np.sqrt(squares.mean(axis=1))
        of_machines.append(true_um / claimed_um)
        of_cycles.append(np.sqrt(squares[0] / squares[1]))
        told = " ".join(f"{n} {t:.2f}/{c:.2f}" for n, t, c in zip(RESPONSES, true_um, claimed_um, strict=True))
        print(f"machine {m}: true/claimed [µm] {told}", flush=True)
    ratios, single = np.array(of_machines), np.concatenate(of_cycles)
    near = np.mean(np.abs(np.log(ratios)) <= np.log(1.5))
    above, alone = (np.mean(some > AT_MOST) for some in (ratios, single))
    low, median, high = ratios.min(), np.median(ratios), ratios.max()
    print(
        f"{arguments.tests} tests, {arguments.start}, seed {arguments.seed}, {ratios.size} claims: true ÷ claimed "
        f"{median:.2f} (median; {low:.2f} to {high:.2f}), within a factor of 1.5 {near:.0%}, above {AT_MOST:g} "
        f"{above:.1%}; of single duty cycles {alone:.1%}"
    )


if __name__ == "__main__":
    main()
