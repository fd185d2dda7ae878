"""Rods of copper, brass and aluminium that grow with steam; a thermometer is clamped to each."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd

from benchmarks.real.case import SIMULATED, Pair, RealCase, pair, thinned
from selector.recording import Channel

_FILE = "Lab 1 Pasco Data (thermal expansion).csv"
_RODS = {"copper": 0, "brass": 4, "aluminium": 8}
_CHANNELS = (
    Channel("growth", "displacement", "um", place="end of the rod, angle of its pin times 1 mm"),
    Channel("T", "temperature", "degC", place="thermometer on the rod"),
)


def _by_thermometer(folder: Path) -> Pair:
    raw = pd.read_csv(folder / _FILE, skiprows=2, encoding="latin-1")
    runs = {}
    for rod, column in _RODS.items():
        values = raw.iloc[:, column : column + 3].astype(np.float64).dropna().to_numpy()
        frame = pd.DataFrame({"growth": 1000.0 * values[:, 2], "T": values[:, 1]}, index=pd.Index(values[:, 0]))
        rise = frame["T"] - frame["T"].iloc[0]
        frame["growth" + SIMULATED] = rise * frame["growth"].iloc[-100:].mean() / rise.iloc[-100:].mean()
        runs[rod] = thinned(frame, 10)
    return pair(runs, _CHANNELS)


CASES = (
    RealCase(
        name="steam_rod/by thermometer",
        kind="positive",
        build=_by_thermometer,
        model="growth = factor x rise of the thermometer, the factor from the end of each run; aluminium is held out",
        truth="half of the growth is there before the thermometer has risen by 10 of 65 K: it is late (read off)",
        right=("data.clock", "gauging.lag", "thermal.memory"),
        tolerated=("thermal.interaction", "thermal.convection", "drive.delay", "thermal.second_source"),
        reading="50 ms, means of ten; radians as mm; the pin turns in steps of 17 mrad",
    ),
)
