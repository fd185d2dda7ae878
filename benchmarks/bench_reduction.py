"""The reduced virtual machining centre against its whole field: states, time and error of eight-hour shifts.

    python benchmarks/bench_reduction.py [--refinement 1.0] [--shifts 3]

Shifts have random speeds (held for 20 to 60 min), random hours of coolant and a hall that swings. Errors are relative
to the peak of each displacement and sensor; the largest over all shifts is printed.
"""

from __future__ import annotations

import argparse
import time

import numpy as np

from selector.physics.thermal.field.machine import film_sets, virtual_machining_centre
from selector.physics.thermal.network.heat_system import Conditions, projected, reduced_basis
from selector.physics.thermal.network.transient import HeatHistory, simulate_heat

TIME_S = np.arange(0.0, 8 * 3600 + 1, 60.0)
FEW_SCALES_S = (60.0, 600.0, 6000.0, np.inf)
TOLERANCES = (1e-1, 3e-2, 1e-2, 3e-3, 1e-3, 3e-4, 1e-4)


def shift(seed: int) -> Conditions:
    draw = np.random.RandomState(seed)
    held_s = 60 * draw.randint(20, 60)
    speed = draw.choice([0.0, 500.0, 1000.0, 1500.0, 2000.0, 2500.0, 3000.0], 25)[(TIME_S // held_s).astype(int)]
    wet = (draw.rand(7) < 0.4)[(TIME_S // 4800).astype(int)]
    hall = 20.0 + 1.5 * np.sin(TIME_S / 6000.0 + seed) + 0.2 * np.sin(TIME_S / 400.0)
    return Conditions(TIME_S, spindle_speed=speed, ambient_degc=hall, coolant_on=wet.astype(float), coolant_degc=19.0)


def share_of_peak(near: HeatHistory, true: HeatHistory) -> tuple[np.ndarray, np.ndarray]:
    """Largest errors of displacements and sensors [% of the peak]."""
    pairs = ((near.displacement_um, true.displacement_um), (near.probe_degc, true.probe_degc))
    errors = (100 * np.abs(a - b).max(axis=0) / np.abs(b - b[0]).max(axis=0) for a, b in pairs)
    displacements, sensors = errors
    return displacements, sensors


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--refinement", type=float, default=1.0)
    parser.add_argument("--shifts", type=int, default=3)
    options = parser.parse_args()
    started = time.perf_counter()
    machine = virtual_machining_centre(refinement=options.refinement)
    print(f"built in {time.perf_counter() - started:.1f} s: {machine.full.size} states, reduced {machine.system.size}")
    conditions = [shift(seed) for seed in range(options.shifts)]
    started = time.perf_counter()
    truth = [
        simulate_heat(machine.full, machine.laws, each, time_s=TIME_S, step_s=20.0, start_degc=20.0)
        for each in conditions
    ]
    print(f"whole field: {(time.perf_counter() - started) / options.shifts:.1f} s a shift ({truth[0].method}, 20 s)")
    sets = film_sets(machine.laws)
    choices = {
        "all films, 6 scales": {},
        "all films, 4 scales": {"time_scales_s": FEW_SCALES_S},
        "rest and full wet, 6 scales": {"film_coefficients": (sets[0], sets[-1])},
    }
    print("choice                        tolerance  states  build_s  shift_s  X_%    Y_%    Z_%    sensors_%")
    for name, choice in choices.items():
        for tolerance in TOLERANCES:
            started = time.perf_counter()
            asked = {"film_coefficients": sets} | choice
            small = projected(machine.full, reduced_basis(machine.full, **asked, tolerance=tolerance))
            build_s = time.perf_counter() - started
            worst, seconds = [], []
            for each, true in zip(conditions, truth, strict=True):
                started = time.perf_counter()
                near = simulate_heat(small, machine.laws, each, time_s=TIME_S, step_s=20.0, start_degc=20.0)
                seconds.append(time.perf_counter() - started)
                displacements, sensors = share_of_peak(near, true)
                by_name = dict(zip(near.displacements, displacements, strict=True))
                worst.append([by_name["X"], by_name["Y"], by_name["Z"], sensors.max()])
            x, y, z, sensor = np.max(worst, axis=0)
            print(
                f"{name:28s}  {tolerance:9.0e}  {small.size:6d}  {build_s:7.1f}  {max(seconds):7.2f}"
                f"  {x:5.3f}  {y:5.3f}  {z:5.3f}  {sensor:9.3f}",
                flush=True,
            )


if __name__ == "__main__":
    main()
