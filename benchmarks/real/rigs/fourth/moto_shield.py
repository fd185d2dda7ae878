"""A small geared motor of the MotoShield: random steps of voltage, and the speed."""

from __future__ import annotations

from functools import partial
from pathlib import Path

import numpy as np
import pandas as pd
from scipy.optimize import least_squares as minimised

from benchmarks.real.case import SIMULATED, Pair, RealCase, Vector, least_squares, pair
from benchmarks.real.rigs.fourth.common import lagging, numbers
from benchmarks.real.rigs.third.common import pieces
from selector.recording import Channel

_DATA = "matlab/examples/MotoShield"
_STEP_S = 0.02
_SPANS = {"first": (4.0, 34.0), "second": (34.0, 64.0), "third": (64.0, 94.0)}
_CHANNELS = (
    Channel("u", "voltage", "V", place="motor", axis="C"),
    Channel("v", "velocity", "m/s", place="shaft, 100 rad/s as 1 m/s", axis="C"),
)


def _read(folder: Path, name: str) -> pd.DataFrame:
    found = numbers(folder / _DATA / f"{name}.mat")
    scale = 0.01 if name == "aprbsResult" else 0.01 * 2.0 * np.pi / 28.0 / _STEP_S
    values = {"u": found["u"].astype(np.float64), "v": scale * found["y"].astype(np.float64)}
    return pd.DataFrame(values, index=pd.Index(_STEP_S * np.arange(len(values["u"])), name="time_s"))


def _lag(x: Vector, run: pd.DataFrame) -> Vector:
    return np.asarray(
        lagging(x[0] * run["u"].to_numpy() + x[2], _STEP_S, abs(x[1]) + 1e-3, float(run["v"].iloc[:5].mean()))
    )


def _affine(folder: Path, *, lag: bool) -> Pair:
    runs = pieces(_read(folder, "identification_data"), _SPANS)
    known = list(runs.values())[:2]
    if lag:
        law = minimised(lambda x: np.concatenate([_lag(x, run) - run["v"] for run in known]), [2.7, 0.12, -0.7]).x
        given = {name: _lag(law, run) for name, run in runs.items()}
    else:
        fitted = pd.concat(known)
        gain, offset = least_squares((fitted["u"].to_numpy(), 1.0), fitted["v"].to_numpy())
        given = {name: gain * run["u"].to_numpy() + offset for name, run in runs.items()}
    for name, run in runs.items():
        run["v" + SIMULATED] = given[name]
    return pair(runs, _CHANNELS)


CASES = (
    RealCase(
        name="moto_shield/no lag",
        kind="positive",
        build=partial(_affine, lag=False),
        model="speed by voltage, a straight line, fitted to two thirds of the record; the last third is held out",
        truth="it follows with a time constant of 0.13 s (read off)",
        right=("drive.mass", "gauging.lag", "drive.delay", "data.clock"),
        tolerated=("drive.viscous", "drive.elasticity", "thermal.memory"),
        verdicts=("miscalibrated",),
        reading="20 ms; 100 rad/s as 1 m/s",
    ),
    RealCase(
        name="moto_shield/straight",
        kind="positive",
        build=partial(_affine, lag=True),
        model="speed by voltage, a straight line behind a lag, fitted to two thirds; the last third is held out",
        truth="speed bends with voltage: a square of it takes two thirds of the rest (read off), for which there is "
        "no id",
        tolerated=("drive.viscous", "drive.varying_damping", "drive.saturation", "drive.stribeck", "drive.coulomb"),
        verdicts=("unexplained",),
        reading="as above",
    ),
)
