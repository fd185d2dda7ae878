"""The drive EMPS with three friction laws: the same model by five measures, and what 0.05 N does to each.

python -m benchmarks.bench_real_recordings

Prints the tables of docs/explanation/real-recordings.md. Laws are fitted to DATA_EMPS by force and motion; the first
50 ms do not count.
"""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from proving_ground.real.emps import AxisLaw, Record, identified, record, simulated
from proving_ground.real.identification import filtered_motion

Vector = NDArray[np.float64]

PERIOD_S, SKIP, STEPS = 1e-3, 50, 10
WINDOW_S = 1.0
LAWS = ("viscous", "symmetric", "by direction")
CUT_OFF_HZ = 95.5


@njit(cache=True)
def free_run(axis, force, place, speed):
    """Place [m] of the axis under a force [N] that is held over every sample."""
    course = np.empty(len(force))
    step = PERIOD_S / STEPS
    for k in range(len(force)):
        course[k] = place
        for _ in range(STEPS):
            viscous = axis[1] if speed > 0.0 else axis[2]
            free = (speed + step / axis[0] * (force[k] - axis[5])) / (1.0 + step * viscous / axis[0])
            slowed = max(free - step / axis[0] * axis[3], 0.0)
            speed = slowed if free > 0.0 else min(free + step / axis[0] * axis[4], 0.0)
            place += step * speed
    return course


def measures(law: AxisLaw, data: Record) -> Vector:
    """Loop: position [µm], voltage [V]; force [% of its size]; windows of a second [µm]; free run [mm]: all rms."""
    position, voltage = simulated(law, data)
    force = data.newtons_per_volt * data.voltage
    smooth, speed, acceleration = filtered_motion(PERIOD_S, data.position, CUT_OFF_HZ)
    dry = np.where(speed > 0.0, law.dry_forwards, -law.dry_backwards)
    viscous = np.where(speed > 0.0, law.viscous_forwards, law.viscous_backwards)
    told = law.mass_kg * acceleration + viscous * speed + dry + law.constant
    inner = slice(SKIP, -SKIP)
    axis = np.array(law)
    size = round(WINDOW_S / PERIOD_S)
    windows = [
        free_run(axis, force[k : k + size], smooth[k], speed[k]) - data.position[k : k + size]
        for k in range(SKIP, len(force) - size, size)
    ]
    whole = free_run(axis, force[SKIP:], smooth[SKIP], speed[SKIP]) - data.position[SKIP:]
    return np.array([
        1e6 * rms((position - data.position)[SKIP:]),
        rms((voltage - data.voltage)[SKIP:]),
        100.0 * rms((told - force)[inner]) / rms(force[inner]),
        1e6 * rms(np.concatenate(windows)),
        1e3 * rms(whole),
    ])  # fmt: skip


def rms(values: Vector) -> float:
    return float(np.sqrt(np.mean(values**2)))


def main() -> None:
    print(f"{'':42s}{'loop, µm':>10s}{'loop, V':>10s}{'force, %':>10s}{'1 s, µm':>10s}{'free, mm':>10s}")
    for name in LAWS:
        law = identified(name)
        print(name, " ".join(f"{field} {value:.3f}" for field, value in law._asdict().items()))
        for run in ("nominal", "pulses"):
            data = record(run)
            for words, bias in (("", 0.0), (", 0.05 N more", 0.05)):
                found = measures(law._replace(constant=law.constant + bias), data)
                print(f"  {run + words:40s}" + "".join(f"{value:10.4g}" for value in found))


if __name__ == "__main__":
    main()
