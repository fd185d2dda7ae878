"""A pouch cell over a round heater, seen by an infrared camera: 121 places on the side away from the heater."""

from __future__ import annotations

from functools import partial
from pathlib import Path

import numpy as np
import pandas as pd

from benchmarks.real.case import SIMULATED, Pair, RealCase, Vector, pair
from benchmarks.real.rigs.fifth.common import first_share, over, simulated
from benchmarks.real.rigs.fourth.common import SILENT, lagging, numbers
from selector.recording import Channel

_T = Channel("T", "temperature", "degC", place="surface, away from the heater")
_CENTRE = Channel("centre", "temperature", "degC", place="surface, above the heater")
_HEATER = Channel("heater", "temperature", "degC", place="heater, kept at 50 degC")


def _read(folder: Path, row: int, column: int) -> pd.DataFrame:
    seen = numbers(folder / "Exp.mat")["E"]
    values = {"T": seen[row, column], "centre": seen[5, 5], "heater": np.loadtxt(folder / "Th.txt")[:, 1]}
    return over(pd.DataFrame(values), 1.0)


def _line(x: Vector, run: pd.DataFrame) -> Vector:
    return np.asarray(x[0] + x[1] * run["centre"])


def _corners(folder: Path) -> Pair:
    places = {"first": (0, 0), "second": (0, 10), "third": (10, 0), "fourth": (10, 10)}
    runs = {name: _read(folder, *place)[["T", "centre"]] for name, place in places.items()}
    simulated(runs, "T", _line, [3.0, 0.75])
    return pair(runs, (_T, _CENTRE))


def _one_lag(x: Vector, run: pd.DataFrame) -> Vector:
    warm = (run["heater"] - run["heater"].iloc[0]).to_numpy()
    return float(run["T"].iloc[0]) + x[0] * np.asarray(lagging(warm, 1.0, abs(x[1]) + 1.0, 0.0))


def _centre(folder: Path) -> Pair:
    run = _read(folder, 5, 5)[["T", "heater"]]
    law = simulated({"fitted": first_share(run).copy()}, "T", _one_lag, [0.2, 200.0], 1)
    run["T" + SIMULATED] = _one_lag(law, run)
    return pair({"heating": run}, (_T, _HEATER))


def _beside(folder: Path, place: tuple[int, int], others: tuple[tuple[int, int], ...]) -> Pair:
    run = _read(folder, *place)[["T"]]
    run["other"] = np.mean([_read(folder, *other)["T"] for other in others], axis=0)
    law = np.polyfit(first_share(run)["other"], first_share(run)["T"], 1)
    run["T" + SIMULATED] = np.polyval(law, run.pop("other"))
    return pair({"heating": run}, (_T,))


_READING = "one picture a second"

CASES = (
    RealCase(
        name="infrared_cell/corners",
        kind="positive",
        build=_corners,
        model="a corner by the temperature of the centre, at once, fitted to three corners; the fourth is held out",
        truth="heat needs minutes from the centre to the corners (read off; the authors identify the conductivity by "
        "it)",
        right=("thermal.memory",),
        tolerated=(
            "gauging.lag",
            "data.clock",
            "drive.delay",
            "data.zero",
            "thermal.convection",
            "thermal.second_source",
        ),
        reading=_READING + "; the corners are taken for runs",
    ),
    RealCase(
        name="infrared_cell/one lag",
        kind="positive",
        build=_centre,
        model="one heat capacity with one loss on the temperature of the heater, fitted to the first 70 %; the rest is "
        "held out",
        truth="the cell warms quickly above the heater and slowly as a whole: two lags (read off)",
        right=("thermal.memory",),
        tolerated=("thermal.second_source", "thermal.convection", "data.drift"),
        reading=_READING,
    ),
    RealCase(
        name="infrared_cell/opposite",
        kind="control",
        build=partial(_beside, place=(2, 5), others=((8, 5),)),
        model="a place by the one opposite of the heater, with a gain and an offset fitted to the first 70 %; the rest "
        "is held out",
        truth="nothing is missing: 0.03 K are left, of a noise of 0.016 K each",
        verdicts=SILENT,
        reading=_READING,
    ),
    RealCase(
        name="infrared_cell/neighbours",
        kind="control",
        build=partial(_beside, place=(4, 8), others=((3, 8), (5, 8), (4, 7), (4, 9))),
        model="a place by the mean of its four neighbours, with a gain and an offset fitted to the first 70 %; the "
        "rest is held out",
        truth="nothing is missing: 0.02 K are left, of a noise of 0.016 K",
        verdicts=SILENT,
        reading=_READING,
    ),
)
