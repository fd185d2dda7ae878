"""A steel strip on a board with a heating coil and a fan (Single Board Heater System, operated over a network)."""

from __future__ import annotations

from functools import partial
from pathlib import Path

import numpy as np
import pandas as pd

from benchmarks.real.case import SIMULATED, Pair, RealCase, least_squares, pair
from benchmarks.real.rigs.fourth.common import evenly
from benchmarks.real.rigs.third.common import pieces
from selector.recording import Channel

_STEP_S = 2.0
_SPANS = {"first": (40.0, 560.0), "second": (560.0, 1080.0), "third": (1080.0, 1600.0)}
_CHANNELS = (
    Channel("T", "temperature", "degC", place="steel strip"),
    Channel("heater", "state", "1", place="heating coil, share of its current"),
)


def _read(folder: Path, name: str) -> pd.DataFrame:
    """Row, heater and fan in per cent, temperature, four clocks in milliseconds."""
    raw = np.loadtxt(folder / f"Scilab/virtual_old/{name}")[1:]
    return evenly(1e-3 * (raw[:, 4] - raw[0, 4]), _STEP_S, T=raw[:, 3], heater=raw[:, 1] / 100.0)


def _telegraph(folder: Path, *, heated: bool) -> Pair:
    runs = pieces(_read(folder, "prbs_analysis/prbs.txt"), _SPANS)
    if heated:
        slow = _read(folder, "Ramp_Analysis/29Apr2014_14_32_06.txt")
        (gain, _) = least_squares((slow["heater"].to_numpy(), 1.0), slow["T"].to_numpy())
        known = pd.concat(list(runs.values())[:2])
        for run in runs.values():
            run["T" + SIMULATED] = known["T"].mean() + gain * (run["heater"] - known["heater"].mean())
    else:
        level = pd.concat(list(runs.values())[:2])["T"].mean()
        for run in runs.values():
            run["T" + SIMULATED] = np.full(len(run), level)
    return pair(runs, _CHANNELS)


_READING = "a reading a second, one every 2 s is taken; steps of 0.1 K"

CASES = (
    RealCase(
        name="heater_board/at once",
        kind="positive",
        build=partial(_telegraph, heated=True),
        model="kelvins by the current at once, as a slow ramp of another day gave them, on a record of random "
        "switching; its last third is held out",
        truth="the strip follows with a time constant of about 40 s; the authors identify a first-order lag",
        right=("thermal.memory",),
        tolerated=("gauging.lag", "data.clock", "drive.delay", "thermal.second_source", "thermal.convection"),
        reading=_READING,
    ),
    RealCase(
        name="heater_board/unheated",
        kind="positive",
        build=partial(_telegraph, heated=False),
        model="the mean of two thirds, with the heater's current at hand; the last third is held out",
        truth="the coil heats the strip",
        right=("thermal.second_source",),
        tolerated=("thermal.memory", "thermal.coolant", "thermal.convection"),
        reading=_READING,
    ),
)
