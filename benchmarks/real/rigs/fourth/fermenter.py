"""A bucket of water in a refrigerator that a brewery's control cools and lets warm again."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd

from benchmarks.real.case import SIMULATED, Pair, RealCase, pair
from benchmarks.real.rigs.fourth.common import evenly
from selector.recording import Channel

_STEP_S = 300.0
_CHANNELS = (
    Channel("water", "temperature", "degC", place="water in the bucket"),
    Channel("fridge", "temperature", "degC", place="air of the refrigerator"),
)


def _read(folder: Path, name: str) -> pd.DataFrame:
    """Clock, water, refrigerator, room; a row that the logger spoiled is left out."""
    raw = pd.read_csv(folder / f"Modelos/{name}.csv", sep=";", header=None, na_values="null", encoding="latin1")
    clock = pd.to_datetime(raw[0].str.replace("\0", "").str.strip(), format="%b %d %Y %H:%M:%S", errors="coerce")
    time_s = (clock - clock.iloc[0]).dt.total_seconds().to_numpy()
    values = np.column_stack([time_s, *(pd.to_numeric(raw[column], errors="coerce") for column in (1, 4))])
    values = values[np.isfinite(values).all(axis=1)]
    values = values[np.r_[True, np.diff(values[:, 0]) > 0.0]]
    return evenly(values[:, 0], _STEP_S, water=values[:, 1], fridge=values[:, 2])


def _as_its_air(folder: Path) -> Pair:
    runs = {"third": _read(folder, "Teste_Balde_3"), "second": _read(folder, "Teste_balde_2")}
    for run in runs.values():
        run["water" + SIMULATED] = run["fridge"]
    return pair(runs, _CHANNELS)


CASES = (
    RealCase(
        name="fermenter/as its air",
        kind="positive",
        build=_as_its_air,
        model="the water is as warm as the air around the bucket; another week is held out",
        truth="it follows with a time constant of 11 h (read off)",
        right=("thermal.memory",),
        tolerated=("gauging.lag", "thermal.ambient", "thermal.second_source", "data.clock", "drive.delay"),
        reading="read every 5 min",
    ),
)
