"""A tank that runs empty, with and without a bottle in it."""

from __future__ import annotations

from functools import partial
from pathlib import Path

import numpy as np
import pandas as pd

from benchmarks.real.case import SIMULATED, Pair, RealCase, least_squares, pair, thinned
from selector.recording import Channel

_LEVELS = (5.0, 25.0)
"""The part of the level [cm] in which the tank runs and the sensor is not at its floor."""
_MEAN_OF = 4
_START = 60
"""Rows from which the level at the start is taken."""
_UM_PER_CM = 1e4
_CHANNELS = (Channel("level", "displacement", "um", place="water above the outlet"),)


def _read(folder: Path, name: str) -> pd.DataFrame:
    raw = pd.read_csv(folder / "data" / f"liq_level_data_{name}.csv", comment="#")
    time_s, reading = raw.iloc[:, 0].to_numpy(dtype=np.float64), raw.iloc[:, 1].to_numpy(dtype=np.float64)
    known = pd.read_csv(folder / "data" / "calibration_curve.csv", encoding="utf-8-sig").to_numpy(dtype=np.float64)
    level = np.interp(reading, known[:, 1], known[:, 0])
    full = len(level) - 1 - int(np.argmax(level[::-1] >= _LEVELS[1]))
    low = full + int(np.argmax(level[full:] < _LEVELS[0]))
    rows = np.arange(full + 1, low)
    rows = rows[np.r_[True, np.diff(time_s[rows]) > 0]]
    frame = pd.DataFrame({"level": level[rows]}).set_axis(pd.Index(time_s[rows] - time_s[rows[0]], name="time_s"))
    return thinned(frame, _MEAN_OF)


def _draining(folder: Path, *, name: str) -> Pair:
    """Outflow by the square root: the root of the level falls evenly, as it does in the empty tank."""
    empty = _read(folder, "empty_train")
    slope, _ = least_squares([empty.index.to_numpy(), 1.0], np.sqrt(empty["level"].to_numpy()))
    runs = {"empty": empty, name: _read(folder, name)}
    for frame in runs.values():
        fall = slope * frame.index.to_numpy()
        root = fall + float(np.mean((np.sqrt(frame["level"]) - fall)[:_START]))
        frame["level" + SIMULATED] = _UM_PER_CM * np.maximum(root, 0.0) ** 2
        frame["level"] = _UM_PER_CM * frame["level"]
    return pair({name: runs[name]}, _CHANNELS, "0.3")


_MODEL = (
    "outflow by the square root of the level, fitted to the empty tank, from the level of the first 38 s; the last "
    "30 % are held out"
)

CASES = (
    RealCase(
        name="bottle_tank/bottle",
        kind="positive",
        build=partial(_draining, name="w_bottle"),
        model=_MODEL,
        truth="README.md: 'with a glass bottle inside of it': the area changes with the height",
        verdicts=("unexplained",),
        reading="level by the calibration, 25 to 5 cm; means of four rows (0.16 s)",
    ),
    RealCase(
        name="bottle_tank/empty",
        kind="control",
        build=partial(_draining, name="empty_test"),
        model=_MODEL,
        truth="README.md: 'without an exogenous object inside of it', a second time",
        verdicts=("nothing-missing", "miscalibrated"),
        reading="level by the calibration, 25 to 5 cm; means of four rows (0.16 s)",
    ),
)
