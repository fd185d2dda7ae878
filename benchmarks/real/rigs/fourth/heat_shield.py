"""The heating block of a printer's nozzle without a printer (HeatShield): power and temperature."""

from __future__ import annotations

from functools import partial
from pathlib import Path

import numpy as np
import pandas as pd

from benchmarks.real.case import SIMULATED, Pair, RealCase, least_squares, pair, thinned
from benchmarks.real.rigs.fourth.common import numbers
from benchmarks.real.rigs.third.common import pieces
from selector.recording import Channel

_STEP_S = 2.0
_CHANNELS = (
    Channel("T", "temperature", "degC", place="heating block"),
    Channel("power", "state", "1", place="heater, share of its power"),
)


def _runs(folder: Path) -> dict[str, pd.DataFrame]:
    runs = {}
    for name, file, span in (
        ("steps start", "resultID", (0.0, 8000.0)),
        ("steps end", "resultID", (8000.0, 16000.0)),
        ("random", "resultID2", (0.0, 17000.0)),
    ):
        found = numbers(folder / f"matlab/examples/HeatShield/{file}.mat")["resultID"].astype(np.float64)
        frame = pd.DataFrame(
            {"T": found[:, 0], "power": 0.01 * found[:, 1]}, index=pd.Index(_STEP_S * np.arange(len(found)))
        )
        runs[name] = thinned(pieces(frame, {name: span})[name], 10)
    return runs


def _at_once(folder: Path, *, heated: bool) -> Pair:
    runs = _runs(folder)
    fitted = pd.concat(list(runs.values())[:2])
    if heated:
        gain, room = least_squares((fitted["power"].to_numpy(), 1.0), fitted["T"].to_numpy())
    for run in runs.values():
        run["T" + SIMULATED] = gain * run["power"] + room if heated else np.full(len(run), float(run["T"].iloc[0]))
    return pair(runs, _CHANNELS)


_READING = "means of ten readings every 2 s"

CASES = (
    RealCase(
        name="heat_shield/at once",
        kind="positive",
        build=partial(_at_once, heated=True),
        model="temperature by power, a straight line, fitted to a record of steps; one of random power is held out",
        truth="it follows with a time constant of 8.6 min; the authors' equation has one heat capacity",
        right=("thermal.memory",),
        tolerated=("gauging.lag", "thermal.convection", "thermal.second_source", "data.clock", "drive.delay"),
        reading=_READING,
    ),
    RealCase(
        name="heat_shield/no heater",
        kind="positive",
        build=partial(_at_once, heated=False),
        model="it stays as warm as it was; a record of random power is held out",
        truth="it is heated, by the power that is recorded",
        right=("thermal.second_source",),
        tolerated=("thermal.memory", "thermal.convection"),
        reading=_READING,
    ),
)
