"""An aluminium rod heated at one end in turns, with six thermometers."""

from __future__ import annotations

from pathlib import Path

import pandas as pd

from benchmarks.real.case import SIMULATED, Pair, RealCase, least_squares, pair, thinned
from selector.recording import Channel

_DAYS = ("6_5", "6_7", "6_9")
_MEAN_OF = 4
_CHANNELS = (
    Channel("T1", "temperature", "degC", place="rod, nearest the heater"),
    Channel("T5", "temperature", "degC", place="rod, fifth hole"),
)


def _read(path: Path) -> pd.DataFrame:
    raw = pd.read_csv(path)
    raw = raw[raw["elapsed"].diff().fillna(1.0) > 0.0]
    columns = {"T1": raw["temp1"], "T5": raw["temp5"]}
    seconds = pd.Index(raw["elapsed"] - raw["elapsed"].iloc[0], name="time_s", dtype="float64")
    return thinned(pd.DataFrame(columns).set_axis(seconds), _MEAN_OF)


def _at_once(folder: Path) -> Pair:
    runs = {f"June {day[2:]}": _read(folder / "Data" / f"HeatTransport_2017_{day}.csv") for day in _DAYS}
    fitted = pd.concat(list(runs.values())[:-1])
    slope, level = least_squares([fitted["T1"].to_numpy(), 1.0], fitted["T5"].to_numpy())
    for frame in runs.values():
        frame["T5" + SIMULATED] = slope * frame["T1"] + level
    return pair(runs, _CHANNELS)


CASES = (
    RealCase(
        name="heated_rod/at once",
        kind="positive",
        build=_at_once,
        model="the fifth thermometer follows the first without delay, fitted to two days; the third is held out",
        truth="README.md: heat waves along a rod; heat takes its time",
        right=("thermal.memory",),
        tolerated=("data.zero", "data.gain", "thermal.convection", "thermal.second_source"),
        reading="means of four rows (1 s)",
    ),
)
