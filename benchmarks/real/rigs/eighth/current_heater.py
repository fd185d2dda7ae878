"""A heater on a power supply under a PID control: temperature and current while the wanted one climbs stairs."""

from __future__ import annotations

from functools import partial
from pathlib import Path

import numpy as np
import pandas as pd

from benchmarks.real.case import SIMULATED, Pair, RealCase, Vector, pair
from benchmarks.real.rigs.fifth.common import simulated
from benchmarks.real.rigs.fourth.common import evenly
from selector.recording import Channel

_STEP_S = 4.0
_MILLI = 1e-3
_SESSIONS = {"low stairs": (1038, 1716), "high stairs": (3500, None), "stairs": (2133, 3500)}
_CHANNELS = (
    Channel("T", "temperature", "degC", place="heated block"),
    Channel("power", "state", "1", place="heater, the square of its current, 1 A2 as 1"),
)


def _read(folder: Path) -> dict[str, pd.DataFrame]:
    raw = pd.read_csv(folder / "temperature_log.csv", sep="\t", skiprows=1, header=None).dropna()
    runs = {}
    for name, (first, last) in _SESSIONS.items():
        times, heat, current = (raw.iloc[first:last, k].to_numpy(dtype=np.float64) for k in (0, 2, 6))
        runs[name] = evenly(times, _STEP_S, T=heat, power=(_MILLI * current) ** 2)
    return runs


def _line(x: Vector, run: pd.DataFrame) -> Vector:
    return np.asarray(x[0] + x[1] * run["power"])


def _stairs(folder: Path, *, heated: bool) -> Pair:
    runs = _read(folder)
    if heated:
        simulated(runs, "T", _line, [40.0, 140.0])
    else:
        level = float(pd.concat(list(runs.values())[:-1])["T"].mean())
        for run in runs.values():
            run["T" + SIMULATED] = np.full(len(run), level)
    return pair(runs, _CHANNELS)


_READING = "1.1 to 1.3 s a row, evened to 4 s; the long session in two halves, of which the first is held out"

CASES = (
    RealCase(
        name="current_heater/at once",
        kind="positive",
        build=partial(_stairs, heated=True),
        model="temperature by the heater's power at once, a straight line, fitted to two flights of stairs; a third is "
        "held out",
        truth="the block follows its power with a time constant of about 150 s (read off)",
        right=("thermal.memory",),
        tolerated=("thermal.second_source", "thermal.coolant", "thermal.convection", "gauging.lag", "data.clock",
                   "drive.delay"),
        reading=_READING,
    ),
    RealCase(
        name="current_heater/cold",
        kind="positive",
        build=partial(_stairs, heated=False),
        model="the block keeps the mean of two flights of stairs, with the heater's power at hand; a third is held out",
        truth="the heater warms it, with a time constant of about 150 s (the author's control)",
        right=("thermal.second_source",),
        tolerated=("thermal.memory", "thermal.coolant", "thermal.convection"),
        reading=_READING,
    ),
)  # fmt: skip
