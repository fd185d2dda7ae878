"""An incubator for Petri dishes: a heating pad on an aluminium plate, and the thermometer of its control."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pandas as pd
from scipy.optimize import least_squares as minimised

from benchmarks.real.case import SIMULATED, Pair, RealCase, Vector, pair
from benchmarks.real.rigs.fourth.common import evenly, lagging
from benchmarks.real.rigs.third.common import pieces
from selector.recording import Channel

_STEP_S = 30.0
_BLOCK = re.compile(r"Set Heat PWM :(\d+)\s+(\d+)\s+Target \(C\) : [\d.]+ Temp : ([\d.]+)")
_CHANNELS = (
    Channel("T", "temperature", "degC", place="thermometer of the control"),
    Channel("power", "state", "1", place="heating pad, share of its power"),
)


def _read(folder: Path, name: str) -> pd.DataFrame:
    text = (folder / f"moonratII/heat_data/{name}.txt").read_text(encoding="utf-8", errors="replace")
    rows = np.array([[float(word) for word in found.groups()] for found in _BLOCK.finditer(text)])
    return evenly(1e-3 * rows[:, 1], _STEP_S, T=rows[:, 2], power=rows[:, 0] / 255.0)


def _block(x: Vector, run: pd.DataFrame) -> Vector:
    """Kelvin at full power, time constant [s], room."""
    start = float(run["T"].iloc[0])
    return np.asarray(lagging(x[2] + x[0] * run["power"].to_numpy(), _STEP_S, abs(x[1]) + 1.0, start))


def _one_lag(folder: Path) -> Pair:
    whole = _read(folder, "ALUM_cont")
    runs = pieces(whole, {"rise": (0.0, 6000.0), "cycles": (6000.0, 13000.0), "more cycles": (13000.0, 20130.0)})
    known = list(runs.values())[:2]
    law = minimised(
        lambda x: np.concatenate([_block(x, run) - run["T"] for run in known]), [15.0, 3000.0, 28.0],
        x_scale=[15.0, 3000.0, 28.0],
    ).x  # fmt: skip
    for run in runs.values():
        run["T" + SIMULATED] = _block(law, run)
    return pair(runs, _CHANNELS)


CASES = (
    RealCase(
        name="heat_pad/one lag",
        kind="positive",
        build=_one_lag,
        model="one heat capacity with one loss on the power of the pad, fitted to the rise and the first cycles; later "
        "cycles are held out",
        truth="the thermometer follows the pad behind the plate, 9 min late (read off): two lags leave a fifth of what "
        "one leaves",
        right=("thermal.memory", "gauging.lag", "data.clock", "drive.delay"),
        tolerated=("thermal.second_source", "thermal.convection"),
        verdicts=("miscalibrated",),
        reading="a reading every 30 s",
    ),
)
