"""A glass furnace (DaISy): two heaters, a cooler, and six thermometers, all as they are published, without units."""

from __future__ import annotations

from functools import partial
from pathlib import Path

import numpy as np
import pandas as pd

from benchmarks.real.case import SIMULATED, Pair, RealCase, Vector, pair
from benchmarks.real.rigs.fifth.common import first_share, over, simulated
from benchmarks.real.rigs.fourth.common import SILENT
from selector.recording import Channel

_STEP_S, _FIRST = 60.0, 3
_DRIVES = {"heater 1": "first heater", "cooler": "cooler", "heater 2": "second heater"}


def _read(folder: Path) -> pd.DataFrame:
    names = [*_DRIVES, *(f"T{k}" for k in range(1, 7))]
    return over(pd.DataFrame(np.loadtxt(folder / "data/glassfurnace.dat")[:, 1:], columns=names), _STEP_S)


def _thermometer(number: int) -> Channel:
    return Channel("T", "temperature", "degC", place=f"thermometer {number}, as published")


def _unheated(folder: Path) -> Pair:
    run = _read(folder)[[*_DRIVES, "T5"]].rename(columns={"T5": "T"})
    run["T" + SIMULATED] = np.full(len(run), first_share(run)["T"].mean())
    drives = tuple(Channel(name, "state", "1", place=place) for name, place in _DRIVES.items())
    return pair({"record": run}, (_thermometer(5), *drives))


def _line(x: Vector, run: pd.DataFrame) -> Vector:
    return np.asarray(x[0] + x[1] * run["beside"])


def _neighbours(folder: Path, of: int, beside: int) -> Pair:
    run = _read(folder)[[f"T{of}", f"T{beside}"]].rename(columns={f"T{of}": "T", f"T{beside}": "beside"})
    law = simulated({"fitted": first_share(run).copy()}, "T", _line, [0.0, 1.0], 1)
    run["T" + SIMULATED] = _line(law, run)
    other = Channel("beside", "temperature", "degC", place=f"thermometer {beside}, as published")
    return pair({"record": run}, (_thermometer(of), other))


_READING = "1247 rows whose interval is not in the file; taken as a minute"

CASES = (
    RealCase(
        name="glass_furnace/unheated",
        kind="positive",
        build=_unheated,
        model="a thermometer keeps its mean of the first 70 %, with heaters and cooler at hand; the rest is held out",
        truth="they heat and cool it, behind some forty rows (the set is one of inputs and outputs)",
        right=("thermal.second_source", "thermal.coolant"),
        tolerated=("thermal.memory", "thermal.convection", "data.drift"),
        reading=_READING,
    ),
    RealCase(
        name="glass_furnace/neighbours",
        kind="control",
        build=partial(_neighbours, of=3, beside=2),
        model="one thermometer by its neighbour, a straight line, fitted to the first 70 %; the rest is held out",
        truth="nothing is missing: 2 to 6 % are left, less than the noise of either",
        verdicts=SILENT,
        reading=_READING,
    ),
)
