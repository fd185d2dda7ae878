"""An accelerometer in a package for drones on a shaker, beside a better one that another computer recorded."""

from __future__ import annotations

from functools import partial
from pathlib import Path

import numpy as np
import pandas as pd

from benchmarks.real.case import SIMULATED, Pair, RealCase, least_squares, pair
from benchmarks.real.rigs.third.common import SILENT
from selector.recording import Channel

_DATA = "data/Benchtop Test V2/Train Sweep"
_BANDS = ("1-2", "5-6", "10-11", "0-20")
_STEP_S = 0.0025
_CHANNELS = (Channel("a", "acceleration", "m/s^2", place="package on the shaker"),)
_LONGEST = 400


def _read(folder: Path, band: str, late: int) -> pd.DataFrame:
    """Rows of both, of the last 30 s of the sweep; the package `late` rows later."""
    own, other = (np.loadtxt(folder / _DATA / f"{band}{which}.csv", delimiter=",")[5:, 1] for which in ("Pkg", "VI"))
    ends = int(np.flatnonzero(np.abs(other) > 0.5 * np.percentile(np.abs(other), 99))[-1])
    rows = np.arange(max(ends - 12000, 0), ends)
    columns = {"a": 9.81 * own[rows + late], "other": 9.81 * other[rows]}
    return pd.DataFrame(columns, index=pd.Index(_STEP_S * np.arange(len(rows)), name="time_s"))


def _lateness(frame: pd.DataFrame) -> int:
    """Rows by which the package is late: where the two agree best."""
    own, other = (frame[name].to_numpy() - frame[name].mean() for name in ("a", "other"))
    agrees = [own[late:] @ other[: len(other) - late] for late in range(_LONGEST)]
    return int(np.argmax(agrees))


def _beside(folder: Path, *, aligned: bool) -> Pair:
    runs = {}
    for band in _BANDS:
        frame = _read(folder, band, 0)
        runs[band] = _read(folder, band, _lateness(frame)) if aligned else frame
    known = pd.concat(list(runs.values())[:-1])
    shifted = known if aligned else pd.concat([_read(folder, one, _lateness(runs[one])) for one in _BANDS[:-1]])
    gain = float(least_squares([shifted["other"].to_numpy()], shifted["a"].to_numpy())[0])
    for name, frame in runs.items():
        runs[name] = frame[["a"]].assign(**{"a" + SIMULATED: gain * frame["other"]})
    return pair(runs, _CHANNELS)


_READING = "the last 30 s of every sweep at 400 Hz; g as m/s^2; the first rows are left out"

CASES = (
    RealCase(
        name="sensor_package/two clocks",
        kind="positive",
        build=partial(_beside, aligned=False),
        model="the better accelerometer times a factor; sweeps of 1 to 2, 5 to 6 and 10 to 11 Hz are fitted, the "
        "whole one is held out",
        truth="two computers record without a common trigger: the package is 0.36 to 0.38 s late in every run (read "
        "off)",
        right=("data.clock",),
        tolerated=("drive.delay", "gauging.lag"),
        verdicts=("miscalibrated",),
        reading=_READING,
    ),
    RealCase(
        name="sensor_package/one clock",
        kind="control",
        build=partial(_beside, aligned=True),
        model="the same, each run shifted to where the two agree best",
        truth="the same motion, measured twice; what is left is 4 to 10 %, most where the shift of whole rows is rough "
        "(read off)",
        tolerated=("data.clock", "drive.delay"),
        verdicts=SILENT,
        reading=_READING,
    ),
)
