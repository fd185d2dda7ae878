"""A passive house in June: a bedroom, and the air outside of its north wall."""

from __future__ import annotations

import zipfile
from functools import partial
from pathlib import Path

import numpy as np
import pandas as pd

from benchmarks.real.case import SIMULATED, Pair, RealCase, Vector, pair
from benchmarks.real.rigs.fifth.common import first_share, over, simulated
from selector.recording import Channel

_STEP_S = 600.0
_T = Channel("T", "temperature", "degC", place="parents' bedroom")
_AIR = Channel("outdoors", "ambient", "degC", place="air at the north wall")


def _read(folder: Path) -> pd.DataFrame:
    with zipfile.ZipFile(folder / "energy_weather_temp.zip") as archive, archive.open("energy_weather_temp.csv") as raw:
        whole = pd.read_csv(raw, usecols=["date", "T9", "T6"], index_col="date", skipinitialspace=True)
    june = whole["2016-06-01":"2016-06-24"].apply(pd.to_numeric, errors="coerce").interpolate(limit=12).dropna()  # type: ignore[misc]
    return over(june.rename(columns={"T9": "T", "T6": "outdoors"})[["T", "outdoors"]], _STEP_S)


def _line(x: Vector, run: pd.DataFrame) -> Vector:
    return np.asarray(x[0] + x[1] * run["outdoors"])


def _bedroom(folder: Path, *, weather: bool) -> Pair:
    run = _read(folder)
    known = first_share(run)
    if weather:
        run["T" + SIMULATED] = _line(simulated({"fitted": known.copy()}, "T", _line, [20.0, 0.2], 1), run)
    else:
        run["T" + SIMULATED] = np.full(len(run), known["T"].mean())
    return pair({"june": run}, (_T, _AIR))


_READING = "a row every 10 minutes; 24 days, the heating is off"

CASES = (
    RealCase(
        name="passive_house/constant",
        kind="positive",
        build=partial(_bedroom, weather=False),
        model="a bedroom that stays as warm as in the first 70 % of June; the rest is held out",
        truth="it follows the air outdoors, two days late (read off)",
        right=("thermal.ambient",),
        tolerated=("thermal.memory", "thermal.second_source"),
        reading=_READING,
    ),
    RealCase(
        name="passive_house/at once",
        kind="positive",
        build=partial(_bedroom, weather=True),
        model="the bedroom by the air outdoors, at once, fitted to the first 70 % of June; the rest is held out",
        truth="the house is heavy and well insulated: it follows two days late (read off)",
        right=("thermal.memory",),
        tolerated=("thermal.ambient", "thermal.second_source", "gauging.lag", "data.clock", "drive.delay"),
        reading=_READING,
    ),
)
