"""A laser beam on a mirror that is driven by random steps: drive, and where the beam falls."""

from __future__ import annotations

from functools import partial
from pathlib import Path

import numpy as np
import pandas as pd
from scipy.optimize import least_squares as minimised
from scipy.signal import lfilter

from benchmarks.real.case import SIMULATED, Pair, RealCase, Vector, pair
from benchmarks.real.rigs.fifth.common import first_share, over
from benchmarks.real.rigs.fourth.common import SILENT, numbers
from selector.recording import Channel

_STEP_S, _MILLI = 1e-3, 1e3
_GUESS = (0.02, 0.02, -1.73, 0.83, 0.0)
"""Of a mode at 50 Hz."""
_CHANNELS = (
    Channel("u", "voltage", "V", place="drive of the mirror, 1 mV as 1 V", axis="C"),
    Channel("y", "position", "m", place="beam, 1 mV of its detector as 1 m", axis="C"),
)


def _mode(x: Vector, run: pd.DataFrame) -> Vector:
    return np.asarray(lfilter([0.0, x[0], x[1]], [1.0, x[2], x[3]], run["u"]) + x[4])


def _steps(folder: Path, *, resonant: bool) -> Pair:
    raw = numbers(folder / "matlab/ce2/laserbeamdataN.mat")
    run = over(pd.DataFrame({name: _MILLI * np.asarray(raw[name], dtype=np.float64) for name in "uy"}), _STEP_S)
    known = first_share(run)
    target = known["y"].to_numpy(dtype=np.float64)

    def left(guess: Vector) -> Vector:
        return np.asarray(_mode(guess, known) - target)

    x = minimised(left, np.array(_GUESS)).x
    still = (x[0] + x[1]) / (1.0 + x[2] + x[3])
    run["y" + SIMULATED] = _mode(x, run) if resonant else still * run["u"] + x[4]
    return pair({"random steps": run}, _CHANNELS)


_READING = "1 ms a row, 500 rows"

CASES = (
    RealCase(
        name="laser_beam/at once",
        kind="positive",
        build=partial(_steps, resonant=False),
        model="the beam follows the drive at once, with the gain that a mode has far below its frequency, fitted to "
        "the first 70 %; the rest is held out",
        truth="the mirror is a mode at 50 Hz, damping 0.3 (the author's model of two poles leaves 1 % of the variance)",
        right=("vibration.mode",),
        tolerated=("gauging.lag", "drive.delay", "data.clock", "drive.mass", "drive.elasticity", "data.gain"),
        reading=_READING,
    ),
    RealCase(
        name="laser_beam/as a mode",
        kind="control",
        build=partial(_steps, resonant=True),
        model="the same with the mode, fitted to the first 70 %; the rest is held out",
        truth="nothing is missing: 11 % are left, as much as the noise by second differences",
        verdicts=SILENT,
        reading=_READING,
    ),
)
