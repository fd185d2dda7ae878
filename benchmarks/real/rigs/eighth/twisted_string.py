"""A slide between two strings that motors twist: angle of a motor, and position of the slide."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd

from benchmarks.real.case import SIMULATED, Pair, RealCase, Vector, pair, thinned
from benchmarks.real.rigs.fifth.common import first_share, over, simulated
from selector.recording import Channel

_STEP_S, _MEANS, _FIRST = 0.002, 4, 20
_SLIDE, _MOTOR = 2, 3
_CHANNELS = (
    Channel("x", "position", "m", place="slide", axis="X"),
    Channel("angle", "position_command", "m", place="first motor, 1 rad as 1 mm", axis="X"),
)


def _line(x: Vector, run: pd.DataFrame) -> Vector:
    return np.asarray(x[0] + x[1] * run["angle"])


def _straight(folder: Path) -> Pair:
    """Rows of the file are channels; lengths come in micrometres, angles in milliradians."""
    raw = 1e-6 * np.genfromtxt(folder / "data/chirp5.csv", delimiter=",")[:, _FIRST:]
    run = thinned(over(pd.DataFrame({"x": raw[_SLIDE], "angle": raw[_MOTOR]}), _STEP_S), _MEANS)
    law = simulated({"fitted": first_share(run).copy()}, "x", _line, [-0.03, 0.3], 1)
    run["x" + SIMULATED] = _line(law, run)
    return pair({"sweep": run}, _CHANNELS)


CASES = (
    RealCase(
        name="twisted_string/straight",
        kind="positive",
        build=_straight,
        model="position of the slide by the angle of its motor, a straight line, fitted to the first 70 %; the rest is "
        "held out",
        truth="a string shortens with the square of the angle (the authors' model of the drive)",
        right=("drive.pitch_error",),
        tolerated=("drive.varying_stiffness", "vibration.hardening", "drive.backlash", "drive.elasticity"),
        verdicts=("unexplained",),
        reading="2 ms a row, means of four",
    ),
)
