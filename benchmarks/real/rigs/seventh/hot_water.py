"""Hot water of a dwelling tower: a heat pump works by day, and warms its pipe and the bottom of its tank."""

from __future__ import annotations

from functools import partial
from pathlib import Path

import numpy as np
import pandas as pd

from benchmarks.real.case import SIMULATED, Pair, RealCase, Vector, pair
from benchmarks.real.rigs.fifth.common import over, simulated
from selector.recording import Channel

_STEP_S = 60.0
_DAYS = (27, 28, 29, 30, 31)
_FLOWING = 0.1
_FILES = {"pipe": "outlet water T in heat pump", "tank": "water T in buttom 2 tank"}
_WORKS = Channel("works", "state", "1", place="heat pump, its pump runs")


def _series(folder: Path, name: str) -> pd.Series:
    """Readings by their time stamps, decimal commas."""
    raw = pd.read_csv(folder / f"Data/week 13 {name}.csv", sep=";", decimal=",", encoding="utf-8-sig", index_col=0)
    return pd.to_numeric(raw.iloc[:, 0].set_axis(pd.to_datetime(raw.index)), errors="coerce")


def _read(folder: Path, where: str) -> dict[str, pd.DataFrame]:
    flow = _series(folder, "water flow rate in heat pump")
    both = pd.DataFrame({"T": _series(folder, _FILES[where]), "works": (flow > _FLOWING).astype(float)})
    days = {f"{day} March": both[pd.DatetimeIndex(both.index).day == day] for day in _DAYS}
    return {day: over(run.reset_index(drop=True), _STEP_S) for day, run in days.items()}


def _line(x: Vector, run: pd.DataFrame) -> Vector:
    return np.asarray(x[0] + x[1] * run["works"])


def _days(folder: Path, where: str, *, heated: bool) -> Pair:
    runs = _read(folder, where)
    if heated:
        simulated(runs, "T", _line, [30.0, 30.0])
    else:
        level = float(pd.concat(list(runs.values())[:-1])["T"].mean())
        for run in runs.values():
            run["T" + SIMULATED] = np.full(len(run), level)
    place = {"pipe": "water behind the heat pump", "tank": "bottom of the tank"}[where]
    return pair(runs, (Channel("T", "temperature", "degC", place=place), _WORKS))


_READING = "a row a minute, five weekdays, each from midnight to midnight; it works where more than 0.1 m3/h flow"
_TOLERATED = ("thermal.memory", "thermal.coolant", "thermal.convection")

CASES = (
    RealCase(
        name="hot_water/at rest",
        kind="positive",
        build=partial(_days, where="pipe", heated=False),
        model="the water behind the heat pump keeps the mean of four days, with the work of the heat pump at hand; a "
        "fifth day is held out",
        truth="the heat pump heats it while it works (the authors' subject)",
        right=("thermal.second_source",),
        tolerated=_TOLERATED,
        reading=_READING,
    ),
    RealCase(
        name="hot_water/at once",
        kind="positive",
        build=partial(_days, where="pipe", heated=True),
        model="the same, warm while the heat pump works and cold else, at once, fitted to four days; a fifth is "
        "held out",
        truth="pipe and water cool for hours after it has stopped (read off)",
        right=("thermal.memory",),
        tolerated=("thermal.second_source", "thermal.coolant", "thermal.convection", "gauging.lag", "data.clock",
                   "drive.delay"),
        reading=_READING,
    ),
    RealCase(
        name="hot_water/tank",
        kind="positive",
        build=partial(_days, where="tank", heated=False),
        model="the bottom of the tank keeps the mean of four days, with the work of the heat pump at hand; a fifth day "
        "is held out",
        truth="the heat pump warms the tank within an hour (the authors' model of the layers)",
        right=("thermal.second_source",),
        tolerated=_TOLERATED,
        reading=_READING,
    ),
)  # fmt: skip
