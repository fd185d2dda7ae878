"""A motor of a course under the same sweep of voltage three times."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd

from benchmarks.real.case import SIMULATED, Pair, RealCase, Vector, pair
from benchmarks.real.rigs.fifth.common import over, simulated
from benchmarks.real.rigs.fourth.common import SILENT
from selector.recording import Channel

_STEP_S, _MEANS, _ROWS = 0.001, 10, 8000
_CHANNELS = (
    Channel("u", "voltage", "V", place="motor", axis="C"),
    Channel("v", "velocity", "m/s", place="shaft, 100 rad/s as 1 m/s", axis="C"),
)


def _read(folder: Path) -> dict[str, pd.DataFrame]:
    """Speed over ten rows, and the voltage as means of these."""
    runs = {}
    for number in (1, 2, 3):
        raw = np.loadtxt(folder / f"data/id_data/{number}.txt")[: _ROWS + 1]
        speed = np.diff(raw[::_MEANS, 2]) / (_MEANS * _STEP_S)
        voltage = raw[:_ROWS, 1].reshape(-1, _MEANS).mean(axis=1)
        runs[f"sweep {number}"] = over(pd.DataFrame({"u": voltage, "v": 0.01 * speed}), _MEANS * _STEP_S)
    return runs


def _line(x: Vector, run: pd.DataFrame) -> Vector:
    return np.asarray(x[0] + x[1] * run["u"])


def _at_once(folder: Path) -> Pair:
    runs = _read(folder)
    simulated(runs, "v", _line, [0.0, 0.5])
    return pair(runs, _CHANNELS)


def _again(folder: Path) -> Pair:
    runs = _read(folder)
    course = {name: run["v"].to_numpy() for name, run in runs.items()}
    for name, run in runs.items():
        run["v" + SIMULATED] = np.mean([values for other, values in course.items() if other != name], axis=0)
    return pair(runs, _CHANNELS)


_READING = "1 ms a row, speed over ten; the first 8 s, 0.1 to 53 Hz; steps of the angle of 0.0157 rad"

CASES = (
    RealCase(
        name="chirped_motor/at once",
        kind="positive",
        build=_at_once,
        model="speed by the voltage, a straight line at once, fitted to two sweeps; a third is held out",
        truth="the motor follows with a time constant of 0.2 s (the authors' model)",
        right=("drive.mass", "gauging.lag", "drive.delay", "data.clock"),
        tolerated=("drive.viscous", "drive.coulomb", "drive.elasticity", "vibration.mode"),
        verdicts=("miscalibrated",),
        reading=_READING,
    ),
    RealCase(
        name="chirped_motor/again",
        kind="control",
        build=_again,
        model="each sweep by the mean of the two others; the third is held out",
        truth="nothing is missing: 2.5 % are left, white, steps of the angle",
        verdicts=SILENT,
        reading=_READING,
    ),
)
