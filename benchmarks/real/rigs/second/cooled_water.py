"""Warm water in a film canister cools down; three runs with other amounts of water."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np
import pandas as pd
from scipy.optimize import least_squares as minimised

from benchmarks.real.case import SIMULATED, Pair, RealCase, Vector, pair, thinned
from selector.recording import Channel

_FILE = "labs-testing/cooling/cooling_trials_1.csv"
_MEAN_OF = 4
_CHANNELS = (
    Channel("room", "ambient", "degC", place="thermometer on the table"),
    Channel("T", "temperature", "degC", place="water in the canister"),
)


def _cooled(time_s: Vector, room: float, start: float, rate: float) -> Vector:
    return np.asarray(room + (start - room) * np.exp(-rate * time_s))


def _off(course: Callable[[float], Vector], measured: Vector, x: Vector) -> Vector:
    return course(x[0]) - measured


def _newton(folder: Path) -> Pair:
    raw = pd.read_csv(folder / _FILE, skiprows=1).apply(pd.to_numeric, errors="coerce")
    runs = {}
    for k in range(3):
        part = raw.iloc[:, 5 * k : 5 * k + 3].set_axis(["time_s", "T", "room"], axis=1).dropna()
        frame = thinned(part.set_index("time_s"), _MEAN_OF)
        course = partial(_cooled, frame.index.to_numpy(), frame["room"].mean(), frame["T"].iloc[0])
        measured = frame["T"].to_numpy()
        (rate,) = minimised(partial(_off, course, measured), [1e-3], x_scale=1e-3).x
        frame["T" + SIMULATED] = course(rate)
        runs[f"run {k + 1}"] = frame
    return pair(runs, _CHANNELS)


CASES = (
    RealCase(
        name="cooled_water/newton",
        kind="positive",
        build=_newton,
        model="loss in proportion to the excess over the room, its rate fitted to each run; the third run is held out",
        truth="README.md: fits of A exp(-B t) + y0 give y0 = 26.1, 27.1, 24.4 degC where the room has 22.9, "
        "23.6, 23.4; "
        "the loss per kelvin falls from 10.8 to 8.9, 7.4 to 6.6, 9.1 to 7.5 times 1e-4 1/s (read off)",
        right=("thermal.convection",),
        tolerated=("thermal.memory", "thermal.second_source"),
        reading="means of four rows (1 s)",
    ),
)
