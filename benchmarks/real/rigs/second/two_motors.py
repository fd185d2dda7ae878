"""Two servo motors on one shaft: one drives with steps of torque, the other is idle."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from pathlib import Path

import numpy as np
import pandas as pd
from scipy.io import loadmat
from scipy.optimize import least_squares as minimised

from benchmarks.real.case import SIMULATED, Pair, RealCase, Vector, pair, thinned
from benchmarks.real.rigs.second.common import SILENT
from selector.recording import Channel

_DATA = "Data/Identification"
_MEAN_OF = 20
_FILES = ("pos_0.06_1", "neg_0.04_1", "neg_0.045_1", "pos_0.065_1")
_CHANNELS = (
    Channel("M", "force", "N", place="motor, commanded torque at a lever of 1 m", axis="C"),
    Channel("v", "velocity", "m/s", place="shaft, at the same lever", axis="C"),
)


def _read(folder: Path, name: str) -> pd.DataFrame:
    rows = loadmat(folder / _DATA / f"idf_{name}.mat")["data"]
    frame = pd.DataFrame({"M": rows[:, 4], "v": rows[:, 3]}, index=pd.Index(rows[:, 0], name="time_s"))
    return thinned(frame, _MEAN_OF)


def _speed(law: Vector, frame: pd.DataFrame) -> Vector:
    """Inertia and viscous friction, from rest."""
    inertia, viscous = np.exp(law)
    torque, step = frame["M"].to_numpy(), float(np.median(np.diff(frame.index)))
    held = np.exp(-viscous * step / inertia)
    course, speed = np.empty(len(frame)), float(frame["v"].iloc[0])
    for k in range(len(frame)):
        course[k] = speed
        speed = held * speed + (1.0 - held) * torque[k] / viscous
    return course


def _viscous(folder: Path, *, files: Sequence[str] = _FILES) -> Pair:
    runs = {name: _read(folder, name) for name in files}
    known = list(runs.values())[:-1]
    law = minimised(lambda x: np.concatenate([_speed(x, one) - one["v"] for one in known]), np.log([1.2e-4, 3e-4])).x
    for frame in runs.values():
        frame["v" + SIMULATED] = _speed(law, frame)
    return pair(runs, _CHANNELS)


def _again(folder: Path) -> Pair:
    runs = {}
    for name in ("pos_0.06", "neg_0.04", "neg_0.045", "pos_0.065"):
        frame = _read(folder, f"{name}_3")
        frame["v" + SIMULATED] = 0.5 * (_read(folder, f"{name}_1")["v"] + _read(folder, f"{name}_2")["v"]).to_numpy()
        runs[name] = frame
    return pair(runs, _CHANNELS)


CASES = (
    RealCase(
        name="two_motors/viscous",
        kind="positive",
        build=partial(_viscous),
        model="inertia and viscous friction, fitted to a run forwards and two backwards; the larger step forwards is "
        "held out",
        truth="0.05 N m turn it at 138 rad/s, 0.06 at 214, -0.03 at -143, -0.045 at -238: a torque of 0.02 to 0.03 N m "
        "against the motion, whatever the speed (read off)",
        right=("drive.coulomb",),
        tolerated=("drive.asymmetric_friction", "drive.stribeck", "drive.viscous", "drive.offset_force"),
        reading="means of 20 rows (1 ms); torque and speed at a lever of 1 m",
    ),
    RealCase(
        name="two_motors/again",
        kind="control",
        build=_again,
        model="the mean of two runs of the same programme, beside the third; four programmes, the last is held out",
        truth="README.md: 'number ... the number of the experiment'; the third differs by 1 to 14 %, as friction is "
        "another (read off)",
        tolerated=("drive.coulomb", "drive.viscous", "drive.stribeck", "drive.asymmetric_friction"),
        verdicts=SILENT,
        reading="means of 20 rows (1 ms); torque and speed at a lever of 1 m",
    ),
)
