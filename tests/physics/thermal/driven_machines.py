"""Simulated machines whose modes are driven by the spindle and by a hall of known law, recorded for days."""

from __future__ import annotations

import numpy as np

from selector.physics.thermal.modes.modes import AmbientCourse
from selector.physics.thermal.modes.thermal_test import ThermalTest
from tests.physics.thermal.segments import of_segments

TAU_S = np.array([900.0, 9000.0])
SPEED_UM = np.array([[12.0, 4.0], [25.0, -9.0]])  # (n_modes, n_responses) at the fastest speed
HALL_UM_PER_K = np.array([[0.5, -1.0], [2.0, -3.0]])
FASTEST_RPM = 5000.0
DAY = of_segments(
    *[part for n in (2000, 3500, 1000, 5000, 2800) for part in ((10.0, 0.0), (240.0, float(n)), (230.0, 0.0))]
)


def hall_at(time_s):
    """A hall that cools at night [°C]."""
    return 22.0 + 1.5 * np.sin(2 * np.pi * time_s / 86400.0) + 0.3 * np.sin(2 * np.pi * time_s / 17000.0)


def course_um(cyclogram, time_s, hall_degc, *, start_um=None, hall=HALL_UM_PER_K, exponent=1.2):
    """Displacements and what every mode has at the end; in equilibrium with the first hall but for `start_um`."""
    step_s = time_s[1] - time_s[0]
    keep = np.exp(-step_s / TAU_S)[:, None]
    drive = (cyclogram.speed_at(time_s) / FASTEST_RPM)[:, None, None] ** exponent * SPEED_UM
    drive = drive + (hall_degc - hall_degc[0])[:, None, None] * hall
    states = np.zeros((len(time_s), *SPEED_UM.shape))
    states[0] = 0.0 if start_um is None else start_um
    for i in range(1, len(time_s)):
        states[i] = drive[i - 1] + (states[i - 1] - drive[i - 1]) * keep
    return states.sum(axis=1), states[-1]


def long_record(rng, *, noise_um=0.1, walk_um=0.0, hall=HALL_UM_PER_K, start_um=(6.0, 15.0)):
    """Five tests in one record of 40 h that begins warm; a random walk of so many µm in an hour upon it."""
    time = np.arange(0.0, DAY.end_s, 60.0)
    start = np.array(start_um)[:, None] * [1.0, -0.5]
    course, end = course_um(DAY, time, hall_at(time), start_um=start, hall=hall)
    walk = np.cumsum(rng.normal(0.0, walk_um / np.sqrt(60.0), course.shape), axis=0)
    read = course + walk + rng.normal(0.0, noise_um, course.shape)
    measured = hall_at(time) + rng.normal(0.0, 0.02, len(time))
    return ThermalTest("days", time, DAY.speed_at(time), read, measured, ("hall",)), end


CYCLE = of_segments((60, 1500), (60, 3000), (30, 0), (90, 4500), (60, 700))


def truth_after(end, *, hall=HALL_UM_PER_K):
    """The duty cycle right after the record: times, foreseen hall and displacement from its start."""
    time = np.arange(0.0, CYCLE.end_s + 1.0, 60.0)
    degc = hall_at(DAY.end_s + time)
    # the states count from the equilibrium with the hall at the start of the record
    step = np.exp(-60.0 / TAU_S)[:, None]
    states = np.empty((len(time), *SPEED_UM.shape))
    states[0] = end
    drive = (CYCLE.speed_at(time) / FASTEST_RPM)[:, None, None] ** 1.2 * SPEED_UM
    drive = drive + (degc - hall_at(np.zeros(1)))[:, None, None] * hall
    for i in range(1, len(time)):
        states[i] = drive[i - 1] + (states[i - 1] - drive[i - 1]) * step
    course = states.sum(axis=1)
    return time, AmbientCourse(time, degc[:, None], ("hall",)), course - course[0]
