"""What makes tests doubtful: gauges that stand still, warm starts, runs that contradict others, untested speeds."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2

from selector.errors import InputError
from selector.findings import Finding, Where
from selector.physics.thermal.cyclogram import Cyclogram
from selector.physics.thermal.mode_data import SAME_SPEED, mode_data
from selector.physics.thermal.repeated_tests import RepeatedTest
from selector.physics.thermal.thermal_test import ThermalTest

Vector = NDArray[np.float64]

LEAST_UM = 1e-3
"""A displacement that moves by less in every test is no reading of a gauge."""
STRETCHES = 8
"""So many means of a run tell slow movement from noise."""
CERTAIN = 0.999
"""Probability with which noise alone shows less than what counts as a movement."""
WARM = 0.1
"""Share of a run's range by which cooling has to end beyond its start, for the start to be called warm."""
IN_NOISE = 3.0
OPPOSITE = -0.5
"""Heating curves whose cosine is below this go the other way."""
FAR_BEYOND = 4.0
"""A run whose residual is this many times the median of the others' contradicts them."""


def movement_findings(tests: Sequence[ThermalTest], responses: Sequence[str]) -> list[Finding]:
    """A warning for every response in which slow movement cannot be told from the noise.

    Raises
    ------
    InputError
        If a response does not move at all in any of the tests.
    """
    findings = []
    for r, name in enumerate(responses):
        courses = [_read(test, r)[1] for test in tests]
        largest = max(float(np.ptp(course)) for course in courses)
        if largest < LEAST_UM:
            raise InputError(
                f"{name} does not move in the tests (by {largest:.2g} µm at most)",
                expected="a displacement that follows the heating and cooling of the machine",
                where="the tests",
                advice=f"check the gauge of {name} and its unit, or predict other displacements only",
            )
        moved, free = np.sum([_slow_part(course) for course in courses], axis=0)
        if moved <= float(chi2.ppf(CERTAIN, max(free, 1.0))):
            noise = float(np.median([_noise_um(course) for course in courses]))
            findings.append(
                Finding(
                    "no-thermal-movement", "warning",
                    f"In {name} no thermal movement was found above the noise of {noise:.2g} µm: what is predicted for "
                    "it is noise.",
                    Where(channel=name), {"noise_um": noise}, "check the gauge, or leave this displacement out",
                )
            )  # fmt: skip
    return findings


def warm_start_findings(tests: Sequence[ThermalTest], responses: Sequence[str]) -> list[Finding]:
    """A warning for every run that cools to the other side of where it started: it did not begin cold.

    Judged by the response that moves most; other axes may turn back beyond their start by themselves.
    """
    findings = []
    for test in tests:
        r = int(np.argmax([float(np.ptp(_read(test, k)[1])) for k in range(len(responses))]))
        time, course, speed = _read(test, r)
        turning = np.flatnonzero(speed > 0.01 * max(float(speed.max()), 1e-9))
        last = int(turning[-1]) + 1 if len(turning) else len(course)
        few = max(1, min(10, len(course) // 50))
        if not len(turning) or len(course) - last < 3 * few:
            continue
        # where the spindle turns from the first sample on, only that one is the start
        start, end = float(np.mean(course[: max(1, min(few, int(turning[0])))])), float(np.mean(course[-few:]))
        top = float(np.mean(course[max(0, last - few) : last]))
        fallen = (start - end) * np.sign(top - start)
        if fallen > max(IN_NOISE * _noise_um(course), WARM * float(np.ptp(course))):
            findings.append(
                Finding(
                    "run-begins-warm", "warning",
                    f"Run {test.run} cools to {fallen:.3g} µm beyond where {responses[r]} started: it did not begin "
                    "cold, or something else moves it. Predictions take starts to be cold, so they are too small.",
                    Where(channel=responses[r], run=test.run, from_s=float(time[0]), to_s=float(time[-1])),
                    {"beyond_start_um": float(fallen)}, "let the machine rest until it is cold before a heating test",
                )
            )  # fmt: skip
    return findings


def speed_findings(tests: Sequence[ThermalTest], cyclogram: Cyclogram) -> list[Finding]:
    """What the tested speeds do not say about those of the duty cycle.

    Raises
    ------
    InputError
        If the tests cannot be used.
    """
    levels = np.array(mode_data(tests).levels_rpm)
    speeds = np.unique(cyclogram.speed_rpm[cyclogram.speed_rpm > 0])
    findings = []
    others = speeds[np.abs(speeds - levels[-1]) > SAME_SPEED * levels[-1]]
    if len(levels) == 1 and len(others):
        findings.append(
            Finding(
                "one-speed-tested", "warning",
                f"Only {levels[0]:.6g} r/min was tested; the duty cycle has {others[0]:.6g} r/min too. How heat grows "
                "with the speed is then an assumption: errors up to half of the displacement were seen.",
                Where(), {"levels_rpm": levels.tolist(), "speeds_rpm": others.tolist()},
                "test at two or more further speeds below it",
            )
        )  # fmt: skip
    slow = speeds[speeds < 0.5 * levels[0]]
    if len(slow):
        findings.append(
            Finding(
                "slower-than-tests", "info",
                f"The duty cycle has {slow[0]:.6g} r/min, less than half of the slowest tested speed, {levels[0]:.6g} "
                "r/min: what is predicted there rests on the law of the speed. Were the speeds written as meant?",
                Where(), {"speeds_rpm": slow.tolist(), "slowest_tested_rpm": float(levels[0])},
                "test at a slow speed too",
            )
        )  # fmt: skip
    return findings


def contradiction_findings(
    tests: Sequence[ThermalTest], repeats: Sequence[RepeatedTest], responses: Sequence[str]
) -> list[Finding]:
    """A warning for every run that heats the other way than most, or is repeated far worse than the others."""
    findings = []
    for r, name in enumerate(responses):
        opposite = _opposite(tests, r)
        worse = {} if opposite else _worse(repeats, r)
        for run in opposite:
            findings.append(
                Finding(
                    "run-contradicts-others", "warning",
                    f"In run {run} heating moves {name} the other way than in "
                    + ("the other run." if len(opposite) == len(tests) == 2 else "most of the other runs."),
                    Where(channel=name, run=run), {}, "check the sign of the gauge in that run, or leave the run out",
                )
            )  # fmt: skip
        for run, (error, usual) in worse.items():
            findings.append(
                Finding(
                    "run-contradicts-others", "warning",
                    f"Run {run} is repeated with an error of {error:.2g} µm RMS in {name}, the others with "
                    f"{usual:.2g} µm: it contradicts them.",
                    Where(channel=name, run=run), {"residual_um": error, "others_um": usual},
                    "look at that run (gauge, speed, start from cold), or leave it out",
                )
            )  # fmt: skip
    return findings


def _opposite(tests: Sequence[ThermalTest], r: int) -> list[str]:
    """Names of the runs whose first heating goes against that of at least half of the others."""
    curves = []
    for test in tests:
        time, course, speed = _read(test, r)
        turning = speed > 0.01 * max(float(speed.max()), 1e-9)
        if not turning.any():
            continue
        first = int(np.argmax(turning))
        after = first + int(np.argmin(turning[first:])) if not turning[first:].all() else len(course)
        if after - first < 3:
            continue
        heated = course[first:after] - float(np.mean(course[: max(1, first)]))
        if float(np.ptp(heated)) > 2.0 * IN_NOISE * _noise_um(course):
            curves.append((test.run, time[first:after] - time[first], heated))
    named = []
    for run, time, heated in curves:
        signs = []
        for other, other_time, other_heated in curves:
            if other != run:
                grid = np.linspace(0.0, min(time[-1], other_time[-1]), 50)
                one, two = np.interp(grid, time, heated), np.interp(grid, other_time, other_heated)
                size = float(np.linalg.norm(one) * np.linalg.norm(two))
                signs.append(size > 0.0 and float(one @ two) < OPPOSITE * size)
        if signs and np.mean(signs) > 0.5:
            named.append(run)
    return named


def _worse(repeats: Sequence[RepeatedTest], r: int) -> dict[str, tuple[float, float]]:
    errors = np.array([float(one.rmse_um[r]) for one in repeats])
    found = {}
    for k, one in enumerate(repeats):
        if len(errors) < 3:
            break
        usual = float(np.median(np.delete(errors, k)))
        course = one.measured_um[np.isfinite(one.measured_um[:, r]), r]
        # a tenth of what it moves: smaller differences are those of speeds and methods
        if errors[k] > max(FAR_BEYOND * usual, IN_NOISE * _noise_um(course), WARM * float(np.ptp(course))):
            found[one.run] = (float(errors[k]), usual)
    return found


def _read(test: ThermalTest, r: int) -> tuple[Vector, Vector, Vector]:
    """Times, displacement and speed where the displacement was read."""
    there = np.isfinite(test.displacement_um[:, r])
    return test.time_s[there], test.displacement_um[there, r], test.speed_rpm[there]


def _noise_um(course: Vector) -> float:
    return float(np.std(np.diff(course))) / np.sqrt(2.0) if len(course) > 2 else 0.0


def _slow_part(course: Vector) -> tuple[float, float]:
    """Sum of squares of the means of stretches in units of their noise, and its degrees of freedom."""
    if float(np.ptp(course)) < LEAST_UM:
        return 0.0, 0.0
    parts = np.array_split(course, min(STRETCHES, len(course) // 2))
    means, sizes = np.array([float(part.mean()) for part in parts]), np.array([len(part) for part in parts])
    noise = max(_noise_um(course), 1e-3 * LEAST_UM)
    return float((sizes * (means - course.mean()) ** 2).sum()) / noise**2, float(len(parts) - 1)
