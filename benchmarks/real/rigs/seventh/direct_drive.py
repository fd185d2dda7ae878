"""An arm with two direct drives that moves evenly up and down."""

from __future__ import annotations

from functools import partial
from pathlib import Path

import numpy as np
import pandas as pd

from benchmarks.real.case import Pair, RealCase, Vector, pair
from benchmarks.real.rigs.fifth.common import over, simulated
from selector.recording import Channel

_STEP_S, _SETTLED_S = 0.015, 0.5
_SPEEDS = ("5", "n5", "10", "n10", "20", "n20", "30", "n30")
_DEGREE_M = 1e-3


def _series(path: Path, first_s: float) -> Vector:
    """Readings behind a moment, of a file of moments and readings."""
    raw = np.loadtxt(path)
    return np.asarray(raw[raw[:, 0] > first_s, 1])


def _even(folder: Path, joint: int, speed: str) -> pd.DataFrame:
    place = folder / "Test 2"
    parts = {name: _series(place / f"cin_{of}{joint}_{speed}_exp_gan.t", _SETTLED_S)
             for name, of in (("torque", "tau"), ("angle", "pos"), ("speed", "vel"))}  # fmt: skip
    rows = min(map(len, parts.values()))
    run = over(pd.DataFrame({name: values[:rows] for name, values in parts.items()}), _STEP_S)
    return run.assign(angle=_DEGREE_M * run["angle"], speed=_DEGREE_M * run["speed"])


def _weight(x: Vector, run: pd.DataFrame) -> Vector:
    return np.asarray(x[0] + x[1] * np.sin(np.radians(run["angle"] / _DEGREE_M)))


def _frictionless(folder: Path, joint: int) -> Pair:
    runs = {f"{speed.replace('n', '-')} deg/s": _even(folder, joint, speed) for speed in _SPEEDS}
    simulated(runs, "torque", _weight, [1.0, 10.0])
    place = {1: "shoulder", 2: "elbow"}[joint]
    return pair(
        runs,
        (
            Channel("torque", "force", "N", place=f"{place}, 1 N m as 1 N", axis="C"),
            Channel("angle", "position", "m", place=f"{place}, 1 deg as 1 mm", axis="C"),
            Channel("speed", "velocity", "m/s", place=f"{place}, 1 deg/s as 1 mm/s", axis="C"),
        ),
    )


_READING = "15 ms a row, from 0.5 s on; negative speeds go down"
_OTHER_FRICTION = ("drive.viscous", "drive.stribeck", "drive.asymmetric_friction", "drive.varying_damping",
                   "drive.offset_force", "data.zero")  # fmt: skip

CASES = (
    RealCase(
        name="direct_drive/shoulder",
        kind="positive",
        build=partial(_frictionless, joint=1),
        model="the shoulder's torque by the weight, at seven even speeds up and down; an eighth, -30 deg/s, is held "
        "out",
        truth="dry friction of some 13 N m (the authors' subject)",
        right=("drive.coulomb",),
        tolerated=_OTHER_FRICTION,
        reading=_READING,
    ),
    RealCase(
        name="direct_drive/elbow",
        kind="positive",
        build=partial(_frictionless, joint=2),
        model="the elbow's torque by the weight, at seven even speeds up and down; an eighth, -30 deg/s, is held out",
        truth="dry friction of some 2.7 N m (the authors' subject)",
        right=("drive.coulomb",),
        tolerated=_OTHER_FRICTION,
        reading=_READING,
    ),
)
