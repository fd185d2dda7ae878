"""An electric oscillator (coil, capacitor, resistor) driven by a square wave."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
from scipy.io import loadmat

from benchmarks.real.case import SIMULATED, Pair, RealCase, least_squares, pair, thinned
from benchmarks.real.rigs.second.common import SILENT
from selector.recording import Channel

_MEAN_OF = 16
_ROWS = slice(2000, 33_000)
_FILES = tuple(f"20221130-0001_0{k}" for k in range(1, 6))
_CHANNELS = (
    Channel("u", "voltage", "V", place="input, times ten"),
    Channel("y", "voltage", "V", place="capacitor's branch, times ten"),
)


def _read(folder: Path, name: str) -> pd.DataFrame:
    raw = loadmat(folder / "data" / f"{name}.mat")
    step_s = raw["Tinterval"].item()
    columns = {"u": 10.0 * raw["A"].ravel()[_ROWS].astype(float), "y": 10.0 * raw["C"].ravel()[_ROWS].astype(float)}
    frame = pd.DataFrame(columns)
    return thinned(frame.set_axis(pd.Index(step_s * np.arange(len(frame)), name="time_s")), _MEAN_OF)


def _static(folder: Path) -> Pair:
    runs = {name: _read(folder, name) for name in _FILES[:3]}
    known = pd.concat(list(runs.values())[:-1])
    slope, level = least_squares([known["u"].to_numpy(), 1.0], known["y"].to_numpy())
    for frame in runs.values():
        frame["y" + SIMULATED] = slope * frame["u"] + level
    return pair(runs, _CHANNELS)


def _again(folder: Path) -> Pair:
    known = _read(folder, _FILES[0])
    runs = {name: _read(folder, name) for name in _FILES[1:]}
    for frame in runs.values():
        frame["y" + SIMULATED] = known["y"].to_numpy()
    return pair(runs, _CHANNELS)


CASES = (
    RealCase(
        name="electric/static",
        kind="positive",
        build=_static,
        model="output = a x input + b, fitted to two steps; a third is held out",
        truth="README.md: 'RLC Oscillator'; main.m: R1 = 14, L = 1.54e-3, C1 = 0.1e-6: 12.8 kHz, which rings after the "
        "step",
        right=("vibration.mode",),
        tolerated=("drive.elasticity",),
        reading="the first 1.8 ms of each record; means of 16 rows (56 ns)",
    ),
    RealCase(
        name="electric/again",
        kind="control",
        build=_again,
        model="the first of five records of the same step, beside the others; the last is held out",
        truth="the same step again, triggered at the same row (read off)",
        verdicts=SILENT,
        reading="the first 1.8 ms of each record; means of 16 rows (56 ns)",
    ),
)
