"""A cup of 80 ml of hot water that cools, once in still air and once before a fan."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd

from benchmarks.real.case import SIMULATED, Pair, RealCase, Vector, pair
from benchmarks.real.rigs.fifth.common import first_share, simulated
from benchmarks.real.rigs.fourth.common import evenly
from selector.recording import Channel

_STEP_S = 2.0
_ROOM = 28.0
_T = Channel("T", "temperature", "degC", place="water")
_FAN = Channel("fan", "state", "1", place="fan")


def _read(folder: Path, fan: float) -> pd.DataFrame:
    raw = np.loadtxt(folder / f"Water Cooling With{'' if fan else 'out'} Fan.dat")
    return evenly(raw[:, 0], _STEP_S, T=raw[:, 1], fan=np.full(len(raw), fan))


def _newton(x: Vector, run: pd.DataFrame) -> Vector:
    return np.asarray(_ROOM + (run["T"].iloc[0] - _ROOM) * np.exp(-run.index.to_numpy() / abs(x[0])))


def _one_film(folder: Path) -> Pair:
    runs = {"still": _read(folder, 0.0), "fan": _read(folder, 1.0)}
    law = simulated({name: first_share(run).copy() for name, run in runs.items()}, "T", _newton, [900.0], 2)
    for run in runs.values():
        run["T" + SIMULATED] = _newton(law, run)
    return pair(runs, (_T, _FAN), holdout="0.3")


def _still(folder: Path) -> Pair:
    run = _read(folder, 0.0)[["T"]]
    law = simulated({"fitted": first_share(run).copy()}, "T", _newton, [1500.0], 1)
    run["T" + SIMULATED] = _newton(law, run)
    return pair({"still": run}, (_T,))


_READING = "a reading a second, one every 2 s is taken; steps of 0.1 K"

CASES = (
    RealCase(
        name="water_cup/one film",
        kind="positive",
        build=_one_film,
        model="Newton's law of cooling to a room of 28 degC, one constant for both cups; the last 30 % of both are "
        "held out",
        truth="the fan doubles the rate of cooling",
        right=("thermal.convection", "thermal.coolant"),
        tolerated=("thermal.second_source", "thermal.memory"),
        reading=_READING,
    ),
    RealCase(
        name="water_cup/newton",
        kind="positive",
        build=_still,
        model="the same of the cup in still air alone, with a constant of its own; the last 30 % are held out",
        truth="rate over warmth grows with the warmth: free convection and vapour; a power of 1.65 leaves a tenth "
        "(read off)",
        right=("thermal.convection",),
        tolerated=("thermal.memory", "data.drift"),
        reading=_READING,
    ),
)
