"""A house of straw bales, not heated in winter: air outdoors and indoors over 24 days."""

from __future__ import annotations

from functools import partial
from pathlib import Path

import numpy as np
import pandas as pd

from benchmarks.real.case import SIMULATED, Pair, RealCase, Vector, pair, thinned
from benchmarks.real.rigs.fifth.common import first_share, over, simulated
from benchmarks.real.rigs.fourth.common import numbers
from selector.recording import Channel

_CHANNELS = (
    Channel("T", "temperature", "degC", place="indoors"),
    Channel("outdoors", "ambient", "degC", place="air outdoors"),
)


def _read(folder: Path) -> pd.DataFrame:
    found = numbers(folder / "ELEX4336-Feedback-Systems/Lab05/temps.mat")
    return thinned(over(pd.DataFrame({"T": found["IntTemp"], "outdoors": found["ExtTemp"]}), 192.0), 10)


def _line(x: Vector, run: pd.DataFrame) -> Vector:
    return np.asarray(x[0] + x[1] * run["outdoors"])


def _house(folder: Path, *, weather: bool) -> Pair:
    run = _read(folder)
    known = first_share(run).copy()
    if weather:
        run["T" + SIMULATED] = _line(simulated({"fitted": known}, "T", _line, [3.0, 0.3], 1), run)
    else:
        run["T" + SIMULATED] = np.full(len(run), known["T"].mean())
    return pair({"winter": run}, _CHANNELS)


_READING = "means of ten readings, one every 192 s"

CASES = (
    RealCase(
        name="straw_house/at once",
        kind="positive",
        build=partial(_house, weather=True),
        model="a straight line of the air outdoors, at once, fitted to 17 days; the last week is held out",
        truth="the house follows with a time constant of one to two days: the exercise identifies a first-order lag",
        right=("thermal.memory",),
        tolerated=("thermal.ambient", "data.clock", "drive.delay", "gauging.lag", "thermal.convection"),
        reading=_READING,
    ),
    RealCase(
        name="straw_house/constant",
        kind="positive",
        build=partial(_house, weather=False),
        model="the mean of 17 days, with the air outdoors at hand; the last week is held out",
        truth="the house follows the weather",
        right=("thermal.ambient",),
        tolerated=("thermal.memory",),
        reading=_READING,
    ),
)
