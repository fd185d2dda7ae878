"""An aluminium bar heated at one end; one of six thermometers reads the air, and wrongly at first."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd

from benchmarks.real.case import SIMULATED, Pair, RealCase, pair
from selector.recording import Channel

_FILE = "Modulated Temperature Data Vertical Setup Jun 12th.csv"
_CHANNELS = (
    *(Channel(f"T{k}", "temperature", "degC", place=f"bar, hole {k}") for k in range(1, 6)),
    Channel("T6", "temperature", "degC", place="air beside the bar"),
)
_WARMED = 0.02


def _air(folder: Path) -> Pair:
    raw = pd.read_csv(folder / _FILE, header=None, encoding="utf-8-sig").drop_duplicates(0)
    columns = {f"T{k}": raw[2 * k].to_numpy(dtype=np.float64) for k in range(1, 7)}
    frame = pd.DataFrame(columns).set_axis(pd.Index(raw[0].to_numpy(dtype=np.float64), name="time_s"))
    start = float(frame.iloc[0][["T1", "T2", "T3", "T4", "T5"]].mean())
    bar = frame[["T1", "T2", "T3", "T4", "T5"]].mean(axis=1)
    frame["T6" + SIMULATED] = start + _WARMED * (bar - start)
    return pair({"bar": frame}, _CHANNELS)


CASES = (
    RealCase(
        name="heated_bar/air",
        kind="positive",
        build=_air,
        model="the air has the bar's temperature at the start and a fiftieth of its rise; the last 30 % are held out",
        truth="3.9 to 4.2 degC up to 710 s, the room's 21.3 to 22.2 after it, in one jump of +17.4 K (read off)",
        right=("data.step",),
        tolerated=("data.zero", "data.gain"),
        reading="2 s; every second column is degC",
    ),
)
