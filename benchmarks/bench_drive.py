"""Simulated axes in compiled fixed steps beside SciPy's solvers and python-control: time, and error of each.

python -m benchmarks.bench_drive [--repeats 5]

*rigid*: one mass with Coulomb friction under continuous cascade control for 24.84 s, recorded at 1 kHz; SciPy starts
anew at every standstill, which it looks for as an event. The same under control that is sampled at 1 kHz has no
counterpart there. *three masses*: seven states under continuous control for 1 s at 20 kHz, without dry friction, so
that python-control can join in. Errors are RMS against steps that are so small that half of them changes nothing.
Of SciPy's methods and tolerances the quickest is shown that is at least as accurate as ours, and the most accurate.
"""

from __future__ import annotations

import argparse
import math
import time
import warnings
from collections.abc import Callable

import numpy as np
from scipy import integrate

from selector.physics.drive.closed_loop import closed_loop
from selector.physics.drive.parts.axis import Axis, Friction, RigidMechanics, Servo, ThreeMassMechanics, unloaded_state
from selector.physics.drive.simulation import simulate_axis
from selector.physics.drive.trajectory import Reference

MASS, VISCOUS, COULOMB, GAIN = 95.1, 203.5, 20.4, 35.15
RIGID_SERVO = Servo(160.18, 243.45, 1000.0, GAIN)
RIGID = Axis(RigidMechanics(MASS, VISCOUS), RIGID_SERVO, Friction(COULOMB))
SAMPLED = Axis(RIGID.mechanics, Servo(160.18, 243.45, 1000.0, GAIN, sample_s=1e-3, command_limit=10.0), RIGID.friction)
THREE = Axis(
    ThreeMassMechanics(0.01, 0.005, 800.0, 0.016, 2e4, 3e8, 0.01, 2000.0, 0.5, 2e3), Servo(40.0, 8.0, 160.0, 1.2)
)
METHODS = ("RK45", "DOP853", "LSODA", "Radau")
TOLERANCES = (1e-4, 1e-5, 1e-6, 1e-7, 1e-8, 1e-9, 1e-10, 1e-11)

Course = Callable[[float], tuple[float, float]]


def sine(amplitude_m: float, frequency_hz: float, period_s: float, count: int) -> tuple[Reference, Course]:
    w = 2 * math.pi * frequency_hz
    t = np.arange(count) * period_s
    position = amplitude_m * np.sin(w * t)
    reference = Reference(period_s, position, amplitude_m * w * np.cos(w * t), -(w**2) * position)
    return reference, lambda at: (amplitude_m * math.sin(w * at), amplitude_m * w * math.cos(w * at))


def seconds(work: Callable[[], object], repeats: int) -> float:
    work()
    times = []
    for _ in range(repeats):
        begin = time.perf_counter()
        work()
        times.append(time.perf_counter() - begin)
    return min(times)


def rms(one: np.ndarray, other: np.ndarray) -> float:
    return float(np.sqrt(np.mean((one - other) ** 2)))


def scipy_rigid(reference: Reference, course: Course, method: str, tolerance: float) -> np.ndarray:
    """Slides between standstills; sticks until the motor is stronger than friction."""
    kp, kv, ki = RIGID_SERVO.position_gain_per_s, RIGID_SERVO.velocity_gain, RIGID_SERVO.velocity_integral_gain

    def push(t: float, x: float, v: float, integral: float) -> tuple[float, float]:
        error = kp * (course(t)[0] - x) - v
        return GAIN * (kv * error + ki * integral), error

    def rate(direction: int) -> Callable[[float, np.ndarray], list[float]]:
        def of(t: float, y: np.ndarray) -> list[float]:
            x, v, integral = y.tolist()
            force, error = push(t, x, v, integral)
            if direction == 0:
                return [0.0, 0.0, error]
            return [v, (force - VISCOUS * v - direction * COULOMB) / MASS, error]

        return of

    def standstill(t: float, y: np.ndarray) -> float:
        return float(y[1])

    def breakaway(t: float, y: np.ndarray) -> float:
        return COULOMB - abs(push(t, float(y[0]), 0.0, float(y[2]))[0])

    t, end, y, direction = 0.0, float(reference.time_s[-1]), np.zeros(3), 0
    out = np.empty(len(reference.time_s))
    while t < end:
        event = standstill if direction else breakaway
        event.terminal, event.direction = True, -direction if direction else -1  # type: ignore[attr-defined]
        ahead = reference.time_s[reference.time_s >= t]
        solved = integrate.solve_ivp(
            rate(direction), (t, end), y, method, ahead, events=event, rtol=tolerance, atol=tolerance * 1e-2
        )
        first = len(out) - len(ahead)
        out[first : first + len(solved.t)] = solved.y[0]
        if solved.status != 1:
            break
        t, y = float(solved.t_events[0][0]), solved.y_events[0][0].copy()
        y[1] = 0.0
        force = push(t, float(y[0]), 0.0, float(y[2]))[0]
        if direction:
            direction = 0 if abs(force) <= COULOMB else int(math.copysign(1, force))
        else:
            direction = int(math.copysign(1, force))
    return out


def scipy_three(reference: Reference, course: Course, method: str, tolerance: float) -> np.ndarray:
    loop = closed_loop(THREE)
    a, b = loop.A, loop.B[:, 0]
    ahead = loop.B[:, 1]
    options = {"jac": a} if method == "Radau" else ({"jac": lambda t, y: a} if method == "LSODA" else {})

    def rate(t: float, y: np.ndarray) -> np.ndarray:
        position, speed = course(t)
        return a @ y + b * position + ahead * speed

    span = (0.0, float(reference.time_s[-1]))
    # positions of 0.1 m beside angles of 40 rad
    solved = integrate.solve_ivp(
        rate, span, np.zeros(len(b)), method, reference.time_s, rtol=tolerance, atol=tolerance * 1e-3, **options
    )
    return np.asarray((loop.C @ solved.y)[0])


def scipy_best(
    solve: Callable[[str, float], np.ndarray], best: np.ndarray, error: float, repeats: int
) -> tuple[str, str]:
    """The quickest that is as accurate as `error`, and the most accurate, as rows."""
    found = []
    for method in METHODS:
        for tolerance in TOLERANCES:
            begin = time.perf_counter()
            reached = rms(solve(method, tolerance), best)
            found.append((time.perf_counter() - begin, reached, method, tolerance))
            if reached <= error:
                break
    good = [one for one in found if one[1] <= error]
    rows = []
    for one in (min(good) if good else None, min(found, key=lambda row: row[1])):
        if one is None:
            rows.append("none is as accurate")
            continue
        took = seconds(lambda one=one: solve(one[2], one[3]), repeats)
        rows.append(f"{one[2]} at {one[3]:.0e}: {1e3 * took:.1f} ms, {one[1]:.1e} m")
    return rows[0], rows[1]


def rigid(repeats: int) -> None:
    reference, course = sine(0.1, 0.3, 1e-3, 24_841)
    start = unloaded_state(RIGID, 0.0)
    best = simulate_axis(RIGID, reference, step_s=2.5e-5, start=start).table_m
    finer = simulate_axis(RIGID, reference, step_s=5e-5, start=start).table_m
    print(f"\nrigid, Coulomb friction, 24.84 s at 1 kHz (steps of 50 µs instead of 25 change {rms(best, finer):.0e} m)")
    for step_s in (1e-3, 2.5e-4):
        took = seconds(lambda step_s=step_s: simulate_axis(RIGID, reference, step_s=step_s), repeats)
        error = rms(simulate_axis(RIGID, reference, step_s=step_s).table_m, best)
        print(f"  ours, continuous control, steps of {step_s * 1e3:g} ms: {1e3 * took:.1f} ms, {error:.1e} m")
        if step_s == 1e-3:
            ours = (took, error)
    took = seconds(lambda: simulate_axis(SAMPLED, reference, step_s=1e-3), repeats)
    print(f"  ours, sampled control, steps of 1 ms: {1e3 * took:.1f} ms")
    rows = scipy_best(lambda method, tol: scipy_rigid(reference, course, method, tol), best, ours[1], min(repeats, 2))
    print(f"  solve_ivp, as accurate: {rows[0]}\n  solve_ivp, most accurate: {rows[1]}")


def three(repeats: int) -> None:
    import control

    reference, course = sine(0.1, 1.0, 5e-5, 20_001)
    best = simulate_axis(THREE, reference, step_s=6.25e-6).table_m
    finer = simulate_axis(THREE, reference, step_s=1.25e-5).table_m
    print(f"\nthree masses, 7 states, 1 s at 20 kHz (steps of 12.5 µs instead of 6.25 change {rms(best, finer):.0e} m)")
    took = seconds(lambda: simulate_axis(THREE, reference, step_s=5e-5), repeats)
    error = rms(simulate_axis(THREE, reference, step_s=5e-5).table_m, best)
    print(f"  ours, steps and records of 50 µs: {1e3 * took:.1f} ms, {error:.1e} m")
    coarse, _ = sine(0.1, 1.0, 1e-3, 1001)
    sparse = seconds(lambda: simulate_axis(THREE, coarse, step_s=5e-5), repeats)
    print(f"  ours, steps of 50 µs, records of 1 ms: {1e3 * sparse:.1f} ms")
    loop = closed_loop(THREE)
    system = control.ss(loop.A, loop.B, loop.C, loop.D)
    commanded = [reference.position_m, reference.speed_m_per_s, reference.acceleration_m_per_s2]
    inputs = np.vstack([*commanded, np.zeros(len(reference.position_m))])
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        forced = control.forced_response(system, reference.time_s, inputs)
        times = seconds(lambda: control.forced_response(system, reference.time_s, inputs), repeats)
    print(f"  forced_response: {1e3 * times:.1f} ms, {rms(np.atleast_2d(forced.outputs)[0], best):.1e} m")
    rows = scipy_best(lambda method, tol: scipy_three(reference, course, method, tol), best, error, min(repeats, 2))
    print(f"  solve_ivp, as accurate: {rows[0]}\n  solve_ivp, most accurate: {rows[1]}")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--repeats", type=int, default=5)
    options = parser.parse_args()
    begin = time.perf_counter()
    simulate_axis(RIGID, sine(0.1, 0.3, 1e-3, 3)[0], step_s=1e-3)
    print(f"first call, compiled or loaded from disk: {time.perf_counter() - begin:.1f} s")
    rigid(options.repeats)
    three(options.repeats)
