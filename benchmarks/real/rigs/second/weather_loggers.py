"""Nine loggers of air temperature side by side for three months."""

from __future__ import annotations

from functools import partial
from pathlib import Path

import numpy as np
import pandas as pd

from benchmarks.real.case import SIMULATED, Pair, RealCase, pair
from benchmarks.real.rigs.second.common import SILENT
from selector.recording import Channel

_NAMES = ("H26", "H27", "H28", "H29", "H31", "H32", "H52", "H53", "H97")
_CHANNELS = (Channel("T", "temperature", "degC", place="air beside the other loggers"),)
_DAYS = ("2018-01-24", "2018-02-20")


def _read(folder: Path, name: str) -> pd.Series:
    raw = pd.read_csv(folder / "raw" / f"{name}cal.csv", encoding="utf-8-sig")
    stamp = pd.to_datetime(raw.iloc[:, 0], format="%d/%m/%Y %H:%M:%S")
    values = pd.Series(pd.to_numeric(raw.iloc[:, 1], errors="coerce").to_numpy(), index=stamp)
    return values[~values.index.duplicated()].dropna()[slice(*_DAYS)]


def _beside_others(folder: Path, *, name: str) -> Pair:
    table = pd.DataFrame({one: _read(folder, one) for one in _NAMES}).dropna().iloc[::2]
    seconds = (table.index - table.index[0]).total_seconds()
    frame = pd.DataFrame({"T": table[name].to_numpy()}, index=pd.Index(np.asarray(seconds), name="time_s"))
    frame["T" + SIMULATED] = table.drop(columns=name).median(axis=1).to_numpy()
    return pair({"four weeks": frame}, _CHANNELS)


def _case(name: str, words: str) -> RealCase:
    return RealCase(
        name=f"weather_loggers/{name}",
        kind="control",
        build=partial(_beside_others, name=name),
        model="the median of eight others at the same time; the last 30 % of four weeks are held out",
        truth=f"README.md: 'Hobo sensors intercomparison'; {words} (reg/regresults.xlsx, without outliers)",
        tolerated=("data.gain", "data.zero", "thermal.memory", "gauging.lag"),
        verdicts=SILENT,
        reading="one row of two (10 min)",
    )


CASES = (_case("H29", "slope 0.994, intercept 0.11 K"), _case("H31", "slope 0.994, intercept 0.08 K"))
