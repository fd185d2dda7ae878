"""A lithium cell (18650, 2.6 Ah) in a chamber of 25 degC, discharged with random currents of up to 6 A."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from scipy.io import loadmat

from benchmarks.real.case import SIMULATED, Pair, RealCase, pair
from benchmarks.real.rigs.fifth.common import over
from selector.recording import Channel

_STEP_S = 10.0
_CHANNELS = (
    Channel("T", "temperature", "degC", place="surface of the cell"),
    Channel("I", "current", "A", place="cell"),
)


def _table(test: Any) -> pd.DataFrame:
    columns = {"T": np.asarray(test.T, dtype=np.float64), "I": np.abs(np.asarray(test.I, dtype=np.float64))}
    return over(pd.DataFrame(columns), _STEP_S)


def _discharges(folder: Path, *, heated: bool) -> Pair:
    raw = loadmat(folder / "Exp25_R1.mat", squeeze_me=True, struct_as_record=False)
    runs = {f"discharge {k + 1}": _table(raw["rw_data"][k]) for k in range(5)}
    slow = _table(raw["ref_data"])
    steady = slow[slow["I"] > 1.0].iloc[-60:]
    per_square = (steady["T"].mean() - slow["T"].iloc[0]) / (steady["I"] ** 2).mean() if heated else 0.0
    for run in runs.values():
        run["T" + SIMULATED] = run["T"].iloc[0] + per_square * run["I"] ** 2
    return pair(runs, _CHANNELS)


_READING = "a reading every 10 s; steps of 0.1 K; the size of the current is taken"

CASES = (
    RealCase(
        name="random_cell/cold",
        kind="positive",
        build=partial(_discharges, heated=False),
        model="a cell that stays as warm as its chamber, on five discharges; the last is held out",
        truth="the current heats it, with its square, by up to 8 K",
        right=("thermal.second_source",),
        tolerated=("thermal.memory", "thermal.coolant", "thermal.convection"),
        reading=_READING,
    ),
    RealCase(
        name="random_cell/at once",
        kind="positive",
        build=partial(_discharges, heated=True),
        model="warmth by the square of the current, at once, as a discharge of 2.6 A gave it; the last of five random "
        "discharges is held out",
        truth="the cell follows with a time constant of about 500 s (read off)",
        right=("thermal.memory",),
        tolerated=("gauging.lag", "data.clock", "drive.delay", "data.gain", "thermal.second_source",
                   "thermal.convection"),
        reading=_READING,
    ),
)  # fmt: skip
