"""Duty-cycle prediction on the virtual machining centre: thermal modes against pieces of characteristics.

python benchmarks/bench_cyclograms.py [--seed 3] [--noise 0.3] [--physics linear convection everything] [--slow]

The tests are those of the source (C: continuous running at five speeds, heating and cooling), and one more at 2500
r/min because its random duty cycles use that speed. Per duty cycle the largest error over its whole course is divided
by the largest displacement of that axis in it. An axis that hardly moves has large relative errors: see its peak.
With --slow one more test at the slowest speed of the duty cycles is among the tests.
"""

from __future__ import annotations

import argparse
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from selector.physics.thermal.field.machine import VirtualMachine, virtual_machining_centre
from selector.physics.thermal.modes.choice import choose_modes
from selector.physics.thermal.modes.modes import Cyclogram, cyclogram_kind
from selector.physics.thermal.modes.thermal_test import ThermalTest
from selector.physics.thermal.network.heat_system import Conditions
from selector.physics.thermal.network.transient import simulate_heat
from selector.physics.thermal.prediction.piecewise import characteristics, piecewise_displacement_um
from tests.physics.thermal.segments import of_segments

Vector = NDArray[np.float64]

AXES = ("X", "Y", "Z")
PERIOD_S = 60.0
HALL_DEGC = 20.0
SPEEDS_RPM = (200, 500, 800, 1000, 1250, 1600, 2000, 2500)
TOLERANCE_UM = 10.0
KINDS = ("rising", "intermittent", "falling", "random")

# (minutes, r/min)
TESTS = {
    **{f"continuous {n}": ((300, n),) for n in (800, 1000, 1250, 1600, 2000, 2500)},
    "heat 240 cool 420 at 1000": ((240, 1000), (420, 0)),
    "heat 30 cool 180 at 1600": ((30, 1600), (180, 0)),
    "heat 240 cool 360 at 2000": ((240, 2000), (360, 0)),
}

SLOW_TEST = {"continuous 200": ((300, 200),)}


@dataclass(frozen=True)
class Case:
    """One duty cycle: what the machine did, and the errors of each method per axis, relative to the peak."""

    kind: str
    peak_um: Vector
    errors: dict[str, Vector]
    drift_exact_um: float
    drift_model_um: float


def duty_cycles(seed: int) -> list[Cyclogram]:
    """60 duty cycles, 15 of every kind, those of the source among them."""
    rng = np.random.default_rng(seed)
    turning = SPEEDS_RPM[1:]
    found = [
        [(30, 1600), (15, 0)] * 7,
        [(20, 2000), (10, 0)] * 10,
        *([(20, a), (280, b)] for a, b in ((800, 2000), (2000, 800))),
        *([(30, a), (270, b)] for a, b in ((1000, 1600), (1600, 1000))),
    ]
    random = [[(43.0, int(n)) for n in rng.choice(SPEEDS_RPM, 7, replace=len(SPEEDS_RPM) < 7)] for _ in range(11)] + [
        [(float(rng.integers(10, 80)), int(rng.choice((0, *SPEEDS_RPM)))) for _ in range(7)] for _ in range(4)
    ]
    found += [one for one in random if cyclogram_kind(of_segments(*one)) == "random"]
    while True:
        counts = dict.fromkeys(KINDS, 0)
        cycles = [of_segments(*one) for one in found]
        for cycle in cycles:
            counts[cyclogram_kind(cycle)] += 1
        wanted = [kind for kind in KINDS if counts[kind] < 15]
        if not wanted:
            return cycles
        steps = int(rng.integers(2, 6))
        speeds = sorted(int(n) for n in rng.choice(turning, steps, replace=False))
        minutes = [float(m) for m in rng.integers(20, 120, steps)]
        if wanted[0] == "rising":
            found.append(list(zip(minutes, speeds, strict=True)))
        elif wanted[0] == "falling":
            found.append(list(zip(minutes, speeds[::-1], strict=True)))
        elif wanted[0] == "intermittent":
            on, off = int(rng.integers(10, 60)), int(rng.integers(5, 40))
            found.append([(on, int(rng.choice(turning))), (off, 0)] * max(2, 300 // (on + off)))
        else:
            found.append([(float(rng.integers(10, 80)), int(rng.choice((0, *SPEEDS_RPM)))) for _ in range(7)])


def course_um(machine: VirtualMachine, cycle: Cyclogram, time_s: Vector) -> Vector:
    """Displacements [µm] of shape (n_times, 3) from a machine in equilibrium with the hall, switched on and idle.

    The machine stands switched on until nothing changes any more, so that what follows is the spindle's alone.
    """
    day = 86_400.0
    rest = Conditions([0.0, 40 * day], spindle_speed=[0.0, 0.0], ambient_degc=[HALL_DEGC] * 2)
    settled = simulate_heat(machine.system, machine.laws, rest, time_s=[40 * day], step_s=3600.0, start_degc=HALL_DEGC)
    conditions = Conditions(
        np.append(cycle.start_s, cycle.end_s),
        spindle_speed=np.append(cycle.speed_rpm, 0.0),
        ambient_degc=np.full(len(cycle.start_s) + 1, HALL_DEGC),
    )
    history = simulate_heat(
        machine.system, machine.laws, conditions, time_s=time_s, step_s=20.0, start_state=settled.end_state
    )
    columns = [history.displacements.index(axis) for axis in AXES]
    course = history.displacement_um[:, columns]
    return course - course[0]


def tests_of(machine: VirtualMachine, noise_um: float, seed: int, *, slow: bool) -> list[ThermalTest]:
    """The recorded tests: gauges with noise, resolution 0.1 µm."""
    rng = np.random.default_rng(seed)
    recorded = []
    for name, segments in (TESTS | (SLOW_TEST if slow else {})).items():
        cycle = of_segments(*segments)
        time = np.arange(0.0, cycle.end_s + 1.0, PERIOD_S)
        course = course_um(machine, cycle, time)
        read = np.round(course + rng.normal(0.0, noise_um, course.shape), 1)
        recorded.append(ThermalTest(name, time, cycle.speed_at(time), read))
    return recorded


def cases(machine: VirtualMachine, noise_um: float, seed: int, *, slow: bool) -> list[Case]:
    """Every duty cycle predicted by both methods from the same tests."""
    tests = tests_of(machine, noise_um, seed, slow=slow)
    fit = choose_modes(tests, AXES)
    curves = characteristics(tests, AXES)
    hours = [round(float(tau) / 3600.0, 2) for tau in fit.model.tau_s]
    print(f"  time constants [h] {hours}; residual [µm] {np.round(fit.residual_um, 2)}")
    found = []
    for cycle in duty_cycles(seed):
        time = np.minimum(np.arange(0.0, cycle.end_s + 1.0, PERIOD_S), cycle.end_s)
        true = course_um(machine, cycle, time)
        peak = np.abs(true).max(axis=0)
        modal = fit.model.displacement_um(cycle, time)
        pieces, _ = piecewise_displacement_um(curves, cycle, time)
        z = AXES.index("Z")
        whole = [cycle.end_s / 5 * (1 - 1e-12)] * 5
        found.append(
            Case(
                cyclogram_kind(cycle),
                peak,
                {way: np.abs(p - true).max(axis=0) / peak for way, p in (("modes", modal), ("pieces", pieces))},
                _largest_drift_um(time, true[:, z], true[:, z], whole),
                _largest_drift_um(time, modal[:, z], true[:, z], whole),
            )
        )
    return found


def _largest_drift_um(time_s: Vector, predicted_um: Vector, true_um: Vector, operations_s: list[float]) -> float:
    from selector.physics.thermal.prediction.correction_program import correction_program

    program = correction_program(time_s, predicted_um, operations_s, TOLERANCE_UM)
    _, left = program.drift_left_um(time_s, true_um)
    return float(np.abs(left).max())


def main() -> None:
    """Prints a Markdown table for every variant of the machine."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seed", type=int, default=3)
    parser.add_argument("--noise", type=float, default=0.3, help="standard deviation of the gauges [µm]")
    parser.add_argument("--slow", action="store_true", help="test at 200 r/min as well")
    parser.add_argument("--physics", nargs="+", default=["linear", "convection", "everything"])
    arguments = parser.parse_args()
    for physics in arguments.physics:
        machine = virtual_machining_centre(physics)
        print(f"\n## {physics}, noise {arguments.noise} µm, seed {arguments.seed}, {machine.system.size} states")
        found = cases(machine, arguments.noise, arguments.seed, slow=arguments.slow)
        print("| duty cycles | axis | peak [µm] | modes: median | max | pieces: median | max |")
        print("|---|---|---|---|---|---|---|")
        for kind in (*KINDS, "all"):
            chosen = [case for case in found if kind in (case.kind, "all")]
            for r, axis in reversed(list(enumerate(AXES))):
                peak = np.median([case.peak_um[r] for case in chosen])
                ways = [np.array([case.errors[way][r] for case in chosen]) * 100 for way in ("modes", "pieces")]
                cells = " | ".join(f"{np.median(w):.2f} % | {w.max():.2f} %" for w in ways)
                print(f"| {len(chosen)} {kind} | {axis} | {peak:.0f} | {cells} |")
        exact = max(case.drift_exact_um for case in found)
        model = max(case.drift_model_um for case in found)
        print(
            f"largest corrected drift along Z, tolerance {TOLERANCE_UM:g} µm: exact {exact:.3f}, model {model:.3f} µm"
        )


if __name__ == "__main__":
    main()
