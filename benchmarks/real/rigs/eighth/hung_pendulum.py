"""A pendulum that hangs on a motor of a course: sweeps of 0.1 to 2 Hz, and sines."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd

from benchmarks.real.case import Pair, RealCase, Vector, pair, thinned
from benchmarks.real.rigs.fifth.common import over, simulated
from benchmarks.real.rigs.seventh.common import resonance
from selector.recording import Channel

_STEP_S, _MEANS, _ROWS = 0.001, 10, 10000
_RUNS = {"sweep 1": "0.1_2_0.1_10_1", "0.5 Hz": "sine_0.5", "1 Hz": "sine_1", "5 Hz": "sine_5_0.3",
         "sweep 2": "0.1_2_0.1_10_2"}  # fmt: skip
_CHANNELS = (
    Channel("u", "voltage", "V", place="motor", axis="C"),
    Channel("angle", "position", "m", place="pendulum, 1 rad as 1 m", axis="C"),
)


def _swing(x: Vector, run: pd.DataFrame) -> Vector:
    deflection, _ = resonance(run["u"].to_numpy(), abs(x[2]), abs(x[3]), _MEANS * _STEP_S)
    return np.asarray(x[0] + x[1] * deflection)


def _linear(folder: Path) -> Pair:
    runs = {}
    for name, file in _RUNS.items():
        raw = np.genfromtxt(folder / f"data/stb_pend_id/{file}.csv", delimiter=",")[:_ROWS]
        runs[name] = thinned(over(pd.DataFrame({"u": raw[:, 1], "angle": raw[:, 2]}), _STEP_S), _MEANS)
    simulated(runs, "angle", _swing, [-0.02, 2.2, 2.6, 0.22])
    return pair(runs, _CHANNELS)


CASES = (
    RealCase(
        name="hung_pendulum/linear",
        kind="positive",
        build=_linear,
        model="an oscillator of second order behind the voltage, fitted to a sweep and three sines; a second sweep is "
        "held out",
        truth="weight by the sine of the angle, and dry friction at small swings (read off; the authors linearize)",
        right=("vibration.hardening", "drive.coulomb"),
        tolerated=("vibration.hysteresis", "drive.stribeck", "drive.backlash", "drive.varying_stiffness",
                   "drive.varying_damping", "drive.viscous", "drive.asymmetric_friction", "drive.offset_force"),
        verdicts=("unexplained",),
        reading="1 ms a row, means of ten; steps of the angle of 0.0157 rad",
    ),
)  # fmt: skip
