"""A small crane: a trolley on a bar, moved by a belt, and a rod with a weight that hangs from it."""

from __future__ import annotations

from functools import partial
from pathlib import Path

import numpy as np
import pandas as pd
from scipy.signal import savgol_filter

from benchmarks.real.case import SIMULATED, Pair, RealCase, pair
from benchmarks.real.rigs.fifth.common import over
from benchmarks.real.rigs.fourth.common import numbers
from selector.recording import Channel

_STEP_S, _GRAVITY = 0.01, 9.81
_FILE = "Atividade05/matlab/Contsid/Contsid7_3/crane.mat"
_ANGLE = Channel("angle", "position", "m", place="rod, 1 rad as 1 m", axis="C")
_PUSH = Channel("a", "acceleration", "m/s^2", place="trolley", axis="X")
_VOLTAGE = Channel("u", "voltage", "V", place="motor of the trolley", axis="X")


def _telegraph(folder: Path, *, pushed: bool) -> Pair:
    raw = numbers(folder / _FILE)
    push = savgol_filter(raw["y2"][:, 0], 15, 2, deriv=1, delta=_STEP_S)
    run = over(pd.DataFrame({"angle": raw["y2"][:, 1], "a": push, "u": raw["u2"]}), _STEP_S)
    if pushed:
        run["angle" + SIMULATED] = -run["a"] / _GRAVITY
        return pair({"telegraph": run.drop(columns="u")}, (_ANGLE, _PUSH))
    run["angle" + SIMULATED] = np.zeros(len(run))
    return pair({"telegraph": run.drop(columns="a")}, (_ANGLE, _VOLTAGE))


_READING = "10 ms a row; the push is the slope of the trolley's speed by a parabola over 0.15 s"

CASES = (
    RealCase(
        name="pilot_crane/plumb",
        kind="positive",
        build=partial(_telegraph, pushed=True),
        model="a rod that hangs along gravity and the push of its trolley at every moment; the last 30 % are held out",
        truth="it is a pendulum and swings at 0.70 Hz (the toolbox: 'a pendulum rod with a weight at its end')",
        right=("vibration.mode",),
        tolerated=("vibration.back_reaction", "drive.elasticity", "vibration.line", "vibration.hardening"),
        reading=_READING,
    ),
    RealCase(
        name="pilot_crane/hanging",
        kind="positive",
        build=partial(_telegraph, pushed=False),
        model="a rod that hangs still, with the voltage of the trolley's motor at hand; the last 30 % are held out",
        truth="it is a pendulum and swings at 0.69 Hz as the trolley moves",
        right=("vibration.mode",),
        tolerated=("vibration.back_reaction", "drive.elasticity", "vibration.line"),
        verdicts=("unexplained",),
        reading=_READING,
    ),
)
