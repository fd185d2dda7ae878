"""A small hydraulic excavator, driven by hand: command of its valves, and the way of its cylinders."""

from __future__ import annotations

from functools import partial
from pathlib import Path

import numpy as np
import pandas as pd
from scipy.signal import savgol_filter

from benchmarks.real.case import Pair, RealCase, Vector, pair
from benchmarks.real.rigs.fifth.common import simulated
from benchmarks.real.rigs.fourth.common import evenly, lagging, step_of
from selector.recording import Channel

_STEP_S = 0.05
_CHANNELS = (
    Channel("u", "voltage", "V", place="valve, 1 % of the duty cycle as 1 V", axis="X"),
    Channel("v", "velocity", "m/s", place="cylinder, 1 cm/s as 0.01 m/s", axis="X"),
)
_SEVERAL = ("1102_1829", "1102_1834", "shyam_1102_1824", "orlando_1102_1405", "mitch_1102_1814")
_ANOTHER_DRIVER = ("mitch_1101_2319", "mitch_1101_2333", "mitch_1102_1814", "mitch_1102_1819")
_ONE_DRIVER = ("orlando_1102_1405", "orlando_1102_1413", "orlando_1102_1418")


def _read(folder: Path, name: str, cylinder: str) -> pd.DataFrame:
    raw = pd.read_csv(folder / f"tests/data/manual_{name}.csv").dropna()
    columns = {"u": raw[f"{cylinder} Cmd"].to_numpy(), "way": raw[f"{cylinder} Ms"].to_numpy()}
    run = evenly(raw["Time"].to_numpy(), _STEP_S, **columns)
    run["u"] -= run["u"].median()
    run["v"] = 0.01 * savgol_filter(run.pop("way").to_numpy(), 9, 2, deriv=1, delta=_STEP_S)
    return run


def _line(x: Vector, run: pd.DataFrame) -> Vector:
    return np.asarray(x[0] + x[1] * run["u"])


def _lag(x: Vector, run: pd.DataFrame) -> Vector:
    return np.asarray(lagging(_line(x, run), step_of(run), abs(x[2]) + 1e-3, float(run["v"].iloc[0])))


def _drives(folder: Path, names: tuple[str, ...], cylinder: str, *, lagged: bool) -> Pair:
    runs = {name: _read(folder, name, cylinder) for name in names}
    if lagged:
        simulated(runs, "v", _lag, [0.0, 0.006, 0.1])
    else:
        simulated(runs, "v", _line, [0.0, 0.006])
    return pair(runs, _CHANNELS)


_READING = "about 50 ms a row, evened; the speed is the slope of a parabola over 0.45 s; zero is the median command"

CASES = (
    RealCase(
        name="excavator/at once",
        kind="positive",
        build=partial(_drives, names=_SEVERAL, cylinder="Bucket", lagged=False),
        model="speed of the bucket's cylinder by the command of its valve, a straight line at once, fitted to four "
        "drives; a fifth is held out",
        truth="pump, valve and oil need 0.1 to 0.15 s (read off)",
        right=("drive.mass", "gauging.lag", "drive.delay", "data.clock"),
        tolerated=("drive.coulomb", "drive.viscous", "drive.elasticity"),
        verdicts=("miscalibrated",),
        reading=_READING,
    ),
    RealCase(
        name="excavator/straight",
        kind="positive",
        build=partial(_drives, names=_ONE_DRIVER, cylinder="Boom", lagged=True),
        model="speed of the boom's cylinder by the command, a straight line behind a lag, fitted to two drives of one "
        "operator; his third is held out",
        truth="up to about 0.7 % of command nothing moves: the valve overlaps (the author's simulator has a 'deadband "
        "offset' a valve)",
        right=("drive.coulomb",),
        tolerated=("drive.viscous", "drive.stribeck", "drive.varying_damping", "drive.asymmetric_friction",
                   "drive.backlash"),
        verdicts=("unexplained",),
        reading=_READING,
    ),
    RealCase(
        name="excavator/stick",
        kind="positive",
        build=partial(_drives, names=_ANOTHER_DRIVER, cylinder="Stick", lagged=True),
        model="speed of the stick's cylinder by the command, a straight line behind a lag, fitted to three drives of "
        "another operator; his fourth is held out",
        truth="little moves up to about 1 % of command, and ever more beyond (read off): the overlap of the valve, and "
        "its edges",
        right=("drive.coulomb",),
        tolerated=("drive.viscous", "drive.stribeck", "drive.varying_damping", "drive.asymmetric_friction",
                   "drive.backlash", "vibration.hardening"),
        verdicts=("unexplained",),
        reading=_READING,
    ),
)  # fmt: skip
