"""An unplanned stop of 20 to 60 min in each of 60 duty cycles: the plan alone, and followed by two thermometers.

python benchmarks/bench_observer.py [--seed 22] [--physics linear everything] [--thermometers T01 T13]

The virtual machining centre and the tests are those of `bench_cyclograms.py`, one at 200 r/min among them, with
thermometers (noise 0.05 K, resolution 0.1 K) beside the gauges. In every duty cycle the spindle is stopped once while
it turns; then the plan goes on by the clock, or, as often, from where it was left. Readings come once a minute, and the
displacement at each of them uses no later one. Errors are root mean squares over the time of the plan, against the true
course. Some 15 min a machine on one core.
"""

from __future__ import annotations

import argparse

import numpy as np
from bench_cyclograms import AXES, HALL_DEGC, PERIOD_S, SLOW_TEST, TESTS, Vector, duty_cycles

from selector.physics.thermal.field.machine import VirtualMachine, virtual_machining_centre
from selector.physics.thermal.modes.choice import choose_modes
from selector.physics.thermal.modes.modes import Cyclogram
from selector.physics.thermal.modes.thermal_test import ThermalTest
from selector.physics.thermal.network.heat_system import Conditions
from selector.physics.thermal.network.transient import simulate_heat
from selector.physics.thermal.prediction.answer import modal_repeats
from selector.physics.thermal.prediction.observer import DayReadings, Stop, as_run, observed
from tests.physics.thermal.segments import of_segments

NOISE_UM, NOISE_K, DIGITS_UM, DIGITS_K = 0.3, 0.05, 1, 1
SHORTEST_S, LONGEST_S, LAST_S = 1200.0, 3600.0, 1200.0


class Rig:
    """The machine, switched on and idle until nothing changes, with its gauges and thermometers."""

    def __init__(self, machine: VirtualMachine, thermometers: tuple[str, ...], seed: int) -> None:
        self.machine, self.thermometers, self.rng = machine, thermometers, np.random.default_rng(seed)
        day = 40 * 86_400.0
        rest = Conditions([0.0, day], spindle_speed=[0.0, 0.0], ambient_degc=[HALL_DEGC] * 2)
        settled = simulate_heat(machine.system, machine.laws, rest, time_s=[day], step_s=3600.0, start_degc=HALL_DEGC)
        self.start = settled.end_state

    def course(self, cycle: Cyclogram, time_s: Vector) -> Vector:
        """Displacements [µm], then temperatures [K], from the start, (n_times, 3 + n_thermometers)."""
        conditions = Conditions(
            np.append(cycle.start_s, cycle.end_s),
            spindle_speed=np.append(cycle.speed_rpm, 0.0),
            ambient_degc=np.full(len(cycle.start_s) + 1, HALL_DEGC),
        )
        history = simulate_heat(
            self.machine.system, self.machine.laws, conditions, time_s=time_s, step_s=20.0, start_state=self.start
        )
        um = history.displacement_um[:, [history.displacements.index(axis) for axis in AXES]]
        values = np.hstack([um, history.probe_degc[:, [history.probes.index(name) for name in self.thermometers]]])
        return values - values[0]

    def read(self, true: Vector) -> Vector:
        """What gauges and thermometers show of it."""
        of_gauges = np.round(true[:, :3] + self.rng.normal(0.0, NOISE_UM, true[:, :3].shape), DIGITS_UM)
        of_others = np.round(true[:, 3:] + self.rng.normal(0.0, NOISE_K, true[:, 3:].shape), DIGITS_K)
        return np.hstack([of_gauges, of_others])

    def tests(self) -> list[ThermalTest]:
        """The recorded tests."""
        found = []
        for name, segments in (TESTS | SLOW_TEST).items():
            cycle = of_segments(*segments)
            time_s = np.arange(0.0, cycle.end_s + 1.0, PERIOD_S)
            read = self.read(self.course(cycle, time_s))
            found.append(ThermalTest(name, time_s, cycle.speed_at(time_s), read))
        return found

    def stop(self, plan: Cyclogram) -> Stop:
        """A stop while the spindle turns, at any moment but the last 20 min."""
        while True:
            begin_s = float(self.rng.uniform(0.0, plan.end_s - LAST_S))
            if plan.speed_at(np.array([begin_s]))[0] > 0:
                length_s, delays = float(self.rng.uniform(SHORTEST_S, LONGEST_S)), bool(self.rng.integers(2))
                return Stop(begin_s, min(begin_s + length_s, plan.end_s - 1.0), delays)


def errors(rig: Rig, seed: int) -> Vector:
    """Root mean squares (n_cycles, 2, 2, 3) [µm]: without and with a stop, by plan and by readings, per axis."""
    tests, names = rig.tests(), (*AXES, *rig.thermometers)
    fit = choose_modes(tests, names)
    columns = np.arange(3, len(names))
    repeats = modal_repeats(tests, fit.model, warm=fit.warm)
    noise_k = np.sqrt(np.mean([one.rmse_um[columns] ** 2 for one in repeats], axis=0))
    found, stops = [], []
    for plan in duty_cycles(seed):
        time_s = np.arange(0.0, plan.end_s + 1e-6, PERIOD_S)
        by_plan, both = fit.model.displacement_um(plan, time_s)[:, :3], []
        for stop in ((), (rig.stop(plan),)):
            true = rig.course(as_run(plan, stop, plan.end_s), time_s)
            day = DayReadings(rig.thermometers, time_s, rig.read(true)[:, 3:], {})
            seen = observed(fit.model.displacement_um, plan, names, day, noise_k, fit.heldout_um[columns])
            followed = np.array([np.interp(time_s, seen.time_s, seen.displacement_um[:, r]) for r in range(3)]).T
            stops.append((len(stop), len(seen.stops)))
            both.append([np.sqrt(((one - true[:, :3]) ** 2).mean(axis=0)) for one in (by_plan, followed)])
        found.append(both)
    told = [sum(one == (k, k) for one in stops) for k in (0, 1)]
    print(f"of {len(found)} days without a stop none was found in {told[0]}, of as many with one, one in {told[1]}")
    return np.array(found)


def main() -> None:
    """Prints a Markdown table a machine."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seed", type=int, default=22)
    parser.add_argument("--physics", nargs="+", default=["linear", "everything"])
    parser.add_argument("--thermometers", nargs="+", default=["T01", "T13"])
    asked = parser.parse_args()
    for physics in asked.physics:
        print(f"\n## {physics}, seed {asked.seed}, {' and '.join(asked.thermometers)}")
        found = errors(Rig(virtual_machining_centre(physics), tuple(asked.thermometers), asked.seed), asked.seed)
        print("| axis | no stop: plan | readings | stop: plan | readings | with ÷ without | duty cycles ≤ 1.5 |")
        print("|---|---:|---:|---:|---:|---:|---:|")
        for r, axis in reversed(list(enumerate(AXES))):
            one = found[:, :, :, r]
            rms = np.sqrt((one**2).mean(axis=0))
            held = np.mean(one[:, 1, 1] <= 1.5 * one[:, 0, 1])
            print(
                f"| {axis} | {rms[0, 0]:.3f} | {rms[0, 1]:.3f} | {rms[1, 0]:.3f} | {rms[1, 1]:.3f} "
                f"| {rms[1, 1] / rms[0, 1]:.2f} ({rms[1, 1] / rms[0, 0]:.2f} of the plan's) | {held:.0%} |"
            )


if __name__ == "__main__":
    main()
